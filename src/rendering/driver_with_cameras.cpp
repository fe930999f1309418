// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/driver_with_cameras.hpp"

#include <algorithm>
#include <cstring>

#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"

namespace trifinger::rendering {
namespace {

using camera::Frame;
using trifinger::detail::require;
using trifinger::detail::text_of;

constexpr TimeIndex kMostSteps = 100000;  // of a period or a delay

}  // namespace

void CaptureOptions::validate() const {
  require(period >= 1 && period <= kMostSteps,
          text_of("period is ", period, " steps, must be 1 to ", kMostSteps));
  require(delay >= 0 && delay <= kMostSteps,
          text_of("delay is ", delay, " steps, must be 0 to ", kMostSteps));
  require(!pose_delay || (*pose_delay >= delay && *pose_delay <= kMostSteps),
          text_of("pose_delay is ", pose_delay.value_or(0), " steps, must be ", delay,
                  ", that is delay, to ", kMostSteps));
}

template <class R>
DriverWithCameras<R>::DriverWithCameras(SimulatedRobot<R>& robot,
                                        const std::vector<camera::Camera>& cameras,
                                        const CaptureOptions& capture,
                                        const RenderingOptions& rendering,
                                        std::unique_ptr<ObjectFinder> finder)
    : robot_(robot),
      options_(capture),
      renderer_(robot.options().description, cameras, rendering),
      finder_(std::move(finder)),
      companions_(robot.companions().begin(), robot.companions().end()),
      writer_(camera::ImageWriter::anonymous(cameras)),
      frames_(cameras.size()) {
  options_.validate();
  require(finder_ == nullptr || !robot.options().description.objects.empty(),
          "there are no objects to find in images");
  companions_.push_back(camera::camera_companion(cameras));
  for (const camera::Camera& camera : cameras) pixels_.emplace_back(camera.format.size());
  for (std::vector<std::byte>& pixels : pixels_) places_.emplace_back(pixels);
}

template <class R>
void DriverWithCameras<R>::share_images(const std::string& robot) {
  writer_ = camera::ImageWriter(robot, renderer().cameras());
}

template <class R>
const RobotTypes& DriverWithCameras<R>::description() const noexcept {
  return robot_.description();
}

template <class R>
std::span<const CompanionDescription> DriverWithCameras<R>::companions() const noexcept {
  return companions_;
}

template <class R>
DriverReport DriverWithCameras<R>::prepare(TimeIndex step) noexcept {
  if (step == 0) {
    under_way_.clear();
    num_captures_ = 0;
    next_capture_ = 0;
    has_failed_ = false;
    if (finder_ != nullptr) finder_->forget();
  }
  return robot_.prepare(step);
}

template <class R>
DriverReport DriverWithCameras<R>::get_latest_observation(void* observation) noexcept {
  const DriverReport report =
      static_cast<UntypedDriver&>(robot_).get_latest_observation(observation);
  return has_failed_ ? DriverReport::fault(kBlind) : report;
}

template <class R>
DriverReport DriverWithCameras<R>::apply_action(const void* desired, void* applied) noexcept {
  return static_cast<UntypedDriver&>(robot_).apply_action(desired, applied);
}

template <class R>
DriverReport DriverWithCameras<R>::hold(const void* observation, void* action) noexcept {
  return static_cast<UntypedDriver&>(robot_).hold(observation, action);
}

template <class R>
DriverReport DriverWithCameras<R>::stop(TimeIndex step) noexcept {
  return robot_.stop(step);
}

template <class R>
std::string_view DriverWithCameras<R>::fault_text(std::int32_t fault_code) const noexcept {
  return fault_code == kBlind ? failure_.view() : robot_.fault_text(fault_code);
}

template <class R>
std::string_view DriverWithCameras<R>::rejection_text() const noexcept {
  return robot_.rejection_text();
}

template <class R>
bool DriverWithCameras<R>::get_companion_element(std::size_t index, TimeIndex time_index,
                                                 void* element) noexcept {
  auto* const bytes = static_cast<std::byte*>(element);
  const CompanionDescription& companion = companions_[index];
  const bool is_images = index + 1 == companions_.size();
  if (!is_images && (finder_ == nullptr || companion.name != kObjectCompanion)) {
    return robot_.get_companion_element(index, time_index, element);
  }
  if (has_failed_) return false;
  try {
    advance(time_index);
    return is_images ? get_images({bytes, companion.element.size()}) : get_poses(time_index, bytes);
  } catch (...) {
    failure_ = FixedText("drawing or reading an image ");
    failure_.append_exception();
    has_failed_ = true;
    return false;
  }
}

// Captures what is due at this step and draws what arrives. The companions ask one after the other,
// so all but the first call of a step have nothing to do.
template <class R>
void DriverWithCameras<R>::advance(TimeIndex time_index) {
  if (time_index < 0) {
    if (num_captures_ == 0) capture(-1);
  } else if (time_index >= next_capture_) {
    capture(time_index);
    next_capture_ = time_index + options_.period;
  }
  for (Capture& capture : under_way_) {
    const bool is_initial = capture.step < 0;
    if (!capture.has_arrived && (is_initial || capture.step + options_.delay <= time_index)) {
      arrive(capture);
    }
  }
}

template <class R>
void DriverWithCameras<R>::capture(TimeIndex step) {
  under_way_.push_back({.step = step,
                        .number = num_captures_++,
                        .configuration = robot_.configuration(),
                        .needs_poses = finder_ != nullptr});
}

template <class R>
void DriverWithCameras<R>::arrive(Capture& capture) {
  capture.has_arrived = true;
  renderer_.render(capture.configuration, static_cast<std::uint64_t>(capture.number), places_);
  if (finder_ == nullptr) return;
  const std::vector<std::span<const std::byte>> images(places_.begin(), places_.end());
  std::vector<ObjectPose> poses(robot_.model().objects().size());
  if (finder_->find(images, poses)) {
    capture.poses = std::move(poses);
  } else {
    capture.needs_poses = false;
  }
}

template <class R>
bool DriverWithCameras<R>::get_images(std::span<std::byte> element) {
  // At most one capture arrives per step.
  const auto found = std::ranges::find_if(under_way_, [](const Capture& capture) {
    return capture.has_arrived && capture.needs_images;
  });
  if (found == under_way_.end()) return false;
  const std::span<const std::span<std::byte>> targets = writer_.begin();
  for (std::size_t i = 0; i < targets.size(); ++i)
    std::ranges::copy(places_[i], targets[i].begin());
  const Nanoseconds period = robot_.options().period;
  std::ranges::fill(frames_, Frame{.state = Frame::State::kGood,
                                   .number = found->number,
                                   .time = Instant(period * std::max<TimeIndex>(0, found->step)),
                                   .exposure = renderer_.options().exposure});
  writer_.commit(frames_, element);
  const Stamp stamp = stamp_of(*found, options_.delay);
  std::memcpy(element.data(), &stamp, sizeof(stamp));
  found->needs_images = false;
  forget();
  return true;
}

template <class R>
bool DriverWithCameras<R>::get_poses(TimeIndex time_index, std::byte* element) {
  const TimeIndex delay = options_.pose_delay.value_or(options_.delay);
  const auto found = std::ranges::find_if(under_way_, [&](const Capture& capture) {
    const bool is_there = capture.step < 0 || capture.step + delay <= time_index;
    return capture.has_arrived && capture.needs_poses && is_there;
  });
  if (found == under_way_.end()) return false;
  write_objects(stamp_of(*found, delay), found->poses, element);
  found->needs_poses = false;
  forget();
  return true;
}

template <class R>
Stamp DriverWithCameras<R>::stamp_of(const Capture& capture, TimeIndex delay) const noexcept {
  return {.arrival_index = capture.step < 0 ? -1 : capture.step + delay,
          .capture_index = capture.step};
}

// Drops what has been delivered.
template <class R>
void DriverWithCameras<R>::forget() {
  while (!under_way_.empty() && under_way_.front().has_arrived &&
         !under_way_.front().needs_images && !under_way_.front().needs_poses) {
    under_way_.pop_front();
  }
}

template class DriverWithCameras<TriFinger>;
template class DriverWithCameras<Finger>;

}  // namespace trifinger::rendering
