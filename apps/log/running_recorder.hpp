// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <future>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "log/recorder.hpp"
#include "shared/signals.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/log/event.hpp"

namespace trifinger::apps {

// A recorder in a thread of its own. It notifies `Signals` of every event and of its end.
class RunningRecorder {
 public:
  // Throws AlreadyRecorded, InvalidArgument, SystemError.
  RunningRecorder(const std::vector<std::string>& robots, log::RecorderOptions options)
      : recorder_(robots, with_listener(std::move(options))) {
    std::packaged_task<void()> work([this] { recorder_.run(); });
    end_ = work.get_future();
    thread_ = std::jthread([work = std::move(work)]() mutable {
      work();
      Signals::notify();
    });
  }
  ~RunningRecorder() { recorder_.request_stop(); }

  [[nodiscard]] log::Recorder& recorder() noexcept { return recorder_; }
  // Returns the events since the last call.
  [[nodiscard]] std::vector<log::Event> take_events() {
    const std::lock_guard lock(mutex_);
    return std::exchange(events_, {});
  }
  // True if the recorder has ended, or ends within `timeout`.
  [[nodiscard]] bool has_ended(Nanoseconds timeout = Nanoseconds::zero()) const {
    return end_.wait_for(timeout) == std::future_status::ready;
  }
  // Call this once, after the end. Throws what ended the recorder before it was asked to.
  void require_success() { end_.get(); }

 private:
  log::RecorderOptions with_listener(log::RecorderOptions options) {
    options.on_event = [this](const log::Event& event) {
      {
        const std::lock_guard lock(mutex_);
        events_.push_back(event);
      }
      Signals::notify();
    };
    return options;
  }

  std::mutex mutex_;
  std::vector<log::Event> events_;
  log::Recorder recorder_;
  std::future<void> end_;
  std::jthread thread_;  // last member, because the thread uses the others
};

}  // namespace trifinger::apps
