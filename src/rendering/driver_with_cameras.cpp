// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/driver_with_cameras.hpp"

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

namespace trifinger::rendering {
namespace {

using camera::Frame;

}  // namespace

DriverWithCameras::DriverWithCameras(SimulatedRobot& robot,
                                     const std::vector<camera::Camera>& cameras,
                                     const CaptureOptions& capture,
                                     const RenderingOptions& rendering,
                                     std::unique_ptr<ObjectFinder> finder, bool varies)
    : robot_(robot),
      pipeline_(robot.options(), cameras, rendering, std::move(finder)),
      captures_(capture, robot.model().objects().size()),
      companions_(robot.companions().begin(), robot.companions().end()),
      writer_(camera::ImageWriter::anonymous(cameras)),
      frames_(cameras.size()) {
  companions_.push_back(camera::camera_companion(cameras));
  if (varies) captures_.vary(rendering);
}

void DriverWithCameras::share_images(const std::string& robot) {
  writer_ = camera::ImageWriter(robot, renderer().cameras());
}

const RobotTypes& DriverWithCameras::description() const noexcept { return robot_.description(); }

std::span<const CompanionDescription> DriverWithCameras::companions() const noexcept {
  return companions_;
}

DriverReport DriverWithCameras::prepare(TimeIndex step) noexcept {
  const DriverReport report = robot_.prepare(step);
  if (step == 0) {
    // The session begins in a state with random numbers of its own.
    captures_.begin(robot_.random());
    has_new_images_ = false;
    has_failed_ = false;
  }
  return report;
}

DriverReport DriverWithCameras::get_latest_observation(void* observation) noexcept {
  const DriverReport report = robot_.get_latest_observation(observation);
  return has_failed_ ? DriverReport::fault(kBlind) : report;
}

DriverReport DriverWithCameras::apply_action(const void* desired, void* applied) noexcept {
  return robot_.apply_action(desired, applied);
}

DriverReport DriverWithCameras::hold(const void* observation, void* action) noexcept {
  return robot_.hold(observation, action);
}

DriverReport DriverWithCameras::stop(TimeIndex step) noexcept { return robot_.stop(step); }

std::string_view DriverWithCameras::fault_text(std::int32_t fault_code) const noexcept {
  return fault_code == kBlind ? failure_.view() : robot_.fault_text(fault_code);
}

std::string_view DriverWithCameras::rejection_text() const noexcept {
  return robot_.rejection_text();
}

bool DriverWithCameras::get_companion_element(std::size_t index, TimeIndex time_index,
                                              void* element) noexcept {
  auto* const bytes = static_cast<std::byte*>(element);
  const CompanionDescription& companion = companions_[index];
  const bool is_images = index + 1 == companions_.size();
  if (!is_images && (!pipeline_.can_find() || companion.name != kObjectCompanion)) {
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

// Captures what is due at this step and draws what arrives: at most one set of images. The
// companions ask one after the other, so all but the first call of a step have nothing to do.
void DriverWithCameras::advance(TimeIndex time_index) {
  if (captures_.is_due(time_index)) captures_.capture(time_index, robot_.configuration());
  if (captures_.look(time_index, pipeline_)) has_new_images_ = true;
}

bool DriverWithCameras::get_images(std::span<std::byte> element) {
  if (!std::exchange(has_new_images_, false)) return false;
  const std::span<const std::span<std::byte>> targets = writer_.begin();
  for (std::size_t i = 0; i < targets.size(); ++i) {
    std::ranges::copy(pipeline_.images()[i], targets[i].begin());
  }
  const CaptureQueue::Images& images = captures_.images();
  const Nanoseconds period = robot_.options().period;
  std::ranges::fill(frames_,
                    Frame{.state = Frame::State::kGood,
                          .number = images.number,
                          .time = Instant(period * std::max<TimeIndex>(0, images.capture_index)),
                          .exposure = renderer().options().exposure});
  writer_.commit(frames_, element);
  const Stamp stamp{.arrival_index = images.arrival_index, .capture_index = images.capture_index};
  std::memcpy(element.data(), &stamp, sizeof(stamp));
  return true;
}

bool DriverWithCameras::get_poses(TimeIndex time_index, std::byte* element) {
  const std::optional<CaptureQueue::Poses> poses = captures_.take_poses(time_index);
  if (!poses) return false;
  const Stamp stamp{.arrival_index = poses->arrival_index, .capture_index = poses->capture_index};
  write_objects(stamp, poses->objects, element);
  return true;
}

}  // namespace trifinger::rendering
