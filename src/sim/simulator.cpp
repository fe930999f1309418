// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/simulator.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <type_traits>
#include <utility>

#include "base/text_of.hpp"
#include "puller.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

using detail::require;
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

// Returns the time constant of the contact of two geoms, mixed like in MuJoCo.
double mixed_time(const mjModel& model, int first, int second) noexcept {
  const double one = model.geom_solref[mjNREF * first];
  const double other = model.geom_solref[mjNREF * second];
  if (model.geom_priority[first] == model.geom_priority[second]) return 0.5 * (one + other);
  return model.geom_priority[first] > model.geom_priority[second] ? one : other;
}

std::string_view unit_of(const DrivenJoint& joint) { return joint.is_slide ? " m" : " rad"; }

// What differs from joint to joint.
enum class Of : std::uint64_t { kHoming, kGain, kRipple };

// From -1 to 1, equally likely: what `seed` gives this joint.
double share_of(Of what, std::size_t joint, std::uint64_t seed) noexcept {
  Random random{.seed = seed, .episode = joint, .count = static_cast<std::uint64_t>(what)};
  return random.uniform(-1.0, 1.0);
}

// The torque of a motor with 12 pairs of poles behind gears of 9:1, as that of TriFingers, comes
// and goes so often in a radian of its joint.
constexpr double kRipplesPerRadian = 12 * 9;

// True if the time constant of a contact is the first number of its solref; else both numbers are
// stiffness and damping.
bool has_time_constant(const double* solref) noexcept { return solref[0] > 0.0; }

}  // namespace

// Braces: what makes the model comes before the move.
Simulator::Simulator(SimulationOptions options)
    : Simulator{(options.validate(), make_model(options)), std::move(options)} {}

Simulator::Simulator(std::shared_ptr<const SceneModel> model, SimulationOptions options)
    : options_(std::move(options)),
      model_(std::move(model)),
      described_(dynamic_cast<const RobotModel*>(model_.get())),
      safety_(options_.limits ? *options_.limits : default_limits(options_.description)),
      stride_(options_.file != nullptr
                  ? 1
                  : std::max<TimeIndex>(options_.physics_step / options_.period, 1)),
      substeps_(options_.file != nullptr
                    ? options_.file->substeps()
                    : static_cast<int>(stride_ * options_.period / options_.physics_step)) {
  // Saved states have no padding, so equal states have equal bytes.
  static_assert(std::is_trivially_copyable_v<Memory::Counters>);
  static_assert(sizeof(Memory::Counters) ==
                sizeof(Variation) + sizeof(Random) + 7 * sizeof(std::uint64_t));
  if (described_ != nullptr) actuator_ = trifinger::actuator(options_.description);
  const SceneModel::Data data = model_->make_data();
  model_->reset(*data);
  for (std::size_t i = 0; i < num_joints(); ++i) {
    initial_position_.push_back(model_->position(i, *data));
  }
  if (options_.initial_position) initial_position_ = *options_.initial_position;
  if (described_ == nullptr) require_soft_limits();
  check(initial_position_);
  put_at_start(*data);
  const mjModel& mujoco = *model_->mujoco();
  initial_configuration_.assign(data->qpos, data->qpos + mujoco.nq);
  for (int body = 1; body < static_cast<int>(mujoco.nbody); ++body) {
    const int root = mujoco.body_rootid[body];
    if (std::ranges::find(model_->objects(), root, &ObjectAddress::body) !=
        model_->objects().end()) {
      loose_.push_back(body);
    }
  }
}

// A file may begin anywhere, so it is said early where the limits do not fit.
void Simulator::require_soft_limits() const {
  std::string beyond;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const JointLimit& limit = limits()[i];
    const double position = initial_position_[i];
    if (position >= limit.soft_lower && position <= limit.soft_upper) continue;
    beyond += (beyond.empty() ? "" : "; ") + text_of(model_->joints()[i].name, " begins at ",
                                                     position, ", its soft limits are ",
                                                     limit.soft_lower, " and ", limit.soft_upper);
  }
  require(beyond.empty(),
          "some joints begin beyond their soft limits: give them an initial position "
          "within (robot.initial_position). " +
              beyond);
}

void Simulator::put_at_start(mjData_& data) const noexcept {
  model_->reset(data);
  for (std::size_t i = 0; i < num_joints(); ++i) {
    model_->set_position(i, initial_position_[i], data);
  }
}

void Simulator::check(std::span<const double> position) const {
  require(position.size() == num_joints(),
          text_of("position has ", position.size(), " numbers, must have ", num_joints()));
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const JointLimit& limit = limits()[i];
    const DrivenJoint& joint = model_->joints()[i];
    require(position[i] >= limit.hard_lower && position[i] <= limit.hard_upper,
            text_of("joint ", i, " (", joint.name, ") cannot begin at ", position[i],
                    unit_of(joint), ", its hard limits are ", limit.hard_lower, " and ",
                    limit.hard_upper, unit_of(joint)));
  }
}

auto Simulator::make_state() const -> State {
  State state;
  const std::size_t objects = model_->objects().size();
  const auto under_way =
      static_cast<std::size_t>(options_.object_delay / options_.object_period) + 2;
  state.captures.assign(under_way, Capture{.objects = std::vector<ObjectPose>(objects)});
  state.objects.resize(objects);
  state.safety.joints.resize(num_joints());
  state.observation = Observation(num_joints());
  if (!model_->drives_all()) {
    state.model_position.resize(model_->model_joints().size());
    state.model_velocity.resize(model_->model_joints().size());
  }
  state.tip_force.resize(model_->tip_geoms().size());
  state.memory.torque = PerJoint<double>(num_joints(), 0.0);
  state.memory.tip_force.resize(model_->tip_geoms().size());
  const auto most = static_cast<std::size_t>(Variation::kMaxDelay) * num_joints();
  state.memory.sent.resize(most);
  state.memory.measured.resize(2 * most);
  for (auto* const values :
       {&state.memory.velocity_noise, &state.memory.in_play, &state.memory.play_speed}) {
    values->resize(num_joints());
  }
  state.position = PerJoint<double>(num_joints(), 0.0);
  return state;
}

void Simulator::check(const Variation& variation) const {
  variation.validate();
  const Identified& own = options_.identified;
  for (const TimeIndex delay : {variation.torque_delay + own.torque_delay,
                                variation.measurement_delay + own.measurement_delay}) {
    require(delay <= Variation::kMaxDelay,
            text_of("a delay is ", delay, " steps with the robot's own, must be at most ",
                    Variation::kMaxDelay));
  }
  if (described_ != nullptr) return;
  require(variation.pair_friction == Variation{}.pair_friction,
          "pair_friction is for TriFingers: surfaces of a robot from a file have no names");
  require(variation.stop_margin == 1.0,
          "stop_margin is for TriFingers: stops of a robot from a file are where the file says");
}

void Simulator::vary(const Variation& variation, mjModel_& varied, mjData_& data) const noexcept {
  const mjModel& original = *model_->mujoco();
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
  for (const int tip : model_->tip_geoms()) {
    varied.geom_size[3 * tip] = variation.tip_radius * original.geom_size[3 * tip];
    varied.geom_rbound[tip] = variation.tip_radius * original.geom_rbound[tip];
    // The centre and the half sizes of a box around it.
    for (int i = 6 * tip + 3; i < 6 * tip + 6; ++i) {
      varied.geom_aabb[i] = variation.tip_radius * original.geom_aabb[i];
    }
  }
  vary_pairs(variation, varied);
  vary_joints(variation, varied);
  mj_setConst(&varied, &data);
}

void Simulator::vary_joints(const Variation& variation, mjModel_& varied) const noexcept {
  const mjModel& original = *model_->mujoco();
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
    if (described_ == nullptr) continue;
    const double more = (variation.stop_margin - 1.0) * options_.description.stops.margin;
    varied.jnt_range[2 * joint] = original.jnt_range[2 * joint] - more;
    varied.jnt_range[2 * joint + 1] = original.jnt_range[2 * joint + 1] + more;
  }
  // A file may give rotor and damping of a joint to its actuator.
  for (int motor = 0; motor < static_cast<int>(original.nactuator); ++motor) {
    varied.actuator_armature[motor] = variation.rotor_inertia * original.actuator_armature[motor];
    varied.actuator_damping[motor] = variation.joint_damping * original.actuator_damping[motor];
    for (int i = mjNPOLY * motor; i < mjNPOLY * (motor + 1); ++i) {
      varied.actuator_dampingpoly[i] = variation.joint_damping * original.actuator_dampingpoly[i];
    }
  }
}

void Simulator::vary_pairs(const Variation& variation, mjModel_& varied) const noexcept {
  const mjModel& original = *model_->mujoco();
  for (int pair = 0; pair < static_cast<int>(varied.npair); ++pair) {
    // The first two of five numbers are the two directions of sliding.
    double* const friction = varied.pair_friction + 5 * pair;
    double& time = varied.pair_solref[mjNREF * pair];
    if (described_ != nullptr) {
      // The varied model may have pairs that the original lacks. The geoms are the same in both.
      const ContactParameters& contact = options_.description.contact;
      const auto surface_of = [this](int geom) {
        return *described_->surfaces()[static_cast<std::size_t>(geom)];
      };
      const int first = varied.pair_geom1[pair];
      const int second = varied.pair_geom2[pair];
      const SurfacePair surfaces = pair_of(surface_of(first), surface_of(second));
      std::fill_n(friction, 2,
                  variation.friction * variation.pair_friction[surfaces] *
                      sliding_friction(contact, surfaces));
      time = variation.contact_time * mixed_time(original, first, second);
      continue;
    }
    for (int i = 0; i < 2; ++i) {
      friction[i] = variation.friction * original.pair_friction[5 * pair + i];
    }
    const double* const solref = original.pair_solref + mjNREF * pair;
    if (has_time_constant(solref)) time = variation.contact_time * solref[0];
  }
}

SceneModel::Compiled Simulator::make_varied_model(const Variation& variation) const {
  if (described_ == nullptr) return model_->copy();
  RobotDescription description = options_.description;
  auto& friction = description.contact.friction;
  for (const SurfacePair pair : all_surface_pairs()) {
    if (variation.varies(pair)) friction[pair] = sliding_friction(description.contact, pair);
  }
  const bool has_all = friction == options_.description.contact.friction;
  if (has_all) return model_->copy();
  RobotModel changed(description);
  changed.adopt(options_.identified);
  changed.set_timestep(model_->mujoco()->opt.timestep);
  return changed.copy();
}

void Simulator::reset(std::span<const double> position, const Random& random, mjData_& data,
                      State& state, std::span<const double> model_position) const noexcept {
  put_at_start(data);
  for (std::size_t i = 0; i < model_position.size(); ++i) {
    if (!std::isnan(model_position[i])) model_->set_model_position(i, model_position[i], data);
  }
  for (std::size_t i = 0; i < num_joints(); ++i) model_->set_position(i, position[i], data);
  Memory& memory = state.memory;
  // After a reset, nothing of what happened before counts.
  std::ranges::fill(state.safety.joints, JointMemory{.heat = memory.counters.variation.motor_heat});
  std::ranges::fill(memory.torque, 0.0);
  std::ranges::fill(memory.tip_force, 0.0);
  for (auto* const values : {&memory.sent, &memory.measured, &memory.velocity_noise,
                             &memory.in_play, &memory.play_speed}) {
    std::ranges::fill(*values, 0.0);
  }
  memory.counters = {.variation = memory.counters.variation, .random = random};
  begin(state);
  observe(data, state);
}

void Simulator::place(const ObjectAddress& object, const ObjectPose& pose, mjData_& data,
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
  state.memory.counters.pending_count = 0;
  state.memory.counters.has_delivered = 0;
  state.memory.counters.next_capture = state.memory.counters.step;
}

void Simulator::set_velocity(const ObjectAddress& object, const ObjectVelocity& velocity,
                             mjData_& data) const noexcept {
  SceneModel::set_velocity(object, velocity.linear, velocity.angular, data);
}

ObjectVelocity Simulator::object_velocity(const ObjectAddress& object,
                                          const mjData_& data) const noexcept {
  const double* const values = data.qvel + object.velocity;
  ObjectVelocity velocity;
  std::copy_n(values, velocity.linear.size(), velocity.linear.begin());
  mju_rotVecQuat(velocity.angular.data(), values + 3, data.qpos + object.position + 3);
  return velocity;
}

void Simulator::begin(State& state) const noexcept {
  move_to_step(0, state);
  state.has_initial_pose = false;
}

// Shifts the indices in the memory, which count from the beginning of the session. A state that was
// saved at step n then continues at `step`.
void Simulator::move_to_step(TimeIndex step, State& state) const noexcept {
  const TimeIndex offset = step - std::exchange(state.memory.counters.step, step);
  state.memory.counters.next_capture += offset;
  for (Capture& capture : state.captures) {
    capture.capture_index += offset;
    capture.arrival_index += offset;
  }
}

void Simulator::observe(const mjData_& data, State& state) const noexcept {
  for (std::size_t i = 0; i < num_joints(); ++i) {
    state.position[i] = model_->position(i, data);
    state.observation.velocity[i] = model_->velocity(i, data);
  }
  state.observation.position = state.position;
  read_encoders(state);
  state.observation.torque = state.memory.torque;
  std::ranges::copy(state.memory.tip_force, state.tip_force.begin());
  for (std::size_t i = 0; i < state.model_position.size(); ++i) {
    state.model_position[i] = model_->model_position(i, data);
    state.model_velocity[i] = model_->model_velocity(i, data);
  }
  for (std::size_t i = 0; i < state.objects.size(); ++i) {
    state.objects[i] = object_pose(model_->objects()[i], data);
  }
}

// What the encoders at the motors say of the true positions and velocities.
void Simulator::read_encoders(State& state) const noexcept {
  const Memory& memory = state.memory;
  const Variation& variation = memory.counters.variation;
  const std::size_t n = num_joints();
  Observation& seen = state.observation;
  for (std::size_t i = 0; i < n; ++i) {
    seen.position[i] += memory.in_play[i];
    seen.velocity[i] += memory.play_speed[i];
  }
  const std::uint64_t delay = measurement_delay(memory);
  if (delay > 0 && memory.counters.num_measured > 0) {
    const std::size_t oldest = memory.counters.num_measured % delay * 2 * n;
    std::copy_n(memory.measured.data() + oldest, n, seen.position.begin());
    std::copy_n(memory.measured.data() + oldest + n, n, seen.velocity.begin());
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (variation.homing_error > 0.0) {
      seen.position[i] += variation.homing_error * share_of(Of::kHoming, i, variation.seed);
    }
    seen.position[i] += Identified::of(options_.identified.zero_offset, i, 0.0);
    seen.velocity[i] += memory.velocity_noise[i];
  }
}

void Simulator::write_observation(const State& state, void* element) const noexcept {
  write_element(state.observation, state.model_position, state.model_velocity, state.tip_force,
                element);
}

DriverReport Simulator::step(const Action& desired, const mjModel_& model, mjData_& data,
                             State& state, AppliedAction& applied) const noexcept {
  const DriverReport report = begin_step(desired, data, state, applied);
  if (report.fault_code != 0) return report;
  return run_physics(model, data, state) ? report : DriverReport::fault(kDiverged);
}

DriverReport Simulator::begin_step(const Action& desired, mjData_& data, State& state,
                                   AppliedAction& applied) const noexcept {
  const SafetyReport report = safety_.apply(desired, state.observation, stride_ * options_.period,
                                            state.safety, applied, nullptr);
  if (report.fault != SafetyFault::kNone) return DriverReport::fault(fault_code_of(report));
  set_torques(applied.torque, data, state);
  return {.action_rejected = report.action_rejected};
}

bool Simulator::end_step(const mjModel_& model, const mjData_& data, State& state) const noexcept {
  Memory& memory = state.memory;
  Memory::Counters& counters = memory.counters;
  if (counters.variation.backlash > 0.0 || !options_.identified.backlash.empty())
    turn_in_play(model, data, memory);
  if (counters.variation.velocity_noise > 0.0) {
    for (double& noise : memory.velocity_noise) {
      noise = counters.variation.velocity_noise * counters.random.normal();
    }
  }
  return SceneModel::is_finite(model, data);
}

bool Simulator::move(const PerJoint<double>& torque, const mjModel_& model, mjData_& data,
                     State& state, detail::Puller* puller) const noexcept {
  set_torques(torque, data, state);
  return run_physics(model, data, state, puller);
}

bool Simulator::run_physics(const mjModel_& model, mjData_& data, State& state,
                            detail::Puller* puller) const noexcept {
  if (puller != nullptr) {
    puller->step(model, data, substeps_);
  } else {
    for (int i = 0; i < substeps_; ++i) mj_step(&model, &data);
  }
  measure_tip_forces(model, data, state);
  return end_step(model, data, state);
}

void Simulator::set_torques(const PerJoint<double>& torque, mjData_& data,
                            State& state) const noexcept {
  Memory& memory = state.memory;
  Memory::Counters& counters = memory.counters;
  counters.step += stride_;
  memory.torque = torque;
  const std::uint64_t delay =
      in_strides(counters.variation.torque_delay + options_.identified.torque_delay);
  if (delay > 0) {
    const std::size_t n = num_joints();
    const auto slot_of = [&](std::uint64_t i) {
      return memory.sent.begin() + static_cast<std::ptrdiff_t>(i % delay * n);
    };
    // At the beginning, the delayed torques are all equal to the first one.
    for (std::uint64_t i = 0; counters.num_sent == 0 && i < delay; ++i) {
      std::ranges::copy(torque, slot_of(i));
    }
    std::swap_ranges(memory.torque.begin(), memory.torque.end(), slot_of(counters.num_sent++));
  }
  for (std::size_t i = 0; i < num_joints(); ++i) {
    if (actuator_) {
      memory.torque[i] = available_torque(*actuator_, memory.torque[i], model_->velocity(i, data));
    }
    model_->set_torque(i, delivered(i, data, memory), data);
  }
  if (measurement_delay(memory) > 0) pass_on_measurements(data, state);
}

// Notes what the encoders say before a step, so that it is known `measurement_delay` steps later.
void Simulator::pass_on_measurements(const mjData_& data, State& state) const noexcept {
  Memory& memory = state.memory;
  const std::size_t n = num_joints();
  const std::uint64_t delay = measurement_delay(memory);
  const auto note = [&](std::uint64_t number) {
    double* const slot = memory.measured.data() + number % delay * 2 * n;
    for (std::size_t i = 0; i < n; ++i) {
      slot[i] = model_->position(i, data) + memory.in_play[i];
      slot[n + i] = model_->velocity(i, data) + memory.play_speed[i];
    }
  };
  // What was before the first step was like it.
  for (std::uint64_t i = 0; memory.counters.num_measured == 0 && i < delay; ++i) note(i);
  note(memory.counters.num_measured++);
}

std::uint64_t Simulator::measurement_delay(const Memory& memory) const noexcept {
  return in_strides(memory.counters.variation.measurement_delay +
                    options_.identified.measurement_delay);
}

// The number of calls of `step` that come nearest to so many steps of the robot.
std::uint64_t Simulator::in_strides(TimeIndex steps) const noexcept {
  return static_cast<std::uint64_t>((steps + stride_ / 2) / stride_);
}

// The whole play of a joint.
double Simulator::backlash(std::size_t joint, const Memory& memory) const noexcept {
  return memory.counters.variation.backlash +
         Identified::of(options_.identified.backlash, joint, 0.0);
}

// What a motor gives when it measures its torque.
double Simulator::motor_torque(std::size_t joint, const mjData_& data,
                               const Memory& memory) const noexcept {
  const Variation& variation = memory.counters.variation;
  double torque = variation.motor_gain *
                  Identified::of(options_.identified.torque_scale, joint, 1.0) *
                  memory.torque[joint];
  if (variation.motor_spread > 0.0) {
    torque *= 1.0 + variation.motor_spread * share_of(Of::kGain, joint, variation.seed);
  }
  if (variation.torque_ripple > 0.0) {
    const double phase = std::numbers::pi * share_of(Of::kRipple, joint, variation.seed);
    const double turned = model_->position(joint, data) + memory.in_play[joint];
    torque *= 1.0 + variation.torque_ripple * std::sin(kRipplesPerRadian * turned + phase);
  }
  return torque;
}

// What of it reaches the joint.
double Simulator::delivered(std::size_t joint, const mjData_& data,
                            const Memory& memory) const noexcept {
  const double torque = motor_torque(joint, data, memory);
  const double backlash = this->backlash(joint, memory);
  if (backlash == 0.0) return torque;
  // Within its play a motor turns alone, at one of its ends it can only push.
  const bool is_at_end = std::abs(memory.in_play[joint]) == 0.5 * backlash;
  return is_at_end && torque * memory.in_play[joint] > 0.0 ? torque : 0.0;
}

// Moves each motor against its joint by what its torque does to its rotor, after a step.
void Simulator::turn_in_play(const mjModel_& model, const mjData_& data,
                             Memory& memory) const noexcept {
  const double step = std::chrono::duration<double>(stride_ * options_.period).count();
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const double inertia = std::max(model_->rotor_inertia(i, model), 1e-9);
    const double acceleration =
        motor_torque(i, data, memory) / inertia - model_->acceleration(i, data);
    const double end = 0.5 * backlash(i, memory);
    double& place = memory.in_play[i];
    double& speed = memory.play_speed[i];
    speed += step * acceleration;
    place += step * speed;
    if (std::abs(place) < end) continue;
    place = std::copysign(end, place);
    speed = 0.0;
  }
}

void Simulator::measure_tip_forces(const mjModel_& model, mjData_& data,
                                   State& state) const noexcept {
  const std::vector<int>& tips = model_->tip_geoms();
  if (tips.empty()) return;
  std::vector<double>& tip_force = state.memory.tip_force;
  std::ranges::fill(tip_force, 0.0);
  for (int i = 0; i < data.ncon; ++i) {
    const mjContact& contact = data.contact[i];
    for (std::size_t finger = 0; finger < tips.size(); ++finger) {
      if (contact.geom[0] != tips[finger] && contact.geom[1] != tips[finger]) continue;
      mjtNum force[6];
      mj_contactForce(&model, &data, i, force);
      // The force is in the contact's frame, whose first axis is the normal.
      tip_force[finger] += force[0];
    }
  }
}

auto Simulator::receive_poses(TimeIndex time_index, const mjData_& data,
                              State& state) const noexcept -> const Capture* {
  Memory::Counters& memory = state.memory.counters;
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

void Simulator::capture(const mjData_& data, State& state, Capture& capture) const noexcept {
  Random& random = state.memory.counters.random;
  for (std::size_t i = 0; i < capture.objects.size(); ++i) {
    ObjectPose& object = capture.objects[i];
    object = object_pose(model_->objects()[i], data);
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

ObjectPose Simulator::object_pose(const ObjectAddress& object, const mjData_& data) const noexcept {
  ObjectPose pose;
  const double* const values = data.qpos + object.position;
  std::copy_n(values, pose.position.size(), pose.position.begin());
  std::copy_n(values + pose.position.size(), pose.orientation.size(), pose.orientation.begin());
  return pose;
}

}  // namespace trifinger
