// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "commands.hpp"
#include "shared/child_program.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/signals.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/sensor.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/tracking/tracker.hpp"

namespace trifinger::apps {
namespace {

using Clock = std::chrono::steady_clock;

struct TrackOptions {
  std::string robot;
  std::string sensor{kObjectCompanion};
  std::optional<std::filesystem::path> colours;
  Nanoseconds length{0};  // 0: until a signal
  pid_t parent{0};        // ends with it, unless 0
};

// Tracks one object, and tells when it is lost and found.
class TrackedThing {
 public:
  TrackedThing(const std::vector<camera::Camera>& cameras, const ObjectDescription& object,
               const tracking::ColourModel& colours)
      : name_(object.name), tracker_(cameras, tracking::tracked_object(object), colours) {}

  // A sentence if no pose can ever be sure.
  [[nodiscard]] std::optional<std::string> warning() const {
    return tracking::look_alike_warning(tracker_.object());
  }

  // The pose at this time; nothing unless it is sure.
  std::optional<ObjectPose> track(std::span<const std::span<const std::byte>> images,
                                  Instant time) {
    // An older pose says little about where the object is now.
    constexpr Nanoseconds kLatest = std::chrono::milliseconds(300);
    const bool has_guess = last_ && time - last_time_ < kLatest;
    const tracking::Estimate estimate = tracker_.track(images, has_guess ? &*last_ : nullptr);
    if (!estimate.is_sure()) return std::nullopt;
    last_ = estimate.pose;
    last_time_ = time;
    ObjectPose pose;
    const Eigen::Quaterniond turn(estimate.pose.linear());
    Eigen::Vector3d::Map(pose.position.data()) = estimate.pose.translation();
    pose.orientation = {turn.w(), turn.x(), turn.y(), turn.z()};
    latest_ = estimate;
    return pose;
  }

  // A sentence if the object was lost for a while or found again.
  [[nodiscard]] std::optional<std::string> message(Instant time) {
    constexpr Nanoseconds kLastLook = std::chrono::milliseconds(500);
    constexpr Nanoseconds kFirstTimeout = std::chrono::seconds(5);
    if (!begin_) begin_ = time;
    const bool is_there = last_ && time - last_time_ < kLastLook;
    if (is_there == was_there_) return std::nullopt;
    if (!was_there_ && !is_there) {
      if (time - *begin_ < kFirstTimeout) return std::nullopt;
      was_there_ = false;
      return name_ +
             " was not found yet: 'trifinger look' shows what the cameras see, --colours "
             "takes colours that were learned from it";
    }
    was_there_ = is_there;
    if (!is_there) return name_ + " is lost: no pose is written until it is found";
    return fmt::format("{} is found, by {} cameras, to about {:.1f} mm", name_, latest_.cameras,
                       1e3 * latest_.position_deviation.norm());
  }

 private:
  std::string name_;
  tracking::Tracker tracker_;
  std::optional<Eigen::Isometry3d> last_;
  Instant last_time_{};
  tracking::Estimate latest_;
  std::optional<bool> was_there_;
  std::optional<Instant> begin_;
};

// The good images that were taken together with the newest one; the others are empty.
std::vector<std::span<const std::byte>> usable(const camera::Images& images, Instant& time) {
  constexpr std::int64_t kTogether = 5'000'000;  // [ns]
  std::int64_t newest = 0;
  for (const camera::ImageInfo& info : images.infos()) {
    if (info.frame().state == camera::Frame::State::kGood) newest = std::max(newest, info.time);
  }
  std::vector<std::span<const std::byte>> pixels(images.infos().size());
  std::int64_t sum = 0;
  std::int64_t count = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const camera::ImageInfo& info = images.infos()[i];
    if (info.frame().state != camera::Frame::State::kGood || newest - info.time > kTogether) {
      continue;
    }
    pixels[i] = images.pixels(i);
    sum += info.time - newest;
    ++count;
  }
  time = Instant(Nanoseconds(count == 0 ? 0 : newest + sum / count));
  return pixels;
}

// One thing for each object. Says which of them can never be found for sure.
std::vector<TrackedThing> tracked_things(const TrackOptions& options,
                                         const std::vector<ObjectDescription>& objects,
                                         const std::vector<camera::Camera>& cameras) {
  const tracking::ColourModel colours = options.colours
                                            ? tracking::read_colour_model(*options.colours)
                                            : tracking::ColourModel::standard();
  std::vector<TrackedThing> things;
  things.reserve(objects.size());
  for (const ObjectDescription& object : objects) {
    const TrackedThing& thing = things.emplace_back(cameras, object, colours);
    if (const auto warning = thing.warning()) say(options.robot, *warning);
  }
  return things;
}

// How many images were looked at, and how long that took.
class LookCounts {
 public:
  void add_look(Nanoseconds took) {
    sum_ += took;
    longest_ = std::max(longest_, took);
    ++looked_;
  }
  void add_written() { ++written_; }

  [[nodiscard]] std::string text() const {
    return fmt::format("{} of {} images gave poses; {} each on average, {} at most", written_,
                       looked_, duration_text(looked_ > 0 ? sum_ / looked_ : Nanoseconds(0)),
                       duration_text(longest_));
  }

 private:
  std::int64_t looked_{0};
  std::int64_t written_{0};
  Nanoseconds sum_{0};
  Nanoseconds longest_{0};
};

int track(const TrackOptions& options) {
  std::signal(SIGPIPE, SIG_IGN);
  const Signals signals;
  if (options.parent > 0) end_with_parent(options.parent);
  const Session session = Session::open(options.robot);
  const RobotConfig config = read_robot_config(config_file_of(session));
  const std::vector<ObjectDescription>& objects = objects_of(config.simulation);
  const std::optional<CompanionDescription> companion = object_companion(objects);
  if (!companion) {
    throw InvalidArgument("robot '" + options.robot +
                          "' has no objects; 'objects' in its configuration names them");
  }
  const std::vector<camera::Camera> cameras = camera::calibration_of(session).cameras;
  std::vector<TrackedThing> things = tracked_things(options, objects, cameras);
  camera::LiveCameras live(options.robot, cameras);
  UntypedSensorWriter writer(options.robot, options.sensor, companion->element);
  std::vector<std::byte> element(companion->element.size());
  say(options.robot, fmt::format("poses become the sensor '{}'", options.sensor));

  LookCounts counts;
  constexpr Nanoseconds kLook = std::chrono::milliseconds(100);
  const Deadline deadline(options.length > Nanoseconds(0) ? options.length : kForever);
  std::vector<ObjectPose> poses(things.size());
  while (!deadline.passed() && !signals.wait(Nanoseconds::zero())) {
    const std::optional<camera::Images> images = live.next(deadline.remaining(kLook));
    const Instant begin = std::chrono::time_point_cast<Nanoseconds>(Clock::now());
    if (images) {
      Instant time{};
      std::vector<std::span<const std::byte>> pixels;
      try {
        pixels = usable(*images, time);
      } catch (const HistoryLost&) {
        continue;  // the process of the cameras has ended meanwhile
      }
      bool is_complete = true;
      for (std::size_t i = 0; i < things.size(); ++i) {
        const std::optional<ObjectPose> pose = things[i].track(pixels, time);
        is_complete = is_complete && pose;
        if (pose) poses[i] = *pose;
      }
      counts.add_look(Clock::now() - begin);
      // Pixels that were overwritten meanwhile may have shown two times at once.
      if (is_complete && images->is_valid()) {
        write_objects({}, poses, element.data());
        writer.write(time, element.data());
        counts.add_written();
      }
    }
    for (TrackedThing& thing : things) {
      if (const auto sentence = thing.message(begin)) say(options.robot, *sentence);
    }
  }
  say(options.robot, counts.text());
  return kDone;
}

}  // namespace

void add_track(CLI::App& program, Action& action) {
  const auto& [command, options] = add_command(
      program, action, "track", "Find a robot's objects in the images of its cameras", track);
  add_robot(command, options.robot, "Name of a running robot that has cameras");
  command
      .add_option("--colours", options.colours,
                  "A colour model; default: the competition's colours in any light")
      ->option_text("FILE");
  command
      .add_option("--sensor", options.sensor, "Name of the sensor that is written; default: object")
      ->option_text("NAME");
  add_seconds(command, "--seconds", options.length, 1e9, "End after this time; default: at Ctrl-C");
  command.add_option("--with-process", options.parent)->group("");
  command.footer(
      "'trifinger cameras ROBOT' delivers the images. A pose that is not sure is not written, nor "
      "is\n"
      "an old one. With several objects, poses are written while all of them are seen.\n"
      "Example:\n"
      "  trifinger track trifinger-pro-3");
}

}  // namespace trifinger::apps
