// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <filesystem>
#include <string>

#include "commands.hpp"
#include "log/repair.hpp"
#include "log/summary.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "trifinger/base/text.hpp"

namespace trifinger::apps {
namespace {

struct LogRecoverOptions {
  std::string file;
  std::string output;
};

int recover_log(const LogRecoverOptions& options) {
  if (std::filesystem::is_directory(options.file)) {
    throw UsageError(options.file + " is a folder; name one of its files");
  }
  std::filesystem::path output = options.output;
  if (output.empty()) {
    output = options.file;
    output.replace_extension(".recovered.mcap");
  }
  const log::FileReport report = log::recover(options.file, output);
  for (const log::Damage& damage : report.damage) print_safely("{}\n", text_of(damage));
  const bool is_all = report.lost_bytes == 0 && report.damage.empty();
  print_safely("{} written: {} messages, {}.\n", output.string(), report.messages,
               is_all ? "nothing is lost" : size_text(report.lost_bytes) + " could not be used");
  return is_all ? kDone : kIncomplete;
}

}  // namespace

void add_log_recover(CLI::App& log, Action& action) {
  const auto& [command, options] = add_command(
      log, action, "recover", "Write a new, whole file with all that can be read of a damaged one",
      recover_log);
  command.add_option("FILE", options.file, "The damaged file; it stays as it is")->required();
  add_output(command, options.output,
             "The new file; default: FILE with the ending .recovered.mcap");
  command.footer(
      "The command works for every MCAP file. A recovered log notes what is lost as gaps.\n"
      "Exit code 0 if nothing is lost, 3 if something is, 1 if no file could be written.\n"
      "Example:\n"
      "  trifinger log recover run.mcap -o whole.mcap");
}

}  // namespace trifinger::apps
