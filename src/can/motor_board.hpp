// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <variant>

#include "can/frame.hpp"

namespace trifinger::can {

// The messages of a motor board, which drives two motors. Both directions are here: a driver
// encodes what the host sends and decodes what the board sends; an emulator does the opposite.
//
// Every number on the wire is a 32-bit integer, most significant byte first. Physical quantities
// are fixed-point with 24 bits after the point ("Q24"): a range of ±128 in steps of 6e-8.

/// Positions go from +100 to -100 motor revolutions, and back; see PositionUnwrapper.
inline constexpr double kRolloverRevolutions = 100.0;

/// One value for each motor of a board.
using MotorPair = std::array<double, 2>;

/// What a host tells a board to do. The value of a command is 1 or 0 if nothing else is said here.
enum class Command : std::uint32_t {
  kEnableSystem = 1,
  kEnableMotor1 = 2,
  kEnableMotor2 = 3,
  kEnableSpring1 = 4,  ///< A virtual spring.
  kEnableSpring2 = 5,
  kSendCurrents = 12,
  kSendPositions = 13,
  kSendVelocities = 14,
  kSendAnalogInputs = 15,
  kSendIndexPulses = 16,
  kSendAll = 20,            ///< The five above.
  kSetReceiveTimeout = 30,  ///< [ms]; 0: off. Without currents for so long, the board stops.
  kEnableRolloverError = 31,
};

/// The three bits in which a board says why it stopped.
enum class BoardError : std::uint8_t {
  kNone = 0,
  kEncoder = 1,
  kReceiveTimeout = 2,
  kTemperature = 3,
  kPositionConverter = 4,
  kRollover = 5,
  kUndefined = 6,
  kOther = 7,
};

struct BoardErrorText {
  std::string_view name;      ///< A word, such as "encoder".
  std::string_view sentence;  ///< What happened.
  std::string_view remedy;    ///< What to do.
};

[[nodiscard]] constexpr const BoardErrorText& text_of(BoardError error) noexcept;

// From the host to the board

struct BoardCommand {
  Command command{Command::kEnableSystem};
  std::int32_t value{0};

  friend bool operator==(const BoardCommand&, const BoardCommand&) = default;
};

/// Currents that the motors shall have. They are saturated at what Q24 can express. A value that is
/// not finite becomes 0 A.
struct DesiredCurrents {
  MotorPair amperes{};

  friend bool operator==(const DesiredCurrents&, const DesiredCurrents&) = default;
};

// From the board to the host

/// Comes once per second.
struct BoardStatus {
  struct Motor {
    bool enabled{false};
    bool ready{false};  ///< Aligned with its encoder.

    friend bool operator==(const Motor&, const Motor&) = default;
  };

  bool system_enabled{false};
  std::array<Motor, 2> motors{};
  BoardError error{BoardError::kNone};

  friend bool operator==(const BoardStatus&, const BoardStatus&) = default;
};

struct MotorCurrents {
  MotorPair amperes{};

  friend bool operator==(const MotorCurrents&, const MotorCurrents&) = default;
};

struct MotorPositions {
  MotorPair revolutions{};  ///< Turns of the motor since the board was switched on.

  friend bool operator==(const MotorPositions&, const MotorPositions&) = default;
};

struct MotorVelocities {
  MotorPair kilo_rpm{};  ///< [1000 revolutions per minute]

  friend bool operator==(const MotorVelocities&, const MotorVelocities&) = default;
};

struct AnalogInputs {
  std::array<double, 2> values{};  ///< Inputs A and B, 0 to 1.

  friend bool operator==(const AnalogInputs&, const AnalogInputs&) = default;
};

/// A motor has passed the index of its encoder, which it does once per revolution.
struct IndexPulse {
  std::uint8_t motor{0};    ///< 0 or 1
  double revolutions{0.0};  ///< Position of the motor at the index.

  friend bool operator==(const IndexPulse&, const IndexPulse&) = default;
};

/// Why a frame is no message.
enum class Rejection : std::uint8_t {
  kUnknownId,
  kWrongDirection,  ///< A second host or a second board is on this bus.
  kWrongLength,
  kWrongValue,  ///< A motor or command that does not exist.
};

using FromBoard = std::variant<Rejection, BoardStatus, MotorCurrents, MotorPositions,
                               MotorVelocities, AnalogInputs, IndexPulse>;
using FromHost = std::variant<Rejection, BoardCommand, DesiredCurrents>;

[[nodiscard]] constexpr Frame encode(const BoardCommand& command) noexcept;
[[nodiscard]] constexpr Frame encode(const DesiredCurrents& currents) noexcept;
[[nodiscard]] constexpr Frame encode(const BoardStatus& status) noexcept;
[[nodiscard]] constexpr Frame encode(const MotorCurrents& currents) noexcept;
[[nodiscard]] constexpr Frame encode(const MotorPositions& positions) noexcept;
[[nodiscard]] constexpr Frame encode(const MotorVelocities& velocities) noexcept;
[[nodiscard]] constexpr Frame encode(const AnalogInputs& inputs) noexcept;
[[nodiscard]] constexpr Frame encode(const IndexPulse& pulse) noexcept;

/// Reads what a board has sent. Any frame is allowed.
[[nodiscard]] constexpr FromBoard decode_from_board(const Frame& frame) noexcept;
/// Reads what a host has sent. Any frame is allowed.
[[nodiscard]] constexpr FromHost decode_from_host(const Frame& frame) noexcept;

// The rest is how.

namespace detail {

enum class MessageId : std::uint32_t {
  kCommand = 0x000,
  kDesiredCurrents = 0x005,
  kStatus = 0x010,
  kCurrents = 0x020,
  kPositions = 0x030,
  kVelocities = 0x040,
  kAnalogInputs = 0x050,
  kIndexPulse = 0x060,
};

enum class Sender : std::uint8_t { kHost, kBoard };

struct MessageFormat {
  MessageId id;
  std::uint8_t dlc;
  Sender sender;
};

// All frames that there may be on the bus of a board.
inline constexpr std::array kMessageFormats{
    MessageFormat{MessageId::kCommand, 8, Sender::kHost},
    MessageFormat{MessageId::kDesiredCurrents, 8, Sender::kHost},
    MessageFormat{MessageId::kStatus, 1, Sender::kBoard},
    MessageFormat{MessageId::kCurrents, 8, Sender::kBoard},
    MessageFormat{MessageId::kPositions, 8, Sender::kBoard},
    MessageFormat{MessageId::kVelocities, 8, Sender::kBoard},
    MessageFormat{MessageId::kAnalogInputs, 8, Sender::kBoard},
    MessageFormat{MessageId::kIndexPulse, 5, Sender::kBoard},
};

constexpr std::optional<Rejection> reject(const Frame& frame, Sender sender) noexcept {
  for (const MessageFormat& format : kMessageFormats) {
    if (static_cast<std::uint32_t>(format.id) != frame.id) continue;
    if (format.sender != sender) return Rejection::kWrongDirection;
    if (format.dlc != frame.dlc) return Rejection::kWrongLength;
    return std::nullopt;
  }
  return Rejection::kUnknownId;
}

constexpr Frame make_frame(MessageId id) noexcept {
  Frame frame{.id = static_cast<std::uint32_t>(id)};
  for (const MessageFormat& format : kMessageFormats) {
    if (format.id == id) frame.dlc = format.dlc;
  }
  return frame;
}

inline constexpr double kQ24 = 1 << 24;

// The nearest fixed-point number, saturated. Not finite: 0, because a board would act on its bits.
constexpr std::int32_t to_q24(double value) noexcept {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const bool is_finite = value > -kInfinity && value < kInfinity;  // false for NaN, too
  if (!is_finite) return 0;
  using Limits = std::numeric_limits<std::int32_t>;
  const double scaled = value * kQ24;
  if (scaled >= Limits::max()) return Limits::max();
  if (scaled <= Limits::min()) return Limits::min();
  const auto truncated = static_cast<std::int32_t>(scaled);
  const double rest = scaled - truncated;  // exact
  if (rest >= 0.5) return truncated + 1;
  return rest <= -0.5 ? truncated - 1 : truncated;
}

constexpr double from_q24(std::int32_t value) noexcept { return value / kQ24; }

constexpr void put_word(Frame& frame, std::size_t offset, std::uint32_t word) noexcept {
  for (std::size_t i = 0; i < 4; ++i) {
    frame.data[offset + i] = static_cast<std::uint8_t>(word >> (24 - 8 * i));
  }
}

constexpr std::uint32_t word_at(const Frame& frame, std::size_t offset) noexcept {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < 4; ++i) word = word << 8U | frame.data[offset + i];
  return word;
}

constexpr Frame encode_pair(MessageId id, const MotorPair& values) noexcept {
  Frame frame = make_frame(id);
  put_word(frame, 0, static_cast<std::uint32_t>(to_q24(values[0])));
  put_word(frame, 4, static_cast<std::uint32_t>(to_q24(values[1])));
  return frame;
}

constexpr double q24_at(const Frame& frame, std::size_t offset) noexcept {
  return from_q24(static_cast<std::int32_t>(word_at(frame, offset)));
}

constexpr MotorPair pair_of(const Frame& frame) noexcept {
  return {q24_at(frame, 0), q24_at(frame, 4)};
}

constexpr bool is_command(std::uint32_t code) noexcept {
  return (code >= 1 && code <= 5) || (code >= 12 && code <= 16) || code == 20 || code == 30 ||
         code == 31;
}

inline constexpr std::array<BoardErrorText, 8> kBoardErrorTexts{{
    {"none", "the board reports no error", "nothing has to be done"},
    {"encoder", "the index of an encoder is more than 1 degree away from where it was first",
     "check the encoder's disc and cable, switch the board off and on, and home the robot again"},
    {"receive_timeout", "no currents reached the board within its time limit",
     "check the cable and whether the loop keeps its time ('trifinger doctor'), then recover"},
    {"temperature", "the board or a motor is too hot",
     "let it cool down and lower the currents, then recover"},
    {"position_converter", "the board cannot follow an encoder's signals",
     "check the encoder's cable, switch the board off and on, and home the robot again"},
    {"rollover", "a motor has turned by more than 100 revolutions since the board was switched on",
     "switch the board off and on, and home the robot again"},
    {"undefined", "the board reports error 6, which no known firmware has",
     "check which firmware the board has"},
    {"other", "the board had another error, mostly on its CAN bus",
     "check the bus's cables and its termination at both ends, then recover"},
}};

}  // namespace detail

constexpr const BoardErrorText& text_of(BoardError error) noexcept {
  return detail::kBoardErrorTexts[static_cast<std::size_t>(error) % 8];
}

constexpr Frame encode(const BoardCommand& command) noexcept {
  Frame frame = detail::make_frame(detail::MessageId::kCommand);
  detail::put_word(frame, 0, static_cast<std::uint32_t>(command.value));
  detail::put_word(frame, 4, static_cast<std::uint32_t>(command.command));
  return frame;
}

constexpr Frame encode(const DesiredCurrents& currents) noexcept {
  return detail::encode_pair(detail::MessageId::kDesiredCurrents, currents.amperes);
}

constexpr Frame encode(const BoardStatus& status) noexcept {
  Frame frame = detail::make_frame(detail::MessageId::kStatus);
  const std::array bits{status.system_enabled, status.motors[0].enabled, status.motors[0].ready,
                        status.motors[1].enabled, status.motors[1].ready};
  unsigned byte = static_cast<unsigned>(status.error) << bits.size();
  for (std::size_t i = 0; i < bits.size(); ++i) byte |= static_cast<unsigned>(bits[i]) << i;
  frame.data[0] = static_cast<std::uint8_t>(byte);
  return frame;
}

constexpr Frame encode(const MotorCurrents& currents) noexcept {
  return detail::encode_pair(detail::MessageId::kCurrents, currents.amperes);
}

constexpr Frame encode(const MotorPositions& positions) noexcept {
  return detail::encode_pair(detail::MessageId::kPositions, positions.revolutions);
}

constexpr Frame encode(const MotorVelocities& velocities) noexcept {
  return detail::encode_pair(detail::MessageId::kVelocities, velocities.kilo_rpm);
}

constexpr Frame encode(const AnalogInputs& inputs) noexcept {
  return detail::encode_pair(detail::MessageId::kAnalogInputs, inputs.values);
}

constexpr Frame encode(const IndexPulse& pulse) noexcept {
  Frame frame = detail::make_frame(detail::MessageId::kIndexPulse);
  detail::put_word(frame, 0, static_cast<std::uint32_t>(detail::to_q24(pulse.revolutions)));
  frame.data[4] = pulse.motor;
  return frame;
}

constexpr FromBoard decode_from_board(const Frame& frame) noexcept {
  if (const auto rejection = detail::reject(frame, detail::Sender::kBoard)) return *rejection;
  switch (static_cast<detail::MessageId>(frame.id)) {
    case detail::MessageId::kStatus: {
      const auto bit = [&frame](unsigned i) { return (frame.data[0] >> i & 1U) != 0; };
      return BoardStatus{
          .system_enabled = bit(0),
          .motors{{{.enabled = bit(1), .ready = bit(2)}, {.enabled = bit(3), .ready = bit(4)}}},
          .error = static_cast<BoardError>(frame.data[0] >> 5U)};
    }
    case detail::MessageId::kCurrents:
      return MotorCurrents{detail::pair_of(frame)};
    case detail::MessageId::kPositions:
      return MotorPositions{detail::pair_of(frame)};
    case detail::MessageId::kVelocities:
      return MotorVelocities{detail::pair_of(frame)};
    case detail::MessageId::kAnalogInputs:
      return AnalogInputs{detail::pair_of(frame)};
    case detail::MessageId::kIndexPulse:
      if (frame.data[4] > 1) return Rejection::kWrongValue;
      return IndexPulse{.motor = frame.data[4], .revolutions = detail::q24_at(frame, 0)};
    default:
      return Rejection::kUnknownId;
  }
}

constexpr FromHost decode_from_host(const Frame& frame) noexcept {
  if (const auto rejection = detail::reject(frame, detail::Sender::kHost)) return *rejection;
  if (static_cast<detail::MessageId>(frame.id) == detail::MessageId::kDesiredCurrents) {
    return DesiredCurrents{detail::pair_of(frame)};
  }
  const std::uint32_t code = detail::word_at(frame, 4);
  if (!detail::is_command(code)) return Rejection::kWrongValue;
  return BoardCommand{.command = static_cast<Command>(code),
                      .value = static_cast<std::int32_t>(detail::word_at(frame, 0))};
}

}  // namespace trifinger::can
