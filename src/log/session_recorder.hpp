// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/log/log_writer.hpp"

namespace trifinger::log {

// Where an earlier recorder has left a session.
struct Position {
  std::filesystem::path file;  // the newest that knows the session
  TimeIndex next_step{0};
  std::map<std::string, TimeIndex> next_elements;  // by companion
  std::int64_t time_offset{0};
  bool has_end{false};    // y_N and its status are in the log
  bool is_closed{false};  // nothing is missing
};

// What is told comes from a robot or from this.
inline constexpr std::string_view kRecorder = "recorder";

// Takes a session, its robot's steps and its companions' elements, from the shared memory to a log.
// Knows how far it has come.
class SessionRecorder {
 public:
  using Tell =
      std::function<void(LogWriter::Level level, std::string_view source, const std::string& text)>;

  // `tell` is called during `pump`. `next_step` is kept at the first step still to read, and may be
  // read by another thread. Throws Error if the session cannot be read.
  SessionRecorder(const Session& robot, const std::vector<Session>& companions,
                  std::shared_ptr<std::atomic<TimeIndex>> next_step, Tell tell);

  // Goes on where the session was left. What the history has lost since then is a gap, unless the
  // recording is another one.
  void go_on_at(const Position& position, bool is_same_recording);
  // Whether the history still holds everything from `step` on.
  [[nodiscard]] bool has_all_since(TimeIndex step) const { return oldest_step() <= step; }
  [[nodiscard]] const SessionHeader& header() const noexcept { return header_; }
  // Outside real-time mode: moves the simulated time behind `time`, where another session ends.
  void begin_after(std::int64_t time) noexcept;
  // Outside real-time mode: of the last step that is in the log. 0 in it.
  [[nodiscard]] std::int64_t last_time() const noexcept;

  // Moves what there is to `log`. If the log throws, what is left comes the next time. `file` is
  // another number for each file: the session begins anew in each.
  void pump(LogWriter& log, int file);
  // Has ended, and everything is in the log.
  [[nodiscard]] bool is_done() const noexcept { return is_done_; }

  [[nodiscard]] const Session& session() const noexcept { return session_; }
  [[nodiscard]] bool backend_is_gone() const { return !session_.info().backend_is_alive; }
  [[nodiscard]] TimeIndex next_step() const noexcept;
  [[nodiscard]] std::shared_ptr<const std::atomic<TimeIndex>> shared_next_step() const noexcept {
    return next_step_;
  }
  // Nothing more will be read.
  void give_up() noexcept;
  // How much of the history is still to be read, 0 to 1.
  [[nodiscard]] double lag() const;
  [[nodiscard]] std::int64_t steps() const noexcept { return steps_; }
  [[nodiscard]] std::int64_t lost_steps() const noexcept { return lost_steps_; }

 private:
  // The series of a companion.
  struct CompanionReader {
    UntypedFrontend series;
    std::size_t element_size;
    TimeIndex next{0};
    std::vector<std::byte> elements;
  };

  void set_next(TimeIndex step) noexcept;
  [[nodiscard]] TimeIndex whole_steps() const;
  [[nodiscard]] TimeIndex oldest_step() const;
  // By how much to stay away from the oldest element, which is about to be overwritten.
  [[nodiscard]] TimeIndex margin(const UntypedFrontend& series) const;
  void pump_steps(LogWriter& log, TimeIndex end);
  std::size_t read_steps(TimeIndex first, std::size_t count);
  void pump_companion(LogWriter& log, std::size_t index);
  void write_end(LogWriter& log, const Fault& fault);
  void lose_steps(LogWriter& log, TimeIndex end);

  Session session_;
  Tell tell_;
  UntypedFrontend robot_;
  std::vector<CompanionReader> companions_;
  SessionHeader header_;
  std::shared_ptr<std::atomic<TimeIndex>> next_step_;
  bool is_fresh_{true};                // begins with what the history holds
  bool has_time_{false};               // the time of step 0 is settled
  std::optional<std::size_t> number_;  // in the log
  int file_{-1};
  bool has_end_{false};
  bool is_done_{false};
  std::int64_t steps_{0};
  std::int64_t lost_steps_{0};

  std::size_t batch_;  // steps
  std::vector<std::byte> desired_actions_;
  std::vector<std::byte> applied_actions_;
  std::vector<std::byte> observations_;
  std::vector<std::byte> statuses_;
};

}  // namespace trifinger::log
