// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include "joint_figures.hpp"
#include "trifinger/learning/environment.hpp"
#include "trifinger/learning/file_body.hpp"
#include "trifinger/learning/task.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::learning {

inline constexpr std::size_t kMaxValues = 1024;  // Largest number of values in an observation.
inline constexpr std::size_t kCorners = 8;       // Keypoints of an object.
inline constexpr std::size_t kFaces = 9;         // Numbers that say how a cube lies.

// How `symmetric_view` turns an entry: numbers of joints in the order of fingers, points of
// fingers, other points, a quaternion, a point with a quaternion.
enum class Turning : std::uint8_t { kNone, kJoints, kTips, kPoints, kRotation, kPose };

// A task on one robot: `environment_set_up.cpp` makes it, `environment_observation.cpp` observes
// robots, `environment.cpp` begins episodes and takes actions.
struct Environment::Implementation {
  Implementation(const TaskDescription& its_task, const EnvironmentOptions& wanted,
                 const RobotDescription& description, Nanoseconds step);
  Implementation(const TaskDescription& its_task, const EnvironmentOptions& wanted,
                 const SimulationOptions& robot);
  void set_up(const TaskDescription& its_task, Nanoseconds step);
  void add(std::string name, std::string unit, std::size_t size, double least, double most);
  void list_entries();
  void list_usual_entries();
  void list_hidden_entries();
  // Lists which number of which entry comes next in the observation.
  void list_flat();

  // Refuses options that show an object to tasks without one.
  void check_shown() const;
  // The finger on whose side the goal is.
  [[nodiscard]] std::size_t first_finger(const Episode& episode) const noexcept;
  // By how much `symmetric_view` turns the scene about the vertical axis [rad].
  [[nodiscard]] double view_angle(const Episode& episode) const noexcept;
  // Turns all entries for `symmetric_view`.
  void turn(const Episode& episode, double* values) const noexcept;
  // Where the number of joint `joint` is in an action, in which finger `first` comes first.
  [[nodiscard]] std::size_t place_in_action(std::size_t joint, std::size_t first) const noexcept {
    return (joint + num_joints - 3 * first) % num_joints;
  }
  // Writes the goals, in the frame of their finger if that is asked for.
  void show_goal(const Episode& episode, double* shown) const noexcept;
  // Computes where tips or frames are.
  void find_points(const Measurement& measurement, View& view) const noexcept;
  // Computes what a task sees of a robot.
  void look(Observed& one) const noexcept;
  // Computes what was achieved and compares it with the goal.
  void judge(Observed& one) const noexcept;
  // Adds to what the task has judged whether the episode has ended, and the distances.
  void complete(Observed& one) const noexcept;
  // Whether the next goal of the episode begins now; it is counted then.
  [[nodiscard]] static bool takes_next_goal(const Observed& one) noexcept;
  // Writes the observation. `shown` is what the task shows, if it says what is observed.
  void write(const Observed& one, std::span<const double> shown) const noexcept;
  // Observes a robot whose task is asked about it alone.
  void observe(Observed& one) const noexcept;

  // What is known of an episode before its task draws anything.
  [[nodiscard]] Start prepare(std::uint64_t seed, std::uint64_t number,
                              Episode& episode) const noexcept;
  // Refuses a start that no robot can have, which the task has drawn in this row.
  void check(const Start& start, std::size_t row) const;
  // Draws what does not depend on the task, after the task has drawn.
  void complete(Start& start, Episode& episode) const noexcept;
  // The action before the first one has held the robot at this position.
  void hold(std::span<const double> position, Episode& episode) const noexcept;
  // The desired position is no further ahead of this one than the leash.
  void pull_back(std::span<const double> position, Episode& episode) const noexcept;

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
  [[nodiscard]] std::span<double> goal_of(Episode& episode) const noexcept {
    return std::span(episode.goal).first(goal.low.size());
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
  std::vector<Turning> turnings;  // of the entries
  std::vector<Entry> hidden_entries;
  bool has_own_entries{false};  // The task says what is observed.
  std::size_t own_values{0};    // Number of numbers that it says.
  bool shows_action{false};
  bool shows_tracking_error{false};
  std::size_t memory_values{0};   // of the task that are observed
  std::vector<std::size_t> flat;  // Index in all entries of each number observed.
  std::vector<double> low;        // Lower bounds of all entries, concatenated.
  std::vector<double> high;
  std::vector<double> turns;  // Angle that rotates each finger onto finger 0 [rad].
};

// Calls `use` with name and value of each number of a variation, without its seed. Those of
// `pair_friction` are called as their surfaces.
template <class Use>
void for_each_number(const Variation& variation, const Use& use) {
  const auto visit = [&]<class T>(const VariationField<T>& row) {
    if constexpr (std::is_same_v<T, OfSurfacePairs<double>>) {
      for (const SurfacePair pair : all_surface_pairs()) {
        use(name_of(pair), variation.pair_friction[pair]);
      }
    } else if constexpr (!std::is_same_v<T, std::uint64_t>) {
      use(std::string_view(row.name), static_cast<double>(variation.*row.value));
    }
  };
  std::apply([&](const auto&... row) { (visit(row), ...); }, Variation::fields());
}

// The distance between the first three numbers of two goals.
[[nodiscard]] double distance_of_places(std::span<const double> achieved,
                                        std::span<const double> desired) noexcept;

}  // namespace trifinger::learning
