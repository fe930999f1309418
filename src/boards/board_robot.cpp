// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/boards/board_robot.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>

#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"

namespace trifinger::boards {
namespace {

using trifinger::detail::require;
using trifinger::detail::text_of;

double seconds(Nanoseconds time) noexcept { return std::chrono::duration<double>(time).count(); }

struct TroubleText {
  std::string_view sentence;  // after the name of the board
  std::string_view remedy;
};

TroubleText text_of_trouble(Trouble trouble) noexcept {
  switch (trouble) {
    case Trouble::kInterfaceDown:
      return {"its CAN interface is down",
              "bring it up ('ip link set INTERFACE up'), then recover"};
    case Trouble::kInterfaceGone:
      return {"its CAN interface was removed", "plug it in, then start the robot again"};
    case Trouble::kBusOff:
      return {"the CAN controller has left the bus after too many errors",
              "check cable and termination, restart the interface, then recover"};
    case Trouble::kSilent:
      return {"no measurements come", "check its supply and its cable, then recover"};
    case Trouble::kSecondHost:
      return {"somebody else sends commands on its bus",
              "end the other program or unplug the other computer, then recover"};
    case Trouble::kSendRefused:
      return {"its bus takes no frames, so nobody acknowledges them",
              "check the board's supply and its cable, then recover"};
    case Trouble::kRestarted:
      return {"its motors are switched off",
              "it has lost its supply, or its button was pressed; recover: the robot homes itself"};
    case Trouble::kNoCurrent:
      return {"a motor gets no current",
              "check supply and emergency stop, or the board has an error; then recover"};
    case Trouble::kNotReady:
      return {"it did not become ready",
              "check its supply, its cable and its motors, then recover"};
    case Trouble::kNone:
    case Trouble::kError:
      break;
  }
  return {};
}

std::string_view text_of_failure(JointHoming::Failure failure) noexcept {
  switch (failure) {
    case JointHoming::Failure::kTooFar:
      return "did not find its end stop within the largest travel; check the belt and the stop";
    case JointHoming::Failure::kNoIndex:
      return "found no index of its encoder within 1.5 revolutions of its motor; check the encoder";
    case JointHoming::Failure::kNone:
      break;
  }
  return {};
}

// The safety chain must know what the motors can give at most.
template <class R>
BoardRobotOptions<R> with_torque_of_current(BoardRobotOptions<R> options) {
  options.validate();
  const double most = options.max_current * options.drive.torque_per_ampere();
  for (JointLimit& limit : options.limits) limit.max_torque = std::min(limit.max_torque, most);
  return options;
}

}  // namespace

template <class R>
BoardRobot<R>::BoardRobot(Options options, std::vector<std::unique_ptr<can::Bus>> buses,
                          const Clock& clock)
    : options_(with_torque_of_current(std::move(options))),
      clock_(clock),
      safety_(options_.limits),
      stop_(options_.stop, options_.period) {
  require(buses.size() == options_.names.size(),
          text_of("there are ", options_.names.size(), " boards, but ", buses.size(), " buses"));
  boards_.reserve(buses.size());
  for (auto& bus : buses) boards_.emplace_back(std::move(bus), options_.board);
  // The first call makes the texts, which must not happen in the loop.
  static_cast<void>(fault_text_of(0));
}

template <class R>
BoardRobot<R>::~BoardRobot() {
  for (Board& board : boards_) board.switch_off();
}

template <class R>
bool BoardRobot<R>::is_homed() const noexcept {
  return is_homed_ && std::ranges::all_of(boards_, &Board::keeps_positions);
}

template <class R>
double BoardRobot<R>::angle_per_revolution() const noexcept {
  return 2.0 * std::numbers::pi / options_.drive.gear_ratio;
}

template <class R>
HomingMeasurement BoardRobot<R>::measure(std::size_t joint) const noexcept {
  const Terminal& place = options_.motors[joint];
  const MotorReading& motor = boards_[place.board].motors()[place.number];
  const double angle = options_.polarity[joint] * angle_per_revolution();
  // 1000 revolutions per minute, in revolutions per second.
  constexpr double kKiloRpm = 1000.0 / 60.0;
  return {.angle = angle * motor.revolutions,
          .velocity = angle * kKiloRpm * motor.kilo_rpm,
          .index = angle * motor.index.value_or(motor.revolutions),
          .index_pulses = motor.index_pulses};
}

template <class R>
HomingGains BoardRobot<R>::gains(std::size_t joint) const noexcept {
  const JointLimit& limit = options_.limits[joint];
  return {.kp = limit.default_kp,
          .kd = limit.safety_kd + limit.default_kd,
          .max_torque = std::min(limit.max_torque, limit.continuous_torque)};
}

template <class R>
void BoardRobot<R>::receive(Instant now) noexcept {
  for (Board& board : boards_) board.receive(now);
}

template <class R>
DriverReport BoardRobot<R>::prepare(TimeIndex step) noexcept {
  const Instant now = clock_.now();
  if (step == 0) {
    for (Board& board : boards_) board.resume(now);
    phase_ = Phase::kStarting;
    has_fault_ = false;
    // Motors stay as warm as they were.
    for (JointMemory& memory : state_.joints) memory = {.heat = memory.heat};
  }
  receive(now);
  if (phase_ == Phase::kStarting) start_what_is_not_ready(step, now);
  if (const DriverReport fault = fault_of_boards(); fault.state != DriverReport::State::kReady) {
    return fault;
  }
  if (phase_ == Phase::kStarting) {
    const auto is_usable = [](const Board& board) {
      return board.is_ready() && board.is_current();
    };
    if (!std::ranges::all_of(boards_, is_usable)) return DriverReport::busy();
    if (!is_homed()) {
      begin_homing();
    } else if (is_outside()) {
      // It was moved by hand, or has fallen while it was released.
      begin_move();
    } else {
      phase_ = Phase::kReady;
    }
  }
  DriverReport report;
  if (phase_ == Phase::kHoming) report = home();
  if (phase_ == Phase::kMoving) report = move();
  if (report.state == DriverReport::State::kReady) lost_before_ = lost_frames();
  return report;
}

// A board that was ready may have been switched off in a pause, so this is no fault yet.
template <class R>
void BoardRobot<R>::start_what_is_not_ready(TimeIndex step, Instant now) noexcept {
  for (Board& board : boards_) {
    const bool is_lost = board.is_ready() && board.trouble() != Trouble::kNone;
    if (is_lost || (step == 0 && !board.is_ready())) board.start(now);
  }
}

template <class R>
std::uint64_t BoardRobot<R>::lost_frames() const noexcept {
  std::uint64_t lost = 0;
  for (const Board& board : boards_) lost += board.bus().lost + board.counts().missing;
  return lost;
}

template <class R>
bool BoardRobot<R>::is_outside() noexcept {
  observe();
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const JointLimit& limit = options_.limits[i];
    const double position = observation_.position[i];
    if (position < limit.soft_lower || position > limit.soft_upper) return true;
  }
  return false;
}

template <class R>
void BoardRobot<R>::begin_homing() noexcept {
  is_homed_ = false;
  phase_ = Phase::kHoming;
  part_steps_ = 0;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    homing_[i].begin(options_.homing.method, options_.homing.torque[i], angle_per_revolution(),
                     measure(i));
  }
}

template <class R>
DriverReport BoardRobot<R>::home() noexcept {
  Joints torque{};
  bool is_part_done = true;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const HomingMeasurement measured = measure(i);
    torque[i] = homing_[i].next(measured, gains(i), seconds(options_.period));
    const auto failure = homing_[i].failure(measured, options_.homing.max_travel);
    if (failure != JointHoming::Failure::kNone) return homing_fault(i, text_of_failure(failure));
    is_part_done = is_part_done && homing_[i].is_part_done();
  }
  if (++part_steps_ * options_.period > options_.homing.max_time) {
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      if (homing_[i].is_part_done()) continue;
      return homing_fault(i,
                          "does not come to rest at its end stop; check the belt and the torque");
    }
  }
  drive(torque);
  if (!is_part_done) return DriverReport::busy();
  bool has_next_part = false;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    has_next_part |= homing_[i].next_part(measure(i));
  }
  part_steps_ = 0;
  if (has_next_part) return DriverReport::busy();
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    zero_[i] = homing_[i].home() - options_.homing.home_position[i];
  }
  for (Board& board : boards_) board.trust_positions();
  is_homed_ = true;
  begin_move();
  return DriverReport::busy();
}

template <class R>
void BoardRobot<R>::begin_move() noexcept {
  phase_ = Phase::kMoving;
  part_steps_ = 0;
  observe();
  start_ = observation_.position;
}

// End stops may be beyond hard limits, so the safety chain cannot judge this movement.
template <class R>
DriverReport BoardRobot<R>::move() noexcept {
  observe();
  // At the end the joints have half a second to arrive.
  const double time = seconds(++part_steps_ * options_.period);
  const double done = trifinger::detail::smooth(std::min(time / seconds(options_.move_time), 1.0));
  Joints torque{};
  if (options_.weight) torque = options_.weight(observation_.position);
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const double target = start_[i] + done * (options_.initial_position[i] - start_[i]);
    const HomingGains gain = gains(i);
    torque[i] += gain.kp * (target - observation_.position[i]);
    torque[i] = std::clamp(torque[i] - gain.kd * observation_.velocity[i], -gain.max_torque,
                           gain.max_torque);
  }
  drive(torque);
  constexpr double kSettling = 0.5;
  if (time < seconds(options_.move_time) + kSettling) return DriverReport::busy();
  constexpr double kTolerance = 0.2;  // [rad]
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const double error = std::abs(observation_.position[i] - options_.initial_position[i]);
    if (error > kTolerance) {
      return homing_fault(i,
                          "did not reach its initial position; check max_current, home_position, "
                          "and whether something is in its way");
    }
  }
  phase_ = Phase::kReady;
  return DriverReport::ready();
}

template <class R>
DriverReport BoardRobot<R>::homing_fault(std::size_t joint, std::string_view text) noexcept {
  is_homed_ = false;
  has_fault_ = true;
  release();
  fault_text_ = FixedText("joint ");
  fault_text_.append(joint).append(" ").append(text);
  return DriverReport::fault(kHomingCode + (static_cast<std::int32_t>(joint + 1) << 8));
}

template <class R>
DriverReport BoardRobot<R>::fault_of_boards() noexcept {
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    const Board& board = boards_[i];
    const Trouble trouble = board.trouble();
    if (trouble == Trouble::kNone) continue;
    has_fault_ = true;
    TroubleText text = text_of_trouble(trouble);
    if (trouble == Trouble::kError) {
      const can::BoardErrorText& error = can::text_of(board.error());
      text = {.sentence = error.sentence, .remedy = error.remedy};
    }
    fault_text_ = FixedText("board ");
    fault_text_.append(i).append(" (").append(options_.names[i]);
    append_joints(i);
    fault_text_.append("): ").append(text.sentence).append("; ").append(text.remedy);
    return DriverReport::fault(kTroubleCode + static_cast<std::int32_t>(trouble) +
                               (static_cast<std::int32_t>(i + 1) << 8));
  }
  return DriverReport::ready();
}

template <class R>
void BoardRobot<R>::append_joints(std::size_t board) noexcept {
  const auto is_here = [board](const Terminal& motor) { return motor.board == board; };
  const bool is_one = std::ranges::count_if(options_.motors, is_here) == 1;
  const char* separator = is_one ? ", joint " : ", joints ";
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    if (options_.motors[i].board != board) continue;
    fault_text_.append(separator).append(i);
    separator = " and ";
  }
}

template <class R>
void BoardRobot<R>::observe() noexcept {
  const double ampere = options_.drive.torque_per_ampere();
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const HomingMeasurement measured = measure(i);
    const Terminal& place = options_.motors[i];
    observation_.position[i] = measured.angle - zero_[i];
    observation_.velocity[i] = measured.velocity;
    observation_.torque[i] =
        options_.polarity[i] * ampere * boards_[place.board].motors()[place.number].amperes;
  }
  if constexpr (R::kTips > 0) {
    for (std::size_t i = 0; i < R::kTips; ++i) {
      const Terminal& place = options_.tips[i];
      const double value = boards_[place.board].analog_inputs()[place.number];
      observation_.tip_force[i] =
          std::max(0.0, options_.tip_sensor.scale * (value - options_.tip_sensor.zero));
    }
  }
}

template <class R>
DriverReport BoardRobot<R>::get_latest_observation(Observation& observation) noexcept {
  const Instant now = clock_.now();
  receive(now);
  observe();
  observation = observation_;
  if (const DriverReport fault = fault_of_boards(); fault.state != DriverReport::State::kReady) {
    return fault;
  }
  DriverReport report;
  Instant oldest = now;
  for (const Board& board : boards_) oldest = std::min(oldest, board.oldest_measurement());
  report.measurement_age = (now - oldest).count();
  report.lost_frames = static_cast<std::uint32_t>(lost_frames() - lost_before_);
  return report;
}

template <class R>
DriverReport BoardRobot<R>::apply_action(const Action& desired, AppliedAction& applied) noexcept {
  FixedText thrown;
  const SafetyReport report =
      safety_.apply(desired, observation_, options_.period, state_, applied, &thrown);
  drive(applied.torque);
  if (report.fault == SafetyFault::kInterrupted) return DriverReport::interrupted();
  if (report.fault != SafetyFault::kNone) {
    has_fault_ = true;
    fault_text_ = report.fault == SafetyFault::kOwnCheck
                      ? thrown
                      : FixedText(fault_text_of(fault_code_of(report)));
    return DriverReport::fault(fault_code_of(report));
  }
  DriverReport done;
  done.action_rejected = report.action_rejected;
  if (report.action_rejected) {
    const RejectedCommand rejected = safety_.find_rejected(desired, applied);
    rejection_text_ = describe(rejected, "", safety_.limits()[rejected.joint]);
  }
  return done;
}

template <class R>
DriverReport BoardRobot<R>::hold(const Observation& observation, Action& action) noexcept {
  action = hold_position(observation);
  if (options_.weight) action.torque = options_.weight(observation.position);
  return DriverReport::ready();
}

// A joint whose board is in trouble gets nothing; the others are damped.
template <class R>
DriverReport BoardRobot<R>::stop(TimeIndex step) noexcept {
  receive(clock_.now());
  observe();
  Action action;
  const bool has_begun = phase_ == Phase::kReady || phase_ == Phase::kMoving;
  if (!has_begun || !stop_.next(step, observation_, action)) {
    release();
    return DriverReport::ready();
  }
  const bool has_trouble = fault_of_boards().state != DriverReport::State::kReady;
  if (has_trouble || (step == 0 && has_fault_)) {
    stop_.give_up(step);
    action = {};
  }
  if (options_.weight && !std::isnan(action.position[0])) {
    action.torque = options_.weight(observation_.position);
  }
  AppliedAction applied;
  const SafetyReport report = safety_.apply(action, observation_, options_.period, state_, applied);
  if (report.fault != SafetyFault::kNone) stop_.give_up(step);
  drive(applied.torque);
  return DriverReport::busy();
}

template <class R>
void BoardRobot<R>::drive(const Joints& torque) noexcept {
  const double ampere = options_.drive.torque_per_ampere();
  for (std::size_t board = 0; board < boards_.size(); ++board) {
    can::MotorPair currents{};
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      if (options_.motors[i].board != board) continue;
      const double current = options_.polarity[i] * torque[i] / ampere;
      // Written so that NaN gives no current.
      currents[options_.motors[i].number] =
          std::isfinite(current) ? std::clamp(current, -options_.max_current, options_.max_current)
                                 : 0.0;
    }
    if (boards_[board].trouble() != Trouble::kNone) currents = {};
    boards_[board].drive(currents);
  }
}

template <class R>
void BoardRobot<R>::release() noexcept {
  for (Board& board : boards_) {
    // A start that waits on a bus without a board must not happen later.
    if (board.is_ready()) {
      board.release();
    } else {
      board.switch_off();
    }
  }
}

template <class R>
std::string_view BoardRobot<R>::fault_text(std::int32_t) const noexcept {
  return fault_text_.view();
}

template class BoardRobot<TriFinger>;
template class BoardRobot<Finger>;
template class BoardRobot<TwoJoints>;
template class BoardRobot<OneJoint>;

}  // namespace trifinger::boards
