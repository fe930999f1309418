// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/hand.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <iterator>
#include <mutex>
#include <new>
#include <stop_token>
#include <string_view>
#include <thread>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/sensor.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/fork.hpp"
#include "trifinger/model/frames.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger {
namespace {

using detail::joined;
using detail::require;
using detail::text_of;

// Larger numbers make no sense, and their squares could be infinite.
constexpr double kFarthestTarget = 10.0;
constexpr double kFarthestPoint = 1.0;

// False for numbers that are not finite, too.
bool is_within(const std::array<double, 3>& values, double limit) noexcept {
  return std::ranges::all_of(values, [limit](double value) { return std::abs(value) <= limit; });
}

std::string text_of_values(const std::array<double, 3>& values) {
  return text_of("(", values[0], ", ", values[1], ", ", values[2], ")");
}

// The bodies of a robot that runs.
std::vector<std::string> bodies_of(const std::string& robot) {
  const Session session = Session::open(robot);
  require(std::ranges::find(session.companion_names(), kHandCompanion) !=
              session.companion_names().end(),
          "robot '" + robot +
              "' cannot be pulled: only a simulation that 'trifinger run' runs has a hand");
  const config::File file = config_file_of(session);
  if (!is_from_file(file)) return pullable_bodies(*make_model(read_robot_config(file).simulation));
  // The session says which objects there are; the file of an untrusted robot is not opened.
  std::vector<std::string> names;
  const auto& companions = session.companion_names();
  if (std::ranges::find(companions, kObjectCompanion) == companions.end()) return names;
  constexpr std::string_view kPosition = ".position";
  const Session objects = session.companion(kObjectCompanion);
  for (const FieldDescription& field : objects.element(Series::kObservation).fields()) {
    if (!field.name.ends_with(kPosition)) continue;
    names.push_back(field.name.substr(0, field.name.size() - kPosition.size()));
  }
  return names;
}

}  // namespace

bool Pull::is_valid() const noexcept {
  return is_within(target, kFarthestTarget) && is_within(point, kFarthestPoint) &&
         stiffness > 0.0 && stiffness <= kMaxPullStiffness;
}

void Pull::validate() const {
  require(is_within(target, kFarthestTarget),
          text_of("the target of a pull is ", text_of_values(target), " m, each must be within ",
                  kFarthestTarget, " m of the origin"));
  require(is_within(point, kFarthestPoint),
          text_of("the point of a pull is ", text_of_values(point), " m, each must be within ",
                  kFarthestPoint, " m of the centre"));
  require(stiffness > 0.0 && stiffness <= kMaxPullStiffness,
          text_of("the stiffness of a pull is ", stiffness, " N/m, must be above 0 and at most ",
                  kMaxPullStiffness, " N/m"));
}

CompanionDescription hand_companion() {
  return {
      .name = kHandCompanion, .type = "hand_observation", .element = describe<HandObservation>()};
}

std::vector<std::string> pullable_bodies(const SceneModel& model) {
  std::vector<std::string> names;
  names.reserve(model.tip_geoms().size() + model.objects().size());
  for (std::size_t tip = 0; tip < model.tip_geoms().size(); ++tip) {
    names.push_back("tip_" + std::to_string(tip));
  }
  for (const ObjectAddress& object : model.objects()) names.push_back(object.name);
  if (model.tip_geoms().empty()) std::ranges::move(end_frames(model), std::back_inserter(names));
  return names;
}

std::int64_t find_body(std::span<const std::string> bodies, const std::string& name) {
  const auto found = std::ranges::find(bodies, name);
  require(found != bodies.end(), "there is no '" + name + "' to pull" +
                                     (bodies.empty() ? "" : "; there are " + joined(bodies)));
  return found - bodies.begin();
}

void require_body(std::span<const std::string> bodies, std::int64_t body) {
  require(body >= 0 && body < std::ssize(bodies),
          text_of("there is no body ", body, " to pull; there are 0 to ", std::ssize(bodies) - 1,
                  ": ", joined(bodies)));
}

// ---- the hand's process ----

struct HandWriter::State {
  explicit State(const std::string& robot)
      : bodies(bodies_of(robot)), writer(robot, kHandCompanion) {
    write();
    // Whoever does not see new elements takes this process for one that was stopped.
    thread = std::jthread([this](const std::stop_token& stop) {
      constexpr Nanoseconds kPeriod = kHandTimeout / 8;
      std::unique_lock lock(mutex);
      while (!sleep.wait_for(lock, stop, kPeriod, [] { return false; }) && !stop.stop_requested()) {
        if (std::chrono::steady_clock::now() >= end) element.body = -1;
        write();
      }
    });
  }

  void write() noexcept { writer.write(std::chrono::steady_clock::now(), element); }

  std::vector<std::string> bodies;
  ipc::ForkGuard fork;
  std::mutex mutex;  // for all below
  std::condition_variable_any sleep;
  HandObservation element{.process = ::getpid()};
  Instant end{Instant::max()};
  SensorWriter<HandObservation> writer;
  std::jthread thread;  // last member, because the thread uses the others
};

HandWriter::HandWriter(const std::string& robot) : state_(std::make_unique<State>(robot)) {}

HandWriter::~HandWriter() {
  // A forked child has no thread to wait for, and the sensor belongs to its parent: all stays as it
  // is.
  if (state_->fork.is_inherited()) {
    static_cast<void>(new (std::nothrow) std::unique_ptr<State>(std::move(state_)));
    return;
  }
  let_go();
}

const std::vector<std::string>& HandWriter::bodies() const noexcept { return state_->bodies; }

void HandWriter::pull(const std::string& body, const Pull& pull, Timeout length) {
  this->pull(find_body(state_->bodies, body), pull, length);
}

void HandWriter::pull(std::int64_t body, const Pull& pull, Timeout length) {
  if (state_->fork.is_inherited()) {
    throw InheritedHandle("the hand belongs to the process that was forked");
  }
  require_body(state_->bodies, body);
  pull.validate();
  const Instant now = std::chrono::steady_clock::now();
  const std::lock_guard lock(state_->mutex);
  state_->element.body = body;
  state_->element.target = pull.target;
  state_->element.point = pull.point;
  state_->element.stiffness = pull.stiffness;
  state_->end = length < Instant::max() - now ? now + length : Instant::max();
  state_->write();
}

void HandWriter::let_go() noexcept {
  if (state_->fork.is_inherited()) return;
  const std::lock_guard lock(state_->mutex);
  state_->element.body = -1;
  state_->write();
}

}  // namespace trifinger
