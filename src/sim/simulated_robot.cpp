// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/simulated_robot.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string_view>
#include <type_traits>
#include <utility>

#include "physics.hpp"
#include "text.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/export.hpp"

namespace trifinger {
namespace {

using sim::text_of;

constexpr Nanoseconds kPhysicsStep = std::chrono::milliseconds(1);

// The user's bounds on gains are ours, no source has any: well inside what is stable at 1 kHz for
// the lightest link.
constexpr double kMaxKp = 50.0;
constexpr double kMaxKd = 0.5;

// Ours: a little more than the motors reach against the safety damping [rad/s].
constexpr FingerJoints kMaxVelocity{5.0, 5.0, 8.0};
// Of real joints: what a motor without load reaches, and half as much again where something hits
// the arm [rad/s].
constexpr double kMaxPositionRate = 65.0;
// Ours: a velocity that is wrong by 1 rad/s for a tenth of a second, a joint that does not move by
// the last bit while its torque varies by half of its maximum.
constexpr double kMaxVelocityError = 1.0;   // [rad/s]
constexpr double kVelocityErrorTime = 0.1;  // [s]
constexpr double kStuckTime = 0.1;          // [s]
constexpr double kStuckShare = 0.5;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Begins every saved state: one of another version is told apart.
constexpr std::uint64_t kStateMagic = 0x32534d4953465254;  // "TRFSIMS2"

// Random bits from a counter (SplitMix64). Small, so that it is saved at every step, and any bits
// are a valid state.
class Random {
 public:
  using result_type = std::uint64_t;  // NOLINT(readability-identifier-naming): the standard's

  explicit Random(std::uint64_t seed = 0) noexcept : counter_(seed) {}

  static constexpr result_type min() { return 0; }
  static constexpr result_type max() { return std::numeric_limits<result_type>::max(); }

  result_type operator()() noexcept {
    counter_ += 0x9e3779b97f4a7c15;
    std::uint64_t bits = counter_;
    bits = (bits ^ (bits >> 30U)) * 0xbf58476d1ce4e5b9;
    bits = (bits ^ (bits >> 27U)) * 0x94d049bb133111eb;
    return bits ^ (bits >> 31U);
  }

 private:
  std::uint64_t counter_;
};

void require(bool holds, const std::string& text) {
  if (!holds) throw InvalidArgument(text);
}

ElementDescription describe_objects(const RobotModel& model) {
  std::vector<FieldDescription> fields;
  std::size_t offset = 0;
  const auto append = [&](const std::string& prefix, const ElementDescription& element) {
    for (FieldDescription field : element.fields()) {
      field.name = prefix + field.name;
      field.offset += offset;
      fields.push_back(std::move(field));
    }
    offset += element.size();
  };
  append("stamp.", describe<Stamp>());
  for (const ObjectAddress& object : model.objects()) {
    append(object.name + ".", describe<ObjectPose>());
  }
  return ElementDescription(std::move(fields));
}

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

// A pose on its way to its reader.
struct Capture {
  TimeIndex capture_index;
  TimeIndex arrival_index;
};

}  // namespace

Document model_document(const RobotDescription& description) {
  return {"model.xml", "application/xml", export_mjcf(description)};
}

template <class R>
JointLimits<R::kJoints> default_limits(const RobotDescription& description) {
  require(num_joints(description) == static_cast<int>(R::kJoints),
          "a robot of type '" + std::string(R::kType) + "' has " + std::to_string(R::kJoints) +
              " joints, this description has " + std::to_string(num_joints(description)));
  const VariantFigures& figures = trifinger::figures(description);
  JointLimits<R::kJoints> limits{};
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const std::size_t joint = i % kJointsPerFinger;
    limits.max_torque[i] = figures.actuator.torque_limit;
    limits.safety_kd[i] = figures.safety_kd[joint];
    limits.soft_lower[i] = figures.soft_lower[joint];
    limits.soft_upper[i] = figures.soft_upper[joint];
    limits.hard_lower[i] = figures.hard_lower[joint];
    limits.hard_upper[i] = figures.hard_upper[joint];
    limits.default_kp[i] = figures.kp[joint];
    limits.default_kd[i] = figures.kd[joint];
    limits.max_kp[i] = kMaxKp;
    limits.max_kd[i] = kMaxKd;
    limits.max_velocity[i] = kMaxVelocity[joint];
    limits.braking[i] = figures.braking[joint];
    limits.max_torque_rate[i] = kInfinity;
    limits.continuous_torque[i] = figures.actuator.continuous_torque;
    limits.thermal_time[i] = figures.actuator.thermal_time;
    limits.plausibility.max_position_rate[i] = kMaxPositionRate;
    limits.plausibility.max_velocity_error[i] = kMaxVelocityError;
    limits.plausibility.velocity_error_time[i] = kVelocityErrorTime;
    limits.plausibility.stuck_torque[i] = kStuckShare * figures.actuator.torque_limit;
    limits.plausibility.stuck_time[i] = kStuckTime;
  }
  return limits;
}

template <class R>
void SimulationOptions<R>::validate() const {
  trifinger::validate(description);
  for (const ObjectDescription& object : description.objects) {
    // Names become names of fields in the session "object".
    const bool is_name = std::all_of(object.name.begin(), object.name.end(), [](char letter) {
      return std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '_';
    });
    require(is_name && object.name != "stamp",
            "an object cannot be called '" + object.name +
                "': names are letters, digits and '_', and 'stamp' is taken");
  }
  const auto used = limits ? *limits : default_limits<R>(description);
  require(num_joints(description) == static_cast<int>(R::kJoints),
          "a robot of type '" + std::string(R::kType) + "' has " + std::to_string(R::kJoints) +
              " joints, this description has " + std::to_string(num_joints(description)));
  used.validate();
  stop.validate(used);
  require(period >= kPhysicsStep && period % kPhysicsStep == Nanoseconds::zero(),
          "period is " + std::to_string(period.count()) +
              " ns, must be a whole number of milliseconds");
  require(object_period >= 1,
          "object_period is " + std::to_string(object_period) + " steps, must be at least 1");
  constexpr TimeIndex kMaxDelay = 100000;
  require(object_delay >= 0 && object_delay <= kMaxDelay,
          "object_delay is " + std::to_string(object_delay) + " steps, must be 0 to " +
              std::to_string(kMaxDelay));
  for (const auto& [name, noise] :
       {std::pair{"object_position_noise", object_position_noise},
        std::pair{"object_orientation_noise", object_orientation_noise}}) {
    require(std::isfinite(noise) && noise >= 0.0,
            std::string(name) + " is " + text_of(noise) + ", must be at least 0");
  }
}

template <class R>
class SimulatedRobot<R>::Implementation {
 public:
  explicit Implementation(Options options)
      : options_((options.validate(), std::move(options))),
        actuator_(trifinger::actuator(options_.description)),
        physics_(options_.description, static_cast<int>(options_.period / kPhysicsStep)),
        safety_(options_.limits ? *options_.limits : default_limits<R>(options_.description)),
        stop_(options_.stop, options_.period),
        companion_{CompanionDescription{.name = "object",
                                        .type = "object_observation",
                                        .element = describe_objects(physics_.model())}},
        pending_(static_cast<std::size_t>(options_.object_delay / options_.object_period) + 2,
                 Pose(num_objects())) {
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      begin_at_[i] = physics_.model().initial_position()[i];
    }
    if (options_.initial_position) begin_at_ = checked(*options_.initial_position);
    begin_state_.resize(state_size());
    spare_state_.resize(state_size());
    reset(begin_at_, options_.seed);
  }

  DriverReport prepare() noexcept {
    read_state(begin_state_);
    move_to_step(0);
    has_initial_pose_ = false;
    has_safety_fault_ = false;
    return DriverReport::ready();
  }

  DriverReport get_latest_observation(Observation& observation) noexcept {
    observe();
    observation = observation_;
    return DriverReport::ready();
  }

  DriverReport apply_action(const Action& desired, AppliedAction& applied) noexcept {
    memory_before_step_ = memory_;
    const SafetyReport report =
        safety_.apply(desired, observation_, options_.period, memory_.safety, applied);
    has_safety_fault_ = report.fault != SafetyFault::kNone;
    if (has_safety_fault_) return DriverReport::fault(fault_code_of(report));
    if (!step(applied.torque)) {
      keep_state_before_divergence();
      return DriverReport::fault(kDiverged);
    }
    return {.action_rejected = report.action_rejected};
  }

  void hold(const Observation& observation, Action& action) noexcept {
    action = hold_position(observation);
    // Without these the fingers would sink until the position controller carries their weight.
    physics_.gravity_torques(action.torque);
  }

  // The observation is that of the period before: the last one of the session, or what the loop has
  // measured since.
  DriverReport stop(TimeIndex step) noexcept {
    Action action;
    if (!stop_.next(step, observation_, action)) return DriverReport::ready();
    if (step == 0 && has_safety_fault_) {
      // The fault of the session may not show again.
      stop_.give_up(step);
      action = {};
    }
    // What the position controller alone would sink under, as in `hold`.
    if (!std::isnan(action.position[0])) physics_.gravity_torques(action.torque);
    AppliedAction applied;
    const SafetyReport report =
        safety_.apply(action, observation_, options_.period, memory_.safety, applied);
    if (report.fault != SafetyFault::kNone) stop_.give_up(step);
    // What has diverged will not come to rest.
    return this->step(applied.torque) ? DriverReport::busy() : DriverReport::ready();
  }

  std::span<const CompanionDescription> companions() const noexcept {
    return {companion_.data(), num_objects() > 0 ? 1U : 0U};
  }

  bool get_companion_element(TimeIndex time_index, void* element) noexcept {
    // Steps count from the beginning of the session: holding does not.
    memory_.step = std::max<TimeIndex>(time_index, 0);
    if (time_index < 0) {
      // One pose before step 0, so that there is always one. In a session that goes on from a saved
      // state it is the one that was known there.
      if (std::exchange(has_initial_pose_, true)) return false;
      Pose& newest = pending_[pending_slot(pending_.size() - 1)];
      if (memory_.has_delivered == 0) {
        newest.when = {-1, -1};
        capture(newest);
        memory_.has_delivered = 1;
      }
      write_element({newest.when.capture_index, -1}, newest, element);
      return true;
    }
    if (time_index >= memory_.next_capture) {
      Pose& pose = pending_[pending_slot(memory_.pending_count)];
      pose.when = {time_index, time_index + options_.object_delay};
      capture(pose);
      ++memory_.pending_count;
      memory_.next_capture = time_index + options_.object_period;
    }
    if (memory_.pending_count == 0) return false;
    const Pose& oldest = pending_[pending_slot(0)];
    if (oldest.when.arrival_index > time_index) return false;
    write_element(oldest.when, oldest, element);
    memory_.pending_begin = pending_slot(1);
    --memory_.pending_count;
    memory_.has_delivered = 1;
    return true;
  }

  void reset(const Joints& position, std::uint64_t seed) noexcept {
    physics_.reset();
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      physics_.set_joint(static_cast<int>(i), position[i]);
    }
    const TimeIndex now = memory_.step;
    memory_ = {};
    random_ = Random(seed);
    move_to_step(now);
    begin_here();
  }
  [[nodiscard]] const Joints& initial_position() const noexcept { return begin_at_; }

  [[nodiscard]] Joints checked(const Joints& position) const {
    const auto& limits = safety_.limits();
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      require(position[i] >= limits.hard_lower[i] && position[i] <= limits.hard_upper[i],
              "joint " + std::to_string(i) + " cannot begin at " + text_of(position[i]) +
                  " rad, its hard limits are " + text_of(limits.hard_lower[i]) + " and " +
                  text_of(limits.hard_upper[i]) + " rad");
    }
    return position;
  }

  void place_object(const std::string& name, const ObjectPose& pose) {
    const ObjectAddress& object = physics_.model().object(name);
    ObjectPose placed = pose;
    double norm = 0.0;
    for (const double value : pose.orientation) norm += value * value;
    norm = std::sqrt(norm);
    constexpr double kSmallestNorm = 1e-6;
    bool is_pose = std::isfinite(norm) && norm > kSmallestNorm;
    for (const double value : pose.position) is_pose = is_pose && std::isfinite(value);
    require(is_pose, "object '" + name +
                         "' cannot be placed: its pose is not finite, or its "
                         "quaternion is zero");
    for (double& value : placed.orientation) value /= norm;
    physics_.place_object(object, placed);
    // What is under way shows where it was.
    memory_.pending_count = 0;
    memory_.has_delivered = 0;
    memory_.next_capture = memory_.step;
    begin_here();
  }

  void push_object(const std::string& name, const std::array<double, 3>& force) {
    const ObjectAddress& object = physics_.model().object(name);
    for (const double value : force) {
      require(std::isfinite(value), "the force on object '" + name + "' is not finite");
    }
    physics_.push_object(object, force);
  }

  [[nodiscard]] ObjectPose object_pose(const std::string& name) const {
    return physics_.object_pose(physics_.model().object(name));
  }

  [[nodiscard]] SimulationState save() const {
    SimulationState state(state_size());
    write_state(state);
    return state;
  }

  void restore(std::span<const std::byte> state) {
    Header header{};
    if (state.size() >= sizeof(header)) std::memcpy(&header, state.data(), sizeof(header));
    require(header.magic == kStateMagic,
            "this is not the saved state of a simulation, or one of another version");
    require(header.model == header_.model && state.size() == state_size(),
            "this state was saved from another model: another robot, other objects, or another "
            "object_period or object_delay");
    const TimeIndex now = memory_.step;
    read_state(state);
    // A damaged state must not lead out of the ring.
    memory_.pending_count = std::min(memory_.pending_count, pending_.size());
    move_to_step(now);
    begin_here();
  }

  [[nodiscard]] const SimulationState& state_before_divergence() const noexcept {
    return state_before_divergence_;
  }
  [[nodiscard]] const Options& options() const noexcept { return options_; }
  [[nodiscard]] const RobotModel& model() const noexcept { return physics_.model(); }
  [[nodiscard]] SafetyChain<R>& safety() noexcept { return safety_; }
  [[nodiscard]] std::vector<double> configuration() const { return physics_.configuration(); }

 private:
  // Begins every saved state.
  struct Header {
    std::uint64_t magic{0};
    std::uint64_t model{0};
  };

  // All poses of one instant.
  struct Pose {
    explicit Pose(std::size_t num_objects) : objects(num_objects) {}

    Capture when{};
    std::vector<ObjectPose> objects;
  };

  // What goes into a saved state besides the physics, the random numbers and the poses under way.
  struct Memory {
    SafetyState<R::kJoints> safety;
    Joints torque{};                           // delivered in the last step
    std::array<double, R::kTips> tip_force{};  // likewise
    TimeIndex step{0};                         // since the session began
    TimeIndex next_capture{0};
    std::size_t pending_begin{0};
    std::size_t pending_count{0};
    // 1 if the pose in front of the pending ones is known to the readers. A whole word: bytes
    // between members would make equal states differ.
    std::uint64_t has_delivered{0};
  };
  static_assert(std::is_trivially_copyable_v<Random> && std::is_trivially_copyable_v<Memory>);
  static_assert(sizeof(Memory) == sizeof(SafetyState<R::kJoints>) + sizeof(Joints) +
                                      sizeof(Memory::tip_force) + 5 * sizeof(std::uint64_t));

  [[nodiscard]] std::size_t num_objects() const noexcept {
    return physics_.model().objects().size();
  }
  [[nodiscard]] std::size_t pending_slot(std::size_t position) const noexcept {
    return (memory_.pending_begin + position) % pending_.size();
  }

  void observe() noexcept {
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      observation_.position[i] = physics_.position(static_cast<int>(i));
      observation_.velocity[i] = physics_.velocity(static_cast<int>(i));
    }
    observation_.torque = memory_.torque;
    observation_.tip_force = memory_.tip_force;
  }

  // The owner has put the robot somewhere: the next session begins here, and a session that goes on
  // must not judge its next action by what it saw before.
  void begin_here() noexcept {
    observe();
    write_state(begin_state_);
  }

  // Of the model and of what else decides the layout of a saved state (FNV-1a).
  [[nodiscard]] std::uint64_t fingerprint() const {
    std::uint64_t hash = 0xcbf29ce484222325;
    const auto add = [&hash](const auto* bytes, std::size_t size) {
      for (const std::byte byte : std::as_bytes(std::span(bytes, size))) {
        hash = (hash ^ std::to_integer<std::uint64_t>(byte)) * 0x100000001b3;
      }
    };
    const std::vector<std::byte> model = physics_.model_bytes();
    add(model.data(), model.size());
    add(&options_.object_period, 1);
    add(&options_.object_delay, 1);
    return hash;
  }

  [[nodiscard]] bool step(const Joints& torque) noexcept {
    ++memory_.step;
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      memory_.torque[i] =
          available_torque(actuator_, torque[i], physics_.velocity(static_cast<int>(i)));
    }
    const bool is_finite = physics_.step(memory_.torque);
    for (std::size_t finger = 0; finger < R::kTips; ++finger) {
      memory_.tip_force[finger] = physics_.tip_force(static_cast<int>(finger));
    }
    return is_finite;
  }

  void capture(Pose& pose) noexcept {
    for (std::size_t i = 0; i < pose.objects.size(); ++i) {
      ObjectPose& object = pose.objects[i];
      object = physics_.object_pose(physics_.model().objects()[i]);
      std::normal_distribution<double> normal;
      if (options_.object_position_noise > 0.0) {
        for (double& value : object.position)
          value += options_.object_position_noise * normal(random_);
      }
      if (options_.object_orientation_noise > 0.0) {
        std::array<double, 3> rotation{};
        for (double& value : rotation) value = options_.object_orientation_noise * normal(random_);
        rotate(object.orientation, rotation);
      }
    }
  }

  static void write_element(const Capture& when, const Pose& pose, void* element) noexcept {
    const Stamp stamp{.arrival_index = when.arrival_index, .capture_index = when.capture_index};
    auto* target = static_cast<std::byte*>(element);
    std::memcpy(target, &stamp, sizeof(stamp));
    std::memcpy(target + sizeof(stamp), pose.objects.data(),
                pose.objects.size() * sizeof(ObjectPose));
  }

  // Indices in the memory count from the beginning of the session: a state that was saved at step n
  // goes on at `step`.
  void move_to_step(TimeIndex step) noexcept {
    const TimeIndex offset = step - std::exchange(memory_.step, step);
    memory_.next_capture += offset;
    for (Pose& pose : pending_) {
      pose.when.capture_index += offset;
      pose.when.arrival_index += offset;
    }
  }

  // A saved state: header, physics, random numbers, memory, poses under way.
  [[nodiscard]] std::size_t state_size() const noexcept {
    return sizeof(Header) + physics_.state_size() * sizeof(double) + sizeof(Random) +
           sizeof(Memory) +
           pending_.size() * (sizeof(Capture) + num_objects() * sizeof(ObjectPose));
  }

  void write_state(std::span<std::byte> state) const noexcept {
    physics_.get_state(scratch());
    write_state(state, scratch(), memory_);
  }

  void write_state(std::span<std::byte> state, std::span<const double> physics,
                   const Memory& memory) const noexcept {
    std::byte* target = state.data();
    const auto write = [&target](const void* source, std::size_t size) {
      // Without objects there is nothing to copy, from no address.
      if (size > 0) std::memcpy(target, source, size);
      target += size;
    };
    write(&header_, sizeof(header_));
    write(physics.data(), physics.size_bytes());
    write(&random_, sizeof(random_));
    write(&memory, sizeof(memory));
    for (const Pose& pose : pending_) {
      write(&pose.when, sizeof(pose.when));
      write(pose.objects.data(), pose.objects.size() * sizeof(ObjectPose));
    }
  }

  void read_state(std::span<const std::byte> state) noexcept {
    const std::byte* source = state.data() + sizeof(Header);
    const auto read = [&source](void* target, std::size_t size) {
      // Without objects there is nothing to copy, from no address.
      if (size > 0) std::memcpy(target, source, size);
      source += size;
    };
    read(scratch().data(), scratch().size_bytes());
    physics_.set_state(scratch());
    read(&random_, sizeof(random_));
    read(&memory_, sizeof(memory_));
    for (Pose& pose : pending_) {
      read(&pose.when, sizeof(pose.when));
      read(pose.objects.data(), pose.objects.size() * sizeof(ObjectPose));
    }
  }

  void keep_state_before_divergence() noexcept {
    // No memory is taken here: this runs in the loop.
    if (state_before_divergence_.empty()) state_before_divergence_.swap(spare_state_);
    physics_.get_state_before_step(scratch());
    write_state(state_before_divergence_, scratch(), memory_before_step_);
  }

  [[nodiscard]] std::span<double> scratch() const noexcept { return scratch_; }

  Options options_;
  ActuatorParameters actuator_;
  sim::Physics physics_;
  SafetyChain<R> safety_;
  OrderlyStop<R> stop_;
  bool has_safety_fault_{false};  // the chain has ended the session
  std::array<CompanionDescription, 1> companion_;
  Joints begin_at_{};
  Header header_{.magic = kStateMagic, .model = fingerprint()};

  Memory memory_;
  Random random_;
  std::vector<Pose> pending_;  // a ring, with the newest pose that has been delivered in front
  Observation observation_;    // the newest one, which the safety chain looks at
  bool has_initial_pose_{false};

  SimulationState begin_state_;
  Memory memory_before_step_;
  SimulationState state_before_divergence_;
  SimulationState spare_state_;  // memory for the one above
  mutable std::vector<double> scratch_ = std::vector<double>(physics_.state_size());
};

template <class R>
SimulatedRobot<R>::SimulatedRobot(Options options)
    : implementation_(std::make_unique<Implementation>(std::move(options))) {}
template <class R>
SimulatedRobot<R>::~SimulatedRobot() = default;

template <class R>
DriverReport SimulatedRobot<R>::prepare(TimeIndex) noexcept {
  return implementation_->prepare();
}
template <class R>
DriverReport SimulatedRobot<R>::get_latest_observation(Observation& observation) noexcept {
  return implementation_->get_latest_observation(observation);
}
template <class R>
DriverReport SimulatedRobot<R>::apply_action(const Action& desired,
                                             AppliedAction& applied) noexcept {
  return implementation_->apply_action(desired, applied);
}
template <class R>
void SimulatedRobot<R>::hold(const Observation& observation, Action& action) noexcept {
  implementation_->hold(observation, action);
}
template <class R>
DriverReport SimulatedRobot<R>::stop(TimeIndex step) noexcept {
  return implementation_->stop(step);
}
template <class R>
std::span<const CompanionDescription> SimulatedRobot<R>::companions() const noexcept {
  return implementation_->companions();
}
template <class R>
bool SimulatedRobot<R>::get_companion_element(std::size_t, TimeIndex time_index,
                                              void* element) noexcept {
  return implementation_->get_companion_element(time_index, element);
}
template <class R>
std::string_view SimulatedRobot<R>::fault_text(std::int32_t fault_code) const noexcept {
  if (fault_code == kDiverged) return "the simulation diverged";
  return fault_text_of(fault_code);
}
template <class R>
auto SimulatedRobot<R>::options() const noexcept -> const Options& {
  return implementation_->options();
}
template <class R>
const RobotModel& SimulatedRobot<R>::model() const noexcept {
  return implementation_->model();
}
template <class R>
SafetyChain<R>& SimulatedRobot<R>::safety() noexcept {
  return implementation_->safety();
}
template <class R>
auto SimulatedRobot<R>::initial_position() const noexcept -> const Joints& {
  return implementation_->initial_position();
}
template <class R>
void SimulatedRobot<R>::reset() {
  implementation_->reset(initial_position(), options().seed);
}
template <class R>
void SimulatedRobot<R>::reset(const Joints& position, std::uint64_t seed) {
  implementation_->reset(implementation_->checked(position), seed);
}
template <class R>
void SimulatedRobot<R>::place_object(const std::string& name, const ObjectPose& pose) {
  implementation_->place_object(name, pose);
}

template <class R>
void SimulatedRobot<R>::push_object(const std::string& name, const std::array<double, 3>& force) {
  implementation_->push_object(name, force);
}
template <class R>
ObjectPose SimulatedRobot<R>::object_pose(const std::string& name) const {
  return implementation_->object_pose(name);
}
template <class R>
SimulationState SimulatedRobot<R>::save() const {
  return implementation_->save();
}
template <class R>
void SimulatedRobot<R>::restore(std::span<const std::byte> state) {
  implementation_->restore(state);
}
template <class R>
const SimulationState& SimulatedRobot<R>::state_before_divergence() const noexcept {
  return implementation_->state_before_divergence();
}
template <class R>
std::vector<double> SimulatedRobot<R>::configuration() const {
  return implementation_->configuration();
}

template JointLimits<TriFinger::kJoints> default_limits<TriFinger>(const RobotDescription&);
template JointLimits<Finger::kJoints> default_limits<Finger>(const RobotDescription&);
template struct SimulationOptions<TriFinger>;
template struct SimulationOptions<Finger>;
template class SimulatedRobot<TriFinger>;
template class SimulatedRobot<Finger>;

}  // namespace trifinger
