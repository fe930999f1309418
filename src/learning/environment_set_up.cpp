// SPDX-License-Identifier: BSD-3-Clause
#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/text_of.hpp"
#include "environment_implementation.hpp"
#include "make_task.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::text_of;

// Bounds of the observed values.
constexpr double kMaxSideways = 0.5;   // [m]
constexpr double kMaxHeight = 0.6;     // [m]
constexpr double kMaxOffset = 0.3;     // [m]
constexpr double kMaxSpeed = 5.0;      // [m/s]
constexpr double kMaxRotation = 50.0;  // [rad/s]
constexpr double kLargestVariation = 100.0;
constexpr std::string_view kImageAge = "image_age";  // What whoever has cameras adds.

struct NamedTurning {
  std::string_view name;
  Turning turning;
};
constexpr std::array kTurnings{NamedTurning{"joint_position", Turning::kJoints},
                               NamedTurning{"joint_velocity", Turning::kJoints},
                               NamedTurning{"action", Turning::kJoints},
                               NamedTurning{"tracking_error", Turning::kJoints},
                               NamedTurning{"tip_position", Turning::kTips},
                               NamedTurning{"tip_offset", Turning::kTips},
                               NamedTurning{"push_offset", Turning::kTips},
                               NamedTurning{"object_position", Turning::kPoints},
                               NamedTurning{"object_keypoints", Turning::kPoints},
                               NamedTurning{"goal_keypoints", Turning::kPoints},
                               NamedTurning{"goal_offset", Turning::kPoints},
                               NamedTurning{"goal_direction", Turning::kPoints},
                               NamedTurning{"goal", Turning::kPoints},
                               NamedTurning{"object_orientation", Turning::kRotation}};

// Pose of an object in positions in the order of MuJoCo's `qpos`.
ObjectPose pose_in(const double* positions, const ObjectAddress& object) noexcept {
  const double* const first = positions + object.position;
  ObjectPose pose;
  std::copy_n(first, pose.position.size(), pose.position.begin());
  std::copy_n(first + pose.position.size(), pose.orientation.size(), pose.orientation.begin());
  return pose;
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

Environment::Implementation::Implementation(const TaskDescription& its_task,
                                            const EnvironmentOptions& wanted,
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

Environment::Implementation::Implementation(const TaskDescription& its_task,
                                            const EnvironmentOptions& wanted,
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

void Environment::Implementation::set_up(const TaskDescription& its_task, Nanoseconds step) {
  action_time = std::chrono::duration<double>(step).count() * options.steps_per_action;
  num_joints = joints.initial.size();
  episode_actions = std::llround(options.duration / action_time);
  if (episode_actions < 1) {
    throw InvalidArgument(text_of("duration is ", options.duration,
                                  " s, must be at least that of an action, ", action_time, " s"));
  }
  if (options.per_finger && !task->has_goals_of_fingers()) {
    throw InvalidArgument(text_of("per_finger is for tasks with a goal for each finger, the task '",
                                  its_task.name, "' has none"));
  }
  if (options.object_poses == ObjectPoses::kTracked && task->object_name().empty()) {
    throw InvalidArgument(
        text_of("object_poses is 'tracked', but the task '", its_task.name, "' has no object"));
  }
  check_bounds(goal, its_task.name);
  if (task->has_goals_of_fingers() && goal.low.size() != 3 * num_points) {
    throw InvalidArgument(text_of("goals of the task '", its_task.name, "' have ", goal.low.size(),
                                  " numbers, must have ", 3 * num_points,
                                  ": three for each finger or frame"));
  }
  task_name = its_task.name;
  num_parts = task->has_goals_of_fingers() ? num_points : 1;
  scores = task->scores();
  list_entries();
  list_hidden_entries();
  list_flat();
}

void Environment::Implementation::add(std::string name, std::string unit, std::size_t size,
                                      double least, double most) {
  entries.push_back({.name = std::move(name),
                     .unit = std::move(unit),
                     .low = std::vector<double>(size, least),
                     .high = std::vector<double>(size, most)});
}

void Environment::Implementation::list_entries() {
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
  const auto lacks = [this](std::string_view name) {
    return std::ranges::find(entries, name, &Entry::name) == entries.end();
  };
  shows_action = options.mapping == Mapping::kStateAugmentation && lacks("action");
  if (shows_action) add("action", "1", num_joints, -1.0, 1.0);
  shows_tracking_error = options.action == ActionKind::kPositionChange && lacks("tracking_error");
  if (shows_tracking_error) {
    add("tracking_error", "rad", num_joints, -options.leash, options.leash);
  }
  if (of_one != nullptr && !has_own_entries) {
    for (Entry& entry : of_one->memory_entries()) {
      memory_values += entry.low.size();
      entries.push_back(std::move(entry));
    }
  }
  if (options.layout != Layout::kGoal && !has_own_entries) entries.push_back(goal);
  check_shown();
  for (const Entry& entry : entries) {
    const auto* const known = std::ranges::find(kTurnings, entry.name, &NamedTurning::name);
    turnings.push_back(known == kTurnings.end() ? Turning::kNone : known->turning);
    if (entry.name == "goal" && entry.low.size() == 7) turnings.back() = Turning::kPose;
  }
}

void Environment::Implementation::list_hidden_entries() {
  std::vector<Entry> shown = std::exchange(entries, {});
  if (!task->object_name().empty()) {
    add("true_object_position", "m", 3, -kMaxSideways, kMaxSideways);
    add("object_velocity", "m/s", 3, -kMaxSpeed, kMaxSpeed);
    add("object_rotation", "rad/s", 3, -kMaxRotation, kMaxRotation);
  }
  for_each_number(Variation{}, [this](std::string_view name, double /*value*/) {
    add(std::string(name), "1", 1, 0.0, kLargestVariation);
  });
  hidden_entries = std::exchange(entries, std::move(shown));
}

void Environment::Implementation::check_shown() const {
  const bool has_three = kinematics && kinematics->num_fingers() == 3;
  for (const auto& [name, is_asked, fits] :
       {std::tuple{"symmetric_view", options.symmetric_view, has_three},
        std::tuple{"object_offsets", options.object_offsets, kinematics.has_value()},
        std::tuple{"keypoints", options.keypoints, kinematics.has_value()}}) {
    if (!is_asked) continue;
    const bool has_place = goal.low.size() == 3 || goal.low.size() == 7;
    const bool shows_both = shows_object() && !has_own_entries && options.layout != Layout::kGoal;
    if (fits && has_place && shows_both) continue;
    throw InvalidArgument(text_of(name,
                                  " is for a TriFinger and tasks with an object, whose pose and "
                                  "goal are observed (observation 'flat' or 'dictionary'), and "
                                  "whose goal is a position, or a position and a quaternion; the "
                                  "task is '",
                                  task_name, "'"));
  }
  if (!options.symmetric_object) return;
  if (options.keypoints) {
    throw InvalidArgument(
        "symmetric_object and keypoints both say how an object lies: choose one of them");
  }
  if (!shows_object() || has_own_entries || goal.low.size() != 3) {
    throw InvalidArgument(
        text_of("symmetric_object is for tasks with a cube that is observed, and "
                "whose goal is a position; the task is '",
                task_name, "'"));
  }
}

void Environment::Implementation::list_usual_entries() {
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
    if (options.symmetric_object) {
      add("object_faces", "1", kFaces, -0.5, 0.5);
    } else if (options.keypoints) {
      add("object_keypoints", "m", 3 * kCorners, -kMaxHeight, kMaxHeight);
    } else {
      add("object_orientation", "1", 4, -1.0, 1.0);
    }
  }
  if (options.keypoints && goal.low.size() == 7) {
    add("goal_keypoints", "m", 3 * kCorners, -kMaxHeight, kMaxHeight);
  }
  if (options.object_offsets) {
    add("tip_offset", "m", num_joints, -kMaxOffset, kMaxOffset);
    add("push_offset", "m", num_joints, -kMaxOffset, kMaxOffset);
    add("goal_offset", "m", 3, -kMaxOffset, kMaxOffset);
    add("goal_direction", "1", 3, -1.0, 1.0);
  }
}

void Environment::Implementation::list_flat() {
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

}  // namespace trifinger::learning
