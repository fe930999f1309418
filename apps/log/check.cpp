// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <filesystem>
#include <string>
#include <vector>

#include "commands.hpp"
#include "log/repair.hpp"
#include "log/summary.hpp"
#include "shared/json.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/terminal.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::apps {
namespace {

struct LogCheckOptions {
  std::vector<std::string> paths;
  bool json{false};
};

int check(const LogCheckOptions& options) {
  const Terminal terminal;
  bool is_whole = true;
  Json files = Json::array();
  for (const std::string& path : options.paths) {
    for (const std::filesystem::path& file : log::files_of(path)) {
      const log::FileReport report = log::check(file);
      is_whole = is_whole && report.is_whole();
      if (options.json) {
        files.push_back({{"file", file.string()},
                         {"is_whole", report.is_whole()},
                         {"is_finished", report.is_finished},
                         {"lost_bytes", report.lost_bytes},
                         {"size", report.size},
                         {"messages", report.messages},
                         {"damage", list_of(report.damage, text_of)}});
        continue;
      }
      const std::string verdict = report.is_whole()    ? terminal.paint("whole", Style::kGood)
                                  : report.is_finished ? terminal.paint("damaged", Style::kBad)
                                  : report.lost_bytes > 0
                                      ? terminal.paint("cut off", Style::kBad)
                                      : terminal.paint("not finished", Style::kWarning);
      fmt::print("{}  {}: {}, {} messages\n", terminal.paint(file.string(), Style::kPlain), verdict,
                 size_text(report.size), report.messages);
      for (const log::Damage& damage : report.damage) print_safely("  {}\n", text_of(damage));
      if (!report.is_whole()) {
        print_safely("  'trifinger log recover {}' writes a whole file of what is there.\n",
                     file.string());
      }
    }
  }
  if (options.json) print_json(Json::object({{"is_whole", is_whole}, {"files", files}}));
  return is_whole ? kDone : kFailed;
}

}  // namespace

void add_log_check(CLI::App& log, Action& action) {
  const auto& [command, options] =
      add_command(log, action, "check", "Read every byte and name what is damaged", check);
  command.add_option("LOG", options.paths, "Files, or folders with parts")->required();
  add_json(command, options.json);
  command.footer(
      "The command works for every MCAP file. Exit code 0 if all are whole, 1 otherwise.\n"
      "Example:\n"
      "  trifinger log check run.mcap");
}

}  // namespace trifinger::apps
