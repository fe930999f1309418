// SPDX-License-Identifier: BSD-3-Clause
#include "model/new_configuration.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <string_view>
#include <system_error>
#include <vector>

#include "joint/limit_text.hpp"
#include "sim/propose_limits.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::apps {
namespace {

namespace fs = std::filesystem;

using detail::is_said;
using detail::JointProposal;
using detail::key_of;
using detail::number_text;
using detail::quoted_text;

constexpr std::string_view kAboutSafety = R"(
# What the file does not say, proposed for the SIMULATION: from the masses in the file, so that the
# robot holds its pose and moves without shaking. A real robot needs values that somebody has
# measured. Joints that slide have m and N instead of rad and Nm.
#   max_torque              largest torque of the motor [Nm]; only its maker knows it
#   soft_lower, soft_upper  targets are clamped, and a joint beyond is pushed back [rad]: proposed 2 %
#                           of the range inside its stops
#   hard_lower, hard_upper  beyond, the robot stops with a fault [rad]: 10 % of the range behind the
#                           stops, because those of a simulation give way
#   max_velocity            a faster joint is not driven, but braked [rad/s]: proposed 3 rad/s, 0.3 m/s
#   default_kp              stiffness of a position [Nm/rad]: weight and dry friction move the joint
#                           by 0.02 rad at most
#   default_kd              its damping [Nms/rad]: critical for the inertia that the motor feels
#   safety_kd               damping that always acts [Nms/rad]: a tenth of it
#   braking                 deceleration that must suffice to stop at a soft limit [rad/s^2]: half of
#                           what the motor has beside the weight
safety:
)";

// The path to `path` from `folder`; absolute if there is none.
std::string relative_path(const fs::path& path, const fs::path& folder) {
  std::error_code ignored;
  const fs::path relative = fs::relative(fs::absolute(path), fs::absolute(folder), ignored);
  return (relative.empty() ? fs::absolute(path) : relative).string();
}

// A text of the file, for a comment.
std::string on_one_line(std::string text) {
  std::ranges::replace_if(
      text, [](char letter) { return static_cast<unsigned char>(letter) < ' '; }, ' ');
  return text;
}

// What names the robot's file, and how it is read.
std::string head_of(const std::string& name, const fs::path& folder, const ModelFile& model) {
  const ModelFileOptions& options = model.options();
  std::string text = fmt::format(
      "# {}, simulated. docs/any_robot.md explains the keys; 'trifinger config {}.yml' checks "
      "them.\n"
      "name: {}\ndriver: simulation\n\nrobot:\n  {}: {}\n",
      on_one_line(model.name()), name, name, is_urdf(options) ? "urdf" : "mjcf",
      // From the folder of the configuration, so that both can be moved together.
      quoted_text(relative_path(options.path, folder)));
  if (options.mesh_folder) {
    // This one counts from the folder of the robot's file.
    text +=
        fmt::format("  mesh_folder: {}\n",
                    quoted_text(relative_path(*options.mesh_folder, options.path.parent_path())));
  }
  for (const std::string& repaired : model.repairs()) {
    text += fmt::format("  # {}\n", on_one_line(repaired));
  }
  if (options.repair_inertia) text += "  repair_inertia: true\n";
  if (options.angle_in_radians) text += "  angle: radian\n";
  if (options.collision == UrdfCollision::kVisual) text += "  collision: visual\n";
  if (options.collision == UrdfCollision::kNone) text += "  collision: none\n";
  return text;
}

template <class Entries, class Write>
std::string flow_of(const Entries& entries, const Write& write) {
  std::string text;
  for (const auto& entry : entries) text += (text.empty() ? "{" : ", ") + write(entry);
  return text + "}";
}

std::string places_of(const detail::RobotProposal& proposal) {
  std::string text;
  if (!proposal.overlaps.empty()) {
    text += fmt::format(
        R"(  # Bodies that are inside each other where the robot begins would throw it. So they pass
  # through each other: {}{}.
  exclude_overlaps: true
)",
        on_one_line(proposal.overlaps.front()),
        proposal.overlaps.size() > 1 ? fmt::format(", {} more", proposal.overlaps.size() - 1) : "");
  }
  const auto write = [](const auto& named) {
    return key_of(named.first) + ": " + number_text(named.second);
  };
  text +=
      proposal.initial_position.empty()
          ? R"(  # Where joints begin, if not at zero or in the file's first key frame [rad], [m].
  # initial_position: {JOINT: 0.5}
)"
          : R"(  # Joints whose place in the file is at a soft limit begin inside, in the middle unless
  # the file has a key frame [rad], [m]. Proposed for the simulation.
  initial_position: )" +
                flow_of(proposal.initial_position, write) + "\n";
  text +=
      proposal.rotors.empty()
          ? R"(  # Inertia of the rotors behind their gears, if the file leaves it out [kgm^2], [kg].
  # armature: {every_joint: 0.1}
)"
          : R"(  # Inertia of rotors behind their gears [kgm^2], [kg]. The file says none, or so little that
  # gains or motors are too strong for the links in steps of this length. Proposed for the
  # simulation: as little as suffices.
  armature: )" + flow_of(proposal.rotors, write) +
                "\n";
  return text;
}

// The values of a joint that its file does not say.
std::vector<std::string> values_of(const NamedJoint& joint, const JointProposal& proposal) {
  std::vector<std::string> values;
  if (!is_said(proposal.limit.max_torque)) values.emplace_back("max_torque: FILL_IN");
  for (const JointLimitField& field : JointLimit::fields()) {
    const double value = proposal.limit.*field.value;
    if (!is_said(value) || value == joint.known.*field.value) continue;
    values.push_back(std::string(field.name) + ": " + number_text(value));
  }
  return values;
}

// Where the values of a joint come from.
std::string reason_of(const NamedJoint& joint, const JointProposal& proposal, bool is_urdf) {
  const bool slides = joint.kind == JointKind::kSlide;
  const char* const torque = slides ? "N" : "Nm";
  const double weight = proposal.load.weight;
  const double largest_weight = proposal.load.largest_weight;
  std::string text =
      fmt::format("simulation: {:.3g} {}, weight up to {:.3g} {}", proposal.load.inertia,
                  slides ? "kg" : "kgm^2", largest_weight, torque);
  if (joint.known.hard_lower > -kLargestJointLimit) {
    // In full, because a soft limit may be copied from here: a rounded one could be beyond.
    text += fmt::format("; its stops: {} to {} {}", number_text(joint.known.hard_lower),
                        number_text(joint.known.hard_upper), slides ? "m" : "rad");
  } else {
    text += "; no stops";
  }
  constexpr double kSmallRange = 0.06;  // [rad]: 3.5, taken for degrees
  if (!slides && !is_urdf && joint.known.hard_upper - joint.known.hard_lower < kSmallRange) {
    text += fmt::format("; so small a range: {}", kHowToTakeRadians);
  }
  if (proposal.replaces_gains) {
    text += fmt::format("; the file's kp {:.3g} and kd {:.3g} are too weak or too strong here",
                        joint.known.default_kp, joint.known.default_kd);
  }
  const double most = proposal.limit.max_torque;
  if (!is_said(most)) {
    text += fmt::format("; the file says no torque, {} {} would do",
                        number_text(proposal.suggested_torque), torque);
  } else if (most < weight) {
    text +=
        fmt::format("; CANNOT HOLD where it begins: the weight is {:.3g} {}, the motor has {:.3g}",
                    weight, torque, most);
  } else if (most < largest_weight) {
    text += fmt::format("; cannot hold everywhere: the motor has {:.3g} {}", most, torque);
  }
  return text;
}

std::string safety_of(const ModelFile& model, const detail::RobotProposal& proposal, bool is_urdf) {
  const std::vector<NamedJoint> joints = joints_of(model);
  std::string text(kAboutSafety);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const JointProposal& joint = proposal.joints[i];
    text +=
        fmt::format("  {}: {}  # {}\n", key_of(joints[i].name),
                    flow_of(values_of(joints[i], joint), [](const auto& value) { return value; }),
                    reason_of(joints[i], joint, is_urdf));
  }
  return text;
}

}  // namespace

std::string configuration_of(const std::string& name, const fs::path& folder,
                             const ModelFile& model) {
  const detail::RobotProposal proposal = detail::propose_limits(model);
  return head_of(name, folder, model) + places_of(proposal) +
         safety_of(model, proposal, is_urdf(model.options()));
}

}  // namespace trifinger::apps
