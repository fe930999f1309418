// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "commands.hpp"
#include "log/flight_recorder.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::apps {
namespace {

struct LogRescueOptions {
  std::string name;
  std::string output;
  Nanoseconds length{std::chrono::seconds(10)};
};

int rescue(const LogRescueOptions& options) {
  std::optional<std::filesystem::path> output;
  if (!options.output.empty()) output = options.output;
  const std::filesystem::path file = log::rescue(options.name, std::move(output), options.length);
  const log::Log log(file);
  const log::LoggedSession session = log.session(options.name);
  std::string steps = "no whole step";
  if (session.has_elements()) {
    const auto [first, end] = session.range(Series::kAppliedAction);
    if (first < end) steps = fmt::format("steps {} to {}", first, end - 1);
  }
  print_safely("{} written: {}, {} of '{}'.\n", file.string(), size_text(log.size()), steps,
               session.name());
  return kDone;
}

}  // namespace

void add_log_rescue(CLI::App& log, Action& action) {
  const auto& [command, options] = add_command(
      log, action, "rescue", "Write a log of what a killed back-end has left in memory", rescue);
  command.add_option("NAME", options.name, "The robot whose back-end is gone")->required();
  add_output(command, options.output,
             "The new file; default: NAME_TIME_fault.mcap in $TRIFINGER_LOG_DIR or "
             "~/.local/state/trifinger");
  add_seconds(command, "--length", options.length, 1e9,
              "Length of the log, up to the end of the session; default: 10");
  command.footer(
      "The memory stays until the next back-end of this name starts, or the machine restarts.\n"
      "Example:\n"
      "  trifinger log rescue sim -o crash.mcap");
}

}  // namespace trifinger::apps
