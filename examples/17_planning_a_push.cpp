// SPDX-License-Identifier: BSD-3-Clause
// Plans a push of the cube by trying many in simulations, and then carries it out. Nobody says
// which finger pushes, or where: only what is wanted. From the same start, a new plan with
// predictive sampling never costs more than the one before.
#include <cstdlib>
#include <iomanip>
#include <iostream>

#include "trifinger/control/predictive_planner.hpp"
#include "trifinger/sim/simulation.hpp"

using namespace trifinger::control;

namespace {

const Eigen::Vector3d kAway(0.03, 0.02, 0);  // [m]
constexpr Seconds kHorizon(1.0);
constexpr int kPlans = 30;

Pose pose_of(const trifinger::ObjectPose& object) {
  const auto& [w, x, y, z] = object.orientation;
  return {Eigen::Vector3d(object.position.data()), Eigen::Quaterniond(w, x, y, z)};
}

}  // namespace

int main(int argument_count, char** arguments) {
  // The robot of the name that this program is given, or one in this process.
  auto robot = argument_count > 1 ? trifinger::connect<trifinger::TriFinger>(arguments[1])
                                  : trifinger::simulate<trifinger::TriFinger>();
  const trifinger::Companion<trifinger::CubeObservation> poses(robot.companion("object"));
  auto t = robot.append_desired_action(trifinger::hold_position(robot.latest_observation()));
  const auto y = robot.get_observation(t);
  const Pose rest = pose_of(poses.get_latest_at(t)->cube);

  PlanningModel model({});
  const trifinger::ObjectAddress cube = model.object("cube");
  PlanningState start = model.initial_state();
  model.set_joints(y.position, y.velocity, start);
  PlanningModel::set_object(cube, rest, Twist{}, start);

  const Pose goal{rest.position + kAway, rest.orientation};
  const PlanningTask task{
      .terms = {{.kind = CostKind::kObjectPosition, .weight = 10, .end_weight = 5, .goal = goal},
                {.kind = CostKind::kObjectVelocity, .weight = 10, .shape = CostShape::kSquare},
                {.kind = CostKind::kTipObject, .weight = 2, .distance = 0.046}}};
  const PlannerOptions options{
      .method = PlanningMethod::kPredictiveSampling, .horizon = kHorizon, .knots = 6, .seed = 1};
  PredictivePlanner planner(std::move(model), task, options);

  const double first = (static_cast<void>(planner.plan(start)), planner.newest().previous_cost);
  double cost = planner.newest().cost;
  bool never_rises = cost <= first;
  std::cout << std::fixed << std::setprecision(3) << "costs of the plans: " << first;
  for (int i = 1; i < kPlans; ++i) {
    const double next = planner.plan(start).cost;
    never_rises &= next <= cost;
    cost = next;
    if (i % 5 == 4) std::cout << ' ' << cost;
  }
  std::cout << '\n';

  const Plan& best = planner.newest();
  trifinger::TriFinger::Action action;
  action.position_kp.fill(options.kp);
  action.position_kd.fill(options.kd);
  for (Seconds time(0); time < kHorizon; time += Seconds(1e-3)) {
    best.commands.at(time, action.position);
    t = robot.append_desired_action(action);
  }
  robot.wait_until_time_index(t);

  // How far the cube is on its way [m].
  const auto moved = [&](const Eigen::Vector3d& position) {
    return (position - rest.position).dot(kAway.normalized());
  };
  const std::span<const double> end = std::span(best.states.positions).last(start.position.size());
  const double planned = moved(PlanningModel::object_pose(cube, end).position);
  const double done = moved(pose_of(poses.get_latest_at(t)->cube).position);
  std::cout << std::setprecision(0) << "the plan moves the cube by " << 1e3 * planned
            << " mm, the robot by " << 1e3 * done << " mm\n";
  return never_rises && cost < 0.8 * first && done > 0.015 ? EXIT_SUCCESS : EXIT_FAILURE;
}
