// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "arrival_time.hpp"
#include "can/bus.hpp"
#include "messages.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::can {

// A node on a socket whose messages are CAN frames, error frames among them.
class RawSocket final : public Bus {
 public:
  RawSocket(ipc::FileDescriptor socket, std::string interface,
            SocketCalls& calls = SocketCalls::of_kernel());

 private:
  std::size_t do_receive(std::span<Frame> budget) noexcept override;
  SendResult do_send(std::span<const Frame> frames) noexcept override;
  // Returns the frame of a message, and notes what else the message tells.
  std::optional<Frame> take(const Incoming& message, const ClockPair& now) noexcept;
  void note_error(int error) noexcept;
  void note_down() noexcept;
  [[nodiscard]] bool is_running() noexcept;

  ipc::FileDescriptor socket_;
  std::string interface_;
  SocketCalls& calls_;
  IncomingBatch incoming_{CAN_MTU};
  OutgoingBatch outgoing_{CAN_MTU};
  Instant empty_;   // when the socket was last found empty
  Instant down_{};  // when the interface was last found down
  std::uint32_t overflow_{0};
};

}  // namespace trifinger::can
