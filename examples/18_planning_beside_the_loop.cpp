// SPDX-License-Identifier: BSD-3-Clause
// Pushes the cube to a place, with plans that are made beside the loop at 1 kHz. Every 40 ms the
// planner gets what was measured and looks half a second ahead. Meanwhile, the robot follows the
// newest plan. Neither waits for the other.
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <thread>

#include "trifinger/control/online_planner.hpp"
#include "trifinger/sim/simulation.hpp"

using namespace trifinger::control;

namespace {

constexpr Seconds kPeriod(1e-3);
const Eigen::Vector3d kAway(0.03, 0.02, 0);  // [m]
constexpr double kNear = 0.01;               // [m]
constexpr trifinger::TimeIndex kMaxSteps = 60'000;

Pose pose_of(const trifinger::ObjectPose& object) {
  const auto& [w, x, y, z] = object.orientation;
  return {Eigen::Vector3d(object.position.data()), Eigen::Quaterniond(w, x, y, z)};
}

}  // namespace

int main(int argument_count, char** arguments) {
  const bool is_here = argument_count < 2;
  auto robot = is_here ? trifinger::simulate<trifinger::TriFinger>()
                       : trifinger::connect<trifinger::TriFinger>(arguments[1]);
  const trifinger::Companion<trifinger::CubeObservation> poses(robot.companion("object"));
  auto action = trifinger::hold_position(robot.latest_observation());
  auto t = robot.append_desired_action(action);
  Pose goal = pose_of(poses.get_latest_at(t)->cube);
  goal.position += kAway;

  PlanningModel model({});
  PlanningState state = model.initial_state();
  const trifinger::ObjectAddress cube = model.object("cube");
  const PlanningTask task{
      .terms = {{.kind = CostKind::kObjectPosition, .weight = 10, .goal = goal},
                {.kind = CostKind::kObjectVelocity, .weight = 0.7, .shape = CostShape::kSquare},
                {.kind = CostKind::kTipObject, .weight = 2, .distance = 0.046},
                {.kind = CostKind::kTargetDistance, .weight = 0.1, .shape = CostShape::kSquare}},
      .late_factor = 3};
  const PlannerOptions options{.seed = 1};
  OnlinePlanner planner(std::move(model), task, options);

  const auto begin = std::chrono::steady_clock::now();
  double distance = std::numeric_limits<double>::infinity();
  while (distance > kNear && t < kMaxSteps) {
    const auto y = robot.get_observation(t);
    const Pose seen = pose_of(poses.get_latest_at(t)->cube);
    distance = (seen.position - goal.position).norm();

    planner.model().set_joints(y.position, y.velocity, state);
    PlanningModel::set_object(cube, seen, Twist{}, state);
    state.time = static_cast<double>(t) * kPeriod;
    planner.set_state(state);

    if (planner.at(state.time, action.position)) {  // otherwise, there is no plan yet
      action.position_kp.fill(options.kp);
      action.position_kd.fill(options.kd);
    }
    t = robot.append_desired_action(action);
    // This simulation does not wait for the clock, but plans take real time.
    if (is_here) std::this_thread::sleep_until(begin + std::chrono::milliseconds(t));
  }

  const OnlinePlannerStatus& status = planner.status();
  std::cout << "after " << static_cast<double>(t) * kPeriod.count() << " s the cube is "
            << 1e3 * distance << " mm from its goal\n"
            << status.num_plans << " plans; the last one took " << 1e3 * status.duration.count()
            << " ms\n";
  return distance < kNear ? EXIT_SUCCESS : EXIT_FAILURE;
}
