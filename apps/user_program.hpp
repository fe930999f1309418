// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/App.hpp>
#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "choice.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/thread.hpp"

// What programs have in common that drive a robot which runs elsewhere.
namespace trifinger::apps {

inline constexpr int kInterrupted = 130;

// The option --scheduling.
[[nodiscard]] Choice<Demand> scheduling_choice();

// What the thread that drives `robot` asks of the machine: nothing unless it is in real-time mode.
[[nodiscard]] RealtimeOptions realtime_beside(const SessionInfo& robot, Demand demand);

// From now on the first SIGINT or SIGTERM sets the flag that is returned; the second one is what it
// is to others.
[[nodiscard]] const std::atomic<bool>& stop_on_signals();

// Understands `words`, then does `work`. Returns the exit code.
int run_user_program(CLI::App& program, const std::vector<std::string>& words,
                     const std::function<int()>& work);

}  // namespace trifinger::apps
