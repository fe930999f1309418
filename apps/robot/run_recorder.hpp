// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "shared/terminal.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/backend.hpp"

namespace trifinger::apps {

// The line that a recorder of `trifinger run` prints as long as it makes progress.
inline constexpr std::string_view kRecorderSign = "goes on";

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
                                                          const BackendOptions& options,
                                                          Backend& backend);
  RunRecorder() = default;
  RunRecorder(const RunRecorder&) = delete;
  RunRecorder& operator=(const RunRecorder&) = delete;
  virtual ~RunRecorder() = default;

  // Looks after the recorder. Returns the messages since the last call, one sentence each.
  [[nodiscard]] virtual std::vector<Line> look() = 0;
  // Returns what is wrong at present, in a few words; empty if nothing is.
  [[nodiscard]] virtual std::string trouble() const = 0;
  // Lets the recorder write what is left; the robot has stopped. Returns false if this takes longer
  // than `timeout`: then call it again. Returns true when the recorder has ended or was given up.
  [[nodiscard]] virtual bool finish(Nanoseconds timeout) = 0;
  // Returns, after `finish`, why the log is incomplete; empty if it is complete.
  [[nodiscard]] virtual std::string failure() const = 0;
};

}  // namespace trifinger::apps
