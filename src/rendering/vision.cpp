// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/vision.hpp"

#include <algorithm>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/rendering/options.hpp"

namespace trifinger::rendering {
namespace {

using trifinger::detail::require;
using trifinger::detail::text_of;

constexpr TimeIndex kMaxSteps = 100000;  // of a period or a delay
// Where the random numbers of a session's look begin, far behind those of the noise on poses.
constexpr std::uint64_t kLook = std::uint64_t{1} << 62;

}  // namespace

void CaptureOptions::validate() const {
  require(period >= 1 && period <= kMaxSteps,
          text_of("period is ", period, " steps, must be 1 to ", kMaxSteps));
  require(delay >= 0 && delay <= kMaxSteps,
          text_of("delay is ", delay, " steps, must be 0 to ", kMaxSteps));
  require(!pose_delay || (*pose_delay >= delay && *pose_delay <= kMaxSteps),
          text_of("pose_delay is ", pose_delay.value_or(0), " steps, must be ", delay,
                  ", that is delay, to ", kMaxSteps));
}

VisionPipeline::VisionPipeline(const SimulationOptions& robot,
                               const std::vector<camera::Camera>& cameras,
                               const RenderingOptions& rendering,
                               std::unique_ptr<ObjectFinder> finder)
    : renderer_(robot, cameras, rendering), finder_(std::move(finder)) {
  require(finder_ == nullptr || !objects_of(robot).empty(),
          "there are no objects to find in images");
  for (const camera::Camera& camera : cameras) pixels_.emplace_back(camera.format.size());
  for (std::vector<std::byte>& pixels : pixels_) places_.emplace_back(pixels);
  images_.assign(places_.begin(), places_.end());
}

void VisionPipeline::look(std::span<const double> configuration, std::uint64_t number,
                          std::span<std::optional<ObjectPose>> poses) {
  renderer_.render(configuration, number, places_);
  if (finder_ != nullptr) finder_->find(images_, poses);
}

CaptureQueue::CaptureQueue(const CaptureOptions& options, std::size_t num_objects)
    : options_((options.validate(), options)), found_(num_objects) {}

void CaptureQueue::begin(const Random& random) {
  // Odd factors spread seeds and episodes over all numbers. Seed 0 and episode 0 give 0.
  noise_ = random.seed * 0x9e3779b97f4a7c15U + random.episode * 0xd1b54a32d192ed03U;
  if (nominal_) {
    Random series = random;
    series.count = kLook;
    look_ = varied(*nominal_, series);
  }
  num_captures_ = 0;
  next_ = 0;
  under_way_.clear();
  images_ = {};
  std::ranges::fill(found_, std::nullopt);
  poses_.clear();
}

bool CaptureQueue::is_due(TimeIndex now) const noexcept {
  return now < 0 ? num_captures_ == 0 : now >= next_;
}

void CaptureQueue::capture(TimeIndex now, std::vector<double> configuration) {
  const TimeIndex arrival = now < 0 ? -1 : now + options_.delay;
  under_way_.push_back(
      {.images = {.capture_index = now, .arrival_index = arrival, .number = num_captures_++},
       .configuration = std::move(configuration)});
  if (now >= 0) next_ = now + options_.period;
}

bool CaptureQueue::look(TimeIndex now, VisionPipeline& pipeline) {
  bool has_new = false;
  while (!under_way_.empty() && under_way_.front().images.arrival_index <= now) {
    const bool is_newest = under_way_.size() == 1 || under_way_[1].images.arrival_index > now;
    if (!is_newest && !pipeline.can_find()) {
      under_way_.pop_front();
      continue;
    }
    // Nothing of this object changes if the pipeline throws.
    const Capture& capture = under_way_.front();
    if (nominal_ && pipeline.renderer().options() != look_) pipeline.renderer().set_options(look_);
    std::vector<std::optional<ObjectPose>> found = found_;
    pipeline.look(capture.configuration, noise_ + static_cast<std::uint64_t>(capture.images.number),
                  found);
    found_ = std::move(found);
    images_ = capture.images;
    under_way_.pop_front();
    has_new = true;
    const bool are_all_found =
        std::ranges::all_of(found_, [](const auto& pose) { return pose.has_value(); });
    if (!pipeline.can_find() || !are_all_found) continue;
    const TimeIndex delay = options_.pose_delay.value_or(options_.delay);
    const TimeIndex captured = images_.capture_index;
    poses_.push_back(
        {.capture_index = captured, .arrival_index = captured < 0 ? -1 : captured + delay});
    for (const auto& pose : found_) poses_.back().objects.push_back(*pose);
  }
  return has_new;
}

std::optional<CaptureQueue::Poses> CaptureQueue::take_poses(TimeIndex now) {
  if (poses_.empty() || poses_.front().arrival_index > now) return std::nullopt;
  Poses oldest = std::move(poses_.front());
  poses_.pop_front();
  return oldest;
}

}  // namespace trifinger::rendering
