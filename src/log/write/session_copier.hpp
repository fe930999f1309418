// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "log/log_writer.hpp"
#include "log/write/image_thread.hpp"
#include "log/write/recorded_position.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/log/event.hpp"
#include "trifinger/log/session_header.hpp"

namespace trifinger::log::detail {

// Source of events that come from the recorder itself and not from a robot.
inline constexpr std::string_view kRecorder = "recorder";

// Copies one session from memory to a log: the robot's steps, the companions' elements and the end.
// Knows how far it is.
class SessionCopier {
 public:
  using Report = std::function<void(Level level, std::string_view source, const std::string& text)>;

  // `tell` is called during `pump`. `next_step` always holds the first step that is still to be
  // read, or whose images are; other threads may read it. Throws Error if the session cannot be
  // read.
  SessionCopier(const Session& robot, const std::vector<Session>& companions,
                std::shared_ptr<std::atomic<TimeIndex>> next_step, const ImageOptions& images,
                Report report);

  // Continues at `position`. Steps that the history has lost since then become a gap, but only if
  // the recording is the same.
  void go_on_at(const RecordedPosition& position, bool is_same_recording);
  // True if the history still holds everything from `step` on.
  [[nodiscard]] bool has_all_since(TimeIndex step) const { return oldest_step() <= step; }
  [[nodiscard]] const SessionHeader& header() const noexcept { return header_; }
  // Outside real-time mode: moves the simulated time after `time`, where another session ends.
  void begin_after(std::int64_t time) noexcept;
  // Outside real-time mode: returns the time of the last step in the log; 0 in real-time mode.
  [[nodiscard]] std::int64_t last_time() const noexcept;

  // Writes everything that is available to `log`. If the log throws, the next call writes the rest.
  // `file` must differ for each file: the session is announced in each.
  void pump(LogWriter& log, int file);
  // True if the session has ended and everything is in the log.
  [[nodiscard]] bool is_done() const noexcept { return is_done_; }

  [[nodiscard]] const Session& session() const noexcept { return session_; }
  [[nodiscard]] TimeIndex next_step() const noexcept;
  [[nodiscard]] std::shared_ptr<const std::atomic<TimeIndex>> shared_next_step() const noexcept {
    return next_step_;
  }
  // Stops reading, so that the back-end no longer waits for this recorder.
  void give_up() noexcept;
  // Ends the reading of images: the next `pump` writes those that are there now. Returns false if
  // there are none to be written.
  bool end_images() noexcept {
    if (!images_ || has_all_images_) return false;
    images_->end();
    return true;
  }
  // Returns the share of the history that is still to be read, 0 to 1.
  [[nodiscard]] double lag() const;
  [[nodiscard]] std::int64_t images() const noexcept { return num_images_; }
  [[nodiscard]] std::int64_t left_out_images() const noexcept { return left_out_images_; }
  [[nodiscard]] std::int64_t steps() const noexcept { return steps_; }
  [[nodiscard]] std::int64_t lost_steps() const noexcept { return lost_steps_; }

 private:
  // Reads the series of a companion.
  struct CompanionReader {
    UntypedFrontend series;
    std::size_t element_size;
    TimeIndex next{0};
    std::vector<std::byte> elements;
  };

  // A companion's element whose images the back-end must not overwrite yet.
  struct UnreadImages {
    TimeIndex element;
    TimeIndex arrival;
  };

  void set_next(TimeIndex step) noexcept;
  void publish_next() noexcept;
  void begin_images();
  void pump_images(LogWriter& log);
  void report_images(bool is_end);
  [[nodiscard]] TimeIndex whole_steps() const;
  [[nodiscard]] TimeIndex oldest_step() const;
  // Returns how many elements to keep away from the oldest one, which is about to be overwritten.
  [[nodiscard]] TimeIndex margin(const UntypedFrontend& series) const;
  void pump_steps(LogWriter& log, TimeIndex end);
  std::size_t read_steps(TimeIndex first, std::size_t count);
  void pump_companion(LogWriter& log, std::size_t index);
  void write_end(LogWriter& log, const Fault& fault);
  void lose_steps(LogWriter& log, TimeIndex end);

  Session session_;
  std::vector<Session> companion_sessions_;
  Report report_;
  UntypedFrontend robot_;
  std::vector<CompanionReader> companions_;
  SessionHeader header_;
  TimeIndex next_{0};                                  // first step that is not in the log
  std::shared_ptr<std::atomic<TimeIndex>> next_step_;  // the same for the back-end
  bool is_fresh_{true};                                // begins with the oldest part of the history
  bool has_time_{false};                               // the time of step 0 is known
  std::optional<std::size_t> number_;                  // number of the session in the log
  int file_{-1};
  bool has_end_{false};
  bool is_done_{false};
  std::int64_t steps_{0};
  std::int64_t lost_steps_{0};

  ImageOptions image_options_;
  std::optional<SessionCameras> cameras_;
  TimeIndex first_images_{0};  // first element whose images are wanted
  std::unique_ptr<ImageThread> images_;
  bool has_all_images_{false};              // of those that `images_` has made
  std::deque<UnreadImages> unread_images_;  // outside real-time mode
  std::int64_t num_images_{0};
  std::int64_t left_out_images_{0};
  std::int64_t reported_left_out_{0};
  std::string image_error_;  // a message that is still to be reported
  Instant next_sentence_{};

  std::size_t batch_;  // number of steps read at once
  std::vector<std::byte> desired_actions_;
  std::vector<std::byte> applied_actions_;
  std::vector<std::byte> observations_;
  std::vector<std::byte> statuses_;
};

}  // namespace trifinger::log::detail
