// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "commands.hpp"

// The commands of `trifinger log`, each defined in a file of its own.
namespace trifinger::apps {

void add_log_info(CLI::App& log, Action& action);
void add_log_check(CLI::App& log, Action& action);
void add_log_recover(CLI::App& log, Action& action);
void add_log_cut(CLI::App& log, Action& action);
void add_log_rescue(CLI::App& log, Action& action);
void add_log_replay(CLI::App& log, Action& action);

}  // namespace trifinger::apps
