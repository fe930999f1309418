// SPDX-License-Identifier: BSD-3-Clause
// The fingers float when they get the torques that carry their weight and nothing else. People can
// push them, and they stay where they are left. Afterwards they get no torque at all.
#include <cstdlib>
#include <iomanip>
#include <iostream>
#include <utility>

#include "trifinger/model/kinematics.hpp"
#include "trifinger/sim/simulation.hpp"

using trifinger::joint_values;
using trifinger::JointValues;

int main(int argument_count, char** arguments) {
  // The robot of the name that this program is given, or one in this process.
  auto robot = argument_count > 1 ? trifinger::connect<trifinger::TriFinger>(arguments[1])
                                  : trifinger::simulate<trifinger::TriFinger>();
  trifinger::Kinematics kinematics;

  // Pushes one joint for a fifth of a second. Returns how far the joints move during that time, and
  // in the second after it.
  const auto push = [&](bool compensates) {
    auto y = robot.latest_observation();
    const JointValues begin = joint_values(y.position);
    JointValues left = begin;
    for (int i = 0; i < 1200; ++i) {
      trifinger::TriFinger::Action action;
      if (compensates) {
        kinematics.update(joint_values(y.position));
        JointValues::Map(action.torque.data(), 9) = kinematics.gravity_torques();
      }
      if (i < 200) action.torque[1] += 0.05;
      y = robot.get_observation(robot.append_desired_action(action));
      if (i == 199) left = joint_values(y.position);
    }
    return std::pair((left - begin).cwiseAbs().maxCoeff(),
                     (joint_values(y.position) - left).cwiseAbs().maxCoeff());
  };

  const auto [pushed, drifted] = push(true);
  const double fallen = push(false).second;
  std::cout << std::fixed << std::setprecision(3) << "floating, a joint was pushed by " << pushed
            << " rad and moved by " << drifted << " rad when left alone; falling, by " << fallen
            << " rad\n";
  // A machine that is late gives emulated boards less time to move in.
  return pushed > 0.03 && drifted < 0.03 && fallen > 3 * drifted ? EXIT_SUCCESS : EXIT_FAILURE;
}
