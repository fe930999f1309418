// SPDX-License-Identifier: BSD-3-Clause
#include "log/write/session_inbox.hpp"

#include <algorithm>
#include <chrono>
#include <limits>
#include <thread>
#include <utility>

namespace trifinger::log::detail {
namespace {

constexpr Nanoseconds kMaxWaitOfBackend = std::chrono::seconds(1);

void give_up(std::atomic<TimeIndex>& next_step) noexcept {
  // relaxed: no step was read.
  next_step.store(std::numeric_limits<TimeIndex>::max(), std::memory_order_relaxed);
}

}  // namespace

void SessionInbox::put(const Session& robot, const std::vector<Session>& companions) {
  wait_for_payloads();
  newest_ = std::make_shared<std::atomic<TimeIndex>>(0);
  const auto has_payload = [](const Session& companion) { return companion.payload().size() > 0; };
  if (!robot.info().is_real_time && std::ranges::any_of(companions, has_payload)) {
    with_payloads_.emplace(robot);
  }
  std::unique_lock lock(mutex_);
  const auto has_room = [this] { return is_closed_ || waiting_.size() < kMaxWaiting; };
  // In real time, the back-end must not wait.
  if (!has_room() && !robot.info().is_real_time) {
    has_room_.wait_for(lock, kMaxWaitOfBackend, has_room);
  }
  if (!is_closed_ && has_room()) {
    waiting_.push_back({robot, companions, newest_});
    return;
  }
  if (!is_closed_) ++dropped_;
  give_up(*newest_);
}

// The memory of payloads outlives their session: the next one overwrites it.
void SessionInbox::wait_for_payloads() {
  if (!with_payloads_) return;
  const TimeIndex steps = with_payloads_->range(Series::kAppliedAction).second;
  const Deadline deadline(kMaxWaitOfBackend);
  while (next_step() <= steps && !deadline.passed()) {
    std::this_thread::sleep_for(std::chrono::microseconds(500));
  }
  with_payloads_.reset();
}

TimeIndex SessionInbox::next_step() const noexcept {
  // acquire: after this, steps that were read may be overwritten.
  return newest_ == nullptr ? 0 : newest_->load(std::memory_order_acquire);
}

SessionInbox::Taken SessionInbox::take(std::size_t max_sessions) {
  Taken taken;
  {
    const std::lock_guard lock(mutex_);
    while (!waiting_.empty() && taken.sessions.size() < max_sessions) {
      taken.sessions.push_back(std::move(waiting_.front()));
      waiting_.pop_front();
    }
    taken.dropped = std::exchange(dropped_, 0);
  }
  has_room_.notify_all();
  return taken;
}

bool SessionInbox::is_empty() const {
  const std::lock_guard lock(mutex_);
  return waiting_.empty();
}

void SessionInbox::close() noexcept {
  {
    const std::lock_guard lock(mutex_);
    is_closed_ = true;
    for (const HandedSession& session : waiting_) give_up(*session.next_step);
    waiting_.clear();
  }
  has_room_.notify_all();
}

}  // namespace trifinger::log::detail
