// SPDX-License-Identifier: BSD-3-Clause
#include "controller/user_program.hpp"

#include <csignal>
#include <optional>

#include "shared/command_line.hpp"
#include "shared/exit_code.hpp"
#include "shared/options.hpp"

namespace trifinger::apps {
namespace {

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free);

extern "C" void request_stop(int signal) {
  stop_requested.store(true, std::memory_order_relaxed);  // No other data depends on it.
  std::signal(signal, SIG_DFL);
}

}  // namespace

void add_user_scheduling(CLI::App& program, Demand& demand) {
  add_scheduling(program, demand,
                 "Whether real-time priority is required, if the robot is in real-time mode; "
                 "default: try, and go on without");
}

RealtimeOptions realtime_beside(const SessionInfo& robot, Demand demand) {
  if (!robot.is_real_time) return {.demand = Demand::kOff};
  // Below the back-end's priority, because the back-end must never wait for us.
  return {.demand = demand, .priority = 70, .keep_cpus_awake = false};
}

const std::atomic<bool>& stop_on_signals() {
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  return stop_requested;
}

int run_user_program(CLI::App& program, const std::vector<std::string>& words,
                     const std::function<int()>& work) {
  return run_and_report(full_name(program, words), [&] {
    const std::optional<int> done = parse(program, words);
    return done ? *done : work();
  });
}

}  // namespace trifinger::apps
