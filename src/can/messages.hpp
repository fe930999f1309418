// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <linux/can.h>
#include <sys/socket.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "can/bus.hpp"
#include "can/frame.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::can {

// The system calls that a bus makes in the loop, without waiting. Tests have others.
class SocketCalls {
 public:
  SocketCalls() = default;
  SocketCalls(const SocketCalls&) = delete;
  SocketCalls& operator=(const SocketCalls&) = delete;
  virtual ~SocketCalls() = default;

  // Both return the number of messages, or minus the number of the error.
  virtual int receive(int socket, std::span<mmsghdr> messages) noexcept;
  virtual int send(int socket, std::span<mmsghdr> messages) noexcept;
  // Whether a network interface is up and running. Any socket will do.
  [[nodiscard]] virtual bool is_running(int socket, const std::string& interface) noexcept;

  [[nodiscard]] static SocketCalls& of_kernel() noexcept;
};

// A message as it is in memory. On a CAN socket it is the frame alone. On a bus between processes
// the sender adds how many frames it has dropped for this receiver so far, modulo 2^32, and what it
// says of the receiver's link.
struct Packet {
  can_frame frame{};
  std::uint32_t dropped{0};
  std::uint32_t link{0};  // a Link
};
static_assert(sizeof(can_frame) == CAN_MTU && sizeof(Packet) == CAN_MTU + 8);

[[nodiscard]] can_frame to_wire(const Frame& frame) noexcept;
// Empty for whatever is no standard data frame.
[[nodiscard]] std::optional<Frame> from_wire(const can_frame& wire, Instant time) noexcept;

// How many messages one system call moves at most.
inline constexpr std::size_t kBatchSize = 64;

// Makes a socket stamp its messages; Incoming::stamp is then set. Returns false if it cannot.
[[nodiscard]] bool enable_stamps(int socket) noexcept;

// A message that was received.
struct Incoming {
  std::size_t size{0};  // [bytes]; 0: the other end was closed; larger than a packet: cut off.
  Packet packet;
  std::optional<Nanoseconds> stamp;  // on the wall clock
  // Messages that this socket has dropped so far, modulo 2^32, because its queue was full.
  std::optional<std::uint32_t> overflow;
};

// Memory to receive messages in, made once.
class IncomingBatch {
 public:
  // `size` is that of a message [bytes].
  explicit IncomingBatch(std::size_t size);

  // Receives up to `count` messages. Returns their number, or minus the number of the error.
  int receive(SocketCalls& calls, int socket, std::size_t count) noexcept;
  // Message `i` of those received last.
  [[nodiscard]] Incoming operator[](std::size_t i) const noexcept;

 private:
  static constexpr std::size_t kControlSize =
      CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t));
  struct alignas(cmsghdr) Control {
    std::array<std::byte, kControlSize> bytes;
  };

  std::vector<Packet> packets_;
  std::vector<Control> controls_;
  std::vector<iovec> parts_;
  std::vector<mmsghdr> headers_;
};

// Memory to send messages from, made once.
class OutgoingBatch {
 public:
  explicit OutgoingBatch(std::size_t size);

  // Takes the first frames, at most kBatchSize of them. Returns their number.
  std::size_t fill(std::span<const Frame> frames) noexcept;
  // Takes a message that is no frame, for what stands beside it.
  void fill_without_frame() noexcept;
  void set_dropped(std::uint32_t dropped) noexcept;
  void set_link(Link link) noexcept;
  // Sends what was filled in. Returns how many were sent; `error` says why not all, else it is 0.
  std::size_t send(SocketCalls& calls, int socket, int& error) noexcept;

 private:
  std::size_t count_{0};
  std::vector<Packet> packets_;
  std::vector<iovec> parts_;
  std::vector<mmsghdr> headers_;
};

}  // namespace trifinger::can
