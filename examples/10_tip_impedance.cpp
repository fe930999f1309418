// SPDX-License-Identifier: BSD-3-Clause
// Each tip hangs on a spring and a damper. Their other end moves up by 3 cm. The transposed
// Jacobian turns the force into joint torques.
#include <cstdlib>
#include <iomanip>
#include <iostream>
#include <vector>

#include "trifinger/control/impedance.hpp"
#include "trifinger/control/trajectories.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/sim/simulation.hpp"

using trifinger::joint_values;
using trifinger::JointValues;

int main(int argument_count, char** arguments) {
  // The robot of the name that this program is given, or one in this process.
  auto robot = argument_count > 1 ? trifinger::connect<trifinger::TriFinger>(arguments[1])
                                  : trifinger::simulate<trifinger::TriFinger>();
  trifinger::Kinematics kinematics;
  const trifinger::control::Seconds period(1e-3);

  auto y = robot.latest_observation();
  kinematics.update(joint_values(y.position));
  std::vector<trifinger::control::LineTrajectory> trajectories;
  for (int finger = 0; finger < 3; ++finger) {
    const Eigen::Vector3d tip = kinematics.tip_position(finger);
    trajectories.emplace_back(tip, tip + Eigen::Vector3d(0, 0, 0.03),
                              trifinger::control::Seconds(1));
  }

  double error = 0;
  for (int i = 0; i < 2000; ++i) {
    kinematics.update(joint_values(y.position));
    const trifinger::JointMatrix jacobians = kinematics.tip_jacobians();
    const JointValues velocity = jacobians * joint_values(y.velocity);
    JointValues forces(9);
    error = 0;
    for (int finger = 0; finger < 3; ++finger) {
      const auto wanted = trajectories[static_cast<std::size_t>(finger)].at(i * period);
      const Eigen::Vector3d tip = kinematics.tip_position(finger);
      forces.segment<3>(3 * finger) = trifinger::control::tip_impedance(
          wanted, tip, velocity.segment<3>(3 * finger), {.stiffness = 200, .damping = 2.5});
      error = std::max(error, (wanted.position - tip).norm());
    }
    trifinger::TriFinger::Action action;
    JointValues::Map(action.torque.data(), 9) =
        jacobians.transpose() * forces + kinematics.bias_torques(joint_values(y.velocity));
    y = robot.get_observation(robot.append_desired_action(action));
  }
  std::cout << std::fixed << std::setprecision(3) << "the tips are within " << 1e3 * error
            << " mm of where they should be\n";
  return error < 1e-3 ? EXIT_SUCCESS : EXIT_FAILURE;
}
