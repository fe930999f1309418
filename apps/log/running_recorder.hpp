// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <future>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/log/event.hpp"
#include "trifinger/log/recorder.hpp"

namespace trifinger::apps {

// A recorder in a thread of its own. It notifies `Signals` of every event and of its end.
class RunningRecorder {
 public:
  // Throws AlreadyRecorded, InvalidArgument, SystemError.
  RunningRecorder(const std::vector<std::string>& robots, log::RecorderOptions options);
  RunningRecorder(const RunningRecorder&) = delete;
  RunningRecorder& operator=(const RunningRecorder&) = delete;
  ~RunningRecorder();

  [[nodiscard]] log::Recorder& recorder() noexcept { return recorder_; }
  // Returns the events since the last call.
  [[nodiscard]] std::vector<log::Event> take_events();
  // True if the recorder has ended, or ends within `timeout`.
  [[nodiscard]] bool has_ended(Nanoseconds timeout = Nanoseconds::zero()) const;
  // Call this once, after the end. Throws what ended the recorder before it was asked to.
  void require_success() { end_.get(); }

 private:
  log::RecorderOptions with_listener(log::RecorderOptions options);

  std::mutex mutex_;
  std::vector<log::Event> events_;
  log::Recorder recorder_;
  std::future<void> end_;
  std::jthread thread_;  // last member, because the thread uses the others
};

}  // namespace trifinger::apps
