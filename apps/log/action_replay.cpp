// SPDX-License-Identifier: BSD-3-Clause
#include "log/action_replay.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>

#include "shared/text.hpp"

namespace trifinger::apps {
namespace {

using Position = std::vector<double>;
using Tell = std::function<void(const std::string&)>;

constexpr std::string_view kPosition = "position";
constexpr std::string_view kTorque = "torque";
constexpr std::string_view kVelocity = "velocity";

// How long the robot rests in the start pose before the motion begins, and when in this rest its
// pose is checked. Actions for the whole rest are sent ahead, so none is late during the check.
constexpr Nanoseconds kRest = std::chrono::milliseconds(500);
constexpr Nanoseconds kLookAhead = std::chrono::milliseconds(300);

// Returns the largest distance of any joint; a NaN is infinitely far from everything.
double distance(const Position& one, const Position& other) {
  double largest = 0.0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    const double difference = std::abs(one[i] - other[i]);
    if (std::isnan(difference)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, difference);
  }
  return largest;
}

// Gives access to the joints of a robot of any type.
class Joints {
 public:
  // Returns nothing if the robot type has no joints.
  [[nodiscard]] static std::optional<Joints> of(const RobotTypes& types) {
    const FieldDescription* const measured = types.observation.find(kPosition);
    const FieldDescription* const desired = types.action.find(kPosition);
    const auto is_vector = [](const FieldDescription* field) {
      return field != nullptr && field->type == ScalarType::kFloat64 && field->shape.size() == 1;
    };
    if (!is_vector(measured) || !is_vector(desired) || measured->shape != desired->shape) {
      return std::nullopt;
    }
    const FieldDescription* const velocity = types.observation.find(kVelocity);
    const bool has_velocity = is_vector(velocity) && velocity->shape == measured->shape;
    return Joints(types, *measured, *desired,
                  has_velocity ? std::optional(velocity->offset) : std::nullopt);
  }

  // Returns the speed of the fastest joint [rad/s]; 0 if velocities are not measured.
  [[nodiscard]] double speed_in(const std::byte* observation) const {
    if (!velocity_) return 0.0;
    const Position velocity = read(observation + *velocity_);
    return distance(velocity, Position(count_));
  }
  // Of positions: "rad", "m", or both.
  [[nodiscard]] const std::string& unit() const { return unit_; }
  [[nodiscard]] Position position_in(const std::byte* observation) const {
    return read(observation + measured_);
  }
  // Returns the desired positions; NaN for joints without one.
  [[nodiscard]] Position desired_in(const std::byte* action) const {
    return read(action + desired_);
  }
  void set_desired(std::byte* action, const Position& position) const {
    std::memcpy(action + desired_, position.data(), count_ * sizeof(double));
  }
  // Makes an action that asks for `position` with the robot's own gains.
  [[nodiscard]] std::vector<std::byte> action_of(const Position& position) const {
    std::vector<std::byte> action = default_action_;
    set_desired(action.data(), position);
    return action;
  }

 private:
  Joints(const RobotTypes& types, const FieldDescription& measured, const FieldDescription& desired,
         std::optional<std::size_t> velocity)
      : unit_(measured.unit),
        count_(measured.count()),
        measured_(measured.offset),
        velocity_(velocity),
        desired_(desired.offset),
        default_action_(types.default_action) {}

  [[nodiscard]] Position read(const std::byte* field) const {
    Position position(count_);
    std::memcpy(position.data(), field, count_ * sizeof(double));
    return position;
  }

  std::string unit_;
  std::size_t count_;
  std::size_t measured_;
  std::optional<std::size_t> velocity_;
  std::size_t desired_;
  std::vector<std::byte> default_action_;
};

std::string table(const Position& recorded, const Position& found, double tolerance,
                  const std::string& unit) {
  std::string text = fmt::format("  joint   recorded        now  difference [{}]\n", unit);
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    const double difference = found[i] - recorded[i];
    text += fmt::format("  {:5} {:10.4f} {:10.4f} {:11.4f}{}\n", i, recorded[i], found[i],
                        difference, std::abs(difference) <= tolerance ? "" : "  too far");
  }
  return text;
}

// Converts applied actions to actions that do the same. For joints, only the torques are taken
// over.
std::vector<std::byte> to_actions(const RobotTypes& types, const std::vector<std::byte>& applied) {
  if (types.applied_action == types.action) return applied;
  const FieldDescription* const from = types.applied_action.find(kTorque);
  const FieldDescription* const to = types.action.find(kTorque);
  if (from == nullptr || to == nullptr || from->type != to->type || from->shape != to->shape) {
    throw InvalidArgument("the applied actions of '" + types.type +
                          "' are no actions: they have other fields, and no torque in common; "
                          "replay the desired ones");
  }
  const std::size_t count = applied.size() / types.applied_action.size();
  std::vector<std::byte> actions;
  for (std::size_t i = 0; i < count; ++i) {
    actions.insert(actions.end(), types.default_action.begin(), types.default_action.end());
    std::memcpy(actions.data() + i * types.action.size() + to->offset,
                applied.data() + i * types.applied_action.size() + from->offset,
                from->count() * size_of(from->type));
  }
  return actions;
}

// Sends actions ahead and keeps count of the steps.
class Player {
 public:
  explicit Player(UntypedFrontend& robot) : robot_(robot) {}

  [[nodiscard]] TimeIndex next() const noexcept { return next_; }

  void play(const std::byte* action) {
    const TimeIndex t = robot_.append_desired_action(action, kForever);
    if (t != next_) {
      throw Error(fmt::format(
          "the action for step {} came too late and would have been applied at step {}: the motion "
          "was broken off. This machine was busy, or the robot runs faster than we can follow",
          next_, t));
    }
    ++next_;
  }
  [[nodiscard]] std::vector<std::byte> observation(TimeIndex t) const {
    std::vector<std::byte> observation(robot_.session().description().observation.size());
    robot_.get(Series::kObservation, t, observation.data(), kForever);
    return observation;
  }

 private:
  UntypedFrontend& robot_;
  TimeIndex next_{0};
};

// Minimum jerk: goes from 0 to 1, at rest on both ends. Its speed is at most kPeak times its mean.
double smooth(double x) { return x * x * x * (10.0 + x * (6.0 * x - 15.0)); }
constexpr double kPeak = 1.875;

TimeIndex steps_in(Nanoseconds time, Nanoseconds period) {
  return std::max<TimeIndex>(1, (time + period - Nanoseconds(1)) / period);
}

// Moves from `here` to `there` and rests. Returns the position that was reached.
Position blend(Player& player, const Joints& joints, const Position& here, const Position& there,
               Nanoseconds period, const ActionReplayOptions& options, const Tell& tell) {
  const double needed = kPeak * distance(here, there) / options.max_velocity;  // [s]
  const auto time = std::max(*options.blend,
                             std::chrono::ceil<Nanoseconds>(std::chrono::duration<double>(needed)));
  const TimeIndex steps = steps_in(time, period);
  tell(fmt::format("moves to the start pose, {:.2f} {} away, in {}", distance(here, there),
                   joints.unit(), duration_text(steps * period)));
  Position position = here;
  for (TimeIndex k = 1; k <= steps; ++k) {
    const double part = smooth(static_cast<double>(k) / static_cast<double>(steps));
    for (std::size_t i = 0; i < position.size(); ++i) {
      position[i] = here[i] + part * (there[i] - here[i]);
    }
    player.play(joints.action_of(position).data());
  }
  const std::vector<std::byte> rest = joints.action_of(there);
  for (TimeIndex k = 0; k < steps_in(kRest, period); ++k) player.play(rest.data());
  return joints.position_in(player.observation(steps + kLookAhead / period).data());
}

// Makes the first targets begin at the position that was asked for before. The difference fades
// away on a smooth curve.
void fade_in(Motion& motion, const Joints& joints, const Position& from, Nanoseconds period,
             double max_velocity) {
  Position offset = joints.desired_in(motion.action(0));
  double largest = 0.0;
  for (std::size_t i = 0; i < offset.size(); ++i) {
    offset[i] = std::isnan(offset[i]) ? 0.0 : from[i] - offset[i];
    largest = std::max(largest, std::abs(offset[i]));
  }
  const auto time =
      std::chrono::ceil<Nanoseconds>(std::chrono::duration<double>(kPeak * largest / max_velocity));
  const TimeIndex steps = time / period;
  for (TimeIndex t = 0; t < std::min(steps, motion.steps()); ++t) {
    Position target = joints.desired_in(motion.action(t));
    const double part = smooth(1.0 - static_cast<double>(t) / static_cast<double>(steps));
    for (std::size_t i = 0; i < target.size(); ++i) target[i] += part * offset[i];
    joints.set_desired(motion.action(t), target);
  }
}

// Brings the robot to the pose in which the motion began, or requires that it is there.
void go_to_start(Motion& motion, const Joints& joints, Nanoseconds period, UntypedFrontend& robot,
                 Player& player, const ActionReplayOptions& options, const Tell& tell) {
  std::vector<std::byte> observation(motion.types.observation.size());
  robot.latest_observation(observation.data(), kForever);
  const Position recorded = joints.position_in(motion.observation(0));
  Position found = joints.position_in(observation.data());
  const char* hint = "bring it there with --blend SECONDS";
  if (options.blend) {
    found = blend(player, joints, found, recorded, period, options, tell);
    hint = "it could not be brought nearer: is something in the way?";
  }
  if (!(distance(found, recorded) <= options.tolerance)) {
    // The robot rests where it was brought to, until the session has ended.
    if (player.next() > 0) robot.finish(kForever);
    throw WrongStartPose(
        fmt::format("the robot is not within {} {} of where step {} of the motion began; {}\n{}",
                    options.tolerance, joints.unit(), motion.first, hint,
                    table(recorded, found, options.tolerance, joints.unit())));
  }
  constexpr double kAtRest = 0.1;  // [rad/s]
  if (const double speed = joints.speed_in(motion.observation(0)); speed > kAtRest) {
    tell(
        fmt::format("step {} of the log was in motion, up to {:.2g} {}/s; the robot begins at rest",
                    motion.first, speed, joints.unit()));
  }
  if (options.blend) fade_in(motion, joints, recorded, period, options.max_velocity);
}

// Sends the actions and compares what the robot does with what was recorded. Returns the result in
// a sentence.
std::string play(const Motion& motion, const std::optional<Joints>& joints, Player& player) {
  constexpr TimeIndex kAhead = 256;
  const TimeIndex begin = player.next();
  const TimeIndex steps = motion.steps();
  double largest = 0.0;
  TimeIndex farthest = 0;
  for (TimeIndex t = 0; t < steps; ++t) {
    while (player.next() - begin < std::min(t + kAhead, steps)) {
      player.play(motion.action(player.next() - begin));
    }
    const std::vector<std::byte> observation = player.observation(begin + t);
    if (!joints) continue;
    const double difference = distance(joints->position_in(observation.data()),
                                       joints->position_in(motion.observation(t)));
    if (difference > largest) {
      largest = difference;
      farthest = t;
    }
  }
  if (!joints) return "done";
  std::string result = fmt::format("done; it was at most {:.4g} {} from the recorded positions",
                                   largest, joints->unit());
  if (largest > 0.0) result += fmt::format(", at step {} of the log", motion.first + farthest);
  return result;
}

}  // namespace

Motion read_motion(const log::LoggedSession& session, Series what, std::optional<TimeIndex> first,
                   std::optional<TimeIndex> last) {
  if (session.is_companion()) {
    throw InvalidArgument("'" + session.name() + "' is a companion and was given no actions");
  }
  if (!session.has_elements()) {
    throw InvalidArgument("the log has no step of '" + session.name() + "'");
  }
  const auto [oldest, end] = session.range(Series::kAppliedAction);
  const TimeIndex begin = first.value_or(oldest);
  const TimeIndex stop = last.value_or(end);
  if (begin < oldest || stop > end || begin >= stop) {
    throw InvalidArgument(fmt::format("the log has the steps {} to {} of '{}', not {} to {}",
                                      oldest, end - 1, session.name(), begin, stop - 1));
  }
  Motion motion{.types = session.header().types, .actions = {}, .observations = {}, .first = begin};
  const auto count = static_cast<std::size_t>(stop - begin);
  const auto read = [&](Series series) {
    std::vector<std::byte> elements(session.element(series).size() * count);
    session.get(series, begin, count, elements.data());
    return elements;
  };
  motion.actions = what == Series::kAppliedAction
                       ? to_actions(motion.types, read(Series::kAppliedAction))
                       : read(Series::kDesiredAction);
  motion.observations = read(Series::kObservation);
  return motion;
}

void replay_actions(Motion motion, Nanoseconds period, UntypedFrontend& robot,
                    const ActionReplayOptions& options,
                    const std::function<void(const std::string&)>& tell) {
  require_same_robot(robot.session(), motion.types);
  if (const Nanoseconds found = robot.session().info().period; found != period) {
    throw InvalidArgument("the motion was recorded with steps of " + duration_text(period) +
                          ", those of the robot are " + duration_text(found));
  }
  const std::optional<Joints> joints = Joints::of(motion.types);
  if (!joints && !options.force) {
    throw WrongStartPose("'" + motion.types.type +
                         "' has no joint positions, so nobody can tell whether it is where the "
                         "motion began; --force begins in any pose");
  }
  Player player(robot);
  if (joints) go_to_start(motion, *joints, period, robot, player, options, tell);
  tell(fmt::format("plays {}", counted(motion.steps(), "step")));
  const std::string result = play(motion, joints, player);
  robot.finish(kForever);
  tell(result);
}

}  // namespace trifinger::apps
