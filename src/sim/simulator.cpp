// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/simulator.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

#include "puller.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"

namespace trifinger {
namespace {

using detail::text_of;

// Turns `orientation` by a small rotation vector [rad], in the world frame.
void rotate(std::array<double, 4>& orientation, const std::array<double, 3>& rotation) {
  const auto [x, y, z] = rotation;
  const double angle = std::sqrt(x * x + y * y + z * z);
  if (angle == 0.0) return;
  const double scale = std::sin(angle / 2) / angle;
  const std::array<double, 4> a{std::cos(angle / 2), scale * x, scale * y, scale * z};
  const std::array<double, 4> b = orientation;
  orientation = {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                 a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                 a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                 a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

bool is_finite(const mjModel& model, const mjData& data) noexcept {
  const auto all_finite = [](const double* values, auto count) {
    return std::none_of(values, values + count, [](double value) { return mju_isBad(value) != 0; });
  };
  return all_finite(data.qpos, model.nq) && all_finite(data.qvel, model.nv) &&
         data.warning[mjWARN_BADQACC].number == 0;
}

// Returns the time constant of the contact of two geoms, mixed like in MuJoCo.
double mixed_time(const mjModel& model, int first, int second) noexcept {
  const double one = model.geom_solref[mjNREF * first];
  const double other = model.geom_solref[mjNREF * second];
  if (model.geom_priority[first] == model.geom_priority[second]) return 0.5 * (one + other);
  return model.geom_priority[first] > model.geom_priority[second] ? one : other;
}

}  // namespace

template <class R>
Simulator<R>::Simulator(SimulationOptions<R> options)
    : options_((options.validate(), std::move(options))),
      actuator_(trifinger::actuator(options_.description)),
      model_(options_.description),
      safety_(options_.limits ? *options_.limits : default_limits<R>(options_.description)),
      substeps_(static_cast<int>(options_.period / kPhysicsStep)) {
  static_assert(std::is_trivially_copyable_v<Memory>);
  static_assert(sizeof(Memory) == sizeof(Memory::safety) + sizeof(Memory::torque) +
                                      sizeof(Memory::tip_force) + sizeof(Memory::sent) +
                                      sizeof(Variation) + sizeof(Random) +
                                      6 * sizeof(std::uint64_t));
  std::copy_n(model_.initial_position().begin(), R::kJoints, initial_position_.begin());
  if (options_.initial_position) initial_position_ = *options_.initial_position;
  check(initial_position_);
}

template <class R>
void Simulator<R>::check(const Joints& position) const {
  const auto& limits = safety_.limits();
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    if (position[i] >= limits[i].hard_lower && position[i] <= limits[i].hard_upper) continue;
    throw InvalidArgument("joint " + std::to_string(i) + " cannot begin at " +
                          text_of(position[i]) + " rad, its hard limits are " +
                          text_of(limits[i].hard_lower) + " and " + text_of(limits[i].hard_upper) +
                          " rad");
  }
}

template <class R>
auto Simulator<R>::make_state() const -> State {
  State state;
  Capture capture;
  capture.objects.resize(model_.objects().size());
  const auto under_way =
      static_cast<std::size_t>(options_.object_delay / options_.object_period) + 2;
  state.captures.assign(under_way, capture);
  state.objects.resize(model_.objects().size());
  return state;
}

template <class R>
void Simulator<R>::vary(const Variation& variation, mjModel_& varied,
                        mjData_& data) const noexcept {
  const mjModel& original = *model_.mujoco();
  for (const ObjectAddress& object : model_.objects()) {
    varied.body_mass[object.body] = variation.object_mass * original.body_mass[object.body];
    for (int axis = 0; axis < 3; ++axis) {
      const int i = 3 * object.body + axis;
      varied.body_inertia[i] = variation.object_mass * original.body_inertia[i];
    }
  }
  for (int geom = 0; geom < static_cast<int>(original.ngeom); ++geom) {
    // Sliding friction is the first of three numbers; the time constant is the first of two.
    varied.geom_friction[3 * geom] = variation.friction * original.geom_friction[3 * geom];
    varied.geom_solref[mjNREF * geom] =
        variation.contact_time * original.geom_solref[mjNREF * geom];
  }
  vary_pairs(variation, varied);
  for (int joint = 0; joint < static_cast<int>(R::kJoints); ++joint) {
    varied.dof_armature[joint] = variation.rotor_inertia * original.dof_armature[joint];
    varied.dof_damping[joint] = variation.joint_damping * original.dof_damping[joint];
    varied.dof_frictionloss[joint] = original.dof_frictionloss[joint] + variation.joint_friction;
    const double more = (variation.stop_margin - 1.0) * options_.description.stops.margin;
    varied.jnt_range[2 * joint] = original.jnt_range[2 * joint] - more;
    varied.jnt_range[2 * joint + 1] = original.jnt_range[2 * joint + 1] + more;
  }
  mj_setConst(&varied, &data);
}

// The varied model may have pairs that the original lacks. The geoms are the same in both.
template <class R>
void Simulator<R>::vary_pairs(const Variation& variation, mjModel_& varied) const noexcept {
  const ContactParameters& contact = options_.description.contact;
  const mjModel& original = *model_.mujoco();
  for (int i = 0; i < static_cast<int>(varied.npair); ++i) {
    const auto surface_of = [this](int geom) {
      return *model_.surfaces()[static_cast<std::size_t>(geom)];
    };
    const int first = varied.pair_geom1[i];
    const int second = varied.pair_geom2[i];
    const SurfacePair pair = pair_of(surface_of(first), surface_of(second));
    // The first two of five numbers are the two directions of sliding.
    const double friction =
        variation.friction * variation.pair_friction[pair] * sliding_friction(contact, pair);
    std::fill_n(varied.pair_friction + 5 * i, 2, friction);
    varied.pair_solref[mjNREF * i] = variation.contact_time * mixed_time(original, first, second);
  }
}

template <class R>
RobotModel::Compiled Simulator<R>::make_varied_model(const Variation& variation) const {
  RobotDescription description = options_.description;
  auto& friction = description.contact.friction;
  for (const SurfacePair pair : all_surface_pairs()) {
    if (variation.varies(pair)) friction[pair] = sliding_friction(description.contact, pair);
  }
  const bool has_all = friction == options_.description.contact.friction;
  return has_all ? model_.copy() : RobotModel(description).copy();
}

template <class R>
void Simulator<R>::reset(const Joints& position, const Random& random, const mjModel_& model,
                         mjData_& data, State& state) const noexcept {
  mj_resetDataKeyframe(&model, &data, 0);
  std::ranges::copy(position, data.qpos);
  const Variation variation = state.memory.variation;
  state.memory = {};
  state.memory.variation = variation;
  state.memory.random = random;
  begin(state);
  observe(data, state);
}

template <class R>
void Simulator<R>::place(const ObjectAddress& object, const ObjectPose& pose, mjData_& data,
                         State& state) const noexcept {
  double* const values = data.qpos + object.position;
  std::ranges::copy(pose.position, values);
  double norm = 0.0;
  for (const double value : pose.orientation) norm += value * value;
  norm = std::sqrt(norm);
  std::ranges::transform(pose.orientation, values + pose.position.size(),
                         [norm](double value) { return value / norm; });
  set_velocity(object, {}, data);
  // Poses under way show where the object was before, so they are dropped.
  state.memory.pending_count = 0;
  state.memory.has_delivered = 0;
  state.memory.next_capture = state.memory.step;
}

template <class R>
void Simulator<R>::set_velocity(const ObjectAddress& object, const ObjectVelocity& velocity,
                                mjData_& data) const noexcept {
  double* const values = data.qvel + object.velocity;
  std::ranges::copy(velocity.linear, values);
  // MuJoCo expresses the rotation of a free body in the body's frame.
  mjtNum inverse[4];
  mju_negQuat(inverse, data.qpos + object.position + 3);
  mju_rotVecQuat(values + 3, velocity.angular.data(), inverse);
}

template <class R>
ObjectVelocity Simulator<R>::object_velocity(const ObjectAddress& object,
                                             const mjData_& data) const noexcept {
  const double* const values = data.qvel + object.velocity;
  ObjectVelocity velocity;
  std::copy_n(values, velocity.linear.size(), velocity.linear.begin());
  mju_rotVecQuat(velocity.angular.data(), values + 3, data.qpos + object.position + 3);
  return velocity;
}

template <class R>
void Simulator<R>::begin(State& state) const noexcept {
  move_to_step(0, state);
  state.has_initial_pose = false;
}

// Shifts the indices in the memory, which count from the beginning of the session. A state that was
// saved at step n then continues at `step`.
template <class R>
void Simulator<R>::move_to_step(TimeIndex step, State& state) const noexcept {
  const TimeIndex offset = step - std::exchange(state.memory.step, step);
  state.memory.next_capture += offset;
  for (Capture& capture : state.captures) {
    capture.capture_index += offset;
    capture.arrival_index += offset;
  }
}

template <class R>
void Simulator<R>::observe(const mjData_& data, State& state) const noexcept {
  std::copy_n(data.qpos, R::kJoints, state.observation.position.begin());
  std::copy_n(data.qvel, R::kJoints, state.observation.velocity.begin());
  state.observation.torque = state.memory.torque;
  state.observation.tip_force = state.memory.tip_force;
  for (std::size_t i = 0; i < state.objects.size(); ++i) {
    state.objects[i] = object_pose(model_.objects()[i], data);
  }
}

template <class R>
DriverReport Simulator<R>::step(const Action& desired, const mjModel_& model, mjData_& data,
                                State& state, AppliedAction& applied,
                                detail::Puller* puller) const noexcept {
  const SafetyReport report = safety_.apply(desired, state.observation, options_.period,
                                            state.memory.safety, applied, &state.thrown);
  if (report.fault == SafetyFault::kInterrupted) return DriverReport::interrupted();
  if (report.fault != SafetyFault::kNone) return DriverReport::fault(fault_code_of(report));
  if (!move(applied.torque, model, data, state, puller)) return DriverReport::fault(kDiverged);
  return {.action_rejected = report.action_rejected};
}

template <class R>
bool Simulator<R>::move(const Joints& torque, const mjModel_& model, mjData_& data, State& state,
                        detail::Puller* puller) const noexcept {
  Memory& memory = state.memory;
  const Variation& variation = memory.variation;
  ++memory.step;
  Joints delivered = torque;
  if (const auto delay = static_cast<std::uint64_t>(variation.torque_delay); delay > 0) {
    // At the beginning, the delayed torques are all equal to the first one.
    if (memory.num_sent == 0) memory.sent.fill(torque);
    delivered = std::exchange(memory.sent[memory.num_sent++ % delay], torque);
  }
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    memory.torque[i] = available_torque(actuator_, delivered[i], data.qvel[i]);
    data.ctrl[i] = variation.motor_gain * memory.torque[i];
  }
  if (puller != nullptr) {
    puller->step(model, data, substeps_);
  } else {
    for (int i = 0; i < substeps_; ++i) mj_step(&model, &data);
  }
  measure_tip_forces(model, data, state);
  return is_finite(model, data);
}

template <class R>
void Simulator<R>::measure_tip_forces(const mjModel_& model, mjData_& data,
                                      State& state) const noexcept {
  auto& tip_force = state.memory.tip_force;
  tip_force.fill(0.0);
  const std::vector<int>& tips = model_.tip_geoms();
  for (int i = 0; i < data.ncon; ++i) {
    const mjContact& contact = data.contact[i];
    for (std::size_t finger = 0; finger < R::kTips; ++finger) {
      if (contact.geom[0] != tips[finger] && contact.geom[1] != tips[finger]) continue;
      mjtNum force[6];
      mj_contactForce(&model, &data, i, force);
      // The force is in the contact's frame, whose first axis is the normal.
      tip_force[finger] += force[0];
    }
  }
}

template <class R>
auto Simulator<R>::receive_poses(TimeIndex time_index, const mjData_& data,
                                 State& state) const noexcept -> const Capture* {
  Memory& memory = state.memory;
  const std::size_t size = state.captures.size();
  const auto slot = [&](std::uint64_t position) -> Capture& {
    return state.captures[(memory.pending_begin + position) % size];
  };
  // Steps count from the beginning of the session. The time of holding before it counts as step 0.
  memory.step = std::max<TimeIndex>(time_index, 0);
  if (time_index < 0) {
    // One pose arrives before step 0, so that there always is one. A session that continues from a
    // saved state begins with the pose that was known there.
    if (std::exchange(state.has_initial_pose, true)) return nullptr;
    Capture& newest = slot(size - 1);
    if (memory.has_delivered == 0) {
      newest.capture_index = -1;
      newest.arrival_index = -1;
      capture(data, state, newest);
      memory.has_delivered = 1;
    }
    return &newest;
  }
  if (time_index >= memory.next_capture) {
    memory.next_capture = time_index + options_.object_period;
    const bool is_lost =
        options_.object_loss > 0.0 && memory.random.uniform(0.0, 1.0) < options_.object_loss;
    if (!is_lost) {
      Capture& next = slot(memory.pending_count++);
      next.capture_index = time_index;
      next.arrival_index = time_index + options_.object_delay;
      capture(data, state, next);
    }
  }
  if (memory.pending_count == 0) return nullptr;
  const Capture& oldest = slot(0);
  if (oldest.arrival_index > time_index) return nullptr;
  memory.pending_begin = (memory.pending_begin + 1) % size;
  --memory.pending_count;
  memory.has_delivered = 1;
  return &oldest;
}

template <class R>
void Simulator<R>::capture(const mjData_& data, State& state, Capture& capture) const noexcept {
  Random& random = state.memory.random;
  for (std::size_t i = 0; i < capture.objects.size(); ++i) {
    ObjectPose& object = capture.objects[i];
    object = object_pose(model_.objects()[i], data);
    if (options_.object_position_noise > 0.0) {
      for (double& value : object.position) {
        value += options_.object_position_noise * random.normal();
      }
    }
    if (options_.object_orientation_noise > 0.0) {
      std::array<double, 3> rotation{};
      for (double& value : rotation) value = options_.object_orientation_noise * random.normal();
      rotate(object.orientation, rotation);
    }
  }
}

template <class R>
void Simulator<R>::gravity_torques(const mjModel_& model, mjData_& data,
                                   Joints& torque) const noexcept {
  // These calls compute only what the inverse dynamics of a robot at rest needs. They leave the
  // solver's warm start unchanged.
  mj_kinematics(&model, &data);
  mj_comPos(&model, &data);
  mj_comVel(&model, &data);
  // qfrc_inverse only serves as memory of the right size: no step reads it.
  mj_rne(&model, &data, 0, data.qfrc_inverse);
  std::copy_n(data.qfrc_inverse, R::kJoints, torque.begin());
}

template <class R>
ObjectPose Simulator<R>::object_pose(const ObjectAddress& object,
                                     const mjData_& data) const noexcept {
  ObjectPose pose;
  const double* const values = data.qpos + object.position;
  std::copy_n(values, pose.position.size(), pose.position.begin());
  std::copy_n(values + pose.position.size(), pose.orientation.size(), pose.orientation.begin());
  return pose;
}

template class Simulator<TriFinger>;
template class Simulator<Finger>;

}  // namespace trifinger
