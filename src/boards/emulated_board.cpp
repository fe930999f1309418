// SPDX-License-Identifier: BSD-3-Clause
#include "boards/emulated_board.hpp"

#include <chrono>
#include <cmath>
#include <variant>

namespace trifinger::boards {

using can::BoardError;
using can::Command;

namespace {

std::size_t place_in_sends(Command data) noexcept {
  return static_cast<std::size_t>(data) - static_cast<std::size_t>(Command::kSendCurrents);
}

}  // namespace

EmulatedBoard::EmulatedBoard(const EmulatedBoardOptions& options) noexcept
    : options_(options), random_{.seed = options.seed} {}

void EmulatedBoard::switch_on(Instant now, const Rotors& rotors, double first) noexcept {
  if (state_.is_on) return;
  state_ = {.is_on = true, .next_status = now};
  for (std::size_t i = 0; i < rotors.size(); ++i) {
    const double count = count_at(rotors[i].revolutions);
    state_.motors[i].zero_count = count - count_at(first);
    state_.motors[i].count = count;
  }
}

void EmulatedBoard::switch_off() noexcept { state_ = {}; }

void EmulatedBoard::receive(const can::Frame& frame, Instant now) noexcept {
  if (!state_.is_on) return;
  const can::FromHost message = can::decode_from_host(frame);
  if (const auto* const currents = std::get_if<can::DesiredCurrents>(&message)) {
    state_.desired = currents->amperes;
    state_.desired_at = now;
  } else if (const auto* const command = std::get_if<can::BoardCommand>(&message)) {
    execute(*command, now);
  }
}

void EmulatedBoard::execute(const can::BoardCommand& command, Instant now) noexcept {
  const bool on = command.value != 0;
  switch (command.command) {
    case Command::kEnableSystem:
      enable_system(on);
      break;
    case Command::kEnableMotor1:
      enable_motor(0, on, now);
      break;
    case Command::kEnableMotor2:
      enable_motor(1, on, now);
      break;
    case Command::kEnableSpring1:
    case Command::kEnableSpring2:
      break;
    case Command::kSendAll:
      state_.sends.fill(on);
      break;
    case Command::kSetReceiveTimeout:
      state_.receive_timeout = std::chrono::milliseconds(command.value);
      break;
    case Command::kEnableRolloverError:
      state_.is_rollover_an_error = on;
      break;
    default:
      state_.sends[place_in_sends(command.command)] = on;
      break;
  }
}

void EmulatedBoard::enable_system(bool enable) noexcept {
  if (enable) {
    state_.is_system_enabled = true;
    state_.error = BoardError::kNone;
  } else {
    disable_everything();
    state_.desired = {};
  }
}

void EmulatedBoard::enable_motor(std::size_t motor, bool enable, Instant now) noexcept {
  if (!enable) {
    state_.motors[motor].is_enabled = false;
    state_.currents[motor] = 0.0;
  } else if (state_.is_system_enabled && !state_.motors[motor].is_enabled) {
    state_.motors[motor].is_enabled = true;
    state_.motors[motor].enabled_at = now;
  }
}

void EmulatedBoard::disable_everything() noexcept {
  state_.is_system_enabled = false;
  for (Motor& motor : state_.motors) motor.is_enabled = false;
  state_.currents = {};
}

// The desired currents stay: a host that enables the motors again without sending zeros first gets
// what it asked for.
void EmulatedBoard::stop(BoardError error) noexcept {
  disable_everything();
  state_.error = error;
}

void EmulatedBoard::fail(BoardError error) noexcept {
  if (error == BoardError::kNone) return;
  if (error == BoardError::kEncoder) state_.has_bad_encoder = true;
  if (state_.is_system_enabled) stop(error);
}

bool EmulatedBoard::is_aligning(std::size_t motor) const noexcept {
  return state_.motors[motor].is_enabled && !state_.motors[motor].is_aligned;
}

can::BoardStatus EmulatedBoard::status() const noexcept {
  if (!state_.is_on) return {};
  can::BoardStatus status{.system_enabled = state_.is_system_enabled, .error = state_.error};
  for (std::size_t i = 0; i < status.motors.size(); ++i) {
    // Ready means "not aligning" to the board, so a motor that was never enabled is ready, too.
    status.motors[i] = {.enabled = state_.motors[i].is_enabled, .ready = !is_aligning(i)};
  }
  return status;
}

std::span<const can::Frame> EmulatedBoard::tick(
    Instant now, const Rotors& rotors, const std::array<double, 2>& analog_inputs) noexcept {
  frame_count_ = 0;
  if (!state_.is_on) return {};

  std::array<double, 2> counts_before{};
  for (std::size_t i = 0; i < rotors.size(); ++i) {
    Motor& motor = state_.motors[i];
    counts_before[i] = motor.count;
    motor.count = count_at(rotors[i].revolutions);
    if (is_aligning(i)) motor.is_aligned = now - motor.enabled_at >= options_.alignment_time;
  }
  // A stopped board does not look for errors, or a second one would hide the first.
  if (state_.is_system_enabled) {
    if (const BoardError error = find_error(now); error != BoardError::kNone) stop(error);
  }
  for (std::size_t i = 0; i < rotors.size(); ++i) {
    const bool acts = state_.motors[i].is_enabled && state_.motors[i].is_aligned;
    state_.currents[i] = acts ? current_factors_[i] * state_.desired[i] : 0.0;
  }

  // In the order in which they win the bus
  if (now >= state_.next_status) {
    constexpr std::chrono::seconds kPeriod(1);
    send(status());
    // Seconds in which there was no tick are left out.
    state_.next_status += ((now - state_.next_status) / kPeriod + 1) * kPeriod;
  }
  send_data(rotors, analog_inputs);
  if (is_sent(Command::kSendIndexPulses)) {
    for (std::size_t i = 0; i < rotors.size(); ++i) send_index_pulse(i, counts_before[i]);
  }
  return std::span(frames_).first(frame_count_);
}

BoardError EmulatedBoard::find_error(Instant now) const noexcept {
  if (state_.has_bad_encoder) return BoardError::kEncoder;
  bool is_pushing = false;
  bool has_rolled_over = false;
  for (std::size_t i = 0; i < state_.motors.size(); ++i) {
    const Motor& motor = state_.motors[i];
    is_pushing |= motor.is_enabled && state_.desired[i] != 0.0;
    has_rolled_over |= rollovers(motor.count, motor) != 0.0;
  }
  const bool is_late = now - state_.desired_at > state_.receive_timeout;
  if (state_.receive_timeout > Nanoseconds::zero() && is_pushing && is_late) {
    return BoardError::kReceiveTimeout;
  }
  if (state_.is_rollover_an_error && has_rolled_over) return BoardError::kRollover;
  return BoardError::kNone;
}

double EmulatedBoard::count_at(double revolutions) const noexcept {
  return std::floor(revolutions * options_.encoder_counts);
}

double EmulatedBoard::rollovers(double count, const Motor& motor) const noexcept {
  const double limit = can::kRolloverRevolutions * options_.encoder_counts;
  return std::floor((count - motor.zero_count + limit) / (2.0 * limit));
}

double EmulatedBoard::position(double count, const Motor& motor) const noexcept {
  return (count - motor.zero_count) / options_.encoder_counts -
         2.0 * can::kRolloverRevolutions * rollovers(count, motor);
}

bool EmulatedBoard::is_sent(Command data) const noexcept {
  return state_.sends[place_in_sends(data)];
}

double EmulatedBoard::with_noise(double value, double deviation) noexcept {
  return deviation == 0.0 ? value : value + deviation * random_.normal();
}

template <class Message>
void EmulatedBoard::send(const Message& message) noexcept {
  frames_[frame_count_++] = can::encode(message);
}

void EmulatedBoard::send_data(const Rotors& rotors,
                              const std::array<double, 2>& analog_inputs) noexcept {
  can::MotorCurrents currents;
  can::MotorPositions positions;
  can::MotorVelocities velocities;
  for (std::size_t i = 0; i < rotors.size(); ++i) {
    currents.amperes[i] = with_noise(state_.currents[i], options_.current_noise);
    positions.revolutions[i] = position(state_.motors[i].count, state_.motors[i]);
    velocities.kilo_rpm[i] = with_noise(rotors[i].kilo_rpm, options_.velocity_noise);
  }
  if (is_sent(Command::kSendCurrents)) send(currents);
  if (is_sent(Command::kSendPositions)) send(positions);
  if (is_sent(Command::kSendVelocities)) send(velocities);
  if (is_sent(Command::kSendAnalogInputs)) send(can::AnalogInputs{analog_inputs});
}

void EmulatedBoard::send_index_pulse(std::size_t motor, double before) noexcept {
  // The index is a step of the encoder, the same one in every revolution. It is passed where that
  // step begins, in either direction.
  const double counts = options_.encoder_counts;
  const double index = count_at(options_.index_places[motor]);
  const double old_turn = std::floor((before - index) / counts);
  const double turn = std::floor((state_.motors[motor].count - index) / counts);
  if (turn == old_turn) return;
  const double passed = (turn > old_turn ? turn : turn + 1.0) * counts + index;
  send(can::IndexPulse{.motor = static_cast<std::uint8_t>(motor),
                       .revolutions = position(passed, state_.motors[motor])});
}

}  // namespace trifinger::boards
