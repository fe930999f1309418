// SPDX-License-Identifier: BSD-3-Clause
#include "log/running_recorder.hpp"

#include <utility>

#include "shared/signals.hpp"

namespace trifinger::apps {

RunningRecorder::RunningRecorder(const std::vector<std::string>& robots,
                                 log::RecorderOptions options)
    : recorder_(robots, with_listener(std::move(options))) {
  std::packaged_task<void()> work([this] { recorder_.run(); });
  end_ = work.get_future();
  thread_ = std::jthread([work = std::move(work)]() mutable {
    work();
    Signals::notify();
  });
}

RunningRecorder::~RunningRecorder() { recorder_.request_stop(); }

std::vector<log::Event> RunningRecorder::take_events() {
  const std::lock_guard lock(mutex_);
  return std::exchange(events_, {});
}

bool RunningRecorder::has_ended(Nanoseconds timeout) const {
  return end_.wait_for(timeout) == std::future_status::ready;
}

log::RecorderOptions RunningRecorder::with_listener(log::RecorderOptions options) {
  options.on_event = [this](const log::Event& event) {
    {
      const std::lock_guard lock(mutex_);
      events_.push_back(event);
    }
    Signals::notify();
  };
  return options;
}

}  // namespace trifinger::apps
