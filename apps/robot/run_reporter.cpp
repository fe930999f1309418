// SPDX-License-Identifier: BSD-3-Clause
#include "robot/run_reporter.hpp"

#include <fmt/core.h>

#include <cstdint>

#include "robot/session_state.hpp"
#include "shared/text.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {

void RunReporter::look(bool is_stopping, const std::string& recorder_error) {
  if (session_) observe(*session_);
  // A next session is searched only when there may be one, because mapping memory costs time in
  // the process of the loop.
  if (!session_ || phase_ == SessionInfo::Phase::kEnded) find_next_session();
  if (session_ && console_.is_live()) console_.draw(status_line(is_stopping, recorder_error));
}

void RunReporter::find_next_session() {
  try {
    UntypedFrontend found(host_, {.control = false, .timeout = Timeout::zero()});
    const std::uint64_t id = found.session().info().session_id;
    if (session_ && id == session_->session().info().session_id) return;
    session_.emplace(std::move(found));
    phase_.reset();
    observe(*session_);
  } catch (const Error&) {
    return;  // No session yet, or somebody has damaged it; then another one follows soon.
  }
}

void RunReporter::observe(const UntypedFrontend& session) {
  const SessionInfo info = session.session().info();
  figures_.update(session);
  if (info.phase != phase_) report(info);
  phase_ = info.phase;
}

void RunReporter::report(const SessionInfo& info) {
  switch (info.phase) {
    case SessionInfo::Phase::kPreparing:
      print("prepares");
      break;
    case SessionInfo::Phase::kHolding:
      print("holds its pose and waits for a user");
      break;
    case SessionInfo::Phase::kRunning:
      print("runs, controlled by " + controller_text(info));
      break;
    case SessionInfo::Phase::kEnded:
      report_end(info);
      break;
  }
}

void RunReporter::report_end(const SessionInfo& info) {
  const bool is_fault = info.fault.needs_recovery();
  print(info.fault_text, is_fault ? Style::kBad : Style::kPlain);
  if (figures_.total().steps > 0) print(summary(info));
  if (is_fault) print(fmt::format("waits for 'trifinger recover {}'", name_), Style::kWarning);
}

std::string RunReporter::summary(const SessionInfo& info) const {
  const StepCounts& total = figures_.total();
  std::string text =
      fmt::format("{}, {} at the end", counted(info.steps, "step"), rate_text(figures_.rate()));
  if (info.is_real_time) {
    text += fmt::format(", {}, {} skipped", counted(total.repeats, "repeat"), total.skipped);
    if (const auto timing = session_->session().timing()) {
      text += "; lateness " + describe(timing->lateness());
    }
  }
  return text;
}

std::vector<Segment> RunReporter::status_line(bool is_stopping,
                                              const std::string& recorder_error) const {
  const SessionInfo info = session_->session().info();
  const Health health = health_of(info);
  const std::string state = is_stopping ? "stopping" : state_text(info);
  std::vector<Segment> segments{{name_, 10, Style::kBold},
                                {state, 11, is_stopping ? Style::kWarning : style_of(health)}};
  if (!recorder_error.empty()) {
    segments.push_back({"recorder " + recorder_error, 10, Style::kBad});
  }
  if (info.phase == SessionInfo::Phase::kRunning) {
    const StepCounts recent = figures_.last_second();
    segments.push_back({rate_text(figures_.rate()), 9, Style::kPlain});
    segments.push_back({fmt::format("step {}", info.steps), 8, Style::kPlain});
    if (info.is_real_time) {
      const LatenessHistogram lateness = figures_.lateness();
      segments.push_back({fmt::format("late p99 {} max {}", duration_text(lateness.quantile(0.99)),
                                      duration_text(lateness.max())),
                          6, Style::kPlain});
      segments.push_back({fmt::format("repeats {}", figures_.total().repeats), 7,
                          recent.repeats > 0 ? Style::kWarning : Style::kPlain});
    }
    segments.push_back({controller_text(info), 5, Style::kDim});
  }
  return segments;
}

}  // namespace trifinger::apps
