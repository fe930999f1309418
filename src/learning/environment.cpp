// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/environment.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "base/moved.hpp"
#include "base/text_of.hpp"
#include "environment_implementation.hpp"
#include "sim/possible_pose.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::text_of;

constexpr double kApproachTime = 2.0;       // Time to reach the start of an episode [s].
constexpr long long kApproachActions = 20;  // Minimum number of actions for it.

// Each episode has four series of random numbers.
constexpr std::uint64_t kStreams = 4;
constexpr std::uint64_t kPoseNoise = 1;
constexpr std::uint64_t kJointNoise = 2;
constexpr std::uint64_t kResets = 3;

double draw(Random& random, const Range<double>& range) noexcept {
  return random.uniform(range.low, range.high);
}

TimeIndex draw(Random& random, const Range<TimeIndex>& range) noexcept {
  return random.integer(range.low, range.high + 1);
}

// Draws a number only if the range has more than one value. Episodes without this option therefore
// stay as they were before the option existed.
template <class T>
T draw_if_free(Random& random, const Range<T>& range) noexcept {
  return range.low < range.high ? draw(random, range) : range.low;
}

template <class T>
struct Drawn {
  Range<T> EnvironmentOptions::* range;
  T Variation::* value;
};
template <class T>
Drawn(Range<T> EnvironmentOptions::*, T Variation::*) -> Drawn<T>;

constexpr std::tuple kDrawn{
    Drawn{&EnvironmentOptions::contact_time, &Variation::contact_time},
    Drawn{&EnvironmentOptions::rotor_inertia, &Variation::rotor_inertia},
    Drawn{&EnvironmentOptions::joint_damping, &Variation::joint_damping},
    Drawn{&EnvironmentOptions::joint_friction, &Variation::joint_friction},
    Drawn{&EnvironmentOptions::stop_margin, &Variation::stop_margin},
    Drawn{&EnvironmentOptions::homing_error, &Variation::homing_error},
    Drawn{&EnvironmentOptions::motor_spread, &Variation::motor_spread},
    Drawn{&EnvironmentOptions::torque_ripple, &Variation::torque_ripple},
    Drawn{&EnvironmentOptions::backlash, &Variation::backlash},
    Drawn{&EnvironmentOptions::measurement_delay, &Variation::measurement_delay},
    Drawn{&EnvironmentOptions::motor_heat, &Variation::motor_heat},
    Drawn{&EnvironmentOptions::tip_radius, &Variation::tip_radius}};

void draw_what_varies(const EnvironmentOptions& options, Random& random, Start& start) noexcept {
  Variation& variation = start.variation;
  for (const SurfacePair pair : all_surface_pairs()) {
    if (const auto& range = options.pair_friction[pair]) {
      variation.pair_friction[pair] = draw_if_free(random, *range);
    }
  }
  const auto take = [&]<class T>(const Drawn<T>& row) {
    const T usual = Variation{}.*row.value;
    const Range<T>& range = options.*row.range;
    if (range != Range<T>{usual, usual}) variation.*row.value = draw_if_free(random, range);
  };
  std::apply([&](const auto&... row) { (take(row), ...); }, kDrawn);
  // A condition brings a seed. Without one, the errors of all episodes would be the same.
  const bool differ =
      variation.homing_error > 0.0 || variation.motor_spread > 0.0 || variation.torque_ripple > 0.0;
  if (differ && variation.seed == 0) {
    variation.seed = static_cast<std::uint64_t>(random.integer(1, 1'000'000'000));
  }
  if (options.object_speed.high > 0.0) {
    const double speed = draw(random, options.object_speed);
    const double direction = draw(random, Range<double>{0.0, 2 * std::numbers::pi});
    start.object_velocity.linear = {speed * std::cos(direction), speed * std::sin(direction), 0.0};
  }
}

}  // namespace

Start Environment::Implementation::prepare(std::uint64_t seed, std::uint64_t number,
                                           Episode& episode) const noexcept {
  const std::uint64_t stream = kStreams * number;
  episode = {};
  episode.random = {.seed = seed, .episode = stream};
  episode.noise = {.seed = seed, .episode = stream + kJointNoise};
  Start start;
  start.random = {.seed = seed, .episode = stream + kPoseNoise};
  std::ranges::copy(joints.initial, start.position.begin());
  start.object = object_pose;
  return start;
}

void Environment::Implementation::check(const Start& start, std::size_t row) const {
  for (std::size_t i = 0; i < num_joints; ++i) {
    const double position = start.position[i];
    if (position >= joints.hard_low[i] && position <= joints.hard_high[i]) continue;
    throw InvalidArgument(text_of("a start of the task '", task_name, "' has joint ", i, " at ",
                                  position, " in row ", row, ", its hard limits are ",
                                  joints.hard_low[i], " and ", joints.hard_high[i]));
  }
  if (trifinger::detail::is_possible(start.object)) return;
  throw InvalidArgument(text_of("a start of the task '", task_name,
                                "' has no pose of the object in row ", row,
                                ": it is not finite, or its quaternion is zero"));
}

void Environment::Implementation::complete(Start& start, Episode& episode) const noexcept {
  Variation& robot = start.variation;
  robot = trifinger::draw(options.condition, episode.random);
  robot.object_mass = draw(episode.random, options.object_mass);
  robot.friction = draw(episode.random, options.friction);
  robot.motor_gain = draw(episode.random, options.motor_gain);
  // Drawn in any case, so that episodes stay as they were before there were conditions.
  const TimeIndex delay = draw(episode.random, options.torque_delay);
  if (options.torque_delay != Range<TimeIndex>{}) robot.torque_delay = delay;
  draw_what_varies(options, episode.random, start);
  hold(start.position, episode);
}

void Environment::Implementation::hold(std::span<const double> position,
                                       Episode& episode) const noexcept {
  for (std::size_t i = 0; i < num_joints; ++i) {
    const double lowest = workspace.low[i];
    const double highest = workspace.high[i];
    episode.target[i] = std::clamp(position[i], lowest, highest);
    // The robot holds its position. Among changes of position, zero says that. No torque says it.
    if (options.action == ActionKind::kPosition) {
      episode.action[i] = (2.0 * episode.target[i] - lowest - highest) / (highest - lowest);
    }
  }
}

void Environment::Implementation::pull_back(std::span<const double> position,
                                            Episode& episode) const noexcept {
  for (std::size_t i = 0; i < num_joints; ++i) {
    const double ahead = std::clamp(episode.target[i] - position[i], -options.leash, options.leash);
    episode.target[i] = std::clamp(position[i] + ahead, workspace.low[i], workspace.high[i]);
  }
}

Environment::Environment(const TaskDescription& task, const EnvironmentOptions& options,
                         const RobotDescription& description, Nanoseconds period)
    : implementation_(std::make_unique<const Implementation>(task, options, description, period)) {}
Environment::Environment(std::string_view task, const EnvironmentOptions& options,
                         const RobotDescription& description, Nanoseconds period)
    : Environment(find_task(task), options, description, period) {}
Environment::Environment(const TaskDescription& task, const EnvironmentOptions& options,
                         const SimulationOptions& robot)
    : implementation_(robot.file != nullptr
                          ? std::make_unique<const Implementation>(task, options, robot)
                          : std::make_unique<const Implementation>(task, options, robot.description,
                                                                   robot.period)) {}
Environment::Environment(std::string_view task, const EnvironmentOptions& options,
                         const SimulationOptions& robot)
    : Environment(find_task(task), options, robot) {}
Environment::Environment(Environment&&) noexcept = default;
Environment& Environment::operator=(Environment&&) noexcept = default;
Environment::~Environment() = default;

const EnvironmentOptions& Environment::options() const noexcept {
  return checked(implementation_)->options;
}
std::size_t Environment::num_joints() const noexcept {
  return checked(implementation_)->num_joints;
}
std::size_t Environment::num_fingers() const noexcept {
  return checked(implementation_)->num_points;
}
std::size_t Environment::num_parts() const noexcept { return checked(implementation_)->num_parts; }
bool Environment::has_goals_of_fingers() const noexcept {
  return checked(implementation_)->task->has_goals_of_fingers();
}
const std::vector<std::string>& Environment::scores() const noexcept {
  return checked(implementation_)->scores;
}
const std::vector<Entry>& Environment::hidden_entries() const noexcept {
  return checked(implementation_)->hidden_entries;
}
std::size_t Environment::first_finger(const Episode& episode) const noexcept {
  return checked(implementation_)->first_finger(episode);
}
std::int64_t Environment::episode_actions() const noexcept {
  return checked(implementation_)->episode_actions;
}
std::string_view Environment::object_name() const noexcept {
  return checked(implementation_)->task->object_name();
}
double Environment::object_reach() const noexcept {
  return checked(implementation_)->task->object_reach();
}
bool Environment::judges_by_truth() const noexcept {
  return !checked(implementation_)->task->object_name().empty() && options().needs_cameras();
}
const std::vector<Entry>& Environment::entries() const noexcept {
  return checked(implementation_)->entries;
}
std::size_t Environment::observation_size() const noexcept {
  return checked(implementation_)->flat.size();
}
std::size_t Environment::goal_size() const noexcept {
  return checked(implementation_)->goal.low.size();
}
const Entry& Environment::goal() const noexcept { return checked(implementation_)->goal; }
std::span<const double> Environment::position_low() const noexcept {
  return checked(implementation_)->workspace.low;
}
std::span<const double> Environment::position_high() const noexcept {
  return checked(implementation_)->workspace.high;
}

std::vector<std::string> Environment::flat_names() const {
  std::vector<std::string> names;
  for (const Entry& entry : checked(implementation_)->entries) {
    for (std::size_t i = 0; i < entry.low.size(); ++i) {
      names.push_back(text_of(entry.name, "[", i, "]"));
    }
  }
  std::vector<std::string> ordered;
  ordered.reserve(checked(implementation_)->flat.size());
  for (const std::size_t i : checked(implementation_)->flat) ordered.push_back(names[i]);
  return ordered;
}

bool Environment::is_of_many() const noexcept {
  return checked(implementation_)->of_many != nullptr;
}

Start Environment::begin(std::uint64_t seed, std::uint64_t number, Episode& episode) const {
  const Implementation& self = *checked(implementation_);
  Start start;
  if (self.of_many != nullptr) {
    const Beginning one{.seed = seed, .number = number, .episode = &episode, .start = &start};
    begin({&one, 1});
    return start;
  }
  start = self.prepare(seed, number, episode);
  self.of_one->begin(self.workspace, start, episode, self.goal_of(episode));
  self.complete(start, episode);
  return start;
}

void Environment::begin(std::span<const Beginning> robots) const {
  const Implementation& self = *checked(implementation_);
  for (const Beginning& one : robots) {
    *one.start = self.of_many != nullptr ? self.prepare(one.seed, one.number, *one.episode)
                                         : begin(one.seed, one.number, *one.episode);
  }
  if (self.of_many == nullptr) return;
  self.of_many->begin(robots);
  for (std::size_t row = 0; row < robots.size(); ++row) {
    self.check(*robots[row].start, row);
    self.complete(*robots[row].start, *robots[row].episode);
  }
}

void Environment::check_reset_states(const ResetStates& resets) const {
  const Implementation& self = *checked(implementation_);
  const bool is_share = resets.share >= 0.0 && resets.share <= 1.0;
  if (!is_share || (resets.states.empty() && resets.share > 0.0)) {
    throw InvalidArgument(text_of("the share of episodes that begin in one of ",
                                  resets.states.size(), " states is ", resets.share,
                                  ", must be 0 to 1, and 0 without states"));
  }
  const bool has_object = !object_name().empty();
  if (self.file != nullptr &&
      self.file->initial_configuration().size() != self.num_joints + (has_object ? 7 : 0)) {
    throw InvalidArgument(
        "reset states say where motors and one object are, this robot has other joints or bodies, "
        "too");
  }
  for (std::size_t i = 0; i < resets.states.size(); ++i) {
    const ResetState& state = resets.states[i];
    if (state.position.size() != self.num_joints || state.torque.size() != self.num_joints) {
      throw InvalidArgument(text_of("state ", i, " has ", state.position.size(),
                                    " joint positions and ", state.torque.size(),
                                    " torques, must have ", self.num_joints));
    }
    if (!std::ranges::all_of(state.torque, [](double one) { return std::isfinite(one); })) {
      throw InvalidArgument(text_of("state ", i, " has torques that are not finite"));
    }
    if (state.object.has_value() != has_object) {
      throw InvalidArgument(text_of("state ", i, has_object ? " has no" : " has a",
                                    " pose of an object, the task '", self.task_name, "' has ",
                                    has_object ? "one" : "none"));
    }
    Start start;
    std::ranges::copy(state.position, start.position.begin());
    start.object = state.object.value_or(ObjectPose{});
    self.check(start, i);
  }
}

const ResetState* Environment::choose_reset_state(const ResetStates& resets, std::uint64_t seed,
                                                  std::uint64_t number,
                                                  Start& start) const noexcept {
  Random random{.seed = seed, .episode = kStreams * number + kResets};
  if (resets.states.empty() || random.uniform(0.0, 1.0) >= resets.share) return nullptr;
  const auto count = static_cast<std::int64_t>(resets.states.size());
  const ResetState& state = resets.states[static_cast<std::size_t>(random.integer(0, count))];
  std::ranges::copy(state.position, start.position.begin());
  if (state.object) start.object = *state.object;
  start.object_velocity = {};
  return &state;
}

void Environment::begin_in(const ResetState& state, std::span<const double> measured,
                           Episode& episode, std::span<double> torque,
                           std::span<double> position) const noexcept {
  const Implementation& self = *checked(implementation_);
  for (std::size_t i = 0; i < self.num_joints; ++i) {
    const double kp = self.options.position_kp > 0.0 ? self.options.position_kp : self.joints.kp[i];
    torque[i] = 0.0;
    position[i] = measured[i] + (kp > 0.0 ? state.torque[i] / kp : 0.0);
  }
  switch (self.options.action) {
    case ActionKind::kPosition:
      self.hold(position, episode);
      break;
    case ActionKind::kPositionChange:
      self.hold(position, episode);
      self.pull_back(measured, episode);
      break;
    case ActionKind::kRelativePosition:
      self.hold(measured, episode);
      return;
    case ActionKind::kTorque:
      self.hold(measured, episode);
      for (std::size_t i = 0; i < self.num_joints; ++i) {
        const double most = self.joints.max_torque[i];
        torque[i] = std::clamp(state.torque[i], -most, most);
        episode.action[i] = torque[i] / most;
        position[i] = kNotGiven;
      }
      return;
  }
  std::copy_n(episode.target.begin(), self.num_joints, position.begin());
}

void Environment::begin_at(std::span<const double> position, Episode& episode) const noexcept {
  checked(implementation_)->hold(position, episode);
}

std::int64_t Environment::approach_actions() const noexcept {
  return std::max(kApproachActions,
                  std::llround(kApproachTime / checked(implementation_)->action_time));
}

void Environment::approach_point(std::span<const double> from, const Start& start,
                                 std::int64_t index, std::span<double> position) const noexcept {
  const double time = static_cast<double>(index + 1) / static_cast<double>(approach_actions());
  const double share = time * time * time * (10 - 15 * time + 6 * time * time);
  for (std::size_t i = 0; i < checked(implementation_)->num_joints; ++i) {
    position[i] = from[i] + share * (start.position[i] - from[i]);
  }
}

double Environment::position_kp() const noexcept {
  const EnvironmentOptions& options = checked(implementation_)->options;
  const bool is_given = options.position_kp > 0.0 && options.action != ActionKind::kTorque;
  return is_given ? options.position_kp : kNotGiven;
}

bool Environment::take_action(std::span<const float> numbers, Episode& episode,
                              std::span<double> torque, std::span<double> position) const noexcept {
  const Implementation& self = *checked(implementation_);
  for (const float number : numbers) {
    if (!std::isfinite(number)) return false;
  }
  ++episode.actions;
  const std::size_t first = self.first_finger(episode);
  for (std::size_t i = 0; i < self.num_joints; ++i) {
    const float said = numbers[self.place_in_action(i, first)];
    const double number = std::clamp(static_cast<double>(said), -1.0, 1.0);
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
      case ActionKind::kRelativePosition:
        target = std::clamp(target + self.options.position_change * number, low, high);
        break;
      case ActionKind::kTorque:
        target = kNotGiven;
        torque[i] = self.joints.max_torque[i] * number;
        break;
    }
    position[i] = target;
  }
  return true;
}

void Environment::invert_action(std::span<const double> torque, std::span<const double> position,
                                const Episode& episode, std::span<float> numbers) const noexcept {
  const Implementation& self = *checked(implementation_);
  const std::size_t first = self.first_finger(episode);
  for (std::size_t i = 0; i < self.num_joints; ++i) {
    const double low = self.workspace.low[i];
    const double high = self.workspace.high[i];
    double number = 0.0;
    switch (self.options.action) {
      case ActionKind::kPosition:
        number = (2.0 * position[i] - low - high) / (high - low);
        break;
      case ActionKind::kPositionChange:
      case ActionKind::kRelativePosition:
        number = (position[i] - episode.target[i]) / self.options.position_change;
        break;
      case ActionKind::kTorque:
        number = torque[i] / self.joints.max_torque[i];
        break;
    }
    numbers[self.place_in_action(i, first)] = static_cast<float>(std::clamp(number, -1.0, 1.0));
  }
}

Outcome Environment::observe(const Measurement& measurement, Episode& episode,
                             std::span<float> observation, std::span<double> achieved,
                             std::span<double> desired) const {
  Observed one;
  one.measurement = measurement;
  one.episode = &episode;
  one.observation = observation;
  one.achieved = achieved;
  one.desired = desired;
  if (is_of_many()) {
    observe({&one, 1});
  } else {
    checked(implementation_)->observe(one);
  }
  return one.outcome;
}

void Environment::observe(std::span<Observed> robots) const {
  const Implementation& self = *checked(implementation_);
  if (self.of_many == nullptr) {
    for (Observed& one : robots) self.observe(one);
    return;
  }
  for (Observed& one : robots) {
    self.look(one);
    one.outcome = {};
    std::copy_n(one.episode->goal.begin(), self.goal.low.size(), one.desired.begin());
  }
  self.of_many->judge(robots);
  for (Observed& one : robots) self.complete(one);
  for (std::vector<Beginning> next;; next.clear()) {
    for (const Observed& one : robots) {
      if (!Implementation::takes_next_goal(one)) continue;
      next.push_back({.robot = one.robot, .episode = one.episode});
    }
    if (next.empty()) break;
    self.of_many->draw_goals(next);
  }
  std::vector<double> shown(robots.size() * self.own_values);
  if (self.has_own_entries) self.of_many->show(robots, shown);
  for (std::size_t i = 0; i < robots.size(); ++i) {
    self.write(robots[i], std::span(shown).subspan(i * self.own_values, self.own_values));
  }
}

double Environment::reward(std::span<const double> achieved,
                           std::span<const double> desired) const {
  double reward = 0.0;
  rewards(achieved, desired, {&reward, 1});
  return reward;
}

void Environment::rewards(std::span<const double> achieved, std::span<const double> desired,
                          std::span<double> rewards) const {
  const Implementation& self = *checked(implementation_);
  const std::size_t size = self.goal.low.size();
  if (achieved.size() != size * rewards.size() || desired.size() != achieved.size()) {
    throw InvalidArgument(
        text_of("goals must have ", size, " numbers each, as many of them achieved as desired"));
  }
  if (self.of_many != nullptr) {
    self.of_many->reward(achieved, desired, rewards);
    return;
  }
  for (std::size_t i = 0; i < rewards.size(); ++i) {
    rewards[i] =
        self.of_one->reward(achieved.subspan(i * size, size), desired.subspan(i * size, size));
  }
}

}  // namespace trifinger::learning
