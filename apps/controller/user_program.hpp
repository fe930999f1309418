// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/App.hpp>
#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "trifinger/core/session.hpp"
#include "trifinger/realtime/thread.hpp"

// Shared parts of programs that drive a robot which runs in another process.
namespace trifinger::apps {

inline constexpr int kInterrupted = 130;

// --scheduling
void add_user_scheduling(CLI::App& program, Demand& demand);

// Returns what the thread that drives `robot` asks of the machine: nothing unless the robot is in
// real-time mode.
[[nodiscard]] RealtimeOptions realtime_beside(const SessionInfo& robot, Demand demand);

// Returns a flag that the first SIGINT or SIGTERM sets from now on. The second one ends the
// program as usual.
[[nodiscard]] const std::atomic<bool>& stop_on_signals();

// Parses `words`, then does `work`. Returns the exit code.
int run_user_program(CLI::App& program, const std::vector<std::string>& words,
                     const std::function<int()>& work);

}  // namespace trifinger::apps
