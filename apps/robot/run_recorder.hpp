// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "log/image_storage.hpp"
#include "shared/terminal.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/backend.hpp"

namespace trifinger::apps {

// Records the robot that this program runs. In real-time mode, a separate process does that: it can
// neither slow the robot nor die with it. Otherwise a thread does it, and the back-end waits for
// that thread, so that nothing is lost however fast time passes.
//
// If a recorder dies, another one replaces it and continues where the file ends. If a recorder
// hangs (a stopped process, a disk that does not answer), that is reported. It is killed and
// replaced only at the end, so that the end does not take for ever.
class RunRecorder {
 public:
  struct Line {
    std::string text;
    Style style{Style::kPlain};
  };

  // Call this before the back-end runs, in a thread without real-time priority. Throws
  // AlreadyRecorded, SystemError.
  [[nodiscard]] static std::unique_ptr<RunRecorder> start(const std::string& robot,
                                                          const std::filesystem::path& folder,
                                                          log::ImageStorage images,
                                                          const BackendOptions& options,
                                                          Backend& backend);
  RunRecorder(const RunRecorder&) = delete;
  RunRecorder& operator=(const RunRecorder&) = delete;
  virtual ~RunRecorder() = default;

  // Looks after the recorder. Returns the messages since the last call, one sentence each.
  [[nodiscard]] std::vector<Line> look() {
    look_after();
    return std::exchange(lines_, {});
  }
  // Returns what is wrong at present, in a few words; empty if nothing is.
  [[nodiscard]] const std::string& error() const noexcept { return error_; }
  // Lets the recorder write what is left; the robot has stopped. Returns false if this takes longer
  // than `timeout`: then call it again. Returns true when the recorder has ended or was given up.
  [[nodiscard]] virtual bool finish(Nanoseconds timeout) = 0;
  // Returns, after `finish`, why the log is incomplete; empty if it is complete.
  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }

 protected:
  // Silence at the end of the program after which a recorder is given up.
  static constexpr Nanoseconds kTimeout = std::chrono::seconds(10);

  RunRecorder() = default;

  // The recorder is started.
  void begin_watch() noexcept { last_sign_ = std::chrono::steady_clock::now(); }
  // The recorder makes progress. Reports that its error is over.
  void see_sign();
  // Reports that the recorder stands still, if that has lasted too long. Call this after the signs
  // so far were seen.
  void see_silence();
  // Reports an error unless it is the last one. `error` is a few words, `text` a sentence.
  void report_error(const std::string& error, const std::string& text);
  void say(std::string text, Style style = Style::kPlain) {
    lines_.push_back({std::move(text), style});
  }
  void fail(std::string why) { failure_ = std::move(why); }
  // Returns the time since the last sign.
  [[nodiscard]] Nanoseconds silence() const noexcept {
    return std::chrono::steady_clock::now() - last_sign_;
  }

 private:
  // Looks at the recorder and calls the protected functions above.
  virtual void look_after() = 0;

  Instant last_sign_{std::chrono::steady_clock::now()};
  Instant error_since_;
  std::string error_;  // that was reported
  std::vector<Line> lines_;
  std::string failure_;
};

}  // namespace trifinger::apps
