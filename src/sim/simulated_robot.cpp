// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/simulated_robot.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <type_traits>
#include <utility>

#include "physics.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

constexpr Nanoseconds kPhysicsStep = std::chrono::milliseconds(1);

// The user's bounds on gains are ours, no source has any: well inside what is stable at 1 kHz for the lightest link.
constexpr double kMaxKp = 50.0;
constexpr double kMaxKd = 0.5;

// How long the robot brakes at the end of a session before it is released.
constexpr TimeIndex kStopSteps = 200;

// Begins every saved state: another version or model is told apart from this one.
constexpr std::uint64_t kStateMagic = 0x31534d4953465254;  // "TRFSIMS1"

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
  }
  return limits;
}

template <class R>
void SimulationOptions<R>::validate() const {
  trifinger::validate(description);
  const auto used = limits ? *limits : default_limits<R>(description);
  require(num_joints(description) == static_cast<int>(R::kJoints),
          "a robot of type '" + std::string(R::kType) + "' has " + std::to_string(R::kJoints) +
              " joints, this description has " + std::to_string(num_joints(description)));
  used.validate();
  require(period >= kPhysicsStep && period % kPhysicsStep == Nanoseconds::zero(),
          "period is " + std::to_string(period.count()) +
              " ns, must be a whole number of milliseconds");
  require(object_period >= 1,
          "object_period is " + std::to_string(object_period) + " steps, must be at least 1");
  constexpr TimeIndex kMaxDelay = 100000;
  require(object_delay >= 0 && object_delay <= kMaxDelay,
          "object_delay is " + std::to_string(object_delay) + " steps, must be 0 to " +
              std::to_string(kMaxDelay));
  for (const auto& [name, noise] : {std::pair{"object_position_noise", object_position_noise},
                                    std::pair{"object_orientation_noise", object_orientation_noise}}) {
    require(std::isfinite(noise) && noise >= 0.0,
            std::string(name) + " is " + std::to_string(noise) + ", must be at least 0");
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
        companion_{CompanionDescription{.name = "object",
                                        .type = "object_observation",
                                        .element = describe_objects(physics_.model())}},
        pending_(static_cast<std::size_t>(options_.object_delay / options_.object_period) + 2,
                 Pose(num_objects())),
        before_step_(physics_.state_size()) {
    begin_at_ = Joints{};
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      begin_at_[i] = physics_.model().initial_position()[i];
    }
    if (options_.initial_position) begin_at_ = checked(*options_.initial_position);
    reset(begin_at_, options_.seed);
    begin_state_.resize(state_size());
  }

  DriverReport prepare() noexcept {
    // A session begins where the owner has put the robot, or where the session before began.
    if (has_moved_) {
      read_state(begin_state_);
    } else {
      write_state(begin_state_);
    }
    has_moved_ = false;
    shift_to_step_zero();
    has_initial_pose_ = false;
    return DriverReport::ready();
  }

  DriverReport get_latest_observation(Observation& observation) noexcept {
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      observation.position[i] = physics_.position(static_cast<int>(i));
      observation.velocity[i] = physics_.velocity(static_cast<int>(i));
    }
    observation.torque = memory_.torque;
    observation.tip_force = memory_.tip_force;
    observation_ = observation;
    return DriverReport::ready();
  }

  DriverReport apply_action(const Action& desired, AppliedAction& applied) noexcept {
    memory_before_step_ = memory_;
    physics_.get_state(before_step_);
    const SafetyReport report = safety_.apply(desired, observation_, memory_.safety, applied);
    if (report.fault != SafetyFault::kNone) {
      return DriverReport::fault(static_cast<std::int32_t>(report.fault));
    }
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

  DriverReport stop(TimeIndex count) noexcept {
    if (count >= kStopSteps) return DriverReport::ready();
    Joints torque{};
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      const double velocity = physics_.velocity(static_cast<int>(i));
      const auto& limits = safety_.limits();
      const double brake = -limits.safety_kd[i] * velocity;
      torque[i] = std::clamp(brake, -limits.max_torque[i], limits.max_torque[i]);
      // Diverged: there is nothing left to bring to rest.
      if (!std::isfinite(torque[i])) return DriverReport::ready();
    }
    return step(torque) ? DriverReport::busy() : DriverReport::ready();
  }

  std::span<const CompanionDescription> companions() const noexcept {
    return {companion_.data(), num_objects() > 0 ? 1U : 0U};
  }

  bool get_companion_element(TimeIndex time_index, void* element) noexcept {
    // Steps count from the beginning of the session: holding does not.
    memory_.step = std::max<TimeIndex>(time_index, 0);
    if (time_index < 0) {
      // One pose before step 0, so that there is always one.
      if (std::exchange(has_initial_pose_, true)) return false;
      Pose& pose = pending_[pending_slot(memory_.pending_count)];
      capture(pose);
      write_element({-1, -1}, pose, element);
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
    return true;
  }

  void reset(const Joints& position, std::uint64_t seed) noexcept {
    physics_.reset();
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      physics_.set_joint(static_cast<int>(i), position[i]);
    }
    memory_ = {};
    random_.seed(seed);
    has_moved_ = false;
  }
  void reset() noexcept { reset(begin_at_, options_.seed); }

  [[nodiscard]] Joints checked(const Joints& position) const {
    const auto& limits = safety_.limits();
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      require(position[i] >= limits.hard_lower[i] && position[i] <= limits.hard_upper[i],
              "joint " + std::to_string(i) + " cannot begin at " + std::to_string(position[i]) +
                  " rad, its hard limits are " + std::to_string(limits.hard_lower[i]) + " and " +
                  std::to_string(limits.hard_upper[i]));
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
    require(is_pose, "object '" + name + "' cannot be placed: its pose is not finite, or its "
                     "quaternion is zero");
    for (double& value : placed.orientation) value /= norm;
    physics_.place_object(object, placed);
    has_moved_ = false;
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
    std::uint64_t magic = 0;
    if (state.size() >= sizeof(magic)) std::memcpy(&magic, state.data(), sizeof(magic));
    require(magic == kStateMagic, "this is not the saved state of a simulation, or one of another version");
    require(state.size() == state_size(),
            "the saved state has " + std::to_string(state.size()) + " bytes, this simulation's has " +
                std::to_string(state_size()) + ": it was saved from another model");
    read_state(state);
    has_moved_ = false;
  }

  [[nodiscard]] const SimulationState& state_before_divergence() const noexcept {
    return state_before_divergence_;
  }
  [[nodiscard]] const Options& options() const noexcept { return options_; }
  [[nodiscard]] const RobotModel& model() const noexcept { return physics_.model(); }
  [[nodiscard]] SafetyChain<R>& safety() noexcept { return safety_; }
  [[nodiscard]] std::vector<double> configuration() const { return physics_.configuration(); }

 private:
  // All poses of one instant.
  struct Pose {
    explicit Pose(std::size_t num_objects) : objects(num_objects) {}

    Capture when{};
    std::vector<ObjectPose> objects;
  };

  // What goes into a saved state besides the physics, the random numbers and the poses under way.
  struct Memory {
    SafetyState<R::kJoints> safety;
    Joints torque{};                             // delivered in the last step
    std::array<double, R::kTips> tip_force{};    // likewise
    TimeIndex step{0};                           // since the session began
    TimeIndex next_capture{0};
    std::size_t pending_begin{0};
    std::size_t pending_count{0};
  };
  using Random = std::mt19937_64;
  static_assert(std::is_trivially_copyable_v<Random> && std::is_trivially_copyable_v<Memory>);

  [[nodiscard]] std::size_t num_objects() const noexcept { return physics_.model().objects().size(); }
  [[nodiscard]] std::size_t pending_slot(std::size_t position) const noexcept {
    return (memory_.pending_begin + position) % pending_.size();
  }

  [[nodiscard]] bool step(const Joints& torque) noexcept {
    has_moved_ = true;
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
        for (double& value : object.position) value += options_.object_position_noise * normal(random_);
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
    std::memcpy(target + sizeof(stamp), pose.objects.data(), pose.objects.size() * sizeof(ObjectPose));
  }

  // Indices in the memory count from the beginning of the session: a state that was saved at step n goes on at 0.
  void shift_to_step_zero() noexcept {
    const TimeIndex offset = std::exchange(memory_.step, 0);
    memory_.next_capture -= offset;
    for (Pose& pose : pending_) {
      pose.when.capture_index -= offset;
      pose.when.arrival_index -= offset;
    }
  }

  // A saved state: magic, physics, random numbers, memory, poses under way.
  [[nodiscard]] std::size_t state_size() const noexcept {
    return sizeof(kStateMagic) + physics_.state_size() * sizeof(double) + sizeof(Random) +
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
      std::memcpy(target, source, size);
      target += size;
    };
    write(&kStateMagic, sizeof(kStateMagic));
    write(physics.data(), physics.size_bytes());
    write(&random_, sizeof(random_));
    write(&memory, sizeof(memory));
    for (const Pose& pose : pending_) {
      write(&pose.when, sizeof(pose.when));
      write(pose.objects.data(), pose.objects.size() * sizeof(ObjectPose));
    }
  }

  void read_state(std::span<const std::byte> state) noexcept {
    const std::byte* source = state.data() + sizeof(kStateMagic);
    const auto read = [&source](void* target, std::size_t size) {
      std::memcpy(target, source, size);
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

  // Off the fast path of a robot that goes on: the session ends here.
  void keep_state_before_divergence() noexcept {
    try {
      state_before_divergence_.resize(state_size());
      write_state(state_before_divergence_, before_step_, memory_before_step_);
    } catch (...) {
      state_before_divergence_.clear();
    }
  }

  [[nodiscard]] std::span<double> scratch() const noexcept { return scratch_; }

  Options options_;
  ActuatorParameters actuator_;
  sim::Physics physics_;
  SafetyChain<R> safety_;
  std::array<CompanionDescription, 1> companion_;
  Joints begin_at_{};

  Memory memory_;
  Random random_;
  std::vector<Pose> pending_;  // a ring
  Observation observation_;    // the newest one, which the safety chain looks at
  bool has_moved_{false};
  bool has_initial_pose_{false};

  SimulationState begin_state_;
  std::vector<double> before_step_;
  Memory memory_before_step_;
  SimulationState state_before_divergence_;
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
DriverReport SimulatedRobot<R>::apply_action(const Action& desired, AppliedAction& applied) noexcept {
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
  return describe(static_cast<SafetyFault>(fault_code));
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
void SimulatedRobot<R>::reset() {
  implementation_->reset();
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
