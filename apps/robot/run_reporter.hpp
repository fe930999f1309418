// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "robot/loop_figures.hpp"
#include "shared/terminal.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::apps {

// Reports on the robot to the user: a line for each event, and on a terminal one line that is
// always up to date.
class RunReporter {
 public:
  // `host` must outlive the reporter.
  RunReporter(std::string name, const SessionHost& host) : name_(std::move(name)), host_(host) {}

  void print(const std::string& text, Style style = Style::kPlain) {
    console_.print(name_, text, style);
  }
  // Prints a text about something else than the robot.
  void print(const std::string& about, const std::string& text, Style style) {
    console_.print(about, text, style);
  }

  // Reads the current session and reports. `recorder_error` says what is wrong with its recorder.
  void look(bool is_stopping, const std::string& recorder_error);

 private:
  void find_next_session();
  // Reports what has changed.
  void observe(const UntypedFrontend& session);
  void report(const SessionInfo& info);
  void report_end(const SessionInfo& info);
  // Summarises the session that has ended.
  [[nodiscard]] std::string summary(const SessionInfo& info) const;
  [[nodiscard]] std::vector<Segment> status_line(bool is_stopping,
                                                 const std::string& recorder_error) const;

  std::string name_;
  const SessionHost& host_;
  Console console_;
  LoopFigures figures_;
  std::optional<UntypedFrontend> session_;
  std::optional<SessionInfo::Phase> phase_;  // the phase that was reported last
};

}  // namespace trifinger::apps
