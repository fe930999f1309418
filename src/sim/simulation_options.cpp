// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/simulation_options.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "base/text_of.hpp"
#include "in_seconds.hpp"
#include "model/export.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger {
namespace {

using detail::in_seconds;
using detail::require;
using detail::text_of;

// Longer steps are not like the robot any more: docs/planning.md says what 8 ms do to a grasp.
constexpr Nanoseconds kLongestStep = std::chrono::milliseconds(10);

// Our own choice: a little more than the motors reach against the safety damping [rad/s].
constexpr FingerJoints kMaxVelocity{5.0, 5.0, 8.0};
// Our own choice: a joint is stuck that stays exactly the same while its torque varies by this
// share of its maximum.
constexpr double kStuckShare = 0.5;

// Letters, digits and '_', for names of types.
std::string plain_name(const std::string& name) {
  std::string plain;
  for (const char letter : name) {
    const bool is_plain = (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                          (letter >= '0' && letter <= '9') || letter == '_';
    plain += is_plain ? letter : '_';
  }
  // Programs know robots of these types.
  const bool is_taken = plain == TriFinger::kType || plain == Finger::kType || plain.empty();
  return is_taken ? plain + "_file" : plain;
}

template <class Joints>
std::vector<JointKind> kinds_of(const Joints& joints) {
  std::vector<JointKind> kinds;
  kinds.reserve(joints.size());
  for (const auto& joint : joints) {
    kinds.push_back(joint.is_slide ? JointKind::kSlide : JointKind::kHinge);
  }
  return kinds;
}

void require_countable(std::size_t joints) {
  require(joints <= kMaxCountedJoints,
          text_of("the model has ", joints, " driven joints, a robot has at most ",
                  kMaxCountedJoints, "; name those to be driven (robot.joints)"));
}

void validate_limits(const SimulationOptions& options) {
  const bool is_from_file = options.file != nullptr;
  const std::size_t joints = is_from_file
                                 ? options.file->joints().size()
                                 : static_cast<std::size_t>(num_joints(options.description));
  require_countable(joints);
  require(options.limits.has_value() || !is_from_file, "a robot from a file needs limits");
  const std::vector<JointLimit> limits =
      options.limits ? *options.limits : default_limits(options.description);
  require(limits.size() == joints,
          text_of("there are limits for ", limits.size(), " joints, but the ",
                  is_from_file ? "model" : "robot", " has ", joints));
  validate(limits);
  options.stop.validate(limits);
  const Identified& identified = options.identified;
  identified.validate(joints);
  for (const TimeIndex delay : {identified.torque_delay, identified.measurement_delay}) {
    require(
        delay >= 0 && delay <= Variation::kMaxDelay,
        text_of("a delay in identified is ", delay, " steps, must be 0 to ", Variation::kMaxDelay));
  }
}

}  // namespace

std::vector<JointLimit> default_limits(const RobotDescription& description) {
  const VariantFigures& figures = trifinger::figures(description);
  std::vector<JointLimit> limits(static_cast<std::size_t>(num_joints(description)));
  for (std::size_t i = 0; i < limits.size(); ++i) {
    const std::size_t joint = i % kJointsPerFinger;
    JointLimit& limit = limits[i];
    for (const JointLimitField& field : JointLimit::fields()) limit.*field.value = field.usual;
    limit.max_torque = figures.actuator.torque_limit;
    limit.safety_kd = figures.safety_kd[joint];
    limit.soft_lower = figures.soft_lower[joint];
    limit.soft_upper = figures.soft_upper[joint];
    limit.hard_lower = figures.hard_lower[joint];
    limit.hard_upper = figures.hard_upper[joint];
    limit.default_kp = figures.kp[joint];
    limit.default_kd = figures.kd[joint];
    limit.max_velocity = kMaxVelocity[joint];
    limit.braking = figures.braking[joint];
    limit.continuous_torque = figures.actuator.continuous_torque;
    limit.thermal_time = figures.actuator.thermal_time;
    limit.stuck_torque = kStuckShare * figures.actuator.torque_limit;
  }
  return limits;
}

std::vector<NamedJoint> joints_of(const ModelFile& model) {
  require_countable(model.joints().size());
  constexpr std::array kAnywhere{-kLargestJointLimit, kLargestJointLimit};
  // Files say huge numbers if they do not know a limit.
  const auto said = [](const std::optional<double>& value) {
    return value && *value <= kLargestJointLimit ? *value : kNotGiven;
  };
  std::vector<NamedJoint> joints;
  for (const DrivenJoint& joint : model.joints()) {
    JointLimit known;
    known.max_torque = said(joint.max_torque);
    known.max_velocity = said(joint.max_velocity);
    if (joint.soft_range) {
      known.soft_lower = (*joint.soft_range)[0];
      known.soft_upper = (*joint.soft_range)[1];
    }
    known.default_kp = joint.kp.value_or(kNotGiven);
    known.default_kd = joint.kd.value_or(kNotGiven);
    // A joint without stops may be anywhere.
    const auto& [lower, upper] = joint.range.value_or(kAnywhere);
    known.hard_lower = std::max(lower, -kLargestJointLimit);
    known.hard_upper = std::min(upper, kLargestJointLimit);
    joints.push_back({.name = joint.name,
                      .kind = joint.is_slide ? JointKind::kSlide : JointKind::kHinge,
                      .known = known});
  }
  return joints;
}

void SimulationOptions::validate() const {
  if (file == nullptr) trifinger::validate(description);
  for (const ObjectDescription& object : objects_of(*this)) {
    require(object.name != "stamp",
            "an object cannot be called 'stamp', which is another field "
            "of the session 'object'");
  }
  validate_limits(*this);
  require(file == nullptr || period == file->period(),
          text_of("period is ", period.count(), " ns, must be that of the file, ",
                  file != nullptr ? file->period().count() : 0, " ns"));
  require(
      file != nullptr || (period >= kPhysicsStep && period % kPhysicsStep == Nanoseconds::zero()),
      "period is " + std::to_string(period.count()) +
          " ns, must be a whole number of milliseconds");
  require(file == nullptr || physics_step == kPhysicsStep,
          "physics_step is for TriFingers: a robot from a file has the timestep of its file");
  require(file != nullptr ||
              (physics_step > Nanoseconds::zero() &&
               (period % physics_step == Nanoseconds::zero() ||
                (physics_step % period == Nanoseconds::zero() && physics_step <= kLongestStep))),
          text_of("physics_step is ", in_seconds(physics_step),
                  " s, must be a whole part of the period, ", in_seconds(period),
                  " s, or some whole periods, at most ", in_seconds(kLongestStep), " s"));
  require(object_period >= 1,
          "object_period is " + std::to_string(object_period) + " steps, must be at least 1");
  constexpr TimeIndex kMaxDelay = 100000;
  require(object_delay >= 0 && object_delay <= kMaxDelay,
          "object_delay is " + std::to_string(object_delay) + " steps, must be 0 to " +
              std::to_string(kMaxDelay));
  require(scene_period >= 0, "scene_period is " + std::to_string(scene_period) +
                                 " steps, must be at least 0; 0 leaves the scene out");
  require(object_loss >= 0.0 && object_loss <= 1.0,
          "object_loss is " + text_of(object_loss) + ", must be 0 to 1");
  for (const auto& [name, noise] :
       {std::pair{"object_position_noise", object_position_noise},
        std::pair{"object_orientation_noise", object_orientation_noise}}) {
    require(std::isfinite(noise) && noise >= 0.0,
            std::string(name) + " is " + text_of(noise) + ", must be at least 0");
  }
}

const std::vector<ObjectDescription>& objects_of(const SimulationOptions& options) {
  return options.file != nullptr ? options.file->options().objects : options.description.objects;
}

std::shared_ptr<const SceneModel> make_model(const SimulationOptions& options, Detail detail) {
  if (options.file != nullptr) return options.file;
  auto model = std::make_shared<RobotModel>(options.description, detail);
  model->adopt(options.identified);
  model->set_timestep(in_seconds(options.physics_step));
  return model;
}

RobotTypes robot_types_of(const SimulationOptions& options) {
  if (options.file != nullptr) return robot_types_of(*options.file);
  return options.description.arrangement == Arrangement::kTriFinger ? describe_robot<TriFinger>()
                                                                    : describe_robot<Finger>();
}

RobotTypes robot_types_of(const ModelFile& model) {
  std::vector<FieldDescription> more;
  if (!model.drives_all()) {
    const std::vector<JointKind> kinds = kinds_of(model.model_joints());
    const bool has_slide = std::ranges::find(kinds, JointKind::kSlide) != kinds.end();
    const bool has_hinge = std::ranges::find(kinds, JointKind::kHinge) != kinds.end();
    const std::string length = !has_slide ? "rad" : !has_hinge ? "m" : "rad or m";
    const std::string rate = !has_slide ? "rad/s" : !has_hinge ? "m/s" : "rad/s or m/s";
    const auto add = [&](const char* name, const std::string& unit) {
      more.push_back({.name = name,
                      .type = ScalarType::kFloat64,
                      .shape = {kinds.size()},
                      .unit = unit,
                      .offset = 0});
    };
    add("joint_position", length);
    add("joint_velocity", rate);
  }
  return describe_counted(plain_name(model.name()), kinds_of(model.joints()), more);
}

std::vector<Document> model_documents(const SimulationOptions& options) {
  if (options.file != nullptr) return {{"model.xml", "application/xml", options.file->mjcf()}};
  const RobotDescription& description = options.description;
  ViewerScene scene =
      export_scene(description, {.joint_field = "position", .object_companion = kObjectCompanion});
  return {{"model.xml", "application/xml", export_mjcf(description)},
          {"robot.urdf", "application/xml", std::move(scene.urdf)},
          {"frames.txt", "text/plain", std::move(scene.frames)}};
}

std::string default_name(const SimulationOptions& options) {
  const RobotTypes types = robot_types_of(options);
  if (options.file != nullptr) return types.type;
  return types.type + "-" + std::string(variant_figures(options.description.variant).name);
}

}  // namespace trifinger
