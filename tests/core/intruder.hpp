// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <memory>
#include <random>

#include "core/session_directory.hpp"
#include "core/session_layout.hpp"
#include "core/session_mapping.hpp"
#include "core/transports.hpp"
#include "ipc/ring.hpp"
#include "ipc/shared_memory.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::test {

/// Returns the action file of the current session of "robot".
[[nodiscard]] inline std::filesystem::path action_path() {
  return session_folder() / detail::action_file("robot", Session::open("robot").info().session_id);
}

/// A second mapping of the queue of "robot", beside the controller's. It writes to places that only
/// the layout of the session knows, so a test program that uses it has src/core among its include
/// folders.
template <class Action>
class Intruder {
 public:
  Intruder()
      : mapping_(detail::directory_in(session_folder()), "robot"),
        memory_(ipc::SharedMemory::open(action_path(), ipc::Access::kReadWrite)),
        queue_(memory_.data() + mapping_.header().queue.offset, mapping_.header().queue.shape) {}

  [[nodiscard]] detail::ActionHeader& header() const noexcept {
    return *reinterpret_cast<detail::ActionHeader*>(memory_.data());
  }
  [[nodiscard]] const ipc::Ring& queue() const noexcept { return queue_; }
  /// Makes `action` the action for step `t`.
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

/// Waits for y[t] for a user whose action may have been destroyed under way. Nobody replaces that
/// action. Outside real-time mode the robot then waits for ever, and this returns false.
template <class R>
[[nodiscard]] bool observes(const Frontend<R>& robot, const Intruder<typename R::Action>& intruder,
                            TimeIndex t) {
  try {
    static_cast<void>(robot.get_observation(t, std::chrono::seconds(2)));
    return true;
  } catch (const TimedOut&) {
    const TimeIndex open = robot.session().info().steps;
    if (intruder.queue().sequence_in_slot(open) != ipc::Ring::sequence_of(open)) return false;
  }
  // The machine may be busy, so wait longer.
  static_cast<void>(robot.get_observation(t, kLong));
  return true;
}

}  // namespace trifinger::test
