// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <memory>
#include <random>

#include "session_layout.hpp"
#include "session_memory.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/ring.hpp"
#include "trifinger/ipc/shared_memory.hpp"

namespace trifinger::test {

/// The action file of the current session of "robot".
[[nodiscard]] inline std::filesystem::path action_path() {
  return session_folder() / detail::action_file("robot", Session::open("robot").info().session_id);
}

/// Another mapping of the queue of "robot", beside the controller's. It writes where only the
/// layout of the session knows: a test program with it has src/core among its include folders.
template <class Action>
class Intruder {
 public:
  Intruder()
      : mapping_(std::make_shared<detail::FolderDirectory>(session_folder()), "robot"),
        memory_(ipc::SharedMemory::open(action_path(), ipc::Access::kReadWrite)),
        queue_(memory_.data() + mapping_.header().queue.offset, mapping_.header().queue.shape) {}

  [[nodiscard]] layout::ActionHeader& header() const noexcept {
    return *reinterpret_cast<layout::ActionHeader*>(memory_.data());
  }
  [[nodiscard]] const ipc::Ring& queue() const noexcept { return queue_; }
  /// Makes `action` the one for step `t`.
  void put(TimeIndex t, const Action& action) const {
    std::array<std::byte, 8 + sizeof(Action)> entry{};
    std::memcpy(entry.data() + 8, &action, sizeof(action));
    queue_.write(t, entry.data(), std::memory_order_seq_cst);
  }
  /// Writes `count` random bytes to random places.
  void scribble(std::mt19937& random, int count) const {
    for (int i = 0; i < count; ++i) {
      memory_.data()[random() % memory_.size()] = static_cast<std::byte>(random());
    }
  }

 private:
  detail::SessionMapping mapping_;
  ipc::SharedMemory memory_;
  ipc::Ring queue_;
};

}  // namespace trifinger::test
