// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/file_simulator.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

#include "file_robot_parts.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"

namespace trifinger {
namespace {

using detail::require;
using detail::text_of;

void set_in_motion(const ObjectAddress& object, const ObjectVelocity& velocity,
                   mjData& data) noexcept {
  double* const values = data.qvel + object.velocity;
  std::ranges::copy(velocity.linear, values);
  // MuJoCo expresses the rotation of a free body in the body's frame.
  std::array<double, 4> inverse{};
  mju_negQuat(inverse.data(), data.qpos + object.position + 3);
  mju_rotVecQuat(values + 3, velocity.angular.data(), inverse.data());
}

std::string_view unit_of(const FileJoint& joint) { return joint.is_slide ? " m" : " rad"; }

// True if the time constant of a contact is the first number of its solref; else both numbers are
// stiffness and damping.
bool has_time_constant(const double* solref) noexcept { return solref[0] > 0.0; }

}  // namespace

std::vector<NamedJoint> joints_of(const ModelFile& model) {
  std::vector<NamedJoint> joints;
  for (const FileJoint& joint : model.joints()) {
    JointLimit known;
    known.max_torque = joint.max_torque.value_or(kNotGiven);
    known.default_kp = joint.kp.value_or(kNotGiven);
    known.default_kd = joint.kd.value_or(kNotGiven);
    // A joint without stops may be anywhere.
    known.hard_lower = joint.range ? (*joint.range)[0] : -kLargestJointLimit;
    known.hard_upper = joint.range ? (*joint.range)[1] : kLargestJointLimit;
    joints.push_back({.name = joint.name,
                      .kind = joint.is_slide ? JointKind::kSlide : JointKind::kHinge,
                      .known = known});
  }
  return joints;
}

void FileRobotOptions::validate() const {
  require(model != nullptr, "a robot from a file has no model");
  require(model->joints().size() <= kMaxCountedJoints,
          text_of("the model has ", model->joints().size(), " driven joints, a robot has at most ",
                  kMaxCountedJoints, "; name those to be driven (robot.joints)"));
  require(limits.size() == model->joints().size(),
          text_of("there are limits for ", limits.size(), " joints, but the model has ",
                  model->joints().size()));
  trifinger::validate(limits);
  require(object_period >= 1, text_of("object_period is ", object_period, ", must be at least 1"));
}

void FileRobotOptions::put_at_start(mjData& data) const noexcept {
  const mjModel& mujoco = *model->mujoco();
  const int key =
      keyframe ? mj_name2id(&mujoco, mjOBJ_KEY, keyframe->c_str()) : (mujoco.nkey > 0 ? 0 : -1);
  if (key >= 0) {
    mj_resetDataKeyframe(&mujoco, &data, key);
  } else {
    mj_resetData(&mujoco, &data);
  }
  for (const ObjectDescription& object : model->options().objects) {
    const auto body = std::ranges::find(model->free_bodies(), object.name, &ObjectAddress::name);
    set_in_motion(*body, {.linear = object.velocity, .angular = object.angular_velocity}, data);
  }
  for (const auto& [name, position] : initial_position) {
    const auto driven = std::ranges::find(model->joints(), name, &FileJoint::name);
    if (driven != model->joints().end()) {
      const auto index = static_cast<std::size_t>(driven - model->joints().begin());
      model->set_position(index, position, data);
      continue;
    }
    const auto any = std::ranges::find(model->model_joints(), name, &ModelJoint::name);
    if (any == model->model_joints().end()) continue;
    model->set_model_position(static_cast<std::size_t>(any - model->model_joints().begin()),
                              position, data);
  }
}

FileSimulator::FileSimulator(FileRobotOptions options)
    : options_((options.validate(), std::move(options))), safety_(options_.limits) {
  const mjModel& mujoco = *model().mujoco();
  if (options_.keyframe) {
    const int key = mj_name2id(&mujoco, mjOBJ_KEY, options_.keyframe->c_str());
    require(key >= 0, "the model has no key frame '" + *options_.keyframe + "'");
  }
  for (const auto& [name, position] : options_.initial_position) {
    const auto driven = std::ranges::find(model().joints(), name, &FileJoint::name);
    const auto any = std::ranges::find(model().model_joints(), name, &ModelJoint::name);
    require(driven != model().joints().end() || any != model().model_joints().end(),
            "the model has no joint '" + name + "', for which there is an initial position");
    require(std::isfinite(position), "the initial position of joint '" + name + "' is not finite");
  }
  const RobotModel::Data data = model().make_data();
  options_.put_at_start(*data);
  initial_configuration_.assign(data->qpos, data->qpos + mujoco.nq);
  std::string beyond;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const JointLimit& limit = options_.limits[i];
    const double position = model().position(i, *data);
    initial_position_.push_back(position);
    if (position >= limit.soft_lower && position <= limit.soft_upper) continue;
    beyond += (beyond.empty() ? "" : "; ") + text_of(model().joints()[i].name, " begins at ",
                                                     position, ", its soft limits are ",
                                                     limit.soft_lower, " and ", limit.soft_upper);
  }
  require(beyond.empty(),
          "some joints begin beyond their soft limits: give them an initial position "
          "within (robot.initial_position). " +
              beyond);
  for (int body = 1; body < static_cast<int>(mujoco.nbody); ++body) {
    const int root = mujoco.body_rootid[body];
    if (std::ranges::find(objects(), root, &ObjectAddress::body) != objects().end()) {
      loose_.push_back(body);
    }
  }
}

void FileSimulator::check(std::span<const double> position) const {
  require(position.size() == num_joints(),
          text_of("position has ", position.size(), " numbers, must have ", num_joints()));
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const JointLimit& limit = options_.limits[i];
    require(position[i] >= limit.hard_lower && position[i] <= limit.hard_upper,
            text_of("joint ", i, " (", model().joints()[i].name, ") cannot begin at ", position[i],
                    unit_of(model().joints()[i]), ", its hard limits are ", limit.hard_lower,
                    " and ", limit.hard_upper));
  }
}

auto FileSimulator::make_state() const -> State {
  State state;
  state.safety.joints.resize(num_joints());
  state.memory.torque = PerJoint<double>(num_joints(), 0.0);
  state.memory.sent.resize(static_cast<std::size_t>(Variation::kMaxTorqueDelay) * num_joints());
  state.observation = Observation(num_joints());
  state.model_position.resize(model().model_joints().size());
  state.model_velocity.resize(model().model_joints().size());
  state.objects.resize(objects().size());
  state.capture.objects.resize(objects().size());
  return state;
}

void FileSimulator::check(const Variation& variation) {
  variation.validate();
  require(variation.pair_friction == Variation{}.pair_friction,
          "pair_friction is for TriFingers: surfaces of a robot from a file have no names");
  require(variation.stop_margin == 1.0,
          "stop_margin is for TriFingers: stops of a robot from a file are where the file says");
}

void FileSimulator::vary(const Variation& variation, mjModel_& varied,
                         mjData_& data) const noexcept {
  const mjModel& original = *model().mujoco();
  for (const int body : loose_) {
    varied.body_mass[body] = variation.object_mass * original.body_mass[body];
    for (int i = 3 * body; i < 3 * body + 3; ++i) {
      varied.body_inertia[i] = variation.object_mass * original.body_inertia[i];
    }
  }
  for (int geom = 0; geom < static_cast<int>(original.ngeom); ++geom) {
    // Sliding friction is the first of three numbers.
    varied.geom_friction[3 * geom] = variation.friction * original.geom_friction[3 * geom];
    const double* const solref = original.geom_solref + mjNREF * geom;
    if (!has_time_constant(solref)) continue;
    varied.geom_solref[mjNREF * geom] = variation.contact_time * solref[0];
  }
  for (int pair = 0; pair < static_cast<int>(original.npair); ++pair) {
    // The first two of five numbers are the two directions of sliding.
    for (int i = 5 * pair; i < 5 * pair + 2; ++i) {
      varied.pair_friction[i] = variation.friction * original.pair_friction[i];
    }
    const double* const solref = original.pair_solref + mjNREF * pair;
    if (!has_time_constant(solref)) continue;
    varied.pair_solref[mjNREF * pair] = variation.contact_time * solref[0];
  }
  for (int joint = 0; joint < static_cast<int>(original.njnt); ++joint) {
    const int type = original.jnt_type[joint];
    if (type != mjJNT_HINGE && type != mjJNT_SLIDE) continue;
    const int dof = original.jnt_dofadr[joint];
    varied.dof_armature[dof] = variation.rotor_inertia * original.dof_armature[dof];
    varied.dof_damping[dof] = variation.joint_damping * original.dof_damping[dof];
    for (int i = mjNPOLY * dof; i < mjNPOLY * (dof + 1); ++i) {
      varied.dof_dampingpoly[i] = variation.joint_damping * original.dof_dampingpoly[i];
    }
    varied.dof_frictionloss[dof] = original.dof_frictionloss[dof] + variation.joint_friction;
  }
  // A file may give rotor and damping of a joint to its actuator.
  for (int motor = 0; motor < static_cast<int>(original.nactuator); ++motor) {
    varied.actuator_armature[motor] = variation.rotor_inertia * original.actuator_armature[motor];
    varied.actuator_damping[motor] = variation.joint_damping * original.actuator_damping[motor];
    for (int i = mjNPOLY * motor; i < mjNPOLY * (motor + 1); ++i) {
      varied.actuator_dampingpoly[i] = variation.joint_damping * original.actuator_dampingpoly[i];
    }
  }
  mj_setConst(&varied, &data);
}

RobotModel::Compiled FileSimulator::make_varied_model() const {
  RobotModel::Compiled copy(mj_copyModel(nullptr, model().mujoco()));
  if (copy == nullptr) throw Error("MuJoCo has no memory for the model");
  return copy;
}

void FileSimulator::reset(std::span<const double> position, const mjModel_& /*model*/,
                          mjData_& data, State& state,
                          std::span<const double> model_position) const noexcept {
  options_.put_at_start(data);
  for (std::size_t i = 0; i < model_position.size(); ++i) {
    if (!std::isnan(model_position[i])) model().set_model_position(i, model_position[i], data);
  }
  for (std::size_t i = 0; i < num_joints(); ++i) model().set_position(i, position[i], data);
  Memory& memory = state.memory;
  // After a reset, nothing of what happened before counts.
  std::ranges::fill(state.safety.joints, JointMemory{});
  memory.torque = PerJoint<double>(num_joints(), 0.0);
  std::ranges::fill(memory.sent, 0.0);
  memory.num_sent = 0;
  begin(state);
  observe(data, state);
}

void FileSimulator::place(const ObjectAddress& object, const ObjectPose& pose,
                          mjData_& data) const noexcept {
  double* const values = data.qpos + object.position;
  std::ranges::copy(pose.position, values);
  double square = 0.0;
  for (const double value : pose.orientation) square += value * value;
  const double norm = std::sqrt(square);
  std::ranges::transform(pose.orientation, values + pose.position.size(),
                         [norm](double value) { return value / norm; });
  std::fill_n(data.qvel + object.velocity, 6, 0.0);
}

void FileSimulator::set_velocity(const ObjectAddress& object, const ObjectVelocity& velocity,
                                 mjData_& data) const noexcept {
  set_in_motion(object, velocity, data);
}

void FileSimulator::begin(State& state) const noexcept {
  state.memory.step = 0;
  state.memory.next_poses = -1;
}

void FileSimulator::observe(const mjData_& data, State& state) const noexcept {
  for (std::size_t i = 0; i < num_joints(); ++i) {
    state.observation.position[i] = model().position(i, data);
    state.observation.velocity[i] = model().velocity(i, data);
  }
  state.observation.torque = state.memory.torque;
  for (std::size_t i = 0; i < state.model_position.size(); ++i) {
    state.model_position[i] = model().model_position(i, data);
    state.model_velocity[i] = model().model_velocity(i, data);
  }
  for (std::size_t i = 0; i < state.objects.size(); ++i) {
    state.objects[i] = object_pose(objects()[i], data);
  }
}

DriverReport FileSimulator::step(const Action& desired, const mjModel_& model, mjData_& data,
                                 State& state, AppliedAction& applied) const noexcept {
  const SafetyReport report = safety_.apply(desired, state.observation, this->model().period(),
                                            state.safety, applied, nullptr);
  if (report.fault != SafetyFault::kNone) return DriverReport::fault(fault_code_of(report));
  if (!move(applied.torque, model, data, state)) return DriverReport::fault(kDiverged);
  return {.action_rejected = report.action_rejected};
}

bool FileSimulator::move(const PerJoint<double>& torque, const mjModel_& model, mjData_& data,
                         State& state) const noexcept {
  set_torques(torque, state.memory, data);
  for (int i = 0; i < this->model().substeps(); ++i) mj_step(&model, &data);
  return detail::is_finite(model, data);
}

// Sends torques to the motors, which may deliver them later, or not quite.
void FileSimulator::set_torques(const PerJoint<double>& torque, Memory& memory,
                                mjData_& data) const noexcept {
  ++memory.step;
  memory.torque = torque;
  if (const auto delay = static_cast<std::uint64_t>(memory.variation.torque_delay); delay > 0) {
    const std::size_t n = num_joints();
    // At the beginning, the delayed torques are all equal to the first one.
    for (std::size_t i = 0; memory.num_sent == 0 && i < delay; ++i) {
      std::ranges::copy(torque, memory.sent.begin() + static_cast<std::ptrdiff_t>(i * n));
    }
    const auto slot = static_cast<std::size_t>(memory.num_sent++ % delay);
    std::swap_ranges(memory.torque.begin(), memory.torque.end(),
                     memory.sent.begin() + static_cast<std::ptrdiff_t>(slot * n));
  }
  for (std::size_t i = 0; i < num_joints(); ++i) {
    model().set_torque(i, memory.variation.motor_gain * memory.torque[i], data);
  }
}

auto FileSimulator::receive_poses(TimeIndex time_index, const mjData_& data,
                                  State& state) const noexcept -> const Capture* {
  Memory& memory = state.memory;
  if (time_index < memory.next_poses) return nullptr;
  // The first poses are those before step 0; the others count from there.
  memory.next_poses = time_index < 0 ? 0 : time_index + options_.object_period;
  state.capture.capture_index = time_index;
  for (std::size_t i = 0; i < objects().size(); ++i) {
    state.capture.objects[i] = object_pose(objects()[i], data);
  }
  return &state.capture;
}

ObjectPose FileSimulator::object_pose(const ObjectAddress& object,
                                      const mjData_& data) const noexcept {
  ObjectPose pose;
  const double* const values = data.qpos + object.position;
  std::copy_n(values, pose.position.size(), pose.position.begin());
  std::copy_n(values + pose.position.size(), pose.orientation.size(), pose.orientation.begin());
  return pose;
}

ObjectVelocity FileSimulator::object_velocity(const ObjectAddress& object,
                                              const mjData_& data) const noexcept {
  const double* const values = data.qvel + object.velocity;
  ObjectVelocity velocity;
  std::copy_n(values, velocity.linear.size(), velocity.linear.begin());
  mju_rotVecQuat(velocity.angular.data(), values + 3, data.qpos + object.position + 3);
  return velocity;
}

}  // namespace trifinger
