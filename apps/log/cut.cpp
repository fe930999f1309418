// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "commands.hpp"
#include "log/text.hpp"
#include "shared/choice.hpp"
#include "trifinger/log/copy.hpp"

namespace trifinger::apps {
namespace {

constexpr double kMost = 1e9;  // [s]: longer than any log

struct LogCutOptions {
  std::string log;
  std::string output;
  std::string robot;
  std::optional<TimeIndex> first;
  std::optional<TimeIndex> last;
  std::optional<double> from;
  std::optional<double> to;
  Choice<log::Precision> precision{
      "--precision",
      "double",
      {{"double", log::Precision::kDouble}, {"single", log::Precision::kSingle}}};
};

int cut(const LogCutOptions& options) {
  const log::Log log(options.log);
  log::CopyOptions copy{.session = options.robot,
                        .first = options.first,
                        .last = options.last,
                        .precision = options.precision.value()};
  if (options.from || options.to) {
    const auto to_time = [](double seconds) {
      return Nanoseconds(static_cast<std::int64_t>(seconds * 1e9));
    };
    const auto [first, last] =
        log.session(options.robot)
            .between(to_time(options.from.value_or(0.0)), to_time(options.to.value_or(kMost)));
    if (options.from) copy.first = first;
    if (options.to) copy.last = last;
  }
  log::copy(log, options.output, copy);
  const log::Log result{std::filesystem::path(options.output)};
  fmt::print("{} written: {}", options.output, size_text(result.size()));
  for (const log::LoggedSession& session : result.sessions()) {
    const auto [first, end] = session.range(Series::kAppliedAction);
    if (first < end) fmt::print(", steps {} to {} of '{}'", first, end - 1, session.name());
  }
  fmt::print(".\n");
  return kDone;
}

}  // namespace

void add_log_cut(CLI::App& log, Action& action) {
  auto options = std::make_shared<LogCutOptions>();
  CLI::App* const command = log.add_subcommand("cut", "Write a part of a log to a new file");
  command->add_option("LOG", options->log, "A file, or a folder: the newest recording in it")
      ->required();
  command->add_option("-o,--output", options->output, "The new file")
      ->required()
      ->option_text("FILE");
  command
      ->add_option("--robot", options->robot,
                   "Whose newest session to cut; needed if there are several robots")
      ->option_text("NAME");
  const CLI::Range steps(TimeIndex{0}, std::numeric_limits<TimeIndex>::max());
  const CLI::Range seconds(0.0, kMost);
  CLI::Option* const first =
      command->add_option("--first", options->first, "First step")->check(steps)->option_text("T");
  CLI::Option* const last = command->add_option("--last", options->last, "First step left out")
                                ->check(steps)
                                ->option_text("T");
  command->add_option("--from", options->from, "First step, in seconds since the first step")
      ->check(seconds)
      ->option_text("SECONDS")
      ->excludes(first);
  command->add_option("--to", options->to, "First step left out, in seconds since the first step")
      ->check(seconds)
      ->option_text("SECONDS")
      ->excludes(last);
  options->precision.add_to(*command, "single halves the bytes, and cannot be replayed exactly");
  command->footer(
      "Sessions, documents and events are kept, and of other robots what was at that time.\n"
      "Without a range it copies everything.\n"
      "Example:\n"
      "  trifinger log cut run.mcap --from 10 --to 12.5 -o interesting.mcap");
  command->callback([&action, options] { action = [options] { return cut(*options); }; });
}

}  // namespace trifinger::apps
