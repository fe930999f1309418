// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "support/shared_value.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::test {

/// Interrupts every thread of this process, and of others, thousands of times a second. It uses a
/// signal after which no system call continues by itself. The handler stays installed, because some
/// signals may still be under way.
class Interruptions {
 public:
  /// From now on this process and its future children handle the signal.
  Interruptions() {
    struct sigaction action{};
    action.sa_handler = [](int) {
      // relaxed: a number that guards no data.
      total->fetch_add(1, std::memory_order_relaxed);
    };
    if (::sigaction(SIGUSR1, &action, nullptr) != 0) throw SystemError("handle a signal", errno);
  }
  Interruptions(const Interruptions&) = delete;
  Interruptions& operator=(const Interruptions&) = delete;
  ~Interruptions() { end(); }

  /// Starts interrupting, including these children.
  void begin(std::vector<pid_t> children = {}) {
    children.push_back(::getpid());
    thread_ = std::thread([this, processes = std::move(children)] { interrupt(processes); });
  }
  /// Stops. Returns when no further signal is sent.
  void end() {
    is_over_.store(true, std::memory_order_relaxed);
    if (thread_.joinable()) thread_.join();
  }
  /// Returns how often threads of all processes together were interrupted since this process began.
  [[nodiscard]] static std::int64_t count() noexcept {
    return total->load(std::memory_order_relaxed);
  }

 private:
  // Outlives its test, like the handler does.
  static inline SharedValue<std::atomic<std::int64_t>> total;

  void interrupt(const std::vector<pid_t>& processes) const {
    std::minstd_rand random(1);
    const pid_t self = ::gettid();
    while (!is_over_.load(std::memory_order_relaxed)) {
      for (const pid_t process : processes) {
        const std::filesystem::path tasks = "/proc/" + std::to_string(process) + "/task";
        std::error_code gone;
        for (const auto& task : std::filesystem::directory_iterator(tasks, gone)) {
          const pid_t thread = std::stoi(task.path().filename());
          if (thread != self) ::syscall(SYS_tgkill, process, thread, SIGUSR1);
        }
      }
      std::this_thread::sleep_for(std::chrono::microseconds(random() % 20));
    }
  }

  std::atomic<bool> is_over_{false};
  std::thread thread_;
};

}  // namespace trifinger::test
