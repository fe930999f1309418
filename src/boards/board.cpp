// SPDX-License-Identifier: BSD-3-Clause
#include "boards/board.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>
#include <variant>

namespace trifinger::boards {
namespace {

using can::Command;
using can::Link;

// A measured current may differ by this much from the desired one [A].
constexpr double kCurrentTolerance = 0.05;
// A board has seen a command within this time.
constexpr Nanoseconds kAnswerTime = std::chrono::milliseconds(20);
// So many commands of others in a second are no accident.
constexpr int kForeignCommands = 5;
// So many ticks in a row may find the bus full.
constexpr int kMaxRefusals = 3;
constexpr int kMaxTicksOfABacklog = 20;
// So many implausible measurements in a row are the truth: the checks of the robot then see them.
constexpr int kBelievedJumps = 3;

BoardFault fault_of(Link link) noexcept {
  switch (link) {
    case Link::kDown:
      return BoardFault::kInterfaceDown;
    case Link::kGone:
      return BoardFault::kInterfaceGone;
    case Link::kBusOff:
      return BoardFault::kBusOff;
    case Link::kUp:
    case Link::kPassive:
      break;
  }
  return BoardFault::kNone;
}

// Boards send every millisecond.
std::uint64_t missing_between(Instant before, Instant now) noexcept {
  const auto periods = std::chrono::round<std::chrono::milliseconds>(now - before).count();
  return periods > 1 ? static_cast<std::uint64_t>(periods - 1) : 0;
}

bool is_fully_enabled(const can::BoardStatus& status) noexcept {
  return status.system_enabled && status.motors[0].enabled && status.motors[1].enabled;
}

}  // namespace

Board::Board(std::unique_ptr<can::Bus> bus, const BoardOptions& options) noexcept
    : bus_(std::move(bus)), options_(options) {}

void Board::start(Instant now) noexcept {
  phase_ = Phase::kStarting;
  fault_ = BoardFault::kNone;
  error_ = can::BoardError::kNone;
  has_lost_motors_ = false;
  keeps_positions_ = false;
  is_driven_ = false;
  is_fresh_.fill(false);
  refusals_ = 0;
  foreign_ = 0;
  started_ = now;
  send_start(now);
}

void Board::resume(Instant now) noexcept {
  // A bus keeps some hundred frames, the oldest ones.
  for (int i = 0; i < kMaxTicksOfABacklog && (i == 0 || has_more_); ++i) read_all();
  is_fresh_.fill(false);
  for (MotorReading& motor : motors_) {
    motor.position_time = std::max(motor.position_time, now);
    motor.velocity_time = std::max(motor.velocity_time, now);
    motor.current_time = std::max(motor.current_time, now);
  }
  current_seen_.fill(now);
  is_driven_ = false;
}

// The order is that of the original host. Both motors must be enabled even if only one is wired:
// otherwise the board never becomes ready.
void Board::send_start(Instant now) noexcept {
  start_sent_ = now;
  const std::array frames{encode(can::DesiredCurrents{}),
                          time_limit(),
                          encode(can::BoardCommand{Command::kEnableSystem, 1}),
                          encode(can::BoardCommand{Command::kSendAll, 1}),
                          encode(can::BoardCommand{Command::kEnableMotor1, 1}),
                          encode(can::BoardCommand{Command::kEnableMotor2, 1})};
  was_start_sent_ = bus_->send(frames).sent == frames.size();
}

void Board::receive(Instant now) noexcept {
  read_all();
  if (now - foreign_since_ > std::chrono::seconds(1)) {
    foreign_since_ = now;
    foreign_ = 0;
  }
  if (phase_ == Phase::kStarting && !was_start_sent_) send_start(now);
  if (phase_ == Phase::kReady) watch_currents(now);
  if (fault_ == BoardFault::kNone) fault_ = find_fault(now);
  if (fault_ != BoardFault::kNone) keeps_positions_ = false;
}

Instant Board::oldest_measurement() const noexcept {
  Instant oldest = Instant::max();
  for (const MotorReading& motor : motors_) {
    oldest = std::min({oldest, motor.position_time, motor.velocity_time, motor.current_time});
  }
  return oldest;
}

// After a pause many frames are waiting. What is left then is read in the next ticks.
void Board::read_all() noexcept {
  constexpr int kMaxRounds = 4;
  has_more_ = true;
  for (int round = 0; round < kMaxRounds && has_more_; ++round) {
    const std::uint64_t overloads = bus_->state().overloads;
    for (const can::Frame& frame : bus_->receive(frames_)) take(frame);
    has_more_ = bus_->state().overloads != overloads;
  }
}

BoardFault Board::find_fault(Instant now) const noexcept {
  if (phase_ == Phase::kOff) return BoardFault::kNone;
  const BoardFault link = fault_of(bus_->state().link);
  // What was read at the start may be old: a bus keeps the oldest frames of a pause.
  const bool may_be_old = phase_ == Phase::kStarting && now - started_ <= options_.silent_after;
  if (link != BoardFault::kNone && !may_be_old) return link;
  if (foreign_ >= kForeignCommands) return BoardFault::kSecondHost;
  if (error_ != can::BoardError::kNone) return BoardFault::kError;
  if (phase_ == Phase::kStarting) {
    return now - started_ > options_.start_timeout ? BoardFault::kNotReady : BoardFault::kNone;
  }
  if (has_lost_motors_) return BoardFault::kRestarted;
  // What is new may be among the frames that are still waiting.
  if (has_more_) return BoardFault::kNone;
  if (now - oldest_measurement() > options_.silent_after) return BoardFault::kSilent;
  if (refusals_ > kMaxRefusals) return BoardFault::kSendRefused;
  for (const Instant seen : current_seen_) {
    if (is_driven_ && now - seen > options_.no_current_after) return BoardFault::kNoCurrent;
  }
  return BoardFault::kNone;
}

// A board that has stopped says so only with its next status, up to a second later. Its currents
// say it at once.
void Board::watch_currents(Instant now) noexcept {
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    const double wanted = std::abs(sent_[i]);
    const bool flows = std::abs(motors_[i].amperes) > 0.1 * wanted;
    if (!is_driven_ || wanted <= kCurrentTolerance || flows) current_seen_[i] = now;
  }
}

// The time limit comes before the first currents, and again and again: a lost frame must not leave
// the board without one.
void Board::drive(const can::MotorPair& amperes) noexcept {
  if (phase_ != Phase::kReady) return;
  constexpr int kDrivesPerTimeLimit = 100;
  sent_ = amperes;
  const std::array frames{time_limit(), encode(can::DesiredCurrents{amperes})};
  const bool sends_limit = !is_driven_ || ++drives_ >= kDrivesPerTimeLimit;
  if (sends_limit) drives_ = 0;
  is_driven_ = true;
  send(std::span(frames).subspan(sends_limit ? 0 : 1));
}

// The time limit stays: if this frame is lost, the board lets the motors go by itself.
void Board::release() noexcept {
  sent_ = {};
  is_driven_ = false;
  send(std::array{encode(can::DesiredCurrents{})});
}

void Board::send(std::span<const can::Frame> frames) noexcept {
  refusals_ = bus_->send(frames).refusal == can::Refusal::kNone ? 0 : refusals_ + 1;
}

can::Frame Board::time_limit() const noexcept {
  const auto limit = std::chrono::ceil<std::chrono::milliseconds>(options_.receive_timeout);
  return encode(
      can::BoardCommand{Command::kSetReceiveTimeout, static_cast<std::int32_t>(limit.count())});
}

void Board::switch_off() noexcept {
  if (phase_ == Phase::kOff) return;
  release();
  send(std::array{encode(can::BoardCommand{Command::kEnableSystem, 0})});
  phase_ = Phase::kOff;
}

void Board::take(const can::Frame& frame) noexcept {
  std::visit([&](const auto& message) { take(message, frame.time); }, decode_from_board(frame));
}

void Board::take(const can::BoardStatus& status, Instant time) noexcept {
  const bool is_whole = is_fully_enabled(status) && status.error == can::BoardError::kNone;
  if (phase_ == Phase::kReady) {
    error_ = status.error;
    has_lost_motors_ = !is_whole && error_ == can::BoardError::kNone;
  }
  // What was sent before the board has seen our start tells nothing.
  if (phase_ != Phase::kStarting || time - start_sent_ < kAnswerTime) return;
  error_ = status.error;
  if (!is_fully_enabled(status) && error_ == can::BoardError::kNone) was_start_sent_ = false;
  if (is_whole && status.motors[0].ready && status.motors[1].ready && is_fresh()) {
    phase_ = Phase::kReady;
    current_seen_.fill(time);
  }
}

void Board::take(const can::MotorCurrents& currents, Instant time) noexcept {
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    MotorReading& motor = motors_[i];
    const Instant before = motor.current_time;
    if (!is_newer(time, motor.current_time)) return;
    // A wrong current would warm the model of the motor as a true one does.
    int& in_a_row = implausible_currents_in_a_row_[i];
    if (std::abs(currents.amperes[i]) > options_.max_current && in_a_row < kBelievedJumps) {
      ++counts_.implausible;
      ++in_a_row;
      motor.current_time = before;
      continue;
    }
    in_a_row = 0;
    motor.amperes = currents.amperes[i];
  }
}

void Board::take(const can::MotorPositions& positions, Instant time) noexcept {
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    MotorReading& motor = motors_[i];
    const Instant before = motor.position_time;
    if (!is_newer(time, motor.position_time)) return;
    can::PositionUnwrapper unwrapper = unwrappers_[i];
    const double revolutions = unwrapper.unwrap(positions.revolutions[i]);
    // Half a revolution more, because the messages do not come regularly.
    const double reach =
        options_.max_speed * std::chrono::duration<double>(time - before).count() + 0.5;
    const bool is_plausible = phase_ != Phase::kReady ||
                              std::abs(revolutions - motor.revolutions) <= reach ||
                              implausible_in_a_row_[i] >= kBelievedJumps;
    if (!is_plausible) {
      ++counts_.implausible;
      ++implausible_in_a_row_[i];
      motor.position_time = before;
      continue;
    }
    if (i == 0 && phase_ == Phase::kReady) counts_.missing += missing_between(before, time);
    implausible_in_a_row_[i] = 0;
    unwrappers_[i] = unwrapper;
    motor.revolutions = revolutions;
    is_fresh_[i] = true;
  }
}

void Board::take(const can::MotorVelocities& velocities, Instant time) noexcept {
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    if (!is_newer(time, motors_[i].velocity_time)) return;
    motors_[i].kilo_rpm = velocities.kilo_rpm[i];
  }
}

void Board::take(const can::AnalogInputs& inputs, Instant) noexcept {
  analog_inputs_ = inputs.values;
}

void Board::take(const can::IndexPulse& pulse, Instant) noexcept {
  MotorReading& motor = motors_[pulse.motor];
  // A copy unwraps it: the next position continues from the position before.
  can::PositionUnwrapper unwrapper = unwrappers_[pulse.motor];
  const double index = unwrapper.unwrap(pulse.revolutions);
  constexpr double kFarthest = 0.5;  // [revolutions]
  if (std::abs(index - motor.revolutions) > kFarthest) {
    ++counts_.implausible;
    return;
  }
  motor.index = index;
  ++motor.index_pulses;
}

void Board::take(can::Rejection rejection, Instant) noexcept {
  ++counts_.invalid;
  if (rejection == can::Rejection::kWrongDirection) ++foreign_;
}

bool Board::is_newer(Instant time, Instant& newest) noexcept {
  if (time < newest) {
    ++counts_.outdated;
    return false;
  }
  newest = time;
  return true;
}

}  // namespace trifinger::boards
