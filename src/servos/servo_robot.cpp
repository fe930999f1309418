// SPDX-License-Identifier: BSD-3-Clause
#include "servos/servo_robot.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/joint/reasons.hpp"

namespace trifinger::servos {
namespace {

using dynamixel::MotorReading;
using trifinger::detail::require;
using trifinger::detail::text_of;
using MotorPhase = dynamixel::MotorSnapshot::Phase;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<double, 2> kNoRange{-detail::kNoLimit, detail::kNoLimit};

constexpr std::int32_t with_joint(std::int32_t code, std::size_t joint) noexcept {
  return code + (static_cast<std::int32_t>(joint + 1) << 8);
}

void check(const Servo& servo, const std::string& name) {
  require(servo.direction == 1.0 || servo.direction == -1.0,
          text_of("direction of ", name, " is ", servo.direction, ", must be 1 or -1"));
  // The comparisons are written so that NaN fails.
  require(servo.ratio > 0.0 && servo.ratio <= 1e6,
          text_of("ratio of ", name, " is ", servo.ratio, ", must be above 0"));
  require(std::abs(servo.zero) <= 1e3,
          text_of("zero of ", name, " is ", servo.zero, " rad, must be within 1000 rad"));
  require(servo.torque_constant > 0.0 && servo.torque_constant <= 1e3,
          text_of("torque_constant of ", name, " is ", servo.torque_constant,
                  " Nm/A, must be above 0"));
}

// A motor that is switched on, or starts again, knows its angle within one turn only.
void require_one_turn(const Servo& servo, const std::array<double, 2>& range,
                      const std::string& name) {
  for (const double end : range) {
    const double angle = servo.motor_position(end);
    // Written so that NaN fails.
    require(std::abs(angle) <= std::numbers::pi,
            text_of("the motor of ", name, " is at ", angle, " rad where the joint is at ", end,
                    ", must be within -pi and pi: a motor that is switched on knows its angle "
                    "within one turn only, so the joint would seem to be somewhere else; correct "
                    "ratio and zero, or narrow the hard limits of the joint"));
  }
}

// True if a turn of the motor is whole turns of the joint, whose direction is then known.
bool has_whole_turns(const Servo& servo) noexcept {
  const double turns = 1.0 / servo.ratio;
  return turns == std::round(turns);
}

// The currents of the motors limit the torques, too, and an applied action must say what applies.
std::vector<JointLimit> limits_of(const ServoRobotOptions& options) {
  std::vector<JointLimit> limits = options.limits;
  for (std::size_t i = 0; i < limits.size(); ++i) {
    const Servo& servo = options.motors[i];
    const double most = std::abs(servo.joint_torque(options.max_current * servo.torque_constant));
    limits[i].max_torque = std::min(limits[i].max_torque, most);
  }
  return limits;
}

void check_reset(const ServoRobotOptions& options) {
  const auto& reset = options.reset;
  const std::size_t count = options.names.size();
  for (const std::size_t joint : reset.first) {
    require(joint < count, "reset.first has a joint that is not there");
  }
  for (const auto& [joint, position] : reset.untangle) {
    require(joint < count, "reset.untangle has a joint that is not there");
    const JointLimit& limit = options.limits[joint];
    require(position >= limit.soft_lower && position <= limit.soft_upper,
            text_of("reset.untangle of ", options.names[joint], " is ", position,
                    ", its soft limits are ", limit.soft_lower, " and ", limit.soft_upper));
  }
  require(reset.tolerance > 0.0,
          text_of("reset.tolerance is ", reset.tolerance, ", must be above 0"));
  require(reset.attempts >= 0, "reset.attempts is negative");
  for (const Nanoseconds time :
       {reset.first_time, reset.move_time, reset.settle_time, reset.release_time}) {
    require(time >= Nanoseconds::zero(), "a time of the reset is negative");
  }
}

}  // namespace

void ServoRobotOptions::validate() const {
  const std::size_t count = names.size();
  require(count > 0 && count + sensors.size() <= dynamixel::kMaxMotors,
          text_of("a robot has ", count, " joints and ", sensors.size(),
                  " sensors on one bus, must be 1 to ", dynamixel::kMaxMotors, " together"));
  validate_joints(motors.size());
  for (std::size_t i = 0; i < count; ++i) {
    check(motors[i], names[i]);
    const JointLimit& limit = limits[i];
    require_one_turn(motors[i], {limit.hard_lower, limit.hard_upper}, names[i]);
  }
  require(sensor_ranges.empty() || sensor_ranges.size() == sensors.size(),
          text_of("there are ", sensor_ranges.size(), " ranges for ", sensors.size(),
                  " sensors, must be one each"));
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    const std::string name = text_of("sensor ", int{sensors[i].id});
    check(sensors[i], name);
    if (has_whole_turns(sensors[i])) continue;
    require_one_turn(sensors[i],
                     sensor_ranges.empty() ? kNoRange : sensor_ranges[i].value_or(kNoRange), name);
  }
  std::set<dynamixel::MotorId> ids;
  for (const auto* const servos : {&motors, &sensors}) {
    for (const Servo& servo : *servos) {
      require(ids.insert(servo.id).second, text_of("motor ", int{servo.id}, " is named twice"));
    }
  }
  for (const auto& source : all_joints) {
    require(!source || *source < count + sensors.size(),
            "a joint is measured by a motor that is not there");
  }
  const bool may_be_infinite = mode == ServoMode::kPosition && std::isinf(max_current);
  require(max_current > 0.0 && (max_current <= 20.0 || may_be_infinite),
          text_of("max_current is ", max_current,
                  " A, must be above 0 and at most 20, or infinite in the mode position"));
  check_reset(*this);
  stop.validate(limits_of(*this));
}

dynamixel::MotorGroupOptions group_options(const ServoRobotOptions& options,
                                           dynamixel::MotorGroupOptions rest) {
  rest.ids.clear();
  rest.sensors.clear();
  rest.models.clear();
  for (const Servo& motor : options.motors) rest.ids.push_back(motor.id);
  for (const Servo& sensor : options.sensors) rest.sensors.push_back(sensor.id);
  for (const auto* const servos : {&options.motors, &options.sensors}) {
    for (const Servo& servo : *servos) rest.models.push_back(servo.model);
  }
  // A motor that follows positions must not be stronger than it is allowed to be.
  rest.mode = options.mode == ServoMode::kTorque ? dynamixel::OperatingMode::kCurrent
              : std::isinf(options.max_current)  ? dynamixel::OperatingMode::kPosition
                                                 : dynamixel::OperatingMode::kCurrentBasedPosition;
  rest.max_current = options.max_current;
  return rest;
}

ServoRobot::ServoRobot(Options options, std::unique_ptr<dynamixel::MotorLink> motors)
    : CountedDriver((options.validate(), options), limits_of(options)),
      options_(std::move(options)),
      link_(std::move(motors)),
      begin_(num_joints(), 0.0),
      target_(num_joints(), kNan),
      goals_(num_joints(), 0.0),
      desired_(num_joints()) {
  require(link_ != nullptr, "a robot on motors needs motors, but got none");
  // A motor that follows positions finds its torque by itself.
  if (options_.mode == ServoMode::kPosition) weight_ = nullptr;
}

ServoRobot::~ServoRobot() = default;

bool ServoRobot::refresh(std::int32_t& code) noexcept {
  static_cast<void>(link_->read(snapshot_));
  if (snapshot_.request >= request_ && snapshot_.phase == MotorPhase::kFailed) {
    const dynamixel::MotorId motor = snapshot_.fault.motor;
    const auto* const found = std::ranges::find(
        options_.motors.data(), options_.motors.data() + num_joints(), motor, &Servo::id);
    const auto joint = static_cast<std::size_t>(found - options_.motors.data());
    const bool has_joint = joint < num_joints() &&
                           snapshot_.fault.kind != dynamixel::MotorFault::kNone &&
                           snapshot_.fault.kind != dynamixel::MotorFault::kLineGone;
    FixedText text(has_joint ? chain_.name(joint) : std::string_view());
    if (has_joint) text.append(": ");
    chain_.set_fault_text(text.append(snapshot_.failure.view()));
    code = has_joint ? with_joint(kMotorFault, joint) : kMotorFault;
    return false;
  }
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const MotorReading& reading = snapshot_.readings[i];
    const Servo& servo = options_.motors[i];
    observation_.position[i] = servo.joint_position(reading.position);
    observation_.velocity[i] = servo.joint_velocity(reading.velocity);
    observation_.torque[i] = servo.joint_torque(reading.current * servo.torque_constant);
  }
  set_unmeasured_torques(0.0);
  copy_to_all_joints();
  for (std::size_t i = 0; i < all_positions_.size(); ++i) {
    const auto& source = options_.all_joints[i];
    if (!source || *source < num_joints()) continue;
    const MotorReading& reading = snapshot_.readings[*source];
    const Servo& servo = options_.sensors[*source - num_joints()];
    all_positions_[i] = servo.joint_position(reading.position);
    all_velocities_[i] = servo.joint_velocity(reading.velocity);
  }
  return true;
}

void ServoRobot::set_unmeasured_torques(double torque) noexcept {
  for (std::size_t i = 0; i < num_joints(); ++i) {
    if (std::isnan(snapshot_.readings[i].current)) observation_.torque[i] = torque;
  }
}

// How far a joint is from its initial position.
double ServoRobot::distance(std::size_t joint) const noexcept {
  return std::abs(observation_.position[joint] - options_.initial_position[joint]);
}

std::optional<std::size_t> ServoRobot::find_astray() const noexcept {
  for (std::size_t i = 0; i < num_joints(); ++i) {
    if (!(distance(i) <= options_.reset.tolerance)) return i;
  }
  return std::nullopt;
}

void ServoRobot::begin(Phase phase) noexcept {
  phase_ = phase;
  phase_steps_ = 0;
  begin_ = observation_.position;
  target_ = PerJoint<double>(num_joints(), kNan);
  switch (phase) {
    case Phase::kFirst:
      for (const std::size_t joint : options_.reset.first) {
        target_[joint] = options_.initial_position[joint];
      }
      return;
    case Phase::kAll:
    case Phase::kSettling:
      std::ranges::copy(options_.initial_position, target_.begin());
      return;
    case Phase::kUntangling:
      for (const auto& [joint, position] : options_.reset.untangle) target_[joint] = position;
      return;
    case Phase::kStarting:
    case Phase::kReleased:
      return;
  }
}

// Drives the joints that have a target; `part` is how much of their way they should have made.
DriverReport ServoRobot::drive_towards(double part) noexcept {
  desired_ = CountedAction(num_joints());
  write_weight(observation_.position, desired_.torque);
  const double way = trifinger::detail::smooth(std::clamp(part, 0.0, 1.0));
  for (std::size_t i = 0; i < num_joints(); ++i) {
    if (std::isnan(target_[i])) {
      desired_.torque[i] = 0.0;
    } else {
      desired_.position[i] = begin_[i] + way * (target_[i] - begin_[i]);
    }
  }
  const DriverReport report = apply(desired_);
  for (std::size_t i = 0; i < num_joints(); ++i) {
    // A motor that follows positions has no torque where it is.
    if (std::isnan(target_[i])) goals_[i] = observation_.position[i];
  }
  send();
  return report.state == DriverReport::State::kReady ? DriverReport::busy() : report;
}

DriverReport ServoRobot::try_again() noexcept {
  const std::optional<std::size_t> astray = find_astray();
  if (!astray) return DriverReport::ready();
  if (attempts_ >= options_.reset.attempts) {
    FixedText text(chain_.name(*astray));
    text.append(" is ")
        .append(distance(*astray))
        .append(
            " from its initial position and does not reach it; free the fingers by hand, check "
            "that "
            "nothing is in their way, then recover");
    chain_.set_fault_text(text);
    return DriverReport::fault(with_joint(kNotAtStart, *astray));
  }
  ++attempts_;
  begin(Phase::kReleased);
  return DriverReport::busy();
}

DriverReport ServoRobot::move() noexcept {
  const ResetOptions& reset = options_.reset;
  const auto part = [this](Nanoseconds duration) {
    if (duration <= Nanoseconds::zero()) return 1.0;
    return static_cast<double>(phase_steps_) * static_cast<double>(options_.period.count()) /
           static_cast<double>(duration.count());
  };
  ++phase_steps_;
  double done = 0.0;
  Phase next = Phase::kAll;
  switch (phase_) {
    case Phase::kStarting:
      return DriverReport::busy();
    case Phase::kFirst:
      done = part(reset.first_time);
      next = Phase::kAll;
      break;
    case Phase::kAll:
      done = part(reset.move_time);
      next = Phase::kSettling;
      break;
    case Phase::kSettling: {
      const DriverReport report = drive_towards(1.0);
      if (report.state != DriverReport::State::kBusy) return report;
      if (!find_astray()) return DriverReport::ready();
      return part(reset.settle_time) < 1.0 ? report : try_again();
    }
    case Phase::kReleased:
      done = part(reset.release_time);
      next = reset.untangle.empty() ? Phase::kFirst : Phase::kUntangling;
      break;
    case Phase::kUntangling:
      done = part(reset.first_time);
      next = Phase::kFirst;
      break;
  }
  const DriverReport report = drive_towards(done);
  if (report.state == DriverReport::State::kBusy && done >= 1.0) begin(next);
  return report;
}

DriverReport ServoRobot::prepare(TimeIndex step) noexcept {
  has_fault_ = false;
  if (step == 0) {
    phase_ = Phase::kStarting;
    attempts_ = 0;
    is_running_ = false;
    chain_.forget();
    request_ = link_->request_start();
    may_have_torque_ = true;
  }
  std::int32_t code = 0;
  if (!refresh(code)) return DriverReport::fault(code);
  if (snapshot_.request < request_ || snapshot_.phase != MotorPhase::kRunning) {
    return DriverReport::busy();
  }
  if (phase_ == Phase::kStarting) {
    is_running_ = true;
    lost_before_ = snapshot_.counts.missing;
    goals_ = observation_.position;
    if (!find_astray()) return DriverReport::ready();
    begin(options_.reset.first.empty() ? Phase::kAll : Phase::kFirst);
  }
  const DriverReport report = move();
  if (report.state == DriverReport::State::kFault) release();
  return report;
}

void ServoRobot::release() noexcept {
  is_running_ = may_have_torque_ = false;
  request_ = link_->request_release();
}

DriverReport ServoRobot::get_latest_observation(void* observation) noexcept {
  std::int32_t code = 0;
  const bool is_fine = refresh(code);
  // A user must not take it for a measurement; the safety chain takes no NaN.
  set_unmeasured_torques(kNan);
  write_observation(observation);
  set_unmeasured_torques(0.0);
  if (!is_fine) return DriverReport::fault(code);
  Instant oldest = link_->now();
  const Instant now = oldest;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    oldest = std::min(oldest, snapshot_.readings[i].measured);
  }
  const std::uint64_t lost = snapshot_.counts.missing - lost_before_;
  return {.measurement_age = (now - oldest).count(),
          .lost_frames = static_cast<std::uint32_t>(
              std::min<std::uint64_t>(lost, std::numeric_limits<std::uint32_t>::max()))};
}

bool ServoRobot::refuse_torques(FixedText& refusal) noexcept {
  if (options_.mode != ServoMode::kPosition) return false;
  bool has_refused = false;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const JointLimit& limit = chain_.limits()[i];
    const auto is_usual = [](double gain, double usual) {
      return std::isnan(gain) || gain == usual;
    };
    const char* field = nullptr;
    double value = 0.0;
    if (desired_.torque[i] != 0.0) {
      field = "torque";
      value = desired_.torque[i];
    } else if (!is_usual(desired_.position_kp[i], limit.default_kp)) {
      field = "position_kp";
      value = desired_.position_kp[i];
    } else if (!is_usual(desired_.position_kd[i], limit.default_kd)) {
      field = "position_kd";
      value = desired_.position_kd[i];
    }
    if (field == nullptr) continue;
    // The chain rejects it, so that the joint holds its last accepted position.
    desired_.torque[i] = kNan;
    if (has_refused) continue;
    has_refused = true;
    refusal = FixedText(field);
    refusal.append(" of joint ").append(i).append(" (").append(chain_.name(i)).append(") is ");
    refusal.append(value).append(
        ", but its motor follows positions with its own gains (dynamixel.mode: position), so "
        "torque must be 0 and gains must not be given");
  }
  return has_refused;
}

DriverReport ServoRobot::apply_action(const void* desired, void* applied) noexcept {
  read_element(desired, desired_);
  FixedText refusal;
  const bool has_refused = refuse_torques(refusal);
  const DriverReport report = apply(desired_);
  has_fault_ = report.state == DriverReport::State::kFault;
  if (has_refused) chain_.set_rejection_text(refusal);
  send();
  write_element(chain_.applied(), applied);
  return report;
}

// Moves a goal towards the position that the chain allows, not faster than the joint may be.
void ServoRobot::limit_goal(std::size_t joint) noexcept {
  CountedAppliedAction& applied = chain_.applied();
  double wanted = applied.position[joint];
  if (has(applied.reasons[joint], Reason::kBraking)) wanted = observation_.position[joint];
  if (!std::isnan(wanted)) {
    const double longest = chain_.limits()[joint].max_velocity *
                           std::chrono::duration<double>(options_.period).count();
    const double goal = std::clamp(wanted, goals_[joint] - longest, goals_[joint] + longest);
    if (goal != wanted) applied.reasons[joint] |= bit(Reason::kTooFast);
    goals_[joint] = goal;
  }
  applied.torque[joint] = 0.0;
  applied.position[joint] = goals_[joint];
}

void ServoRobot::send() noexcept {
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const Servo& servo = options_.motors[i];
    if (options_.mode == ServoMode::kTorque) {
      sent_[i] = servo.motor_torque(chain_.applied().torque[i]) / servo.torque_constant;
    } else {
      limit_goal(i);
      sent_[i] = servo.motor_position(goals_[i]);
    }
  }
  link_->set_goals(std::span(sent_).first(num_joints()));
}

DriverReport ServoRobot::stop(TimeIndex step) noexcept {
  std::int32_t code = 0;
  // What has happened is reported already; the motors are without torque then.
  const bool is_fine = is_running_ && refresh(code) && snapshot_.phase == MotorPhase::kRunning;
  if (is_fine && apply_stop(step, [] { return false; })) {
    send();
    return DriverReport::busy();
  }
  // Also motors that are only being set up: they would get torque after the end.
  if (may_have_torque_) release();
  static_cast<void>(link_->read(snapshot_));
  return snapshot_.request < request_ ? DriverReport::busy() : DriverReport::ready();
}

}  // namespace trifinger::servos
