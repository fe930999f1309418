// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/boards/board.hpp"

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
// So many implausible positions in a row are the truth: the checks of the robot then see the jump.
constexpr int kBelievedJumps = 3;

Trouble trouble_of(Link link) noexcept {
  switch (link) {
    case Link::kDown:
      return Trouble::kInterfaceDown;
    case Link::kGone:
      return Trouble::kInterfaceGone;
    case Link::kBusOff:
      return Trouble::kBusOff;
    case Link::kUp:
    case Link::kPassive:
      break;
  }
  return Trouble::kNone;
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
  trouble_ = Trouble::kNone;
  error_ = can::BoardError::kNone;
  has_lost_motors_ = false;
  is_driven_ = false;
  was_start_sent_ = false;
  started_ = now;
  send_start();
}

// The order is that of the original host. Both motors must be enabled even if only one is wired:
// otherwise the board never becomes ready.
void Board::send_start() noexcept {
  const std::array frames{encode(can::DesiredCurrents{}),
                          encode(can::BoardCommand{Command::kSetReceiveTimeout, 0}),
                          encode(can::BoardCommand{Command::kEnableSystem, 1}),
                          encode(can::BoardCommand{Command::kSendAll, 1}),
                          encode(can::BoardCommand{Command::kEnableMotor1, 1}),
                          encode(can::BoardCommand{Command::kEnableMotor2, 1})};
  was_start_sent_ = bus_->send(frames).sent == frames.size();
}

void Board::receive(Instant now) noexcept {
  read_all();
  if (phase_ == Phase::kStarting && !was_start_sent_) send_start();
  if (phase_ != Phase::kReady) {
    if (trouble_ == Trouble::kNone) trouble_ = find_trouble(now);
    return;
  }
  watch_currents(now);
  if (trouble_ == Trouble::kNone) trouble_ = find_trouble(now);
  if (trouble_ == Trouble::kSilent || trouble_ == Trouble::kRestarted) keeps_positions_ = false;
}

// After a pause many frames are waiting. What is left then is read in the next ticks.
void Board::read_all() noexcept {
  constexpr int kMostRounds = 4;
  has_more_ = true;
  for (int round = 0; round < kMostRounds && has_more_; ++round) {
    const auto received = bus_->receive(frames_);
    for (const can::Frame& frame : received) take(frame);
    has_more_ = received.size() == frames_.size();
  }
}

Trouble Board::find_trouble(Instant now) const noexcept {
  if (phase_ == Phase::kOff) return Trouble::kNone;
  if (const Trouble link = trouble_of(bus_->state().link); link != Trouble::kNone) return link;
  if (error_ != can::BoardError::kNone) return Trouble::kError;
  if (phase_ == Phase::kStarting) {
    return now - started_ > options_.start_timeout ? Trouble::kNotReady : Trouble::kNone;
  }
  if (has_lost_motors_) return Trouble::kRestarted;
  // What is new may be among the frames that are still waiting.
  if (has_more_) return Trouble::kNone;
  if (now - newest_data_ > options_.silent_after) return Trouble::kSilent;
  for (const Instant seen : current_seen_) {
    if (is_driven_ && now - seen > options_.no_current_after) return Trouble::kNoCurrent;
  }
  return Trouble::kNone;
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

void Board::drive(const can::MotorPair& amperes) noexcept {
  if (phase_ != Phase::kReady) return;
  sent_ = amperes;
  const auto limit =
      std::chrono::duration_cast<std::chrono::milliseconds>(options_.receive_timeout);
  const std::array frames{encode(can::DesiredCurrents{amperes}),
                          encode(can::BoardCommand{Command::kSetReceiveTimeout,
                                                   static_cast<std::int32_t>(limit.count())})};
  // The time limit follows the first currents, so that it cannot run out before they are there.
  is_driven_ =
      bus_->send(std::span(frames).first(is_driven_ ? 1U : 2U)).refusal == can::Refusal::kNone ||
      is_driven_;
}

void Board::release() noexcept {
  sent_ = {};
  is_driven_ = false;
  const std::array frames{encode(can::DesiredCurrents{}),
                          encode(can::BoardCommand{Command::kSetReceiveTimeout, 0})};
  static_cast<void>(bus_->send(frames));
}

void Board::switch_off() noexcept {
  release();
  static_cast<void>(bus_->send(std::array{encode(can::BoardCommand{Command::kEnableSystem, 0})}));
  phase_ = Phase::kOff;
}

void Board::take(const can::Frame& frame) noexcept {
  std::visit([&](const auto& message) { take(message, frame.time); }, decode_from_board(frame));
}

void Board::take(const can::BoardStatus& status, Instant time) noexcept {
  if (phase_ == Phase::kStarting && time <= started_) return;  // from before
  error_ = status.error;
  const bool is_whole = is_fully_enabled(status) && status.error == can::BoardError::kNone;
  if (phase_ == Phase::kReady) has_lost_motors_ = !is_whole && error_ == can::BoardError::kNone;
  if (phase_ != Phase::kStarting) return;
  // The error of a board that has not seen our start yet is an old one.
  const bool is_old = !status.system_enabled;
  if (is_old) error_ = can::BoardError::kNone;
  if (is_whole && status.motors[0].ready && status.motors[1].ready && newest_data_ > started_) {
    phase_ = Phase::kReady;
    current_seen_.fill(time);
  }
}

void Board::take(const can::MotorCurrents& currents, Instant time) noexcept {
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    if (!is_newer(time, motors_[i].current_time)) return;
    motors_[i].amperes = currents.amperes[i];
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
    newest_data_ = std::max(newest_data_, time);
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
  motor.index = unwrapper.unwrap(pulse.revolutions);
  ++motor.index_pulses;
}

void Board::take(can::Rejection, Instant) noexcept { ++counts_.invalid; }

bool Board::is_newer(Instant time, Instant& newest) noexcept {
  if (time < newest) {
    ++counts_.outdated;
    return false;
  }
  newest = time;
  return true;
}

}  // namespace trifinger::boards
