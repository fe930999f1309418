// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <chrono>
#include <optional>
#include <string>

#include "commands.hpp"
#include "log/copy.hpp"
#include "log/options.hpp"
#include "shared/output.hpp"
#include "trifinger/base/text.hpp"

namespace trifinger::apps {
namespace {

constexpr Nanoseconds kLongest = std::chrono::seconds(1'000'000'000);  // longer than any log

struct LogCutOptions {
  std::string log;
  std::string output;
  std::string robot;
  std::optional<TimeIndex> first;
  std::optional<TimeIndex> last;
  std::optional<Nanoseconds> from;
  std::optional<Nanoseconds> to;
  log::Precision precision{log::Precision::kDouble};
};

int cut(const LogCutOptions& options) {
  const log::Log log(options.log);
  log::CopyOptions copy{.session = options.robot,
                        .first = options.first,
                        .last = options.last,
                        .precision = options.precision};
  if (options.from || options.to) {
    const auto [first, last] =
        log.session(options.robot)
            .between(options.from.value_or(Nanoseconds::zero()), options.to.value_or(kLongest));
    if (options.from) copy.first = first;
    if (options.to) copy.last = last;
  }
  log::copy(log, options.output, copy);
  const log::Log result{std::filesystem::path(options.output)};
  print_safely("{} written: {}", options.output, size_text(result.size()));
  for (const log::LoggedSession& session : result.sessions()) {
    const auto [first, end] = session.range(Series::kAppliedAction);
    if (first < end) print_safely(", steps {} to {} of '{}'", first, end - 1, session.name());
  }
  print_safely(".\n");
  return kDone;
}

}  // namespace

void add_log_cut(CLI::App& log, Action& action) {
  const auto& [command, options] =
      add_command(log, action, "cut", "Write a part of a log to a new file", cut);
  add_log_file(command, options.log);
  add_output(command, options.output, "The new file")->required();
  command
      .add_option("--robot", options.robot,
                  "Robot whose newest session is cut; needed if the log has several robots")
      ->option_text("NAME");
  const auto [first, last] = add_steps(command, options.first, options.last);
  add_seconds(command, "--from", options.from, 1e9,
              "Begin of the part, in seconds since the first step in the log")
      ->excludes(first);
  add_seconds(command, "--to", options.to, 1e9,
              "End of the part, in seconds since the first step in the log")
      ->excludes(last);
  add_precision(command, options.precision);
  command.footer(
      "The new file keeps sessions, documents and events, and what other robots did at that time.\n"
      "Without a range it has everything.\n"
      "Example:\n"
      "  trifinger log cut run.mcap --from 10 --to 12.5 -o interesting.mcap");
}

}  // namespace trifinger::apps
