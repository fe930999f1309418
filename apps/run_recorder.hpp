// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/backend.hpp"

namespace trifinger::apps {

// Records the robot that this program runs. In real-time mode that is done by a process of its own,
// which can neither slow the robot nor die with it; otherwise by a thread for which the back-end
// waits, so that nothing is lost however fast time goes.
class RunRecorder {
 public:
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

  // What it has told since the last call, a sentence each.
  [[nodiscard]] virtual std::vector<std::string> take_lines() = 0;
  // The robot has stopped: lets the recorder write what is there. False if it takes longer than
  // `timeout`; call again.
  [[nodiscard]] virtual bool finish(Nanoseconds timeout) = 0;
};

}  // namespace trifinger::apps
