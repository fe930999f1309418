// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "can/frame.hpp"
#include "trifinger/ipc/fork.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::can {

/// What a node can do on its bus now.
enum class Link : std::uint8_t {
  kUp,
  kPassive,  ///< Up, but the controller counted so many errors that it no longer reports them.
  kBusOff,   ///< The controller has left the bus after too many errors. It may be restarted.
  kDown,     ///< Somebody has taken the interface down. It may be taken up again.
  kGone,     ///< The interface was removed. Only a new node can help.
};

/// Why a frame was not sent.
enum class Refusal : std::uint8_t {
  kNone,
  kInvalidFrame,  ///< Its id has more than 11 bits, or it has more than 8 bytes.
  kQueueFull,     ///< Frames that wait to be sent fill the queue. Perhaps nobody acknowledges them.
  kBusOff,        ///< See Link.
  kDown,
  kGone,
  kFailed,  ///< Another error of the system; see `SendResult::error_number`.
};

/// Why nothing is sent on such a link; kNone if it is.
[[nodiscard]] Refusal refusal_of(Link link) noexcept;

struct SendResult {
  std::size_t sent{0};              ///< The first `sent` frames were handed over.
  Refusal refusal{Refusal::kNone};  ///< Why the next one was not.
  int error_number{0};              ///< That of the system, for kFailed.
};

/// A node's view of its bus since it was made.
struct BusState {
  Link link{Link::kUp};
  std::uint64_t received{0};  ///< [frames]
  std::uint64_t sent{0};      ///< [frames]
  /// Frames that reached this node and were dropped because it did not receive them in time.
  std::uint64_t lost{0};
  /// Calls of `receive` that used all of their budget, so that more frames may have been waiting.
  std::uint64_t overloads{0};
  std::uint64_t invalid{0};  ///< Messages that were no standard data frames.

  // What the controller reported in error frames.
  std::uint64_t error_frames{0};
  std::uint64_t error_passives{0};        ///< Changes to Link::kPassive.
  std::uint64_t bus_offs{0};              ///< Changes to Link::kBusOff.
  std::uint64_t restarts{0};              ///< Restarts after bus-off.
  std::uint64_t no_acknowledgements{0};   ///< Transmissions that no other node acknowledged.
  std::uint64_t controller_overflows{0};  ///< Times when the controller itself lost frames.
};

/// A node on a CAN bus, for a loop at 1 kHz: no call blocks, allocates or throws.
///
/// Each frame reaches every other node on the bus, but not its sender. The frames of one sender
/// arrive in order. All calls must come from one thread at a time. To a forked child, the bus of
/// its parent is gone.
class Bus {
 public:
  Bus() = default;
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;
  virtual ~Bus() = default;

  /// Moves waiting frames into `budget` and returns those that it has got, oldest first for each
  /// sender. The size of `budget` bounds the work: what exceeds it waits for the next call.
  [[nodiscard]] std::span<const Frame> receive(std::span<Frame> budget) noexcept TRIFINGER_REALTIME;

  /// Hands `frames` over for sending, in this order. Stops at the first one that is refused.
  [[nodiscard]] SendResult send(std::span<const Frame> frames) noexcept TRIFINGER_REALTIME;

  /// What was known at the last call of `receive` or `send`.
  [[nodiscard]] const BusState& state() const noexcept { return state_; }

 protected:
  /// True in a child that was forked after this node was made.
  [[nodiscard]] bool is_inherited() const noexcept { return fork_.is_inherited(); }

  BusState state_;

 private:
  /// Returns the number of frames received. Counts overloads, losses and what else it notices.
  virtual std::size_t do_receive(std::span<Frame> budget) noexcept TRIFINGER_REALTIME = 0;
  /// Sends valid frames.
  virtual SendResult do_send(std::span<const Frame> frames) noexcept TRIFINGER_REALTIME = 0;

  ipc::ForkGuard fork_;
};

}  // namespace trifinger::can
