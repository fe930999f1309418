// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "terminal.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/backend.hpp"

namespace trifinger::apps {

// The line that a recorder of `trifinger run` prints as long as it gets on.
inline constexpr std::string_view kRecorderSign = "goes on";

// Records the robot that this program runs. In real-time mode that is done by a process of its own,
// which can neither slow the robot nor die with it; otherwise by a thread for which the back-end
// waits, so that nothing is lost however fast time goes.
//
// A recorder that died is replaced by another one, which goes on where the file ends. One that
// stands still (a stopped process, a disk that hangs) is told of; only at the end it is killed and
// replaced, so that the end does not take for ever.
class RunRecorder {
 public:
  struct Line {
    std::string text;
    Style style{Style::kPlain};
  };

  // To be called before the back-end runs, by a thread without real-time priority. Throws
  // AlreadyRecorded, SystemError.
  [[nodiscard]] static std::unique_ptr<RunRecorder> start(const std::string& robot,
                                                          const std::filesystem::path& folder,
                                                          const BackendOptions& options,
                                                          Backend& backend);
  RunRecorder() = default;
  RunRecorder(const RunRecorder&) = delete;
  RunRecorder& operator=(const RunRecorder&) = delete;
  virtual ~RunRecorder() = default;

  // Looks after the recorder. Returns what there is to tell since the last call, a sentence each.
  [[nodiscard]] virtual std::vector<Line> look() = 0;
  // What is wrong at present, in a few words; empty if nothing is.
  [[nodiscard]] virtual std::string trouble() const = 0;
  // The robot has stopped: lets the recorder write what is there. False if it takes longer than
  // `timeout`; call again. True when it has ended or was given up.
  [[nodiscard]] virtual bool finish(Nanoseconds timeout) = 0;
  // After `finish`: why the log is not complete; empty if it is.
  [[nodiscard]] virtual std::string failure() const = 0;
};

}  // namespace trifinger::apps
