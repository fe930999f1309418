// SPDX-License-Identifier: BSD-3-Clause
// The tips go down to the table and press on it with 1 N each. In the vertical direction a force
// replaces the spring; in the horizontal directions the spring remains.
#include <algorithm>
#include <cstdlib>
#include <iostream>

#include "trifinger/control/impedance.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/sim/simulation.hpp"

using trifinger::joint_values;
using trifinger::JointValues;

int main(int argument_count, char** arguments) {
  // The robot of the name that this program is given, or one in this process.
  auto robot = argument_count > 1 ? trifinger::connect<trifinger::TriFinger>(arguments[1])
                                  : trifinger::simulate<trifinger::TriFinger>();
  trifinger::Kinematics kinematics;
  constexpr double kForce = 1.0;          // [N]
  constexpr double kDownwardSpeed = 0.1;  // [m/s]

  auto y = robot.latest_observation();
  kinematics.update(joint_values(y.position));
  const JointValues begin = kinematics.tip_positions();
  for (int i = 0; i < 2000; ++i) {
    kinematics.update(joint_values(y.position));
    const trifinger::JointMatrix jacobians = kinematics.tip_jacobians();
    const JointValues velocity = jacobians * joint_values(y.velocity);
    JointValues forces(9);
    for (int finger = 0; finger < 3; ++finger) {
      trifinger::control::PointMotion wanted{.position = begin.segment<3>(3 * finger)};
      const Eigen::Vector3d tip = kinematics.tip_position(finger);
      wanted.position.z() = tip.z();
      const bool touches = y.tip_force[static_cast<std::size_t>(finger)] > 0;
      if (!touches) wanted.velocity.z() = -kDownwardSpeed;
      forces.segment<3>(3 * finger) = trifinger::control::tip_impedance(
          wanted, tip, velocity.segment<3>(3 * finger), {.stiffness = 200, .damping = 5});
      if (touches) forces[3 * finger + 2] = -kForce;
    }
    trifinger::TriFinger::Action action;
    JointValues::Map(action.torque.data(), 9) =
        jacobians.transpose() * forces + kinematics.bias_torques(joint_values(y.velocity));
    y = robot.get_observation(robot.append_desired_action(action));
  }
  const auto [least, most] = std::ranges::minmax(y.tip_force);
  std::cout << "the tips press with " << least << " to " << most << " N\n";
  return least > 0.95 && most < 1.05 ? EXIT_SUCCESS : EXIT_FAILURE;
}
