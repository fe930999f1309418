// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/file_body.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "base/suggestion.hpp"
#include "base/text_of.hpp"
#include "tasks/drawing.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::require;
using trifinger::detail::text_of;

using Configuration = std::array<double, FileBody::kMaxConfiguration>;

template <class Joints>
std::size_t place_of(std::string_view name, const Joints& joints) {
  const auto found =
      std::ranges::find_if(joints, [name](const auto& joint) { return joint.name == name; });
  if (found != joints.end()) return static_cast<std::size_t>(found - joints.begin());
  std::vector<std::string_view> names;
  names.reserve(joints.size());
  for (const auto& joint : joints) names.push_back(joint.name);
  throw InvalidArgument(
      text_of("the robot has no joint '", name, "'; it has ", quoted_list(names, "and")));
}

}  // namespace

FileBody::FileBody(const SimulationOptions& robot, std::span<const std::string> frames)
    : simulator_(robot),
      frames_(robot.file, frames),
      contacts_(robot.file, simulator_.initial_configuration()) {
  require(frames.size() <= kMaxFrames,
          text_of("there are ", frames.size(), " frames, allowed are ", kMaxFrames));
  const std::size_t size = simulator_.initial_configuration().size();
  require(size <= kMaxConfiguration,
          text_of("the model has ", size, " positions, allowed are ", kMaxConfiguration));
}

std::size_t FileBody::joint(std::string_view name) const {
  return place_of(name, model().joints());
}

std::size_t FileBody::model_joint(std::string_view name) const {
  return place_of(name, model().model_joints());
}

void FileBody::find_frames(std::span<const double> position, std::span<const double> model_position,
                           std::span<const ObjectPose> bodies,
                           std::span<double> points) const noexcept {
  if (frames_.size() == 0) return;
  Configuration memory;  // NOLINT(cppcoreguidelines-pro-type-member-init): filled below
  const std::vector<double>& initial = simulator_.initial_configuration();
  const std::span configuration(memory.data(), initial.size());
  std::ranges::copy(initial, configuration.begin());
  for (std::size_t i = 0; i < model_position.size(); ++i) {
    model().set_model_position(i, model_position[i], configuration);
  }
  for (std::size_t i = 0; i < position.size(); ++i) {
    model().set_position(i, position[i], configuration);
  }
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    double* const values = configuration.data() + model().objects()[i].position;
    std::ranges::copy(bodies[i].orientation, std::ranges::copy(bodies[i].position, values).out);
  }
  frames_.positions(configuration, points);
}

void FileBody::draw_pose(std::span<const double> low, std::span<const double> high, Random& random,
                         std::span<double> points) const noexcept {
  Configuration memory;  // NOLINT(cppcoreguidelines-pro-type-member-init): filled below
  const std::vector<double>& initial = simulator_.initial_configuration();
  const std::span configuration(memory.data(), initial.size());
  for (int draw = 0; draw < kDraws; ++draw) {
    std::ranges::copy(initial, configuration.begin());
    for (std::size_t i = 0; i < num_joints(); ++i) {
      model().set_position(i, random.uniform(low[i], high[i]), configuration);
    }
    if (contacts_.is_free(configuration)) break;
  }
  frames_.positions(configuration, points);
}

Entry FileBody::frame_bounds(std::string name, std::span<const double> low,
                             std::span<const double> high) const {
  constexpr int kPoses = 1000;
  constexpr double kMore = 0.1;  // of the extent, on both sides
  const std::size_t size = 3 * num_frames();
  Entry entry{.name = std::move(name), .unit = "m", .low = {}, .high = {}};
  Random random;
  std::vector<double> position(num_joints());
  std::vector<double> points(size);
  for (int pose = 0; pose < kPoses; ++pose) {
    for (std::size_t i = 0; i < position.size(); ++i) {
      position[i] = random.uniform(low[i], high[i]);
    }
    find_frames(position, {}, {}, points);
    if (pose == 0) entry.low = entry.high = points;
    for (std::size_t i = 0; i < size; ++i) {
      entry.low[i] = std::min(entry.low[i], points[i]);
      entry.high[i] = std::max(entry.high[i], points[i]);
    }
  }
  for (std::size_t i = 0; i < size; ++i) {
    // A point that hardly moves has bounds, too.
    const double more = std::max(kMore * (entry.high[i] - entry.low[i]), 1e-3);
    entry.low[i] -= more;
    entry.high[i] += more;
  }
  return entry;
}

}  // namespace trifinger::learning
