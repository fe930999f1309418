// SPDX-License-Identifier: BSD-3-Clause
#include "camera/device.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>

#include "camera/error_throttle.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/ipc/fork.hpp"

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
  Instant done{Instant::min()};  // images up to this time come too late
  bool is_there{true};
  ErrorThrottle throttle;
  std::vector<std::string> messages;

  // Leaves out the images that come too late.
  void leave_out() {
    while (!shots.empty() && shots.front().frame.time <= done) {
      free.push_back(std::move(shots.front().pixels));
      shots.pop_front();
    }
  }
};

constexpr std::size_t kBuffers = 8;
constexpr Nanoseconds kSlice = std::chrono::milliseconds(100);
constexpr Nanoseconds kRetryPeriod = std::chrono::milliseconds(500);  // after a failure

}  // namespace

struct CameraGroup::State {
  std::vector<std::string> names;
  std::vector<ImageFormat> formats;
  std::vector<std::unique_ptr<Device>> devices;
  Nanoseconds period;
  ipc::ForkGuard fork{};
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
      std::optional<std::string> failure;
      try {
        is_new = devices[camera]->grab(shot.pixels, shot.frame, kSlice);
      } catch (const std::exception& error) {
        failure = error.what();
      }
      const Instant now = std::chrono::steady_clock::now();
      shot.arrival = now;
      std::unique_lock lock(mutex);
      lane.is_there = !failure && devices[camera]->is_there();
      take_messages(camera);
      if (is_new) {
        lane.throttle.end();
        lane.shots.push_back(std::move(shot));
        lane.leave_out();
      } else {
        lane.free.push_back(std::move(shot.pixels));
      }
      if (failure && lane.throttle.is_due(*failure, now)) {
        lane.messages.push_back(names[camera] + ": " + *failure);
      }
      has_come.notify_all();
      if (!failure) continue;
      std::condition_variable_any pause;
      pause.wait_for(lock, stop, kRetryPeriod, [] { return false; });
    }
  }

  void take_messages(std::size_t camera) {
    for (const std::string& sentence : devices[camera]->take_messages()) {
      lanes[camera].messages.push_back(names[camera] + ": " + sentence);
    }
  }

  [[nodiscard]] bool is_any_there() const {
    return std::ranges::any_of(lanes, [](const Lane& lane) { return lane.is_there; });
  }
  // What is known of the image of a camera from which none has come.
  [[nodiscard]] Frame without_image(std::size_t camera) const {
    return {.state = lanes[camera].is_there ? Frame::State::kNone : Frame::State::kLost};
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
    state_->lanes[i].is_there = state_->devices[i]->is_there();
    state_->take_messages(i);
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    state_->threads.emplace_back(
        [state = state_.get(), i](const std::stop_token& stop) { state->work(i, stop); });
  }
}

CameraGroup::~CameraGroup() {
  if (state_->fork.is_inherited()) {
    // The threads stayed in the parent, and the mutex may be locked for ever in this copy.
    [[maybe_unused]] const State* const left = state_.release();
    return;
  }
  // All at once, or each would wait for the one before.
  for (std::jthread& thread : state_->threads) thread.request_stop();
}

const std::vector<std::string>& CameraGroup::names() const noexcept { return state_->names; }
const std::vector<ImageFormat>& CameraGroup::formats() const noexcept { return state_->formats; }

bool CameraGroup::grab(std::span<const std::span<std::byte>> images, std::span<Frame> frames,
                       Timeout timeout) {
  State& state = *state_;
  if (state.fork.is_inherited()) {
    throw InheritedHandle("the cameras were opened before fork(); open them in the child process");
  }
  const Deadline deadline(timeout);
  std::unique_lock lock(state.mutex);
  while (true) {
    const Instant now = std::chrono::steady_clock::now();
    const Instant due = state.due();
    if (due <= now) break;
    if (deadline.passed()) {
      for (std::size_t i = 0; i < frames.size(); ++i) frames[i] = state.without_image(i);
      // Somebody must learn that nothing is there.
      return due == Instant::max() && !state.is_any_there();
    }
    state.has_come.wait_for(
        lock, std::min(deadline.remaining(kSlice), due == Instant::max() ? kSlice : due - now));
  }
  const Instant last = state.first()->frame.time + state.period / 2;
  std::vector<Shot> taken(state.lanes.size());
  Instant newest = Instant::min();
  for (std::size_t i = 0; i < state.lanes.size(); ++i) {
    Lane& lane = state.lanes[i];
    frames[i] = state.without_image(i);
    if (lane.shots.empty() || lane.shots.front().frame.time > last) continue;
    taken[i] = std::move(lane.shots.front());
    lane.shots.pop_front();
    frames[i] = taken[i].frame;
    newest = std::max(newest, frames[i].time);
  }
  for (std::size_t i = 0; i < taken.size(); ++i) {
    // The image of a camera that has none here may still come.
    Lane& lane = state.lanes[i];
    lane.done = std::max(lane.done, taken[i].pixels.empty() ? last : newest);
    lane.leave_out();
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

std::vector<std::string> CameraGroup::take_messages() {
  if (state_->fork.is_inherited()) return {};
  const std::lock_guard lock(state_->mutex);
  std::vector<std::string> messages;
  for (Lane& lane : state_->lanes) {
    for (std::string& sentence : std::exchange(lane.messages, {}))
      messages.push_back(std::move(sentence));
  }
  return messages;
}

Instant DeviceClock::host_time(Nanoseconds device_time, Instant arrival) noexcept {
  constexpr std::int64_t kDrift = 5000;  // clocks drift apart by a 5000th of the time at most
  constexpr Nanoseconds kVeryLate = std::chrono::seconds(1);
  constexpr Nanoseconds kTimeout = std::chrono::seconds(10);
  const Nanoseconds difference = arrival.time_since_epoch() - device_time;
  if (is_known_) difference_ += (arrival - last_arrival_) / kDrift;
  const bool is_late = is_known_ && difference - difference_ > kVeryLate;
  late_since_ = is_late ? std::min(late_since_, arrival) : Instant::max();
  const bool is_another =
      device_time < last_device_ || (is_late && arrival - late_since_ > kTimeout);
  if (!is_known_ || is_another || difference < difference_) difference_ = difference;
  is_known_ = true;
  last_device_ = device_time;
  last_arrival_ = arrival;
  const Instant found(device_time + difference_);
  // A shorter way than all before makes the next image a little earlier.
  last_host_ = found > last_host_ ? found : std::min(last_host_ + Nanoseconds(1), arrival);
  return last_host_;
}

}  // namespace trifinger::camera
