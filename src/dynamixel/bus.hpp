// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "dynamixel/control_table.hpp"
#include "dynamixel/packet.hpp"
#include "dynamixel/port.hpp"
#include "dynamixel/status.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::dynamixel {

/// How an exchange with a motor ended.
enum class Outcome : std::uint8_t {
  kDone,
  kRefused,  ///< The motor answered with an error: `Answer::error`.
  /// No whole answer came in time, or the motor has heard a damaged instruction (`kCrc`).
  kNoAnswer,
  kBadAnswer,   ///< The answer has another size than was asked for.
  kNotSent,     ///< The line took no bytes.
  kLineGone,    ///< The line is not there any more.
  kImpossible,  ///< The instruction makes no packet: too many motors or bytes.
};

/// The word for an outcome, such as "no answer".
[[nodiscard]] std::string_view name_of(Outcome outcome) noexcept;

/// A motor's answer.
struct Answer {
  Outcome outcome{Outcome::kNoAnswer};
  StatusError error{StatusError::kNone};
  bool alert{false};  ///< The register "hardware_error_status" is not 0.
  Instant asked{};    ///< When the instruction was on the line as a whole.
  Instant arrived{};  ///< When the answer was here.

  [[nodiscard]] explicit operator bool() const noexcept { return outcome == Outcome::kDone; }
};

/// What a motor says of itself when it is pinged.
struct Identity {
  MotorId id{0};
  std::uint16_t model_number{0};
  std::uint8_t firmware{0};
};

/// The answer of one motor to a read of many.
struct MotorAnswer {
  static constexpr std::size_t kMaxData = 32;

  Answer answer{};
  std::array<std::uint8_t, kMaxData> data{};
};

struct BusOptions {
  /// What an answer may take beyond its bytes and the return delay: the adapter, the motor, and the
  /// scheduler of this machine.
  Nanoseconds slack{std::chrono::milliseconds(4)};
  /// The longest return delay of a motor on the bus. New motors have 500 µs.
  Nanoseconds return_delay{std::chrono::microseconds(500)};
};

/// Numbers since a bus was made.
struct BusCounts {
  std::uint64_t instructions{0};  ///< Packets sent.
  std::uint64_t answers{0};       ///< Answers that came whole and in time, refusals included.
  std::uint64_t missing{0};       ///< Answers that did not come whole and in time, see `kNoAnswer`.
  std::uint64_t damaged{0};       ///< Packets that came damaged. Their answers count as missing.
  std::uint64_t late{0};     ///< Whole answers that came too late, or that nobody had asked for.
  std::uint64_t refused{0};  ///< Answers with an error.
  std::uint64_t echoes{0};   ///< Instructions heard: an adapter's echo, or a second host.
  std::uint64_t skipped{0};  ///< Bytes that belong to no packet.
};

/// The host's side of a bus of motors.
///
/// A call sends one instruction and waits for its answers, until a time limit that follows from the
/// number of bytes, the rate of the line, the return delay and the slack. Whatever comes on the
/// line, calls end in time, and the next one begins anew. Nothing allocates or throws; but a call
/// waits, so it is not for a loop at 1 kHz: `MotorLoop` has a thread for it.
class Bus {
 public:
  /// @throws InvalidArgument
  explicit Bus(std::unique_ptr<Port> port, const BusOptions& options = {});
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;
  ~Bus() = default;

  [[nodiscard]] Answer ping(MotorId id, Identity& identity) noexcept;
  /// Finds the motors of the line. Returns their number; the first found.size() are in `found`. It
  /// takes about a second at 1 Mbaud, because every number gets its time.
  [[nodiscard]] std::size_t find_motors(std::span<Identity> found) noexcept;

  /// Reads data.size() bytes from `address` on.
  [[nodiscard]] Answer read(MotorId id, std::uint16_t address,
                            std::span<std::uint8_t> data) noexcept;
  [[nodiscard]] Answer read(MotorId id, const Register& which, std::int32_t& value) noexcept;
  /// Writes bytes from `address` on. Nobody answers if `id` is `kBroadcast`.
  [[nodiscard]] Answer write(MotorId id, std::uint16_t address,
                             std::span<const std::uint8_t> data) noexcept;
  [[nodiscard]] Answer write(MotorId id, const Register& which, std::int32_t value) noexcept;
  /// Starts the firmware of a motor again, with torque off. It takes a part of a second.
  [[nodiscard]] Answer reboot(MotorId id) noexcept;

  /// Reads the same `size` bytes of many motors with one instruction: "fast sync read" if
  /// `is_fast`, to which all motors answer with one common packet. answers[i] belongs to ids[i].
  ///
  /// Motors answer in the order of `ids`. One that is silent may silence those after it. Returns
  /// the number of answers that came.
  std::size_t sync_read(std::span<const MotorId> ids, std::uint16_t address, std::size_t size,
                        std::span<MotorAnswer> answers, bool is_fast = false) noexcept;

  /// Writes `size` bytes to each of many motors with one instruction; `data` has those of ids[0]
  /// first. Nobody answers, so a refusal remains unknown.
  [[nodiscard]] Outcome sync_write(std::span<const MotorId> ids, std::uint16_t address,
                                   std::size_t size, std::span<const std::uint8_t> data) noexcept;

  /// Waits until answers that are late have come, and counts them. Call this before an exchange is
  /// tried again: the late answer to a read could otherwise pass for that to another read of the
  /// same motor.
  void drop_late_answers() noexcept;

  /// Waits until everything that was sent has left.
  void wait_until_sent() noexcept { port_->sleep_until(sent_); }

  void set_return_delay(Nanoseconds longest) noexcept { options_.return_delay = longest; }
  [[nodiscard]] const BusOptions& options() const noexcept { return options_; }
  [[nodiscard]] Port& port() noexcept { return *port_; }
  [[nodiscard]] const Port& port() const noexcept { return *port_; }
  [[nodiscard]] BusCounts counts() const noexcept;

 private:
  // Sends an instruction; what came before is read and counted.
  [[nodiscard]] Outcome send(const Packet& packet) noexcept;
  // Waits for the next whole status until the deadline.
  [[nodiscard]] std::optional<Packet> receive(Instant deadline) noexcept;
  // The status of one motor. Others before it are counted.
  [[nodiscard]] Answer receive_from(MotorId id, Instant deadline, std::size_t size,
                                    std::span<const std::uint8_t>& data) noexcept;
  [[nodiscard]] Answer exchange(const Packet& packet, std::size_t size,
                                std::span<const std::uint8_t>& data) noexcept;
  void receive_sync(std::span<const MotorId> ids, std::size_t size,
                    std::span<MotorAnswer> answers) noexcept;
  void receive_fast_sync(std::span<const MotorId> ids, std::size_t size,
                         std::span<MotorAnswer> answers) noexcept;
  [[nodiscard]] Answer judge(std::uint8_t error, Instant arrived) const noexcept;
  [[nodiscard]] bool is_too_early(std::size_t bytes, Instant now) const noexcept;
  void drop_what_came() noexcept;
  [[nodiscard]] Instant deadline_of(std::size_t bytes, std::size_t answers) const noexcept;

  std::unique_ptr<Port> port_;
  BusOptions options_;
  BusCounts counts_{};
  PacketParser parser_;
  Instant sent_{};  // when the last byte of the last instruction has left
  std::array<std::uint8_t, kMaxPacket> outgoing_{};
  std::array<std::uint8_t, kMaxPacket> parameters_{};
  std::array<std::uint8_t, 512> incoming_{};
  std::span<const std::uint8_t> unread_{};  // of `incoming_`, what the parser has not taken
};

}  // namespace trifinger::dynamixel
