// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <optional>
#include <string>

#include "commands.hpp"
#include "log/options.hpp"
#include "log/summary.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::apps {
namespace {

struct LogInfoOptions {
  std::string log;
  bool json{false};
  bool events{false};
};

int info(const LogInfoOptions& options) {
  std::optional<log::Log> log;
  try {
    log.emplace(std::filesystem::path(options.log));
  } catch (const mcap::FormatError& error) {
    if (std::filesystem::is_directory(options.log)) throw;
    const McapSummary summary = summary_of(options.log, error.what());
    if (options.json) {
      print_json(summary);
    } else {
      print(summary);
    }
    return kDone;
  }
  const LogSummary summary = summary_of(*log);
  if (options.json) {
    print_json(summary);
  } else {
    print(summary, options.events);
  }
  return kDone;
}

}  // namespace

void add_log_info(CLI::App& log, Action& action) {
  const auto& [command, options] =
      add_command(log, action, "info",
                  "Tell what is in a log: sessions, duration, rates, faults, gaps, damage", info);
  add_log_file(command, options.log);
  add_json(command, options.json);
  command.add_flag("--events", options.events, "Show all events, not only warnings and errors");
  command.footer(
      "The command reads the whole log. For other MCAP files it lists the topics.\n"
      "Example:\n"
      "  trifinger log info run.mcap");
}

}  // namespace trifinger::apps
