// SPDX-License-Identifier: BSD-3-Clause
#include "rendering/simulated_cameras.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>
#include <utility>

#include "sim/scene_observation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger::rendering {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;

constexpr Nanoseconds kSearch = 20ms;  // between two looks whether the robot runs
constexpr Nanoseconds kSlice = 100ms;  // of a longer wait

}  // namespace

SimulatedCameras::SimulatedCameras(std::string robot, const SimulationOptions& simulation,
                                   std::vector<camera::Camera> cameras, Nanoseconds period,
                                   const RenderingOptions& options)
    : robot_(std::move(robot)),
      renderer_(simulation, std::move(cameras), options),
      period_(period),
      scene_element_(scene_companion(renderer_.model()).element),
      element_(scene_element_.size()) {
  trifinger::detail::require(period > Nanoseconds::zero(),
                             "the period of simulated cameras must be above 0");
  for (const camera::Camera& camera : renderer_.cameras()) {
    names_.push_back(camera.name);
    formats_.push_back(camera.format);
  }
  scene_.configuration.resize(configuration_size(renderer_.model()));
}

bool SimulatedCameras::grab(std::span<const std::span<std::byte>> images,
                            std::span<camera::Frame> frames, Timeout timeout) {
  const Deadline deadline(timeout);
  while (true) {
    if (!find_robot(deadline)) return false;
    try {
      if (find_scene(deadline)) break;
      if (companion_ || deadline.passed()) return false;
    } catch (const RobotStopped&) {
      companion_.reset();  // The next session has a companion of its own.
    }
  }
  std::int64_t steps = 1;
  if (last_) {
    const double periods = std::chrono::duration<double>(scene_.time - *last_) / period_;
    steps = std::max<std::int64_t>(1, std::llround(periods));
  }
  number_ += steps;
  num_dropped_ += steps - 1;
  last_ = scene_.time;
  renderer_.render(scene_.configuration, static_cast<std::uint64_t>(number_), images);
  std::ranges::fill(frames, camera::Frame{.state = camera::Frame::State::kGood,
                                          .number = number_,
                                          .time = scene_.time,
                                          .exposure = renderer_.options().exposure});
  return true;
}

// False if the robot has not begun a session by then.
bool SimulatedCameras::find_robot(const Deadline& deadline) {
  while (!companion_) {
    try {
      UntypedFrontend found(robot_ + "." + kSceneCompanion,
                            {.control = false, .timeout = deadline.remaining(kSlice)});
      require_same_companion(found.session(), scene_element_);
      if (!found.fault()) {
        companion_ = std::move(found);
        next_ = 0;
        last_.reset();
        return true;
      }
    } catch (const SessionNotFound&) {
    } catch (const TimedOut&) {
    } catch (const RobotStopped&) {
    }
    if (deadline.passed()) return false;
    std::this_thread::sleep_for(deadline.remaining(kSearch));
  }
  return true;
}

// Waits for a scene that is due. False if there is none by then.
bool SimulatedCameras::find_scene(const Deadline& deadline) {
  while (true) {
    if (read_newest() && is_due()) return true;
    Nanoseconds wait = deadline.remaining(kSlice);
    if (scene_.is_before_step_0 && last_) {
      // The robot stands still, but cameras do not stop.
      const Instant now = steady_clock::now();
      if (now >= *last_ + period_) {
        if (!goes_on()) return false;
        scene_.time = now;
        return true;
      }
      wait = std::min(wait, Nanoseconds(*last_ + period_ - now));
    }
    try {
      companion_->get(Series::kObservation, next_, element_.data(), wait);
    } catch (const TimedOut&) {
      if (deadline.passed()) return false;
    } catch (const HistoryLost&) {
      // Far behind: the newest one counts.
    }
  }
}

// False if the robot's session has ended, or its process. Then its next session is looked for.
bool SimulatedCameras::goes_on() {
  const SessionInfo info = companion_->session().info();
  if (info.phase != SessionInfo::Phase::kEnded && info.backend_is_alive) return true;
  companion_.reset();
  return false;
}

bool SimulatedCameras::is_due() const noexcept {
  // Steps begin a little early or late.
  return !last_ || scene_.time - *last_ > 3 * period_ / 4;
}

// Reads the newest scene. False if it is known already.
bool SimulatedCameras::read_newest() {
  const TimeIndex end = companion_->range(Series::kObservation).second;
  if (end <= next_) return false;
  try {
    companion_->get(Series::kObservation, end - 1, element_.data(), Nanoseconds::zero());
  } catch (const HistoryLost&) {
    return false;
  }
  next_ = end;
  Stamp stamp;
  std::memcpy(&stamp, element_.data(), sizeof(stamp));
  std::memcpy(scene_.configuration.data(), element_.data() + sizeof(stamp),
              std::span(scene_.configuration).size_bytes());
  // Before step 0 the robot stands still, so this is what it looks like now.
  scene_.is_before_step_0 = stamp.arrival_index < 0;
  scene_.time = scene_.is_before_step_0 ? Instant(steady_clock::now())
                                        : Instant(Nanoseconds(stamp.capture_time));
  return true;
}

}  // namespace trifinger::rendering
