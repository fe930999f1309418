// SPDX-License-Identifier: BSD-3-Clause
#include "camera/feed.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::camera {
namespace {

using trifinger::detail::text_of;

// The longest wait of a step: its caller has other things to look at.
constexpr Nanoseconds kLongestWait = std::chrono::milliseconds(100);
constexpr int kAbsent = 5;  // images in a row that are missing, before it is reported

// Silence of all cameras that is reported.
Nanoseconds timeout_of(Nanoseconds period) {
  return std::max<Nanoseconds>(kAbsent * period, kLongestWait);
}

void require_same(const Source& source, const std::vector<Camera>& cameras) {
  std::vector<std::string> names;
  names.reserve(cameras.size());
  for (const Camera& camera : cameras) names.push_back(camera.name);
  detail::require(source.names() == names,
                  "the source has the cameras " + trifinger::detail::joined(source.names()) +
                      ", the robot has " + trifinger::detail::joined(names));
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const ImageFormat& found = source.formats()[i];
    const ImageFormat& expected = cameras[i].format;
    detail::require(found == expected, text_of("images of ", names[i], " have ", found.width, " x ",
                                               found.height, " pixels in ", name_of(found.pixels),
                                               ", the robot expects ", expected.width, " x ",
                                               expected.height, " in ", name_of(expected.pixels)));
  }
}

}  // namespace

CameraFeed::CameraFeed(Source& source, const std::string& robot, const std::vector<Camera>& cameras,
                       Nanoseconds period)
    : source_((require_same(source, cameras), source)),
      sensor_(robot, cameras),
      period_(period),
      names_(source.names()),
      frames_(cameras.size()),
      states_(cameras.size()),
      written_(std::chrono::steady_clock::now()) {
  for (const std::string& name : names_) statistics_.cameras.push_back({.name = name});
}

bool CameraFeed::step() {
  std::ranges::fill(frames_, Frame{});
  const Instant silence = written_ + timeout_of(period_);
  const Nanoseconds left = silence - std::chrono::steady_clock::now();
  const bool has_come =
      source_.grab(sensor_.begin(), frames_, std::clamp(left, Nanoseconds(0), kLongestWait));
  for (std::string& sentence : source_.take_messages()) messages_.push_back(std::move(sentence));
  const Instant now = std::chrono::steady_clock::now();
  if (!has_come) {
    if (source_.has_ended()) {
      report_missed();
      return false;
    }
    if (now < silence) return true;
  }
  sensor_.write(frames_);
  written_ = now;
  count(now);
  judge(now, !has_come);
  return true;
}

void CameraFeed::count(Instant now) {
  ++statistics_.elements;
  Instant oldest = Instant::max();
  Instant newest = Instant::min();
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    FeedStatistics::OfCamera& camera = statistics_.cameras[i];
    switch (frames_[i].state) {
      case Frame::State::kNone:
        ++camera.missing;
        continue;
      case Frame::State::kDamaged:
        ++camera.damaged;
        continue;
      case Frame::State::kLost:
        ++camera.lost;
        continue;
      case Frame::State::kGood:
        break;
    }
    ++camera.good;
    oldest = std::min(oldest, frames_[i].time);
    newest = std::max(newest, frames_[i].time);
    const Nanoseconds delay = now - frames_[i].time;
    sum_of_delays_ += delay;
    statistics_.mean_delay = sum_of_delays_ / ++delays_;
    statistics_.largest_delay = std::max(statistics_.largest_delay, delay);
  }
  if (oldest > newest) return;
  statistics_.largest_skew = std::max<Nanoseconds>(statistics_.largest_skew, newest - oldest);
  if (first_ == Instant{}) first_ = oldest;
  statistics_.duration = newest - first_;
}

void CameraFeed::judge(Instant now, bool is_silent) {
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    const Frame& frame = frames_[i];
    CameraState& state = states_[i];
    if (frame.state == Frame::State::kDamaged) ++state.missed;
    if (frame.number >= 0) {
      if (state.number >= 0 && frame.number > state.number + 1) {
        state.missed += frame.number - state.number - 1;
      }
      state.number = frame.number;
    }
    // Single images that are missing or damaged are counted and reported once per second.
    const bool is_missing = frame.state == Frame::State::kNone;
    state.absent = is_missing ? state.absent + (is_silent ? kAbsent : 1) : 0;
    judge_absence(i, now);
  }
  judge_steps();
  if (now - reported_missed_ < std::chrono::seconds(1)) return;
  reported_missed_ = now;
  report_missed();
}

// Reports the loss of a camera, its return, and a loss that lasts again from time to time.
void CameraFeed::judge_absence(std::size_t camera, Instant now) {
  CameraState& state = states_[camera];
  const std::string& name = names_[camera];
  if (frames_[camera].state == Frame::State::kLost) {
    if (!state.throttle.is_due("lost", now)) return;
    const bool others_go_on = std::ranges::any_of(
        frames_, [](const Frame& frame) { return frame.state == Frame::State::kGood; });
    messages_.push_back(name + " is lost" + (others_go_on ? "; the others go on" : ""));
  } else if (state.absent >= kAbsent) {
    if (!state.throttle.is_due("late", now)) return;
    messages_.push_back("no images of " + name + " come: it is late or loses them");
  } else if (state.absent == 0 && state.throttle.end()) {
    messages_.push_back(name + " delivers again");
  }
}

void CameraFeed::report_missed() {
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const std::int64_t missed = std::exchange(states_[i].missed, 0);
    if (missed > 0) {
      messages_.push_back(text_of(missed, missed == 1 ? " image" : " images", " of ", names_[i],
                                  missed == 1 ? " was" : " were", " lost or damaged"));
    }
  }
}

// A camera that is more than a quarter of a period away from the middle one is out of step, until
// it is nearer than an eighth.
void CameraFeed::judge_steps() {
  std::vector<Instant> times;
  for (const Frame& frame : frames_) {
    if (frame.state == Frame::State::kGood) times.push_back(frame.time);
  }
  if (times.size() < 2) return;
  std::ranges::sort(times);
  const Instant middle = times[(times.size() - 1) / 2];
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    if (frames_[i].state != Frame::State::kGood) continue;
    const Nanoseconds ahead = frames_[i].time - middle;
    const bool is_out = std::chrono::abs(ahead) > period_ / (states_[i].is_out_of_step ? 8 : 4);
    if (is_out == states_[i].is_out_of_step) continue;
    states_[i].is_out_of_step = is_out;
    if (!is_out) {
      messages_.push_back(names_[i] + " is in step again");
    } else {
      messages_.push_back(text_of(
          names_[i], " is out of step: its image is ", duration_text(std::chrono::abs(ahead)),
          ahead > Nanoseconds(0) ? " later" : " earlier", " than those of the others"));
    }
  }
}

std::vector<std::string> CameraFeed::take_messages() { return std::exchange(messages_, {}); }

}  // namespace trifinger::camera
