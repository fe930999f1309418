// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "model/joint_loads.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/model/model_file.hpp"

namespace trifinger::detail {

// What a robot's file says of a joint, and what is proposed where it says nothing.
struct JointProposal {
  JointLimit limit;            // the largest torque is NaN if the file does not say it
  double suggested_torque{};   // that of a motor that can carry and move the links
  JointLoad load{};            // with the proposed rotor
  bool replaces_gains{false};  // the file's gains would be too weak or too stiff for this step
};

// Values with which a simulated robot holds its pose and can be moved. They follow from masses and
// limits in its file; whoever has a real robot must measure.
struct RobotProposal {
  std::vector<JointProposal> joints;
  // Joints that begin elsewhere than the file says, driven or following.
  std::vector<std::pair<std::string, double>> initial_position;
  std::map<std::string, double> rotors;  // inertia of joints' rotors [kgm^2], [kg]
  // Bodies of an MJCF that are deep inside each other where it begins, as `JointLoads` has them.
  std::vector<std::string> overlaps{};
};

[[nodiscard]] RobotProposal propose_limits(const ModelFile& model);

}  // namespace trifinger::detail
