// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <csignal>
#include <optional>

#include "trifinger/base/time.hpp"

namespace trifinger::apps {

// Receives SIGINT, SIGTERM and SIGHUP where the program waits for them, and nowhere else. To be
// made before any thread: they inherit that these signals are blocked.
class Signals {
 public:
  Signals();
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;
  ~Signals() = default;

  // Waits for one of the signals, or for `notify`. Nothing if none came in time.
  [[nodiscard]] std::optional<int> wait(Nanoseconds timeout) const;
  // Ends the wait of this process, from any of its threads.
  static void notify() noexcept;
  // Lets `signal` do to this process what it does to others.
  [[noreturn]] static void die_of(int signal);

 private:
  sigset_t set_{};
};

}  // namespace trifinger::apps
