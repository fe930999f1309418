// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <csignal>
#include <optional>

#include "trifinger/base/time.hpp"

namespace trifinger::apps {

// Receives SIGINT, SIGTERM and SIGHUP where the program waits for them, and nowhere else. Make it
// before any thread, because threads inherit that these signals are blocked.
class Signals {
 public:
  Signals();
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;
  ~Signals() = default;

  // Waits for one of the signals or for `notify`. Returns nothing if no signal came in time.
  [[nodiscard]] std::optional<int> wait(Nanoseconds timeout) const;
  // Ends the wait of this process. Any thread may call it.
  static void notify() noexcept;
  // Ends this process the way `signal` usually does.
  [[noreturn]] static void die_of(int signal);

 private:
  sigset_t set_{};
};

}  // namespace trifinger::apps
