// SPDX-License-Identifier: BSD-3-Clause
#include "log/image_source.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::log {
namespace {

using camera::Frame;

}  // namespace

ImageSource::ImageSource(const LoggedSession& robot, const ImageSourceOptions& options)
    : cameras_(robot), options_(options), counts_(cameras_.calibration().cameras.size()) {
  for (const camera::Camera& camera : cameras_.calibration().cameras) {
    names_.push_back(camera.name);
    formats_.push_back(camera.format);
  }
  bool is_any = false;
  const auto [first, end] = cameras_.range();
  std::int64_t begin = 0;
  for (TimeIndex i = first; i < end; ++i) {
    try {
      const LoggedImages images = cameras_.at(i);
      // The first one may show the scene before step 0, at the same time as the second.
      const std::int64_t time = *std::ranges::max_element(images.times());
      if (sets_.empty()) begin = time;
      if (!sets_.empty() && Nanoseconds(time - begin) <= sets_.back().time) continue;
      sets_.push_back({.index = i, .time = Nanoseconds(time - begin)});
      for (std::size_t camera = 0; camera < names_.size(); ++camera) {
        counts_[camera] = std::max(counts_[camera], images.infos()[camera].number + 1);
        is_any = is_any || images.has(camera);
      }
    } catch (const NotInLog&) {  // NOLINT(bugprone-empty-catch): what is missing is not shown
    }
  }
  if (!is_any) {
    throw InvalidArgument("the log of '" + robot.name() +
                          "' has no images: they were not recorded");
  }
  const Nanoseconds step = sets_.size() > 1
                               ? sets_.back().time / static_cast<std::int64_t>(sets_.size() - 1)
                               : Nanoseconds(std::chrono::milliseconds(10));
  round_ = sets_.back().time + step;
}

ImageSource::~ImageSource() = default;

bool ImageSource::has_ended() const noexcept { return !options_.repeats && rounds_ > 0; }

std::vector<std::string> ImageSource::take_messages() { return std::exchange(messages_, {}); }

void ImageSource::go_on() noexcept {
  if (++next_ < sets_.size()) return;
  next_ = 0;
  ++rounds_;
}

// After a pause of the program, or if decoding takes longer than a period.
void ImageSource::leave_out_what_is_over(Instant now) {
  if (!options_.repeats) return;
  if (const auto rounds = (now - begin_) / round_; rounds > rounds_) {
    rounds_ = rounds;
    next_ = 0;
  }
  const auto due_after = [this] {
    return next_ + 1 < sets_.size() ? begin_ + rounds_ * round_ + sets_[next_ + 1].time
                                    : begin_ + (rounds_ + 1) * round_;
  };
  while (due_after() <= now) go_on();
}

bool ImageSource::grab(std::span<const std::span<std::byte>> images, std::span<Frame> frames,
                       Timeout timeout) {
  if (has_ended()) return false;
  const Instant now = std::chrono::steady_clock::now();
  if (rounds_ == 0 && next_ == 0 && begin_ == Instant{}) begin_ = now;
  leave_out_what_is_over(now);
  const Set& set = sets_[next_];
  const Instant due = begin_ + rounds_ * round_ + set.time;
  if (timeout != kForever && due - now > timeout) {
    std::this_thread::sleep_for(timeout);
    return false;
  }
  std::this_thread::sleep_until(due);
  const LoggedImages logged = cameras_.at(set.index);
  const std::int64_t newest = *std::ranges::max_element(logged.times());
  for (std::size_t i = 0; i < names_.size(); ++i) {
    Frame& frame = frames[i];
    frame = logged.infos()[i].frame();
    frame.time = due - Nanoseconds(newest - logged.times()[i]);
    if (frame.number >= 0) frame.number += rounds_ * counts_[i];
    if (frame.state != Frame::State::kGood) continue;
    try {
      const std::vector<std::byte> pixels = logged.pixels(i);
      std::memcpy(images[i].data(), pixels.data(), pixels.size());
    } catch (const NotInLog& error) {
      frame.state = Frame::State::kNone;
      if (rounds_ == 0) messages_.emplace_back(error.what());
    } catch (const InvalidArgument& error) {
      frame.state = Frame::State::kDamaged;
      if (rounds_ == 0) messages_.emplace_back(error.what());
    }
  }
  go_on();
  return true;
}

}  // namespace trifinger::log
