// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "core/refused_sessions.hpp"
#include "robot/loop_figures.hpp"
#include "robot/session_state.hpp"
#include "shared/json.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/terminal.hpp"
#include "shared/text.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::apps {
namespace {

constexpr std::size_t kNumColumns = 7;
using Row = std::array<std::string, kNumColumns>;

constexpr std::size_t kStateColumn = 1;

struct ListOptions {
  bool json{false};
};

std::optional<double> rate_of(const SessionInfo& info) {
  if (health_of(info) != Health::kGood || info.phase != SessionInfo::Phase::kRunning) return {};
  try {
    const UntypedFrontend session(info.name, {.control = false});
    if (info.is_companion) return arrival_rate(session);
    LoopFigures figures;
    figures.update(session);
    return figures.rate();
  } catch (const Error&) {
    return {};  // it disappeared since it was listed
  }
}

Json with_rate(const SessionInfo& info) {
  Json json = json_of(info);
  const std::optional<double> rate = rate_of(info);
  json["rate"] = rate ? Json(*rate) : Json();
  return json;
}

Row row_of(const SessionInfo& info) {
  const std::optional<double> rate = rate_of(info);
  return {info.name,
          state_text(info),
          rate ? rate_text(*rate) : "-",
          std::to_string(info.steps),
          info.type,
          info.backend_is_alive ? ipc::describe(info.backend) : "-",
          info.is_companion || !info.backend_is_alive ? "-" : controller_text(info)};
}

int list(const ListOptions& options) {
  const std::vector<SessionInfo> sessions = list_sessions();
  for (const std::string& reason : refused_sessions()) print_safely(stderr, "{}\n", reason);
  if (options.json) {
    print_json(Json::object({{"sessions", list_of(sessions, with_rate)}}));
    return kDone;
  }
  if (sessions.empty()) {
    fmt::print("There is no session in {}; 'trifinger run sim' starts one.\n",
               session_folder().string());
    return kDone;
  }

  std::vector<Row> rows{{"NAME", "STATE", "RATE", "STEPS", "TYPE", "BACK-END", "CONTROLLER"}};
  std::array<std::size_t, kNumColumns> widths{};
  for (const SessionInfo& info : sessions) rows.push_back(row_of(info));
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < kNumColumns; ++i) {
      widths[i] = std::max(widths[i], columns_of(row[i]));
    }
  }

  const Terminal terminal;
  const std::size_t width = terminal.width();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::vector<Segment> segments;
    for (std::size_t column = 0; column < kNumColumns; ++column) {
      Style style = i == 0 ? Style::kBold : Style::kPlain;
      if (i > 0 && column == kStateColumn) style = style_of(health_of(sessions[i - 1]));
      const bool is_last = column + 1 == kNumColumns;
      segments.push_back({is_last ? rows[i][column] : pad(rows[i][column], widths[column]),
                          -static_cast<int>(column), style});
    }
    fmt::print("{}\n", fit(std::move(segments), width, terminal));
  }
  return kDone;
}

}  // namespace

void add_list(CLI::App& program, Action& action) {
  const auto& [command, options] = add_command(
      program, action, "list", "List the sessions on this machine, with their companions", list);
  add_json(command, options.json);
  command.footer(
      "The session of a dead back-end stays readable until another back-end takes its name.\n"
      "Example:\n"
      "  trifinger list");
}

}  // namespace trifinger::apps
