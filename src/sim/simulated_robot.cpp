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

#include "puller.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/export.hpp"
#include "trifinger/sim/scene_observation.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger {
namespace {

using detail::require;

// Every saved state begins with this number, so that states of other versions are recognised.
constexpr std::uint64_t kSimulatedStateMagic = 0x34534d4953465254;  // "TRFSIMS4"

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

std::size_t state_size_of(const RobotModel& model, int components) {
  return static_cast<std::size_t>(mj_stateSize(model.mujoco(), components));
}

Pull pull_of(const HandObservation& hand) noexcept {
  return {.target = hand.target, .point = hand.point, .stiffness = hand.stiffness};
}

}  // namespace

std::vector<Document> model_documents(const RobotDescription& description) {
  ViewerScene scene =
      export_scene(description, {.joint_field = "position", .object_companion = kObjectCompanion});
  return {{"model.xml", "application/xml", export_mjcf(description)},
          {"robot.urdf", "application/xml", std::move(scene.urdf)},
          {"frames.txt", "text/plain", std::move(scene.frames)}};
}

template <class R>
SimulatedRobot<R>::SimulatedRobot(Options options)
    : simulator_(std::move(options)),
      data_(model().make_data()),
      state_(simulator_.make_state()),
      stop_(this->options().stop, this->options().period),
      joint_names_(joint_names(this->options().description)),
      fingerprint_(fingerprint()),
      before_step_(state_size_of(model(), kChangedByStep)),
      changed_by_step_(parts_changed_by_step()),
      after_step_(before_step_.size()),
      physics_(state_size_of(model(), kWholeState)) {
  if (auto objects = object_companion(this->options().description);
      objects && this->options().exact_poses) {
    companions_.push_back(std::move(*objects));
  }
  if (this->options().scene_period > 0) {
    companions_.push_back(scene_companion(this->options().description));
  }
  if (this->options().has_hand) companions_.push_back(hand_companion());
  puller_ = std::make_unique<detail::Puller>(model());
  begin_state_.resize(state_size());
  spare_state_.resize(state_size());
  reset();
}

template <class R>
SimulatedRobot<R>::~SimulatedRobot() = default;

template <class R>
DriverReport SimulatedRobot<R>::prepare(TimeIndex) noexcept {
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

template <class R>
DriverReport SimulatedRobot<R>::get_latest_observation(Observation& observation) noexcept {
  simulator_.observe(*data_, state_);
  observation = state_.observation;
  return DriverReport::ready();
}

template <class R>
DriverReport SimulatedRobot<R>::apply_action(const Action& desired,
                                             AppliedAction& applied) noexcept {
  memory_before_step_ = state_.memory;
  keep_state_before_step();
  detail::Puller* const puller = next_pull();
  const DriverReport report = simulator_.step(desired, mujoco(), *data_, state_, applied, puller);
  if (puller != nullptr) acting_.force = puller->force();
  const bool has_diverged = report.fault_code == kDiverged;
  has_safety_fault_ = report.fault_code != 0 && !has_diverged;
  if (has_diverged) keep_state_before_divergence();
  if (report.action_rejected) {
    const RejectedCommand rejected = simulator_.safety().find_rejected(desired, applied);
    rejection_text_ = describe(rejected, joint_names_[rejected.joint],
                               simulator_.safety().limits()[rejected.joint]);
  }
  return report;
}

template <class R>
DriverReport SimulatedRobot<R>::hold(const Observation& observation, Action& action) noexcept {
  action = hold_position(observation);
  // Without these torques the fingers would sink until the position controller carries their
  // weight.
  simulator_.gravity_torques(mujoco(), *data_, action.torque);
  return DriverReport::ready();
}

// The observation belongs to the previous period: it is the session's last one, or the newest that
// the loop has measured since.
template <class R>
DriverReport SimulatedRobot<R>::stop(TimeIndex step) noexcept {
  Action action;
  if (!stop_.next(step, state_.observation, action)) return DriverReport::ready();
  if (step == 0 && has_safety_fault_) {
    // The fault that ended the session may not be detected again.
    stop_.give_up(step);
    action = {};
  }
  // These torques carry the weight under which the fingers would sink, as in `hold`.
  if (!std::isnan(action.position[0])) {
    simulator_.gravity_torques(mujoco(), *data_, action.torque);
  }
  AppliedAction applied;
  const SafetyReport report = simulator_.safety().apply(
      action, state_.observation, options().period, state_.memory.safety, applied);
  if (report.fault != SafetyFault::kNone) stop_.give_up(step);
  // A simulation that has diverged cannot come to rest.
  return simulator_.move(applied.torque, mujoco(), *data_, state_) ? DriverReport::busy()
                                                                   : DriverReport::ready();
}

template <class R>
std::span<const CompanionDescription> SimulatedRobot<R>::companions() const noexcept {
  return companions_;
}

template <class R>
bool SimulatedRobot<R>::get_companion_element(std::size_t index, TimeIndex time_index,
                                              void* element) noexcept {
  const std::string_view name = companions_[index].name;
  if (name == kSceneCompanion) return get_scene(time_index, element);
  if (name == kHandCompanion) return get_hand(time_index, element);
  return get_poses(time_index, element);
}

// Finds out what is pulled in the next step, and what acts in it. Null if nothing is pulled.
template <class R>
detail::Puller* SimulatedRobot<R>::next_pull() noexcept {
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
template <class R>
bool SimulatedRobot<R>::get_hand(TimeIndex time_index, void* element) noexcept {
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

template <class R>
bool SimulatedRobot<R>::get_poses(TimeIndex time_index, void* element) noexcept {
  const auto* const received = simulator_.receive_poses(time_index, *data_, state_);
  if (received == nullptr) return false;
  const Stamp stamp{.arrival_index = time_index < 0 ? -1 : received->arrival_index,
                    .capture_index = received->capture_index};
  write_objects(stamp, received->objects, static_cast<std::byte*>(element));
  return true;
}

template <class R>
bool SimulatedRobot<R>::get_scene(TimeIndex time_index, void* element) noexcept {
  if (time_index < next_scene_) return false;
  // The first one is that before step 0; the others count from there.
  next_scene_ = time_index < 0 ? 0 : time_index + options().scene_period;
  const mjModel& model = mujoco();
  write_scene({.arrival_index = time_index, .capture_index = time_index},
              {data_->qpos, static_cast<std::size_t>(model.nq)},
              {data_->qvel, static_cast<std::size_t>(model.nv)}, static_cast<std::byte*>(element));
  return true;
}

template <class R>
std::string_view SimulatedRobot<R>::fault_text(std::int32_t fault_code) const noexcept {
  if (fault_code == kDiverged) return "the simulation diverged";
  if (fault_code == fault_code_of({.fault = SafetyFault::kOwnCheck})) return state_.thrown.view();
  return fault_text_of(fault_code);
}

template <class R>
std::string_view SimulatedRobot<R>::rejection_text() const noexcept {
  return rejection_text_.view();
}

template <class R>
void SimulatedRobot<R>::reset() {
  reset(initial_position(), Random{.seed = options().seed});
}

template <class R>
void SimulatedRobot<R>::reset(const Joints& position, const Random& random) {
  simulator_.check(position);
  let_go();
  const TimeIndex now = state_.memory.step;
  simulator_.reset(position, random, mujoco(), *data_, state_);
  simulator_.move_to_step(now, state_);
  begin_here();
}

template <class R>
void SimulatedRobot<R>::vary(const Variation& variation) {
  variation.validate();
  vary_model(variation);
  state_.memory.variation = variation;
  begin_here();
}

template <class R>
void SimulatedRobot<R>::place_object(const std::string& name, const ObjectPose& pose) {
  const ObjectAddress& object = model().object(name);
  double square = 0.0;
  for (const double value : pose.orientation) square += value * value;
  constexpr double kSmallestSquare = 1e-12;
  bool is_pose = std::isfinite(square) && square > kSmallestSquare;
  for (const double value : pose.position) is_pose = is_pose && std::isfinite(value);
  require(is_pose, "object '" + name +
                       "' cannot be placed: its pose is not finite, or its quaternion is zero");
  simulator_.place(object, pose, *data_, state_);
  begin_here();
}

template <class R>
void SimulatedRobot<R>::push_object(const std::string& name, const std::array<double, 3>& force) {
  const ObjectAddress& object = model().object(name);
  for (const double value : force) {
    require(std::isfinite(value), "the force on object '" + name + "' is not finite");
  }
  constexpr std::ptrdiff_t kWrench = 6;  // The force, then the moment.
  std::ranges::copy(force, data_->xfrc_applied + kWrench * object.body);
}

template <class R>
void SimulatedRobot<R>::pull(const std::string& body, const Pull& pull) {
  this->pull(find_body(pullable_bodies(options().description), body), pull);
}

template <class R>
void SimulatedRobot<R>::pull(std::int64_t body, const Pull& pull) {
  require_body(pullable_bodies(options().description), body);
  pull.validate();
  own_pull_ = {
      .body = body, .point = pull.point, .target = pull.target, .stiffness = pull.stiffness};
}

template <class R>
void SimulatedRobot<R>::let_go() noexcept {
  own_pull_ = {};
}

template <class R>
void SimulatedRobot<R>::listen_to_hand(const std::string& name) {
  hand_ = std::make_unique<LoopSensorReader>(name, kHandCompanion, describe<HandObservation>(),
                                             kHandPatience);
}

template <class R>
std::vector<std::string> SimulatedRobot<R>::take_hand_news() {
  return hand_ != nullptr ? hand_->take_news() : std::vector<std::string>();
}

template <class R>
void SimulatedRobot<R>::set_object_velocity(const std::string& name,
                                            const ObjectVelocity& velocity) {
  const ObjectAddress& object = model().object(name);
  for (const auto& part : {velocity.linear, velocity.angular}) {
    for (const double value : part) {
      require(std::isfinite(value), "the velocity of object '" + name + "' is not finite");
    }
  }
  simulator_.set_velocity(object, velocity, *data_);
  begin_here();
}

template <class R>
ObjectPose SimulatedRobot<R>::object_pose(const std::string& name) const {
  return simulator_.object_pose(model().object(name), *data_);
}

template <class R>
ObjectPose SimulatedRobot<R>::observed_object_pose(const std::string& name) const {
  const ObjectAddress* const first = model().objects().data();
  return state_.objects[static_cast<std::size_t>(&model().object(name) - first)];
}

template <class R>
ObjectVelocity SimulatedRobot<R>::object_velocity(const std::string& name) const {
  return simulator_.object_velocity(model().object(name), *data_);
}

template <class R>
SimulationState SimulatedRobot<R>::save() const {
  SimulationState state(state_size());
  write_state(state);
  return state;
}

template <class R>
void SimulatedRobot<R>::restore(std::span<const std::byte> state) {
  SimulatedStateHeader header{.magic = 0};
  if (state.size() >= sizeof(header)) std::memcpy(&header, state.data(), sizeof(header));
  require(header.magic == kSimulatedStateMagic,
          "this is not the saved state of a simulation, or one of another version");
  require(header.model == fingerprint_ && state.size() == state_size(),
          "this state was saved from another model: another robot, other objects, or another "
          "object_period or object_delay");
  Memory memory;
  std::memcpy(&memory,
              state.data() + sizeof(SimulatedStateHeader) + std::span(physics_).size_bytes(),
              sizeof(memory));
  memory.variation.validate();
  vary_model(memory.variation);
  let_go();
  const TimeIndex now = state_.memory.step;
  read_state(state);
  // A damaged state must not lead to an index outside the ring.
  state_.memory.pending_count =
      std::min<std::uint64_t>(state_.memory.pending_count, state_.captures.size());
  simulator_.move_to_step(now, state_);
  begin_here();
}

template <class R>
std::vector<double> SimulatedRobot<R>::configuration() const {
  std::vector<double> values(data_->qpos, data_->qpos + mujoco().nq);
  values.insert(values.end(), data_->qvel, data_->qvel + mujoco().nv);
  return values;
}

template <class R>
const mjModel& SimulatedRobot<R>::mujoco() const noexcept {
  return varied_ != nullptr ? *varied_ : *model().mujoco();
}

// Varies the model. The state of the physics does not change.
template <class R>
void SimulatedRobot<R>::vary_model(const Variation& variation) {
  const Variation& now = state_.memory.variation;
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
template <class R>
void SimulatedRobot<R>::begin_here() noexcept {
  simulator_.observe(*data_, state_);
  write_state(begin_state_);
}

// Returns a hash (FNV-1a) of the model and of the other options that set the layout of saved
// states.
template <class R>
std::uint64_t SimulatedRobot<R>::fingerprint() const {
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
  return hash;
}

// Returns the size of a saved state: header, physics, memory, poses under way.
template <class R>
std::size_t SimulatedRobot<R>::state_size() const noexcept {
  return sizeof(SimulatedStateHeader) + std::span(physics_).size_bytes() + sizeof(Memory) +
         state_.captures.size() *
             (2 * sizeof(TimeIndex) + model().objects().size() * sizeof(ObjectPose));
}

template <class R>
void SimulatedRobot<R>::write_state(std::span<std::byte> state) const noexcept {
  mj_getState(&mujoco(), data_.get(), physics_.data(), kWholeState);
  write_state(state, physics_, state_.memory);
}

template <class R>
void SimulatedRobot<R>::write_state(std::span<std::byte> state, std::span<const double> physics,
                                    const Memory& memory) const noexcept {
  std::byte* target = state.data();
  const auto write = [&target](const void* source, std::size_t size) {
    // Without objects there is nothing to copy, and the address may be null.
    if (size > 0) std::memcpy(target, source, size);
    target += size;
  };
  const SimulatedStateHeader header{.model = fingerprint_};
  write(&header, sizeof(header));
  write(physics.data(), physics.size_bytes());
  write(&memory, sizeof(memory));
  for (const auto& capture : state_.captures) {
    write(&capture.capture_index, sizeof(TimeIndex));
    write(&capture.arrival_index, sizeof(TimeIndex));
    write(capture.objects.data(), capture.objects.size() * sizeof(ObjectPose));
  }
}

template <class R>
void SimulatedRobot<R>::read_state(std::span<const std::byte> state) noexcept {
  const std::byte* source = state.data() + sizeof(SimulatedStateHeader);
  const auto read = [&source](void* target, std::size_t size) {
    // Without objects there is nothing to copy, and the address may be null.
    if (size > 0) std::memcpy(target, source, size);
    source += size;
  };
  read(physics_.data(), std::span(physics_).size_bytes());
  mj_setState(&mujoco(), data_.get(), physics_.data(), kWholeState);
  data_->warning[mjWARN_BADQACC].number = 0;
  read(&state_.memory, sizeof(Memory));
  for (auto& capture : state_.captures) {
    read(&capture.capture_index, sizeof(TimeIndex));
    read(&capture.arrival_index, sizeof(TimeIndex));
    read(capture.objects.data(), capture.objects.size() * sizeof(ObjectPose));
  }
}

// Returns where the components of kChangedByStep are, in their order.
template <class R>
std::vector<std::span<const double>> SimulatedRobot<R>::parts_changed_by_step() const {
  const mjModel& model = mujoco();
  const auto part = [](const double* values, auto count) {
    return std::span(values, static_cast<std::size_t>(count));
  };
  std::vector<std::span<const double>> parts{part(&data_->time, 1),
                                             part(data_->qpos, model.nq),
                                             part(data_->qvel, model.nv),
                                             part(data_->act, model.na),
                                             part(data_->qacc_warmstart, model.nv),
                                             part(data_->ctrl, model.nu)};
  std::size_t size = 0;
  for (const auto& values : parts) size += values.size();
  if (size != before_step_.size()) {
    throw Error("this version of MuJoCo has a state that the simulation does not know");
  }
  return parts;
}

// Does what mj_getState does, but 20 times faster: mj_getState checks every possible component in
// every step.
template <class R>
void SimulatedRobot<R>::keep_state_before_step() noexcept {
  double* target = before_step_.data();
  for (const std::span<const double> part : changed_by_step_) {
    target = std::ranges::copy(part, target).out;
  }
}

template <class R>
void SimulatedRobot<R>::keep_state_before_divergence() noexcept {
  // The loop calls this, so it must not allocate.
  if (state_before_divergence_.empty()) state_before_divergence_.swap(spare_state_);
  mj_getState(&mujoco(), data_.get(), after_step_.data(), kChangedByStep);
  mj_setState(&mujoco(), data_.get(), before_step_.data(), kChangedByStep);
  mj_getState(&mujoco(), data_.get(), physics_.data(), kWholeState);
  mj_setState(&mujoco(), data_.get(), after_step_.data(), kChangedByStep);
  write_state(state_before_divergence_, physics_, memory_before_step_);
}

template class SimulatedRobot<TriFinger>;
template class SimulatedRobot<Finger>;

}  // namespace trifinger
