// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::dynamixel {

/// The host's end of a serial line, with the clock of that line: the monotonic clock, or the time
/// of an emulated line in the same thread.
///
/// One thread at a time uses a port. No call but `reopen` allocates or throws.
class Port {
 public:
  Port() = default;
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;
  virtual ~Port() = default;

  [[nodiscard]] virtual Instant now() const noexcept = 0;
  /// Bits per second. A byte takes ten bits.
  [[nodiscard]] virtual int baud() const noexcept = 0;
  /// False once the line has gone, for example because its adapter was unplugged, until `reopen`.
  [[nodiscard]] virtual bool is_open() const noexcept = 0;
  /// Opens a line again that has gone.
  /// @throws Error with the remedy if it is not there
  virtual void reopen() = 0;

  /// Hands all bytes over for sending. Waits while the line takes none, but not longer than
  /// `deadline`. False if it did not take all.
  [[nodiscard]] virtual bool write(std::span<const std::uint8_t> bytes,
                                   Instant deadline) noexcept = 0;
  /// Waits for at least one byte until `deadline`. Returns the number of bytes; 0 if none came.
  [[nodiscard]] virtual std::size_t read(std::span<std::uint8_t> bytes,
                                         Instant deadline) noexcept = 0;
  /// Waits until `instant`. Bytes that come meanwhile wait, too.
  virtual void sleep_until(Instant instant) noexcept = 0;

  /// The time that `count` bytes take on the line.
  [[nodiscard]] Nanoseconds time_of(std::size_t count) const noexcept {
    return Nanoseconds(static_cast<std::int64_t>(count) * 10 * 1'000'000'000 / baud());
  }
};

struct SerialOptions {
  int baud{1'000'000};      ///< [bit/s]; any number that the adapter can make.
  bool is_emulated{false};  ///< The device must be the link of an emulator that lives.
  bool low_latency{true};   ///< Asks the adapter to hand bytes over at once: FTDI waits 16 ms else.
};

/// A serial device such as /dev/ttyUSB0, or a pseudo-terminal. The line is raw: 8 bits, no parity,
/// 1 stop bit, no flow control.
class SerialPort final : public Port {
 public:
  /// Opens the device for this process alone.
  /// @throws InvalidArgument, SystemError with the remedy, for example if this user may not open
  /// it, another program has it, or it is not a serial device
  explicit SerialPort(const std::string& path, const SerialOptions& options = {});
  ~SerialPort() override;

  /// What the device refused, one sentence with the remedy each; empty if it granted everything.
  [[nodiscard]] const std::vector<std::string>& warnings() const noexcept { return warnings_; }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }

  [[nodiscard]] Instant now() const noexcept override { return std::chrono::steady_clock::now(); }
  [[nodiscard]] int baud() const noexcept override { return options_.baud; }
  [[nodiscard]] bool is_open() const noexcept override { return static_cast<bool>(device_); }
  void reopen() override { open(); }
  [[nodiscard]] bool write(std::span<const std::uint8_t> bytes, Instant deadline) noexcept override;
  [[nodiscard]] std::size_t read(std::span<std::uint8_t> bytes, Instant deadline) noexcept override;
  void sleep_until(Instant instant) noexcept override;

 private:
  // Waits until the device can do one of `events`. False at the deadline or if it has gone.
  bool wait_for(short events, Instant deadline) noexcept;
  void open();
  void set_up();
  void lower_latency();
  void close() noexcept;

  std::string path_;
  SerialOptions options_;
  ipc::FileDescriptor device_;  // none once the line has gone
  std::vector<std::string> warnings_;
};

}  // namespace trifinger::dynamixel
