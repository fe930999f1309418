// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/device.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::camera {
namespace {

using Pixels = std::vector<std::byte>;

// An image that waits for its partners.
struct Shot {
  Frame frame;
  Instant arrival;
  Pixels pixels;
};

// What the thread of a camera shares with the group, under the group's mutex.
struct Lane {
  std::deque<Shot> shots;
  std::vector<Pixels> free;
  bool is_there{true};
  std::exception_ptr failure;
  std::vector<std::string> news;
};

constexpr std::size_t kBuffers = 8;
constexpr Nanoseconds kSlice = std::chrono::milliseconds(100);

}  // namespace

struct CameraGroup::State {
  std::vector<std::string> names;
  std::vector<ImageFormat> formats;
  std::vector<std::unique_ptr<Device>> devices;
  Nanoseconds period;
  std::mutex mutex{};
  std::condition_variable has_come{};
  std::vector<Lane> lanes{};
  std::vector<std::jthread> threads{};  // last member, because they use the others

  // What the thread of a camera does.
  void work(std::size_t camera, const std::stop_token& stop) {
    Lane& lane = lanes[camera];
    while (!stop.stop_requested()) {
      Shot shot;
      {
        const std::lock_guard lock(mutex);
        if (lane.free.empty()) {
          // Nobody has taken images for long: the oldest one goes, and its number is missing.
          lane.free.push_back(std::move(lane.shots.front().pixels));
          lane.shots.pop_front();
        }
        shot.pixels = std::move(lane.free.back());
        lane.free.pop_back();
      }
      bool is_new = false;
      try {
        is_new = devices[camera]->grab(shot.pixels, shot.frame, kSlice);
      } catch (...) {
        const std::lock_guard lock(mutex);
        lane.failure = std::current_exception();
        has_come.notify_all();
        return;
      }
      shot.arrival = std::chrono::steady_clock::now();
      const std::lock_guard lock(mutex);
      lane.is_there = devices[camera]->is_there();
      for (std::string& sentence : devices[camera]->take_news()) {
        lane.news.push_back(names[camera] + ": " + sentence);
      }
      if (is_new) {
        lane.shots.push_back(std::move(shot));
      } else {
        lane.free.push_back(std::move(shot.pixels));
      }
      has_come.notify_all();
    }
  }

  [[nodiscard]] bool is_any_there() const {
    return std::ranges::any_of(lanes, [](const Lane& lane) { return lane.is_there; });
  }
  // The first image in the queues, or nullptr.
  [[nodiscard]] const Shot* first() const {
    const Shot* first = nullptr;
    for (const Lane& lane : lanes) {
      if (lane.shots.empty()) continue;
      const Shot& shot = lane.shots.front();
      if (first == nullptr || shot.frame.time < first->frame.time) first = &shot;
    }
    return first;
  }
  // When the images that are there need not wait for others any more.
  [[nodiscard]] Instant due() const {
    const Shot* const first = this->first();
    if (first == nullptr) return Instant::max();
    const bool is_complete = std::ranges::all_of(
        lanes, [](const Lane& lane) { return !lane.shots.empty() || !lane.is_there; });
    return is_complete ? first->arrival : first->arrival + 2 * period;
  }
};

CameraGroup::CameraGroup(const std::vector<Camera>& cameras,
                         std::vector<std::unique_ptr<Device>> devices, Nanoseconds period)
    : state_(
          new State{.names = {}, .formats = {}, .devices = std::move(devices), .period = period}) {
  detail::require(cameras.size() == state_->devices.size() && !cameras.empty(),
                  "a group needs one device for each of its cameras");
  for (const Camera& camera : cameras) {
    state_->names.push_back(camera.name);
    state_->formats.push_back(camera.format);
    state_->lanes.emplace_back().free.assign(kBuffers, Pixels(camera.format.size()));
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    state_->threads.emplace_back(
        [state = state_.get(), i](const std::stop_token& stop) { state->work(i, stop); });
  }
}

CameraGroup::~CameraGroup() {
  // All at once, or each would wait for the one before.
  for (std::jthread& thread : state_->threads) thread.request_stop();
}

const std::vector<std::string>& CameraGroup::names() const noexcept { return state_->names; }
const std::vector<ImageFormat>& CameraGroup::formats() const noexcept { return state_->formats; }

bool CameraGroup::grab(std::span<const std::span<std::byte>> images, std::span<Frame> frames,
                       Timeout timeout) {
  State& state = *state_;
  const Deadline deadline(timeout);
  std::unique_lock lock(state.mutex);
  while (true) {
    for (const Lane& lane : state.lanes) {
      if (lane.failure != nullptr) std::rethrow_exception(lane.failure);
    }
    const Instant now = std::chrono::steady_clock::now();
    const Instant due = state.due();
    if (due <= now) break;
    if (deadline.passed()) {
      // Somebody must learn that nothing is there.
      if (due != Instant::max() || state.is_any_there()) return false;
      for (Frame& frame : frames) frame = {.state = Frame::State::kLost};
      return true;
    }
    state.has_come.wait_for(
        lock, std::min(deadline.remaining(kSlice), due == Instant::max() ? kSlice : due - now));
  }
  const Instant last = state.first()->frame.time + state.period / 2;
  std::vector<Shot> taken(state.lanes.size());
  for (std::size_t i = 0; i < state.lanes.size(); ++i) {
    Lane& lane = state.lanes[i];
    frames[i] = {.state = lane.is_there ? Frame::State::kNone : Frame::State::kLost};
    if (lane.shots.empty() || lane.shots.front().frame.time > last) continue;
    taken[i] = std::move(lane.shots.front());
    lane.shots.pop_front();
    frames[i] = taken[i].frame;
  }
  lock.unlock();
  for (std::size_t i = 0; i < taken.size(); ++i) {
    if (frames[i].state == Frame::State::kGood) {
      std::memcpy(images[i].data(), taken[i].pixels.data(), images[i].size());
    }
  }
  lock.lock();
  for (std::size_t i = 0; i < taken.size(); ++i) {
    if (!taken[i].pixels.empty()) state.lanes[i].free.push_back(std::move(taken[i].pixels));
  }
  return true;
}

std::vector<std::string> CameraGroup::take_news() {
  const std::lock_guard lock(state_->mutex);
  std::vector<std::string> news;
  for (Lane& lane : state_->lanes) {
    for (std::string& sentence : std::exchange(lane.news, {})) news.push_back(std::move(sentence));
  }
  return news;
}

Instant DeviceClock::host_time(Nanoseconds device_time, Instant arrival) noexcept {
  const Nanoseconds difference = arrival.time_since_epoch() - device_time;
  // A device that was started again counts from another origin.
  constexpr Nanoseconds kJump = std::chrono::seconds(1);
  const Nanoseconds known = std::min(smallest_, before_);
  if (known != Nanoseconds::max() && difference - known > kJump) {
    smallest_ = before_ = Nanoseconds::max();
  }
  if (smallest_ == Nanoseconds::max() && before_ == Nanoseconds::max()) begin_ = arrival;
  // Clocks drift apart, so an old difference must not count for ever.
  if (arrival - begin_ > kWindow) {
    before_ = std::exchange(smallest_, Nanoseconds::max());
    begin_ = arrival;
  }
  smallest_ = std::min(smallest_, difference);
  return Instant(device_time + std::min(smallest_, before_));
}

}  // namespace trifinger::camera
