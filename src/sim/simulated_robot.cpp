// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/simulated_robot.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/text_of.hpp"
#include "gain_warnings.hpp"
#include "possible_pose.hpp"
#include "puller.hpp"
#include "sim/scene_observation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger {
namespace {

// The series of random numbers that says which robot in its condition this is.
constexpr std::uint64_t kRobot = 1'000'000'007;

using detail::require;
using detail::text_of;

// Every saved state begins with this number, so that states of other versions are recognised.
constexpr std::uint64_t kSimulatedStateMagic = 0x36534d4953465254;  // "TRFSIMS6"

// Every saved state begins with this header.
struct SimulatedStateHeader {
  std::uint64_t magic{kSimulatedStateMagic};
  std::uint64_t model{0};
};

// Components of the state that a step changes. The other components are inputs that are never set
// here.
constexpr int kChangedByStep = mjSTATE_FULLPHYSICS | mjSTATE_WARMSTART | mjSTATE_CTRL;

// Components from which MuJoCo continues bit for bit. mjSTATE_FULLPHYSICS lacks the solver's warm
// start.
constexpr int kWholeState = mjSTATE_INTEGRATION;

std::size_t state_size_of(const SceneModel& model, int components) {
  return static_cast<std::size_t>(mj_stateSize(model.mujoco(), components));
}

Pull pull_of(const HandObservation& hand) noexcept {
  return {.target = hand.target, .point = hand.point, .stiffness = hand.stiffness};
}

// Calls `use` with each part of the memory that a saved state has.
template <class Memory, class Use>
void for_each_part(Memory& memory, Use use) {
  use(std::span(&memory.counters, 1));
  use(std::span(memory.torque));
  use(std::span(memory.tip_force));
  use(std::span(memory.sent));
  use(std::span(memory.measured));
  use(std::span(memory.velocity_noise));
  use(std::span(memory.in_play));
  use(std::span(memory.play_speed));
}

}  // namespace

SimulatedRobot::SimulatedRobot(SimulationOptions options)
    : simulator_(std::move(options)),
      chain_(robot_types_of(this->options()), model().joint_names(), simulator_.limits()),
      shakes_(num_joints(), false),
      data_(model().make_data()),
      state_(simulator_.make_state()),
      desired_(num_joints()),
      stop_(this->options().stop, this->options().period),
      bodies_(pullable_bodies(model())),
      fingerprint_(fingerprint()),
      memory_before_step_(state_.memory),
      safety_before_step_(num_joints()),
      before_step_(state_size_of(model(), kChangedByStep)),
      changed_by_step_(parts_changed_by_step()),
      after_step_(before_step_.size()),
      physics_(state_size_of(model(), kWholeState)) {
  detail::require(simulator_.stride() == 1,
                  "physics_step is longer than the period of the robot: that is only for many "
                  "simulations at once");
  if (auto companion = object_companion(model()); companion && this->options().exact_poses) {
    companions_.push_back(std::move(*companion));
  }
  if (this->options().scene_period > 0) companions_.push_back(scene_companion(model()));
  if (this->options().has_hand) companions_.push_back(hand_companion());
  for (const auto& [joint, warning] : detail::gain_warnings(this->options())) shakes_[joint] = true;
  puller_ = std::make_unique<detail::Puller>(model());
  begin_state_.resize(state_size());
  spare_state_.resize(state_size());
  reset();
  if (this->options().condition == Condition::kAsDocumented) return;
  Random random{.seed = this->options().seed, .episode = kRobot};
  vary(draw(this->options().condition, random));
  reset();
}

SimulatedRobot::~SimulatedRobot() = default;

DriverReport SimulatedRobot::prepare(TimeIndex) noexcept {
  read_state(begin_state_);
  simulator_.begin(state_);
  has_safety_fault_ = false;
  next_scene_ = -1;
  let_go();
  acting_ = {};
  was_acting_ = false;
  next_hand_ = -1;
  return DriverReport::ready();
}

DriverReport SimulatedRobot::get_latest_observation(void* observation) noexcept {
  simulator_.observe(*data_, state_);
  simulator_.write_observation(state_, observation);
  return DriverReport::ready();
}

DriverReport SimulatedRobot::apply_action(const void* desired, void* applied) noexcept {
  keep_state_before_step();
  detail::Puller* const puller = next_pull();
  read_element(desired, desired_);
  const DriverReport report = chain_.apply(desired_, state_.observation, options().period);
  write_element(chain_.applied(), applied);
  has_safety_fault_ = report.fault_code != 0;
  if (has_safety_fault_) explain_fault(report.fault_code);
  if (report.state != DriverReport::State::kReady) return report;
  const bool is_finite = simulator_.move(chain_.applied().torque, mujoco(), *data_, state_, puller);
  if (puller != nullptr) acting_.force = puller->force();
  if (is_finite) return report;
  keep_state_before_divergence();
  return DriverReport::fault(kDiverged);
}

// The joint stands above the fault, counted from 1.
void SimulatedRobot::explain_fault(std::int32_t fault_code) noexcept {
  const auto joint = static_cast<std::size_t>(fault_code >> 8);
  if (joint == 0 || joint > shakes_.size() || !shakes_[joint - 1]) return;
  FixedText text(chain_.fault_text());
  chain_.set_fault_text(text.append(
      "; its gains are too strong for its inertia in such steps, as 'trifinger config' says"));
}

DriverReport SimulatedRobot::hold(const void* observation, void* action) noexcept {
  CountedObservation measured(num_joints());
  read_element(observation, measured);
  CountedAction holding = hold_position(measured);
  // Without these torques the robot would sink until the position controllers carry its weight.
  model().compute_weight(mujoco(), *data_, holding.torque);
  write_element(holding, action);
  return DriverReport::ready();
}

// The observation belongs to the previous period: it is the session's last one, or the newest that
// the loop has measured since.
DriverReport SimulatedRobot::stop(TimeIndex step) noexcept {
  CountedAction action(num_joints());
  PerJoint<double> target(num_joints(), kNotGiven);
  OrderlyStop::Phase phase = stop_.next(step, state_.observation.position, target);
  if (phase == OrderlyStop::Phase::kOver) return DriverReport::ready();
  if (step == 0 && has_safety_fault_) {
    // The fault that ended the session may not be detected again.
    stop_.give_up(step);
    phase = OrderlyStop::Phase::kDamp;
  }
  if (phase == OrderlyStop::Phase::kMove) {
    action.position = target;
    // These torques carry the weight under which the robot would sink, as in `hold`.
    model().compute_weight(mujoco(), *data_, action.torque);
  }
  const DriverReport report = chain_.apply(action, state_.observation, options().period);
  if (report.state != DriverReport::State::kReady) stop_.give_up(step);
  // A simulation that has diverged cannot come to rest.
  return simulator_.move(chain_.applied().torque, mujoco(), *data_, state_) ? DriverReport::busy()
                                                                            : DriverReport::ready();
}

void SimulatedRobot::add_check(CountedChain::Check check) {
  chain_.add_check(std::move(check),
                   [this](void* element) { simulator_.write_observation(state_, element); });
}

void SimulatedRobot::require_elements(const RobotTypes& types) const {
  require(description().action == types.action && description().observation == types.observation,
          "a check for robots of type '" + types.type + "' cannot check one of type '" +
              description().type + "'");
}

bool SimulatedRobot::get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept {
  const std::string_view name = companions_[index].name;
  if (name == kSceneCompanion) return get_scene(time_index, element);
  if (name == kHandCompanion) return get_hand(time_index, element);
  return get_poses(time_index, element);
}

// Finds out what is pulled in the next step, and what acts in it. Null if nothing is pulled.
detail::Puller* SimulatedRobot::next_pull() noexcept {
  if (acting_.body >= 0) acting_ = {};
  // What another process wrote is copied once; this copy is checked and used.
  HandObservation pulled;
  const auto is_pull = [this](const HandObservation& hand) {
    return hand.body >= 0 && hand.body < puller_->num_bodies() && pull_of(hand).is_valid();
  };
  if (hand_ == nullptr || !hand_->read_newest(&pulled) || !is_pull(pulled)) {
    if (own_pull_.body < 0) return nullptr;
    pulled = own_pull_;
  }
  acting_ = pulled;
  acting_.force = {};
  puller_->set(pulled.body, pull_of(pulled));
  return puller_.get();
}

// The element says what acted in the step before, which is known now.
bool SimulatedRobot::get_hand(TimeIndex time_index, void* element) noexcept {
  if (time_index < next_hand_) return false;
  const bool is_acting = acting_.body >= 0;
  const bool is_first = next_hand_ < 0;
  next_hand_ = time_index + 1;
  if (!is_first && !is_acting && !was_acting_) return false;
  was_acting_ = is_acting;
  HandObservation hand = acting_;
  hand.stamp = {.arrival_index = time_index,
                .capture_index = std::max<TimeIndex>(time_index - 1, -1)};
  std::memcpy(element, &hand, sizeof(hand));
  return true;
}

bool SimulatedRobot::get_poses(TimeIndex time_index, void* element) noexcept {
  const auto* const received = simulator_.receive_poses(time_index, *data_, state_);
  if (received == nullptr) return false;
  const Stamp stamp{.arrival_index = time_index < 0 ? -1 : received->arrival_index,
                    .capture_index = received->capture_index};
  write_objects(stamp, received->objects, static_cast<std::byte*>(element));
  return true;
}

bool SimulatedRobot::get_scene(TimeIndex time_index, void* element) noexcept {
  if (time_index < next_scene_) return false;
  // The first one is that before step 0; the others count from there.
  next_scene_ = time_index < 0 ? 0 : time_index + options().scene_period;
  const mjModel& model = mujoco();
  write_scene({.arrival_index = time_index, .capture_index = time_index},
              {data_->qpos, static_cast<std::size_t>(model.nq)},
              {data_->qvel, static_cast<std::size_t>(model.nv)}, static_cast<std::byte*>(element));
  return true;
}

std::string_view SimulatedRobot::fault_text(std::int32_t fault_code) const noexcept {
  return fault_code == kDiverged ? "the simulation diverged" : chain_.fault_text();
}

std::string_view SimulatedRobot::rejection_text() const noexcept { return chain_.rejection_text(); }

void SimulatedRobot::reset() { reset(initial_position(), Random{.seed = options().seed}); }

void SimulatedRobot::reset(std::span<const double> position, const Random& random,
                           std::span<const double> model_position) {
  simulator_.check(position);
  const std::size_t joints = model().model_joints().size();
  require(model_position.size() <= joints,
          text_of("there are positions for ", model_position.size(),
                  " hinges and slides, the model has ", joints));
  let_go();
  const TimeIndex now = state_.memory.counters.step;
  simulator_.reset(position, random, *data_, state_, model_position);
  chain_.forget(state_.memory.counters.variation.motor_heat);
  simulator_.move_to_step(now, state_);
  begin_here();
}

void SimulatedRobot::vary(const Variation& variation) {
  simulator_.check(variation);
  vary_model(variation);
  Memory::Counters& counters = state_.memory.counters;
  // What is on its way was sent and measured with the delays of before.
  if (variation.torque_delay != counters.variation.torque_delay) counters.num_sent = 0;
  if (variation.measurement_delay != counters.variation.measurement_delay)
    counters.num_measured = 0;
  counters.variation = variation;
  begin_here();
}

void SimulatedRobot::place_object(const std::string& name, const ObjectPose& pose) {
  const ObjectAddress& object = model().object(name);
  require(
      detail::is_possible(pose),
      "object '" + name + "' cannot be placed: its pose is not finite, or its quaternion is zero");
  simulator_.place(object, pose, *data_, state_);
  begin_here();
}

void SimulatedRobot::push_object(const std::string& name, const std::array<double, 3>& force) {
  const ObjectAddress& object = model().object(name);
  for (const double value : force) {
    require(std::isfinite(value), "the force on object '" + name + "' is not finite");
  }
  constexpr std::ptrdiff_t kWrench = 6;  // The force, then the moment.
  std::ranges::copy(force, data_->xfrc_applied + kWrench * object.body);
}

void SimulatedRobot::pull(const std::string& body, const Pull& pull) {
  this->pull(find_body(bodies_, body), pull);
}

void SimulatedRobot::pull(std::int64_t body, const Pull& pull) {
  require_body(bodies_, body);
  pull.validate();
  own_pull_ = {
      .body = body, .point = pull.point, .target = pull.target, .stiffness = pull.stiffness};
}

void SimulatedRobot::let_go() noexcept { own_pull_ = {}; }

void SimulatedRobot::listen_to_hand(const std::string& name) {
  hand_ = std::make_unique<LoopSensorReader>(name, kHandCompanion, describe<HandObservation>(),
                                             kHandTimeout);
}

std::vector<std::string> SimulatedRobot::take_hand_messages() {
  return hand_ != nullptr ? hand_->take_messages() : std::vector<std::string>();
}

void SimulatedRobot::set_object_velocity(const std::string& name, const ObjectVelocity& velocity) {
  const ObjectAddress& object = model().object(name);
  for (const auto& part : {velocity.linear, velocity.angular}) {
    for (const double value : part) {
      require(std::isfinite(value), "the velocity of object '" + name + "' is not finite");
    }
  }
  simulator_.set_velocity(object, velocity, *data_);
  begin_here();
}

ObjectPose SimulatedRobot::object_pose(const std::string& name) const {
  return simulator_.object_pose(model().object(name), *data_);
}

ObjectPose SimulatedRobot::observed_object_pose(const std::string& name) const {
  const ObjectAddress* const first = model().objects().data();
  return state_.objects[static_cast<std::size_t>(&model().object(name) - first)];
}

ObjectVelocity SimulatedRobot::object_velocity(const std::string& name) const {
  return simulator_.object_velocity(model().object(name), *data_);
}

double SimulatedRobot::contact_depth() const noexcept {
  double depth = 0.0;
  for (int i = 0; i < data_->ncon; ++i) depth = std::max(depth, -data_->contact[i].dist);
  return depth;
}

SimulationState SimulatedRobot::save() const {
  SimulationState state(state_size());
  write_state(state);
  return state;
}

void SimulatedRobot::restore(std::span<const std::byte> state) {
  SimulatedStateHeader header{.magic = 0};
  if (state.size() >= sizeof(header)) std::memcpy(&header, state.data(), sizeof(header));
  require(header.magic == kSimulatedStateMagic,
          "this is not the saved state of a simulation, or one of another version");
  require(header.model == fingerprint_ && state.size() == state_size(),
          "this state was saved from another model: another robot, other objects, or another "
          "object_period or object_delay");
  Memory::Counters counters;
  std::memcpy(&counters,
              state.data() + sizeof(SimulatedStateHeader) + std::span(physics_).size_bytes(),
              sizeof(counters));
  simulator_.check(counters.variation);
  vary_model(counters.variation);
  let_go();
  const TimeIndex now = state_.memory.counters.step;
  read_state(state);
  // A damaged state must not lead to an index outside the ring, or to steps beyond all numbers.
  Memory::Counters& read = state_.memory.counters;
  read.pending_count = std::min<std::uint64_t>(read.pending_count, state_.captures.size());
  const auto bound = [](TimeIndex& step) {
    constexpr TimeIndex kMost = 1'000'000'000'000'000;
    step = std::clamp(step, -kMost, kMost);
  };
  bound(read.step);
  bound(read.next_capture);
  for (Simulator::Capture& capture : state_.captures) {
    bound(capture.capture_index);
    bound(capture.arrival_index);
  }
  simulator_.move_to_step(now, state_);
  begin_here();
}

std::vector<double> SimulatedRobot::configuration() const {
  std::vector<double> values(data_->qpos, data_->qpos + mujoco().nq);
  values.insert(values.end(), data_->qvel, data_->qvel + mujoco().nv);
  return values;
}

const mjModel& SimulatedRobot::mujoco() const noexcept {
  return varied_ != nullptr ? *varied_ : *model().mujoco();
}

// Varies the model. The state of the physics does not change.
void SimulatedRobot::vary_model(const Variation& variation) {
  const Variation& now = state_.memory.counters.variation;
  if (variation == now) return;
  mj_getState(&mujoco(), data_.get(), physics_.data(), kWholeState);
  if (varied_ == nullptr || !variation.varies_same_pairs_as(now)) {
    varied_ = simulator_.make_varied_model(variation);
  }
  simulator_.vary(variation, *varied_, *data_);
  mj_setState(&mujoco(), data_.get(), physics_.data(), kWholeState);
}

// Call this after the owner has moved the robot: the next session begins here. In a session that
// continues, the next action must not be judged by an observation from before.
void SimulatedRobot::begin_here() noexcept {
  simulator_.observe(*data_, state_);
  write_state(begin_state_);
}

// Returns a hash (FNV-1a) of the model and of the other options that set the layout of saved
// states.
std::uint64_t SimulatedRobot::fingerprint() const {
  std::uint64_t hash = 0xcbf29ce484222325;
  const auto add = [&hash](const auto* bytes, std::size_t size) {
    for (const std::byte byte : std::as_bytes(std::span(bytes, size))) {
      hash = (hash ^ std::to_integer<std::uint64_t>(byte)) * 0x100000001b3;
    }
  };
  const mjModel* const original = model().mujoco();
  std::vector<std::byte> bytes(static_cast<std::size_t>(mj_sizeModel(original)));
  mj_saveModel(original, nullptr, bytes.data(), static_cast<int>(bytes.size()));
  add(bytes.data(), bytes.size());
  add(&options().object_period, 1);
  add(&options().object_delay, 1);
  const Identified& identified = options().identified;
  for (const IdentifiedField& field : Identified::fields()) {
    const std::vector<double>& list = identified.*field.value;
    add(list.data(), list.size());
  }
  add(&identified.torque_delay, 1);
  add(&identified.measurement_delay, 1);
  return hash;
}

// Returns the size of a saved state: header, physics, memory, checks, poses under way.
std::size_t SimulatedRobot::state_size() const noexcept {
  std::size_t size = sizeof(SimulatedStateHeader) + std::span(physics_).size_bytes() +
                     chain_.memory().size_bytes();
  for_each_part(state_.memory, [&size](auto part) { size += part.size_bytes(); });
  return size + state_.captures.size() *
                    (2 * sizeof(TimeIndex) + model().objects().size() * sizeof(ObjectPose));
}

void SimulatedRobot::write_state(std::span<std::byte> state) const noexcept {
  mj_getState(&mujoco(), data_.get(), physics_.data(), kWholeState);
  write_state(state, chain_.memory(), state_.memory);
}

// Writes `physics_` and the rest.
void SimulatedRobot::write_state(std::span<std::byte> state, std::span<const JointMemory> safety,
                                 const Memory& memory) const noexcept {
  std::byte* target = state.data();
  const auto write = [&target](auto part) {
    target = std::ranges::copy(std::as_bytes(part), target).out;
  };
  const SimulatedStateHeader header{.model = fingerprint_};
  write(std::span(&header, 1));
  write(std::span(physics_));
  for_each_part(memory, write);
  write(safety);
  for (const auto& capture : state_.captures) {
    write(std::span(&capture.capture_index, 1));
    write(std::span(&capture.arrival_index, 1));
    write(std::span(capture.objects));
  }
}

void SimulatedRobot::read_state(std::span<const std::byte> state) noexcept {
  const std::byte* source = state.data() + sizeof(SimulatedStateHeader);
  const auto read = [&source](auto part) {
    const std::span target = std::as_writable_bytes(part);
    std::copy_n(source, target.size(), target.begin());
    source += target.size();
  };
  read(std::span(physics_));
  mj_setState(&mujoco(), data_.get(), physics_.data(), kWholeState);
  data_->warning[mjWARN_BADQACC].number = 0;
  for_each_part(state_.memory, read);
  read(chain_.memory());
  for (auto& capture : state_.captures) {
    read(std::span(&capture.capture_index, 1));
    read(std::span(&capture.arrival_index, 1));
    read(std::span(capture.objects));
  }
}

// Returns where the components of kChangedByStep are, in their order.
std::vector<std::span<const double>> SimulatedRobot::parts_changed_by_step() const {
  const mjModel& model = mujoco();
  const auto part = [](const double* values, auto count) {
    return std::span(values, static_cast<std::size_t>(count));
  };
  std::vector<std::span<const double>> parts{part(&data_->time, 1),
                                             part(data_->qpos, model.nq),
                                             part(data_->qvel, model.nv),
                                             part(data_->act, model.na),
                                             part(data_->history, model.nhistory),
                                             part(data_->qacc_warmstart, model.nv),
                                             part(data_->ctrl, model.nu),
                                             part(data_->plugin_state, model.npluginstate),
                                             part(data_->plastic, model.nplastic)};
  std::size_t size = 0;
  for (const auto& values : parts) size += values.size();
  if (size != before_step_.size()) {
    throw Error("this version of MuJoCo has a state that the simulation does not know");
  }
  return parts;
}

// Does what mj_getState does, but 20 times faster: mj_getState checks every possible component in
// every step.
void SimulatedRobot::keep_state_before_step() noexcept {
  memory_before_step_ = state_.memory;
  std::ranges::copy(chain_.memory(), safety_before_step_.begin());
  double* target = before_step_.data();
  for (const std::span<const double> part : changed_by_step_) {
    target = std::ranges::copy(part, target).out;
  }
}

void SimulatedRobot::keep_state_before_divergence() noexcept {
  // The loop calls this, so it must not allocate.
  if (state_before_divergence_.empty()) state_before_divergence_.swap(spare_state_);
  mj_getState(&mujoco(), data_.get(), after_step_.data(), kChangedByStep);
  mj_setState(&mujoco(), data_.get(), before_step_.data(), kChangedByStep);
  mj_getState(&mujoco(), data_.get(), physics_.data(), kWholeState);
  mj_setState(&mujoco(), data_.get(), after_step_.data(), kChangedByStep);
  write_state(state_before_divergence_, safety_before_step_, memory_before_step_);
}

}  // namespace trifinger
