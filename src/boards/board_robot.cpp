// SPDX-License-Identifier: BSD-3-Clause
#include "boards/board_robot.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <numbers>
#include <utility>

#include "base/text_of.hpp"
#include "board_robot_prepare.hpp"
#include "fault_texts.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::boards {
namespace {

using trifinger::detail::require;
using trifinger::detail::text_of;

// The safety chain must know what the motors can give at most.
template <class R>
BoardRobotOptions<R> with_torque_of_current(BoardRobotOptions<R> options) {
  options.validate();
  const double most = options.max_current * options.drive.torque_per_ampere();
  for (JointLimit& limit : options.limits) limit.max_torque = std::min(limit.max_torque, most);
  // A controller of currents overshoots; twice the largest command is something else.
  options.board.max_current = std::min(options.board.max_current, 2.0 * options.max_current);
  return options;
}

// The largest torques that test the wiring: what a motor may give for long.
template <class R>
JointVector<R::kJoints> test_torques(const BoardRobotOptions<R>& options) {
  JointVector<R::kJoints> torques{};
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    torques[i] = std::min(options.limits[i].max_torque, options.limits[i].continuous_torque);
  }
  return torques;
}

}  // namespace

template <class R>
BoardRobot<R>::BoardRobot(Options options, std::vector<std::unique_ptr<can::Bus>> buses,
                          const Clock& clock)
    : options_(with_torque_of_current(std::move(options))),
      clock_(clock),
      safety_(options_.limits),
      stop_(options_.stop, options_.period),
      wiring_(test_torques(options_), options_.period),
      home_position_(options_.homing.home_position),
      companions_{{{.name = "wear",
                    .type = std::string(R::kType) + "_wear",
                    .element = describe<Wear<R::kJoints>>()}}} {
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
  count_wear(now);
}

// What a motor does while its board is off or has a fault does not count: nobody knows it.
template <class R>
void BoardRobot<R>::count_wear(Instant now) noexcept {
  // Boards have let their motors go before a longer gap ends.
  constexpr Nanoseconds kLongestGap = std::chrono::milliseconds(100);
  const double elapsed = seconds(std::clamp(now - counted_, Nanoseconds::zero(), kLongestGap));
  counted_ = now;
  // A revolution more, because the messages do not come regularly.
  const double reach = options_.board.max_speed * elapsed + 1.0;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const Terminal& place = options_.motors[i];
    const Board& board = boards_[place.board];
    const MotorReading& motor = board.motors()[place.number];
    if (!board.is_ready() || board.fault() != BoardFault::kNone) {
      meters_[i].forget(motor);
      continue;
    }
    const MotorMeter::Step step =
        meters_[i].measure(motor, elapsed, options_.drive.torque_constant, reach);
    wear_.powered_time[i] += step.powered_time;
    wear_.revolutions[i] += step.revolutions;
    wear_.work[i] += step.work;
    wear_.squared_current[i] += step.squared_current;
    wear_.index_slips[i] += step.has_slipped ? 1 : 0;
  }
}

// A session counts one fault, however many follow from it.
template <class R>
void BoardRobot<R>::note_fault() noexcept {
  wear_.faults += has_fault_ ? 0 : 1;
  has_fault_ = true;
}

template <class R>
const CompanionDescription& BoardRobot<R>::wear_description() const noexcept {
  return companions_[0];
}

template <class R>
std::span<const std::byte> BoardRobot<R>::wear_bytes() const noexcept {
  return std::as_bytes(std::span(&wear_, 1));
}

template <class R>
void BoardRobot<R>::continue_wear(std::span<const std::byte> kept) {
  require(kept.empty() || kept.size() == sizeof(wear_),
          text_of("running hours of this robot have ", sizeof(wear_), " bytes, but ", kept.size(),
                  " were kept"));
  if (!kept.empty()) std::memcpy(&wear_, kept.data(), sizeof(wear_));
  wear_.stamp = {};
  ++wear_.starts;
}

template <class R>
bool BoardRobot<R>::get_companion_element(std::size_t, TimeIndex time_index,
                                          void* element) noexcept {
  if (wear_shown_ && counted_ - *wear_shown_ < std::chrono::seconds(1)) return false;
  wear_shown_ = counted_;
  Wear<R::kJoints> shown = wear_;
  shown.stamp = {.arrival_index = time_index, .capture_index = time_index};
  std::memcpy(element, &shown, sizeof(shown));
  return true;
}

template <class R>
std::uint64_t BoardRobot<R>::lost_frames() const noexcept {
  std::uint64_t lost = 0;
  for (const Board& board : boards_) lost += board.bus().lost + board.counts().missing;
  return lost;
}

template <class R>
DriverReport BoardRobot<R>::joint_fault(std::size_t joint, std::string_view text) noexcept {
  is_homed_ = false;
  note_fault();
  release();
  fault_text_ = FixedText("joint ");
  fault_text_.append(joint).append(" ").append(text);
  return DriverReport::fault(kHomingCode + (static_cast<std::int32_t>(joint + 1) << 8));
}

template <class R>
DriverReport BoardRobot<R>::fault_of_boards() noexcept {
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    const Board& board = boards_[i];
    const BoardFault fault = board.fault();
    if (fault == BoardFault::kNone) continue;
    note_fault();
    FaultText text = boards::text_of(fault);
    if (fault == BoardFault::kError) {
      const can::BoardErrorText& error = can::text_of(board.error());
      text = {.sentence = error.sentence, .remedy = error.remedy};
    }
    fault_text_ = FixedText("board ");
    fault_text_.append(i).append(" (").append(options_.names[i]);
    append_joints(i);
    fault_text_.append("): ").append(text.sentence).append("; ").append(text.remedy);
    return DriverReport::fault(kBoardFaultCode + static_cast<std::int32_t>(fault) +
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
    note_fault();
    // The zero of its encoder may have moved.
    if (report.fault == SafetyFault::kPositionJumped) is_homed_ = false;
    // It counts from a wrong place, or something holds it: the way to the end stops, with small
    // torques, leads out of both.
    if (report.fault == SafetyFault::kHardLimit && homes_at_end_stop(options_.homing.method)) {
      is_homed_ = false;
    }
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

// A joint whose board has a fault gets nothing; the others are damped.
template <class R>
DriverReport BoardRobot<R>::stop(TimeIndex step) noexcept {
  receive(clock_.now());
  observe();
  Action action;
  Joints target;
  const bool has_begun = phase_ >= Phase::kMoving;
  const OrderlyStop::Phase next =
      has_begun ? stop_.next(step, observation_.position, target) : OrderlyStop::Phase::kOver;
  if (next == OrderlyStop::Phase::kOver) {
    release();
    return DriverReport::ready();
  }
  bool moves = next == OrderlyStop::Phase::kMove;
  const bool has_board_fault = fault_of_boards().state != DriverReport::State::kReady;
  if (has_board_fault || (step == 0 && has_fault_)) {
    stop_.give_up(step);
    moves = false;
  }
  if (moves) {
    action.position = target;
    if (options_.weight) action.torque = options_.weight(observation_.position);
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
    if (boards_[board].fault() != BoardFault::kNone) currents = {};
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
