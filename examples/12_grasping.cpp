// SPDX-License-Identifier: BSD-3-Clause
// Three tips grasp the cube, lift it by 3 cm, put it down and let it go. The object session
// delivers the cube's pose every 10 ms, with a delay of 20 ms. An estimator computes where the cube
// is now.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <vector>

#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/pose_estimator.hpp"
#include "trifinger/control/trajectories.hpp"
#include "trifinger/sim/simulation.hpp"

using namespace trifinger::control;

namespace {

constexpr Seconds kPeriod(1e-3);
constexpr Seconds kMove(1.0);  // Time to move up, and to move down again.
constexpr Seconds kStay(1.0);  // Time at the top.

Pose pose_of(const trifinger::ObjectPose& object) {
  const auto& [w, x, y, z] = object.orientation;
  return {Eigen::Vector3d(object.position.data()), Eigen::Quaterniond(w, x, y, z)};
}

}  // namespace

int main(int argument_count, char** arguments) {
  // The robot of the name that this program is given, or one in this process.
  auto robot = argument_count > 1 ? trifinger::connect<trifinger::TriFinger>(arguments[1])
                                  : trifinger::simulate<trifinger::TriFinger>({.object_delay = 20});
  const trifinger::Companion<trifinger::CubeObservation> cube(robot.companion("object"));
  auto t = robot.append_desired_action(trifinger::hold_position(robot.latest_observation()));

  const Pose rest = pose_of(cube.get_latest_at(t)->cube);
  const Pose top{rest.position + Eigen::Vector3d(0, 0, 0.03), rest.orientation};
  const PoseTrajectory up(rest, top, kMove);
  const PoseTrajectory down(top, rest, kMove);
  Seconds lift_begin(std::numeric_limits<double>::infinity());  // Not known yet.
  const auto desired_at = [&](Seconds time) {
    const Seconds since = time - lift_begin;
    return since < kMove + kStay ? up.at(since) : down.at(since - kMove - kStay);
  };

  const trifinger::RobotDescription description;
  const auto grasp =
      GraspPlanner(description).plan(std::vector<Motion>{{.pose = rest}, {.pose = top}});
  if (!grasp) return EXIT_FAILURE;
  GraspController controller(description, rigid_body(trifinger::cube()));
  controller.grasp(grasp->touches, rest);

  PoseEstimator estimator;
  Motion object;
  double highest = 0;
  while (controller.state().phase != GraspPhase::kIdle) {
    const auto y = robot.get_observation(t);
    const Seconds now = static_cast<double>(t) * kPeriod;
    const auto seen = cube.get_latest_at(t);
    const Seconds then = static_cast<double>(seen->stamp.capture_index) * kPeriod;
    estimator.update(then, pose_of(seen->cube), desired_at(then));
    object = estimator.predict(now, desired_at(now));
    highest = std::max(highest, object.pose.position.z());

    trifinger::TriFinger::Action action;
    std::ranges::copy(
        controller.update(kPeriod,
                          {trifinger::joint_values(y.position), trifinger::joint_values(y.velocity),
                           trifinger::joint_values(y.torque)},
                          object, desired_at(now)),
        action.torque.begin());
    t = robot.append_desired_action(action);

    const GraspPhase phase = controller.state().phase;
    if (phase == GraspPhase::kHold && lift_begin > now) lift_begin = now;
    const bool is_down = phase == GraspPhase::kHold && now > lift_begin + 2 * kMove + kStay;
    if (is_down || phase == GraspPhase::kLost) controller.release();
  }

  const double height = highest - rest.position.z();
  const double moved = (object.pose.position - rest.position).norm();
  std::cout << "the cube was lifted by " << 1e3 * height << " mm and lies " << 1e3 * moved
            << " mm from where it was\n";
  return std::abs(height - 0.03) < 2e-3 && moved < 3e-3 ? EXIT_SUCCESS : EXIT_FAILURE;
}
