// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/environment.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "make_task.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::text_of;

// Bounds of the observed values. The safety checks brake joints that are faster.
constexpr double kMaxVelocity = 10.0;   // [rad/s]
constexpr double kMaxSideways = 0.5;    // [m]
constexpr double kBeyondLimits = 0.2;   // [rad]
constexpr double kMaxHeight = 0.6;      // [m]
constexpr double kWayTime = 2.0;        // Time to reach the start of an episode [s].
constexpr long long kWayActions = 20;   // Minimum number of actions for it.
constexpr std::size_t kMaxValues = 64;  // Largest number of values in an observation.

// Each episode has three series of random numbers.
constexpr std::uint64_t kStreams = 4;
constexpr std::uint64_t kPoseNoise = 1;
constexpr std::uint64_t kJointNoise = 2;

double draw(Random& random, const Range<double>& range) noexcept {
  return random.uniform(range.low, range.high);
}

// Draws a number only if the range has more than one value. Episodes without this option therefore
// stay as they were before the option existed.
double draw_if_free(Random& random, const Range<double>& range) noexcept {
  return range.low < range.high ? draw(random, range) : range.low;
}

void draw_what_varies(const EnvironmentOptions& options, Random& random, Start& start) noexcept {
  Variation& variation = start.variation;
  for (const SurfacePair pair : all_surface_pairs()) {
    if (const auto& range = options.pair_friction[pair]) {
      variation.pair_friction[pair] = draw_if_free(random, *range);
    }
  }
  variation.contact_time = draw_if_free(random, options.contact_time);
  variation.rotor_inertia = draw_if_free(random, options.rotor_inertia);
  variation.joint_damping = draw_if_free(random, options.joint_damping);
  variation.joint_friction = draw_if_free(random, options.joint_friction);
  variation.stop_margin = draw_if_free(random, options.stop_margin);
  if (options.object_speed.high > 0.0) {
    const double speed = draw(random, options.object_speed);
    const double direction = draw(random, {0.0, 2 * std::numbers::pi});
    start.object_velocity.linear = {speed * std::cos(direction), speed * std::sin(direction), 0.0};
  }
}

// A quaternion and its negative mean the same; the one with w >= 0 is shown.
ObjectPose upward(const ObjectPose& pose) noexcept {
  ObjectPose shown = pose;
  if (shown.orientation[0] < 0.0) {
    for (double& value : shown.orientation) value = -value;
  }
  return shown;
}

// The range of desired positions in the authors' simulation of their reaching task, in the sign
// convention of the variant and clipped to the soft limits.
Workspace make_workspace(const Kinematics& kinematics) {
  const RobotDescription& description = kinematics.description();
  const bool is_one = description.variant == Variant::kOne;
  const FingerJoints low{-70 * kDegree, is_one ? -70 * kDegree : 0.0, -160 * kDegree};
  const FingerJoints high{70 * kDegree, is_one ? 0.0 : 70 * kDegree, -2 * kDegree};
  const VariantFigures& limits = figures(description);
  Workspace workspace{.kinematics = &kinematics, .low = {}, .high = {}};
  for (int finger = 0; finger < kinematics.num_fingers(); ++finger) {
    for (std::size_t i = 0; i < kJointsPerFinger; ++i) {
      workspace.low.push_back(std::max(low[i], limits.soft_lower[i]));
      workspace.high.push_back(std::min(high[i], limits.soft_upper[i]));
    }
  }
  return workspace;
}

}  // namespace

struct Environment::Implementation {
  Implementation(const TaskDescription& its_task, const EnvironmentOptions& wanted,
                 const RobotDescription& description, Nanoseconds step)
      : options((wanted.validate(), wanted)),
        kinematics(description),
        task(make_task(its_task, description)),
        workspace(make_workspace(kinematics)),
        goal(task->goal()),
        action_time(std::chrono::duration<double>(step).count() * wanted.steps_per_action),
        max_torque(actuator(description).torque_limit),
        num_joints(workspace.low.size()),
        episode_actions(std::llround(options.duration / action_time)) {
    if (episode_actions < 1) {
      throw InvalidArgument(text_of("duration is ", options.duration,
                                    " s, must be at least that of an action, ", action_time, " s"));
    }
    if (options.per_finger && !task->has_goals_of_fingers()) {
      throw InvalidArgument(
          text_of("per_finger is for tasks with a goal for each finger, the task '", its_task.name,
                  "' has none"));
    }
    if (options.object_poses == ObjectPoses::kTracked && task->object_name().empty()) {
      throw InvalidArgument(
          text_of("object_poses is 'tracked', but the task '", its_task.name, "' has no object"));
    }
    list_entries();
    list_flat();
    for (int finger = 0; finger < kinematics.num_fingers(); ++finger) {
      turns.push_back(kinematics.finger_azimuth(0) - kinematics.finger_azimuth(finger));
    }
  }

  void add(std::string name, std::string unit, std::size_t size, double least, double most) {
    entries.push_back({.name = std::move(name),
                       .unit = std::move(unit),
                       .low = std::vector<double>(size, least),
                       .high = std::vector<double>(size, most)});
  }

  void list_entries() {
    const VariantFigures& limits = figures(kinematics.description());
    Entry positions{.name = "joint_position", .unit = "rad", .low = {}, .high = {}};
    for (std::size_t i = 0; i < num_joints; ++i) {
      positions.low.push_back(limits.hard_lower[i % kJointsPerFinger] - kBeyondLimits);
      positions.high.push_back(limits.hard_upper[i % kJointsPerFinger] + kBeyondLimits);
    }
    entries.push_back(std::move(positions));
    add("joint_velocity", "rad/s", num_joints, -kMaxVelocity, kMaxVelocity);
    if (!task->object_name().empty()) {
      add("tip_position", "m", num_joints, -kMaxSideways, kMaxSideways);
      for (std::size_t i = 2; i < num_joints; i += 3) entries.back().low[i] = 0.0;
      for (std::size_t i = 2; i < num_joints; i += 3) entries.back().high[i] = kMaxHeight;
    }
    if (shows_object()) {
      add("object_position", "m", 3, -kMaxSideways, kMaxSideways);
      entries.back().low[2] = 0.0;
      entries.back().high[2] = kMaxHeight;
      add("object_orientation", "1", 4, -1.0, 1.0);
    }
    if (options.mapping == Mapping::kStateAugmentation) add("action", "1", num_joints, -1.0, 1.0);
    goal_entry = entries.size();
    if (options.layout != Layout::kGoal) entries.push_back(goal);
  }

  // Lists which number of which entry comes next in the observation.
  void list_flat() {
    std::vector<std::size_t> begins;
    std::size_t begin = 0;
    for (const Entry& entry : entries) {
      begins.push_back(begin);
      begin += entry.low.size();
      low.insert(low.end(), entry.low.begin(), entry.low.end());
      high.insert(high.end(), entry.high.begin(), entry.high.end());
    }
    if (!is_flat() || !task->has_goals_of_fingers()) {
      flat.resize(begin);
      std::iota(flat.begin(), flat.end(), std::size_t{0});
      return;
    }
    for (std::size_t finger = 0; finger < num_joints / 3; ++finger) {
      for (const std::size_t entry_begin : begins) {
        for (std::size_t i = 0; i < 3; ++i) flat.push_back(entry_begin + 3 * finger + i);
      }
    }
  }

  // Observations in SI units have their entries one after the other.
  [[nodiscard]] bool is_flat() const noexcept {
    return options.layout == Layout::kFlat || options.layout == Layout::kGoal;
  }
  [[nodiscard]] bool shows_object() const noexcept {
    return !task->object_name().empty() && options.layout != Layout::kImages;
  }

  [[nodiscard]] double time_of(const Episode& episode) const noexcept {
    return static_cast<double>(episode.actions) * action_time;
  }

  // Writes the goals, in the frame of their finger if that is asked for.
  void show_goal(const Episode& episode, double* shown) const noexcept {
    std::copy_n(episode.goal.begin(), goal.low.size(), shown);
    if (!options.per_finger) return;
    for (std::size_t finger = 0; finger < turns.size(); ++finger) {
      const double cosine = std::cos(turns[finger]);
      const double sine = std::sin(turns[finger]);
      double* const xy = shown + 3 * finger;
      const auto [x, y] = std::pair(xy[0], xy[1]);
      xy[0] = cosine * x - sine * y;
      xy[1] = sine * x + cosine * y;
    }
  }

  // Computes what was achieved and compares it with the goal.
  Outcome judge(const View& view, Episode& episode, std::span<double> achieved,
                std::span<double> desired) const noexcept {
    const std::size_t goal_size = goal.low.size();
    task->achieve(view, episode, achieved);
    std::copy_n(episode.goal.begin(), goal_size, desired.begin());
    Outcome outcome;
    outcome.reward = task->reward(achieved, desired);
    outcome.success = task->is_success(achieved, desired, episode);
    outcome.terminated = episode.actions > 0 && task->has_ended(view, episode);
    outcome.truncated = !outcome.terminated && episode.actions >= episode_actions;
    const bool by_finger = task->has_goals_of_fingers();
    for (std::size_t i = 0; i < (by_finger ? num_joints / 3 : 1); ++i) {
      double square = 0.0;
      for (std::size_t k = 3 * i; k < std::min(3 * i + 3, goal_size); ++k) {
        square += (achieved[k] - desired[k]) * (achieved[k] - desired[k]);
      }
      outcome.distance[i] = std::sqrt(square);
      if (by_finger) outcome.finger_rewards[i] = -outcome.distance[i];
    }
    return outcome;
  }

  EnvironmentOptions options;
  Kinematics kinematics;
  std::unique_ptr<const Task> task;
  Workspace workspace;
  Entry goal;
  double action_time;  // Duration of one action [s].
  double max_torque;   // [Nm]
  std::size_t num_joints;
  std::int64_t episode_actions;
  std::vector<Entry> entries;
  std::size_t goal_entry{0};
  std::vector<std::size_t> flat;  // Index in all entries of each number observed.
  std::vector<double> low;        // Lower bounds of all entries, concatenated.
  std::vector<double> high;
  std::vector<double> turns;  // Angle that rotates each finger onto finger 0 [rad].
};

Environment::Environment(const TaskDescription& task, const EnvironmentOptions& options,
                         const RobotDescription& description, Nanoseconds period)
    : implementation_(std::make_unique<const Implementation>(task, options, description, period)) {}
Environment::Environment(std::string_view task, const EnvironmentOptions& options,
                         const RobotDescription& description, Nanoseconds period)
    : Environment(find_task(task), options, description, period) {}
Environment::Environment(Environment&&) noexcept = default;
Environment& Environment::operator=(Environment&&) noexcept = default;
Environment::~Environment() = default;

const EnvironmentOptions& Environment::options() const noexcept { return implementation_->options; }
std::size_t Environment::num_joints() const noexcept { return implementation_->num_joints; }
std::size_t Environment::num_fingers() const noexcept {
  return implementation_->num_joints / kJointsPerFinger;
}
std::int64_t Environment::episode_actions() const noexcept {
  return implementation_->episode_actions;
}
std::string_view Environment::object_name() const noexcept {
  return implementation_->task->object_name();
}
bool Environment::judges_by_truth() const noexcept {
  return !implementation_->task->object_name().empty() && options().needs_cameras();
}
const std::vector<Entry>& Environment::entries() const noexcept { return implementation_->entries; }
std::size_t Environment::observation_size() const noexcept { return implementation_->flat.size(); }
std::size_t Environment::goal_size() const noexcept { return implementation_->goal.low.size(); }
const Entry& Environment::goal() const noexcept { return implementation_->goal; }
std::span<const double> Environment::position_low() const noexcept {
  return implementation_->workspace.low;
}
std::span<const double> Environment::position_high() const noexcept {
  return implementation_->workspace.high;
}

std::vector<std::string> Environment::flat_names() const {
  std::vector<std::string> names;
  for (const Entry& entry : implementation_->entries) {
    for (std::size_t i = 0; i < entry.low.size(); ++i) {
      names.push_back(text_of(entry.name, "[", i, "]"));
    }
  }
  std::vector<std::string> ordered;
  ordered.reserve(implementation_->flat.size());
  for (const std::size_t i : implementation_->flat) ordered.push_back(names[i]);
  return ordered;
}

Start Environment::begin(std::uint64_t seed, std::uint64_t number,
                         Episode& episode) const noexcept {
  const Implementation& self = *implementation_;
  const std::uint64_t stream = kStreams * number;
  episode = {};
  episode.random = {.seed = seed, .episode = stream};
  episode.noise = {.seed = seed, .episode = stream + kJointNoise};
  Start start;
  start.random = {.seed = seed, .episode = stream + kPoseNoise};
  const FingerJoints& initial = figures(self.kinematics.description()).initial_position;
  for (std::size_t i = 0; i < self.num_joints; ++i) {
    start.position[i] = initial[i % kJointsPerFinger];
  }
  self.task->draw_start(self.workspace, episode.random, start);
  self.task->draw_goal(self.workspace, episode.random,
                       std::span(episode.goal).first(self.goal.low.size()));
  const EnvironmentOptions& options = self.options;
  start.variation = {.object_mass = draw(episode.random, options.object_mass),
                     .friction = draw(episode.random, options.friction),
                     .motor_gain = draw(episode.random, options.motor_gain),
                     .torque_delay = episode.random.integer(options.torque_delay.low,
                                                            options.torque_delay.high + 1)};
  draw_what_varies(options, episode.random, start);
  for (std::size_t i = 0; i < self.num_joints; ++i) {
    const double low = self.workspace.low[i];
    const double high = self.workspace.high[i];
    episode.target[i] = std::clamp(start.position[i], low, high);
    // The robot holds its position. Among changes of position, zero says that. No torque says it.
    if (options.action == ActionKind::kPosition) {
      episode.action[i] = (2.0 * episode.target[i] - low - high) / (high - low);
    }
  }
  return start;
}

std::int64_t Environment::way_actions() const noexcept {
  return std::max(kWayActions, std::llround(kWayTime / implementation_->action_time));
}

void Environment::way_point(std::span<const double> from, const Start& start, std::int64_t index,
                            std::span<double> position) const noexcept {
  const double time = static_cast<double>(index + 1) / static_cast<double>(way_actions());
  const double share = time * time * time * (10 - 15 * time + 6 * time * time);
  for (std::size_t i = 0; i < implementation_->num_joints; ++i) {
    position[i] = from[i] + share * (start.position[i] - from[i]);
  }
}

bool Environment::take_action(std::span<const float> numbers, Episode& episode,
                              std::span<double> torque, std::span<double> position) const noexcept {
  const Implementation& self = *implementation_;
  for (const float number : numbers) {
    if (!std::isfinite(number)) return false;
  }
  ++episode.actions;
  for (std::size_t i = 0; i < self.num_joints; ++i) {
    const double number = std::clamp(static_cast<double>(numbers[i]), -1.0, 1.0);
    const double low = self.workspace.low[i];
    const double high = self.workspace.high[i];
    double& target = episode.target[i];
    episode.action[i] = number;
    torque[i] = 0.0;
    switch (self.options.action) {
      case ActionKind::kPosition:
        target = 0.5 * (low + high) + 0.5 * (high - low) * number;
        break;
      case ActionKind::kPositionChange:
        target = std::clamp(target + self.options.position_change * number, low, high);
        break;
      case ActionKind::kTorque:
        target = kNotGiven;
        torque[i] = self.max_torque * number;
        break;
    }
    position[i] = target;
  }
  return true;
}

Outcome Environment::observe(const Measurement& measurement, Episode& episode,
                             std::span<float> observation, std::span<double> achieved,
                             std::span<double> desired) const noexcept {
  const Implementation& self = *implementation_;
  const EnvironmentOptions& options = self.options;
  const std::size_t n = self.num_joints;
  const auto joints = static_cast<Eigen::Index>(n);
  const auto goal_size = self.goal.low.size();

  std::array<double, kMaxValues> values{};
  double* next = values.data();
  JointValues position = JointValues::Map(measurement.position.data(), joints);
  JointValues velocity = JointValues::Map(measurement.velocity.data(), joints);
  if (options.position_noise > 0.0) {
    for (double& value : position) value += options.position_noise * episode.noise.normal();
  }
  if (options.velocity_noise > 0.0) {
    for (double& value : velocity) value += options.velocity_noise * episode.noise.normal();
  }
  next = std::ranges::copy(position, next).out;
  next = std::ranges::copy(velocity, next).out;

  View view{
      .tips = self.kinematics.tip_positions(position), .object = {}, .time = self.time_of(episode)};
  if (measurement.object != nullptr) {
    view.object = upward(*measurement.object);
    next = std::ranges::copy(view.tips, next).out;
    if (self.shows_object()) {
      next = std::ranges::copy(view.object.position, next).out;
      next = std::ranges::copy(view.object.orientation, next).out;
    }
    if (measurement.true_object != nullptr) view.object = upward(*measurement.true_object);
  }
  if (options.mapping == Mapping::kStateAugmentation) {
    next = std::copy_n(episode.action.begin(), n, next);
  }

  // The outcome is judged by the goal that was shown before this action.
  const Outcome outcome = self.judge(view, episode, achieved, desired);
  while (!outcome.truncated && episode.goals < self.task->num_goals(view.time)) {
    ++episode.goals;
    self.task->draw_goal(self.workspace, episode.random, std::span(episode.goal).first(goal_size));
  }
  if (options.layout != Layout::kGoal) self.show_goal(episode, next);

  for (std::size_t i = 0; i < self.flat.size(); ++i) {
    const std::size_t k = self.flat[i];
    const double value = std::clamp(values[k], self.low[k], self.high[k]);
    const double scaled = 2.0 * (value - self.low[k]) / (self.high[k] - self.low[k]) - 1.0;
    observation[i] = static_cast<float>(self.is_flat() ? scaled : value);
  }
  return outcome;
}

double Environment::reward(std::span<const double> achieved,
                           std::span<const double> desired) const noexcept {
  return implementation_->task->reward(achieved, desired);
}

}  // namespace trifinger::learning
