// SPDX-License-Identifier: BSD-3-Clause
// Buses on which every node must keep the contract of bus_contract_test.cpp.
#pragma once

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "can/memory_bus.hpp"
#include "can/raw_socket.hpp"
#include "can/socket_can.hpp"
#include "can/unix_bus.hpp"
#include "support/session_folder.hpp"

namespace trifinger::can::test {

/// Nodes of a bus in memory.
class MemoryNodes {
 public:
  std::unique_ptr<Bus> connect() { return bus_.connect(); }
  [[nodiscard]] Instant now() const { return clock_.now(); }
  /// Lets time pass.
  void pass() { clock_.advance(std::chrono::milliseconds(1)); }

 private:
  ManualClock clock_;
  MemoryBus bus_{clock_};
};

class RealTime {
 public:
  [[nodiscard]] static Instant now() { return std::chrono::steady_clock::now(); }
  static void pass() {}
};

/// Nodes of a bus between processes, all in this one.
class UnixNodes : public RealTime {
 public:
  std::unique_ptr<Bus> connect() const { return join_unix_bus(folder_.path() / "bus"); }

 private:
  trifinger::test::SessionFolder folder_;
};

/// Nodes with the code of SocketCAN on pairs of sockets. In place of the kernel, this class passes
/// each frame on to all other nodes, and counts what their queues have no room for.
class SocketPairNodes : public RealTime {
 public:
  std::unique_ptr<Bus> connect() {
    std::array<int, 2> ends{};
    ipc::FileDescriptor socket([&ends] {
      constexpr int kType = SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC;
      return ::socketpair(AF_UNIX, kType, 0, ends.data()) == 0 ? ends[0] : -1;
    });
    if (!socket || !enable_stamps(socket.get())) throw SystemError("make a pair of sockets", errno);
    calls_.forget(ends[0]);
    calls_.wires.push_back({.node = ends[0], .kernel = ends[1]});
    return std::make_unique<RawSocket>(std::move(socket), "pair", calls_);
  }

 private:
  struct Wire {
    int node;
    int kernel;
    std::uint32_t overflow{0};
  };

  class Calls final : public SocketCalls {
   public:
    Calls() = default;
    Calls(const Calls&) = delete;
    Calls& operator=(const Calls&) = delete;
    ~Calls() override {
      for (const Wire& wire : wires) ::close(wire.kernel);
    }

    // A node of this number, if there was one, has been closed.
    void forget(int node) {
      std::erase_if(wires, [node](const Wire& wire) {
        return wire.node == node && ::close(wire.kernel) == 0;
      });
    }

    int receive(int socket, std::span<mmsghdr> messages) noexcept override {
      const int count = SocketCalls::receive(socket, messages);
      const auto wire = std::ranges::find(wires, socket, &Wire::node);
      for (int i = 0; i < count; ++i) {
        add_overflow(messages[static_cast<std::size_t>(i)].msg_hdr, wire->overflow);
      }
      return count;
    }

    [[nodiscard]] bool is_running(int /*socket*/, const std::string&) noexcept override {
      return true;
    }

    int send(int socket, std::span<mmsghdr> messages) noexcept override {
      const int count = SocketCalls::send(socket, messages);
      const auto sender = std::ranges::find(wires, socket, &Wire::node);
      can_frame frame{};
      while (::recv(sender->kernel, &frame, sizeof(frame), MSG_DONTWAIT) == sizeof(frame)) {
        for (Wire& wire : wires) {
          if (wire.node == socket) continue;
          const ssize_t sent =
              ::send(wire.kernel, &frame, sizeof(frame), MSG_DONTWAIT | MSG_NOSIGNAL);
          if (sent < 0 && errno == EAGAIN) ++wire.overflow;
        }
      }
      return count;
    }

    std::vector<Wire> wires;

   private:
    // Adds what the kernel adds for SO_RXQ_OVFL. The node has room for it.
    static void add_overflow(msghdr& header, std::uint32_t overflow) noexcept {
      if (overflow == 0) return;
      cmsghdr control{};
      control.cmsg_len = CMSG_LEN(sizeof(overflow));
      control.cmsg_level = SOL_SOCKET;
      control.cmsg_type = SO_RXQ_OVFL;
      auto* const end = static_cast<std::byte*>(header.msg_control) + header.msg_controllen;
      std::memcpy(end, &control, sizeof(control));
      std::memcpy(end + sizeof(control), &overflow, sizeof(overflow));
      header.msg_controllen += CMSG_SPACE(sizeof(overflow));
    }
  };

  Calls calls_;
};

/// Nodes of the CAN interface $TRIFINGER_TEST_CAN, default vcan0. Nobody else may use it.
class SocketCanNodes : public RealTime {
 public:
  static std::unique_ptr<Bus> connect() {
    const char* const name = std::getenv("TRIFINGER_TEST_CAN");
    return open_socket_can(name != nullptr ? name : "vcan0");
  }
};

}  // namespace trifinger::can::test
