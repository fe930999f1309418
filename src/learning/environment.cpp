// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/environment.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include "base/moved.hpp"
#include "base/text_of.hpp"
#include "make_task.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::text_of;

// Bounds of the observed values. The safety checks brake joints that are faster.
constexpr double kMaxVelocity = 10.0;                // [rad/s]
constexpr double kMaxSideways = 0.5;                 // [m]
constexpr double kBeyondLimits = 0.2;                // [rad]
constexpr double kMaxHeight = 0.6;                   // [m]
constexpr double kWayTime = 2.0;                     // Time to reach the start of an episode [s].
constexpr long long kWayActions = 20;                // Minimum number of actions for it.
constexpr std::size_t kMaxValues = 1024;             // Largest number of values in an observation.
constexpr std::string_view kImageAge = "image_age";  // What whoever has cameras adds.
constexpr double kSmallestSquare = 1e-12;            // Of a quaternion that is not zero.

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

double distance_between(std::span<const double> a, std::span<const double> b) noexcept {
  double square = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) square += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(square);
}

// The distance between the first three numbers of two goals.
double distance_of_places(std::span<const double> achieved,
                          std::span<const double> desired) noexcept {
  const std::size_t size = std::min<std::size_t>(achieved.size(), 3);
  return distance_between(achieved.first(size), desired.first(size));
}

// A quaternion and its negative mean the same; the one with w >= 0 is shown.
ObjectPose upward(const ObjectPose& pose) noexcept {
  ObjectPose shown = pose;
  if (shown.orientation[0] < 0.0) {
    for (double& value : shown.orientation) value = -value;
  }
  return shown;
}

// Pose of an object in positions in the order of MuJoCo's `qpos`.
ObjectPose pose_in(const double* positions, const ObjectAddress& object) noexcept {
  const double* const first = positions + object.position;
  ObjectPose pose;
  std::copy_n(first, pose.position.size(), pose.position.begin());
  std::copy_n(first + pose.position.size(), pose.orientation.size(), pose.orientation.begin());
  return pose;
}

// What is known of each joint of a robot, one number per joint.
struct JointFigures {
  std::vector<double> initial{};  // Where it begins [rad], [m].
  std::vector<double> low{};      // What actions can ask for.
  std::vector<double> high{};
  std::vector<double> hard_low{};  // Where the joint can be.
  std::vector<double> hard_high{};
  std::vector<double> max_torque{};                                                // [Nm], [N]
  Entry position{.name = "joint_position", .unit = "rad", .low = {}, .high = {}};  // observed
  Entry velocity{.name = "joint_velocity", .unit = "rad/s", .low = {}, .high = {}};
};

// The range of desired positions is that of the authors' simulation of their reaching task, in the
// sign convention of the variant and clipped to the soft limits.
JointFigures figures_of(const Kinematics& kinematics) {
  const RobotDescription& description = kinematics.description();
  const bool is_one = description.variant == Variant::kOne;
  const FingerJoints low{-70 * kDegree, is_one ? -70 * kDegree : 0.0, -160 * kDegree};
  const FingerJoints high{70 * kDegree, is_one ? 0.0 : 70 * kDegree, -2 * kDegree};
  const VariantFigures& limits = figures(description);
  JointFigures joints;
  for (int finger = 0; finger < kinematics.num_fingers(); ++finger) {
    for (std::size_t i = 0; i < kJointsPerFinger; ++i) {
      joints.initial.push_back(limits.initial_position[i]);
      joints.low.push_back(std::max(low[i], limits.soft_lower[i]));
      joints.high.push_back(std::min(high[i], limits.soft_upper[i]));
      joints.hard_low.push_back(limits.hard_lower[i]);
      joints.hard_high.push_back(limits.hard_upper[i]);
      joints.max_torque.push_back(actuator(description).torque_limit);
      joints.position.low.push_back(limits.hard_lower[i] - kBeyondLimits);
      joints.position.high.push_back(limits.hard_upper[i] + kBeyondLimits);
      joints.velocity.low.push_back(-kMaxVelocity);
      joints.velocity.high.push_back(kMaxVelocity);
    }
  }
  return joints;
}

// The range of desired positions is that of the soft limits. Where a joint has no end, it is asked
// for half a turn from where it begins, and observed for half a turn more.
JointFigures figures_of(const FileBody& body) {
  JointFigures joints;
  bool has_slide = false;
  bool has_hinge = false;
  for (std::size_t i = 0; i < body.num_joints(); ++i) {
    const JointLimit& limit = body.limits()[i];
    const bool is_slide = body.model().joints()[i].is_slide;
    (is_slide ? has_slide : has_hinge) = true;
    const double half_turn = is_slide ? 1.0 : std::numbers::pi;
    const auto is_end = [](double bound) { return std::abs(bound) < kLargestJointLimit; };
    const double initial = body.initial_position()[i];
    const double low = is_end(limit.soft_lower) ? limit.soft_lower : initial - half_turn;
    const double high = is_end(limit.soft_upper) ? limit.soft_upper : initial + half_turn;
    joints.initial.push_back(initial);
    joints.low.push_back(low);
    joints.high.push_back(high);
    joints.hard_low.push_back(limit.hard_lower);
    joints.hard_high.push_back(limit.hard_upper);
    joints.max_torque.push_back(limit.max_torque);
    joints.position.low.push_back(is_end(limit.hard_lower) ? limit.hard_lower - kBeyondLimits
                                                           : low - half_turn);
    joints.position.high.push_back(is_end(limit.hard_upper) ? limit.hard_upper + kBeyondLimits
                                                            : high + half_turn);
    const double fastest = is_end(limit.max_velocity) ? limit.max_velocity : kMaxVelocity;
    joints.velocity.low.push_back(-fastest);
    joints.velocity.high.push_back(fastest);
  }
  if (has_slide) {
    joints.position.unit = has_hinge ? "rad or m" : "m";
    joints.velocity.unit = has_hinge ? "rad/s or m/s" : "m/s";
  }
  return joints;
}

Workspace workspace_of(const JointFigures& joints, const Kinematics* kinematics,
                       const FileBody* file) {
  return {.kinematics = kinematics, .file = file, .low = joints.low, .high = joints.high};
}

// Refuses bounds that nothing can be between.
void check_bounds(const Entry& entry, std::string_view task) {
  if (entry.low.size() != entry.high.size() || entry.low.empty()) {
    throw InvalidArgument(text_of("'", entry.name, "' of the task '", task, "' has ",
                                  entry.low.size(), " lower and ", entry.high.size(),
                                  " upper bounds, must have as many of both, at least 1"));
  }
  for (std::size_t i = 0; i < entry.low.size(); ++i) {
    const double width = entry.high[i] - entry.low[i];
    if (std::isfinite(width) && width > 0.0) continue;
    throw InvalidArgument(text_of("number ", i, " of '", entry.name, "' of the task '", task,
                                  "' is from ", entry.low[i], " to ", entry.high[i],
                                  ": bounds must be finite, the lower one below the upper one"));
  }
}

// Refuses names that an observation has of its own, or twice.
void check_names(std::span<const Entry> entries, std::string_view task) {
  for (auto entry = entries.begin(); entry != entries.end(); ++entry) {
    if (entry->name.empty() || entry->name == kImageAge) {
      throw InvalidArgument(text_of("an entry of the task '", task, "' is called '", entry->name,
                                    "', which no entry can be"));
    }
    if (std::ranges::find(entries.begin(), entry, entry->name, &Entry::name) != entry) {
      throw InvalidArgument(
          text_of("two entries of the task '", task, "' are called '", entry->name, "'"));
    }
  }
}

// Refuses what only a simulated TriFinger can do.
void check_for_file(const EnvironmentOptions& options, const TaskDescription& task) {
  const auto refuse = [](bool is_asked, const char* option, const char* reason) {
    if (is_asked) throw InvalidArgument(text_of(option, " is for TriFingers: ", reason));
  };
  if (!task.is_for_files) {
    throw InvalidArgument(
        text_of("the task '", task.name, "' is for a TriFinger, this robot is from a file"));
  }
  refuse(options.per_finger, "per_finger", "frames of a robot from a file are not alike");
  const EnvironmentOptions usual;
  refuse(options.stop_margin.low != usual.stop_margin.low ||
             options.stop_margin.high != usual.stop_margin.high,
         "stop_margin", "stops of a robot from a file are where the file says");
  for (const SurfacePair pair : all_surface_pairs()) {
    refuse(options.pair_friction[pair].has_value(), "pair_friction",
           "surfaces of a robot from a file have no names");
  }
}

}  // namespace

struct Environment::Implementation {
  Implementation(const TaskDescription& its_task, const EnvironmentOptions& wanted,
                 const RobotDescription& description, Nanoseconds step)
      : options((wanted.validate(), wanted)),
        kinematics(std::in_place, description),
        joints(figures_of(*kinematics)),
        workspace(workspace_of(joints, &*kinematics, nullptr)),
        task(make_task(its_task, workspace)),
        of_one(dynamic_cast<const Task*>(task.get())),
        of_many(dynamic_cast<const TaskOfMany*>(task.get())),
        goal(task->goal()),
        num_points(static_cast<std::size_t>(kinematics->num_fingers())) {
    if (!options.frames.empty()) {
      throw InvalidArgument("frames are for robots from files: a TriFinger has its tips");
    }
    set_up(its_task, step);
    if (of_many != nullptr && !task->object_name().empty()) {
      const RobotModel model(description);
      const ObjectAddress& object = model.object(std::string(task->object_name()));
      object_pose = pose_in(model.mujoco()->key_qpos, object);
    }
    for (int finger = 0; finger < kinematics->num_fingers(); ++finger) {
      turns.push_back(kinematics->finger_azimuth(0) - kinematics->finger_azimuth(finger));
    }
  }

  Implementation(const TaskDescription& its_task, const EnvironmentOptions& wanted,
                 const SimulationOptions& robot)
      : options((wanted.validate(), check_for_file(wanted, its_task), wanted)),
        file(std::make_unique<const FileBody>(robot, wanted.frames)),
        joints(figures_of(*file)),
        workspace(workspace_of(joints, nullptr, file.get())),
        task(make_task(its_task, workspace)),
        of_one(dynamic_cast<const Task*>(task.get())),
        of_many(dynamic_cast<const TaskOfMany*>(task.get())),
        goal(task->goal()),
        num_points(file->num_frames()) {
    set_up(its_task, robot.period);
    if (of_many != nullptr && !task->object_name().empty()) {
      object_pose = pose_in(file->initial_configuration().data(),
                            file->model().object(std::string(task->object_name())));
    }
  }

  void set_up(const TaskDescription& its_task, Nanoseconds step) {
    action_time = std::chrono::duration<double>(step).count() * options.steps_per_action;
    num_joints = joints.initial.size();
    episode_actions = std::llround(options.duration / action_time);
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
    check_bounds(goal, its_task.name);
    if (task->has_goals_of_fingers() && goal.low.size() != 3 * num_points) {
      throw InvalidArgument(text_of("goals of the task '", its_task.name, "' have ",
                                    goal.low.size(), " numbers, must have ", 3 * num_points,
                                    ": three for each finger or frame"));
    }
    task_name = its_task.name;
    num_parts = task->has_goals_of_fingers() ? num_points : 1;
    scores = task->scores();
    list_entries();
    list_flat();
  }

  void add(std::string name, std::string unit, std::size_t size, double least, double most) {
    entries.push_back({.name = std::move(name),
                       .unit = std::move(unit),
                       .low = std::vector<double>(size, least),
                       .high = std::vector<double>(size, most)});
  }

  void list_entries() {
    entries = task->entries();
    check_names(entries, task_name);
    has_own_entries = !entries.empty();
    if (has_own_entries) {
      if (options.layout == Layout::kGoal) {
        throw InvalidArgument(text_of("observation is 'goal', but what the task '", task_name,
                                      "' shows has no part without its goal"));
      }
      for (const Entry& entry : entries) {
        check_bounds(entry, task_name);
        own_values += entry.low.size();
      }
    } else {
      list_usual_entries();
    }
    const auto is_action = [](const Entry& entry) { return entry.name == "action"; };
    shows_action =
        options.mapping == Mapping::kStateAugmentation && std::ranges::none_of(entries, is_action);
    if (shows_action) add("action", "1", num_joints, -1.0, 1.0);
    if (options.layout != Layout::kGoal && !has_own_entries) entries.push_back(goal);
  }

  void list_usual_entries() {
    entries = {joints.position, joints.velocity};
    if (!task->object_name().empty() && file != nullptr && num_points > 0) {
      entries.push_back(file->frame_bounds("frame_position", workspace.low, workspace.high));
    } else if (!task->object_name().empty() && file == nullptr) {
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
    if (begin > kMaxValues) {
      throw InvalidArgument(text_of("an observation of this robot would have ", begin,
                                    " numbers, allowed are ", kMaxValues));
    }
    if (!is_flat() || !task->has_goals_of_fingers() || file != nullptr) {
      flat.resize(begin);
      std::iota(flat.begin(), flat.end(), std::size_t{0});
      return;
    }
    for (const Entry& entry : entries) {
      if (entry.low.size() == num_joints) continue;
      throw InvalidArgument(text_of("the task '", task_name,
                                    "' has goals of fingers, so all that is observed is in the "
                                    "order of fingers, three numbers for each; '",
                                    entry.name, "' has ", entry.low.size(), " numbers, not ",
                                    num_joints, ": take observation 'dictionary'"));
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

  // Computes where tips or frames are.
  void find_points(const Measurement& measurement, View& view) const noexcept {
    if (kinematics) {
      view.tips = kinematics->tip_positions(
          JointValues::Map(view.position.data(), static_cast<Eigen::Index>(num_joints)));
      return;
    }
    view.tips.resize(static_cast<Eigen::Index>(3 * num_points));
    file->find_frames(
        view.position,
        measurement.model_position.empty() ? std::span<const double>() : view.model_position,
        view.bodies, {view.tips.data(), 3 * num_points});
  }

  // Computes what a task sees of a robot.
  void look(Observed& one) const noexcept {
    const Measurement& measurement = one.measurement;
    const std::size_t n = num_joints;
    const std::size_t num_model = measurement.model_position.size();
    std::ranges::copy(measurement.position, one.position.begin());
    std::ranges::copy(measurement.velocity, one.velocity.begin());
    std::ranges::copy(measurement.model_position, one.model_position.begin());
    const auto add_noise = [&one](std::span<double> numbers, double deviation) {
      if (!(deviation > 0.0)) return;
      for (double& value : numbers) value += deviation * one.episode->noise.normal();
    };
    add_noise(std::span(one.position).first(n), options.position_noise);
    add_noise(std::span(one.velocity).first(n), options.velocity_noise);
    add_noise(std::span(one.model_position).first(num_model), options.position_noise);

    View& view = one.view;
    view.object = {};
    view.time = time_of(*one.episode);
    view.position = std::span(one.position).first(n);
    view.velocity = std::span(one.velocity).first(n);
    view.torque = measurement.torque;
    view.model_position = std::span(one.model_position).first(num_model);
    view.model_velocity = measurement.model_velocity;
    view.bodies = measurement.bodies;
    if (num_model == 0) {
      view.model_position = view.position;
      view.model_velocity = view.velocity;
    }
    find_points(measurement, view);
    if (measurement.object == nullptr) return;
    one.shown_object = upward(*measurement.object);
    view.object =
        measurement.true_object != nullptr ? upward(*measurement.true_object) : one.shown_object;
  }

  // Computes what was achieved and compares it with the goal.
  void judge(Observed& one) const noexcept {
    Episode& episode = *one.episode;
    Outcome& outcome = one.outcome;
    of_one->achieve(one.view, episode, one.achieved);
    std::copy_n(episode.goal.begin(), goal.low.size(), one.desired.begin());
    outcome = {};
    outcome.reward = of_one->reward(one.achieved, one.desired) - of_one->cost(one.view);
    outcome.success = of_one->is_success(one.achieved, one.desired, episode);
    outcome.terminated = of_one->has_ended(one.view, episode);
    of_one->score(one.view, one.achieved, one.desired,
                  std::span(outcome.scores).first(scores.size()));
    one.goals = of_one->num_goals(one.view.time);
  }

  // Adds to what the task has judged whether the episode has ended, and the distances.
  void complete(Observed& one) const noexcept {
    const Episode& episode = *one.episode;
    Outcome& outcome = one.outcome;
    outcome.terminated = outcome.terminated && episode.actions > 0;
    outcome.truncated = !outcome.terminated && episode.actions >= episode_actions;
    if (!task->has_goals_of_fingers()) {
      outcome.distance[0] = of_one != nullptr ? of_one->distance(one.achieved, one.desired)
                                              : distance_of_places(one.achieved, one.desired);
      return;
    }
    for (std::size_t i = 0; i < num_parts; ++i) {
      outcome.distance[i] =
          distance_between(one.achieved.subspan(3 * i, 3), one.desired.subspan(3 * i, 3));
      outcome.finger_rewards[i] = -outcome.distance[i];
    }
  }

  // Whether the next goal of the episode begins now; it is counted then.
  [[nodiscard]] static bool takes_next_goal(const Observed& one) noexcept {
    if (one.outcome.truncated || one.episode->goals >= one.goals) return false;
    ++one.episode->goals;
    return true;
  }

  // Writes the observation. `shown` is what the task shows, if it says what is observed.
  void write(const Observed& one, std::span<const double> shown) const noexcept {
    std::array<double, kMaxValues> values;  // NOLINT(*-member-init)
    double* next = std::ranges::copy(shown, values.data()).out;
    if (!has_own_entries) {
      next = std::ranges::copy(one.view.position, next).out;
      next = std::ranges::copy(one.view.velocity, next).out;
      if (!task->object_name().empty()) next = std::ranges::copy(one.view.tips, next).out;
      if (shows_object()) {
        next = std::ranges::copy(one.shown_object.position, next).out;
        next = std::ranges::copy(one.shown_object.orientation, next).out;
      }
    }
    if (shows_action) next = std::copy_n(one.episode->action.begin(), num_joints, next);
    if (options.layout != Layout::kGoal && !has_own_entries) show_goal(*one.episode, next);

    for (std::size_t i = 0; i < flat.size(); ++i) {
      const std::size_t k = flat[i];
      const double value = std::clamp(values[k], low[k], high[k]);
      const double scaled = 2.0 * (value - low[k]) / (high[k] - low[k]) - 1.0;
      one.observation[i] = static_cast<float>(is_flat() ? scaled : value);
    }
  }

  // Observes a robot whose task is asked about it alone.
  void observe(Observed& one) const noexcept {
    look(one);
    // The outcome is judged by the goal that was shown before this action.
    judge(one);
    complete(one);
    while (takes_next_goal(one)) {
      of_one->draw_goal(workspace, one.episode->random, goal_of(*one.episode));
    }
    std::array<double, kMaxValues> shown;  // NOLINT(*-member-init)
    if (has_own_entries) of_one->show(one.view, *one.episode, std::span(shown).first(own_values));
    write(one, std::span(shown).first(own_values));
  }

  [[nodiscard]] std::span<double> goal_of(Episode& episode) const noexcept {
    return std::span(episode.goal).first(goal.low.size());
  }

  // What is known of an episode before its task draws anything.
  [[nodiscard]] Start prepare(std::uint64_t seed, std::uint64_t number,
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

  // Refuses a start that no robot can have, which the task has drawn in this row.
  void check(const Start& start, std::size_t row) const {
    for (std::size_t i = 0; i < num_joints; ++i) {
      const double position = start.position[i];
      if (position >= joints.hard_low[i] && position <= joints.hard_high[i]) continue;
      throw InvalidArgument(text_of("a start of the task '", task_name, "' has joint ", i, " at ",
                                    position, " in row ", row, ", its hard limits are ",
                                    joints.hard_low[i], " and ", joints.hard_high[i]));
    }
    double square = 0.0;
    for (const double value : start.object.orientation) square += value * value;
    bool is_pose = std::isfinite(square) && square > kSmallestSquare;
    for (const double value : start.object.position) is_pose = is_pose && std::isfinite(value);
    if (is_pose) return;
    throw InvalidArgument(text_of("a start of the task '", task_name,
                                  "' has no pose of the object in row ", row,
                                  ": it is not finite, or its quaternion is zero"));
  }

  // Draws what does not depend on the task, after the task has drawn.
  void complete(Start& start, Episode& episode) const noexcept {
    start.variation = {.object_mass = draw(episode.random, options.object_mass),
                       .friction = draw(episode.random, options.friction),
                       .motor_gain = draw(episode.random, options.motor_gain),
                       .torque_delay = episode.random.integer(options.torque_delay.low,
                                                              options.torque_delay.high + 1)};
    draw_what_varies(options, episode.random, start);
    for (std::size_t i = 0; i < num_joints; ++i) {
      const double lowest = workspace.low[i];
      const double highest = workspace.high[i];
      episode.target[i] = std::clamp(start.position[i], lowest, highest);
      // The robot holds its position. Among changes of position, zero says that. No torque says it.
      if (options.action == ActionKind::kPosition) {
        episode.action[i] = (2.0 * episode.target[i] - lowest - highest) / (highest - lowest);
      }
    }
  }

  EnvironmentOptions options;
  std::optional<Kinematics> kinematics{};  // of a TriFinger
  std::unique_ptr<const FileBody> file{};  // a robot from a file
  JointFigures joints;
  Workspace workspace;
  std::unique_ptr<const AnyTask> task;
  std::string task_name{};    // of the task
  const Task* of_one;         // the task; nullptr if it is one of many
  const TaskOfMany* of_many;  // the task; nullptr if it is one of one
  Entry goal;
  std::size_t num_points;    // tips or frames
  std::size_t num_parts{1};  // of a goal
  ObjectPose object_pose{};  // Where the object of a task of many begins by the configuration.
  double action_time{0.0};   // Duration of one action [s].
  std::size_t num_joints{0};
  std::int64_t episode_actions{0};
  std::vector<std::string> scores;
  std::vector<Entry> entries;
  bool has_own_entries{false};  // The task says what is observed.
  std::size_t own_values{0};    // Number of numbers that it says.
  bool shows_action{false};
  std::vector<std::size_t> flat;  // Index in all entries of each number observed.
  std::vector<double> low;        // Lower bounds of all entries, concatenated.
  std::vector<double> high;
  std::vector<double> turns;  // Angle that rotates each finger onto finger 0 [rad].
};

double Task::distance(std::span<const double> achieved,
                      std::span<const double> desired) const noexcept {
  return distance_of_places(achieved, desired);
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
std::int64_t Environment::episode_actions() const noexcept {
  return checked(implementation_)->episode_actions;
}
std::string_view Environment::object_name() const noexcept {
  return checked(implementation_)->task->object_name();
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

std::int64_t Environment::way_actions() const noexcept {
  return std::max(kWayActions, std::llround(kWayTime / checked(implementation_)->action_time));
}

void Environment::way_point(std::span<const double> from, const Start& start, std::int64_t index,
                            std::span<double> position) const noexcept {
  const double time = static_cast<double>(index + 1) / static_cast<double>(way_actions());
  const double share = time * time * time * (10 - 15 * time + 6 * time * time);
  for (std::size_t i = 0; i < checked(implementation_)->num_joints; ++i) {
    position[i] = from[i] + share * (start.position[i] - from[i]);
  }
}

bool Environment::take_action(std::span<const float> numbers, Episode& episode,
                              std::span<double> torque, std::span<double> position) const noexcept {
  const Implementation& self = *checked(implementation_);
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
        torque[i] = self.joints.max_torque[i] * number;
        break;
    }
    position[i] = target;
  }
  return true;
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
