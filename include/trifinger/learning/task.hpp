// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/learning/environment.hpp"
#include "trifinger/learning/environment_options.hpp"
#include "trifinger/learning/file_body.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::learning {

inline constexpr double kDegree = std::numbers::pi / 180.0;

/// What a task knows of the robot.
struct Workspace {
  const Kinematics* kinematics{
      nullptr};                   ///< Kinematics of a TriFinger; nullptr for a robot from a file.
  const FileBody* file{nullptr};  ///< A robot from a file; nullptr for a TriFinger.
  std::vector<double> low{};      ///< Lowest joint positions that actions can ask for [rad], [m].
  std::vector<double> high{};
};

/// Three numbers for each point. They are stored in place, never on the heap.
using Points = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, static_cast<int>(3 * kMaxFrames), 1>;

/// What a task sees at one instant, as it was measured.
struct View {
  Points tips{};  ///< Tips of a TriFinger, frames of a robot from a file [m].
  ObjectPose object{};
  double time{0.0};                    ///< Time since the episode began [s].
  std::span<const double> position{};  ///< Joint positions [rad], [m].
  std::span<const double> velocity{};  ///< Joint velocities [rad/s], [m/s].
  std::span<const double> torque{};    ///< Joint torques [Nm], [N].
  /// @name Robots from files
  /// @{
  std::span<const double> model_position{};  ///< Positions of all hinges and slides, driven or not.
  std::span<const double> model_velocity{};
  std::span<const ObjectPose> bodies{};  ///< Free bodies.
  /// @}
};

/// What any task says of itself.
class AnyTask {
 public:
  AnyTask() = default;
  AnyTask(const AnyTask&) = delete;
  AnyTask& operator=(const AnyTask&) = delete;
  virtual ~AnyTask() = default;

  /// Name of the object that the task is about, in the robot's configuration; empty for none.
  [[nodiscard]] virtual std::string_view object_name() const noexcept { return ""; }
  /// Largest distance of that object from the middle at the start of an episode [m].
  [[nodiscard]] virtual double object_reach() const noexcept {
    return std::numeric_limits<double>::infinity();
  }
  /// True if each finger, or frame of a robot from a file, has a goal of its own, of three numbers.
  [[nodiscard]] virtual bool has_goals_of_fingers() const noexcept { return false; }
  /// Unit and bounds of goals: up to `kMaxGoal` numbers.
  [[nodiscard]] virtual Entry goal() const = 0;
  /// All that an observation consists of, if the task says so. Default: none, and the observation
  /// consists of joints, object, last action and goal.
  [[nodiscard]] virtual std::vector<Entry> entries() const { return {}; }
  /// Names of up to `kMaxScores` other measures of how well it goes.
  [[nodiscard]] virtual std::vector<std::string> scores() const { return {}; }
};

/// What is to be done with a robot: starts, goals, reward, success. An environment asks it, in
/// threads that share it, once it is constant; so it takes no memory from the heap then, and keeps
/// what it has to remember in `Episode::memory`.
///
/// docs/environments.md has a task of one's own, step by step.
class Task : public AnyTask {
 public:
  /// Fills in the joints and the object of a start. The joints are at the robot's usual position
  /// and the object at zero before.
  virtual void draw_start(const Workspace& workspace, Random& random,
                          Start& start) const noexcept = 0;
  virtual void draw_goal(const Workspace& workspace, Random& random,
                         std::span<double> goal) const noexcept = 0;
  /// Begins an episode. Override it if start, goal and memory depend on each other.
  virtual void begin(const Workspace& workspace, Start& start, Episode& episode,
                     std::span<double> goal) const noexcept {
    draw_start(workspace, episode.random, start);
    draw_goal(workspace, episode.random, goal);
  }
  /// Number of goals that an episode has had until `time` [s].
  [[nodiscard]] virtual std::int64_t num_goals(double /*time*/) const noexcept { return 1; }

  /// Says what is achieved, in the numbers of goals, each time the robot was looked at. It may move
  /// `episode.goal` if the goal moves by itself.
  virtual void achieve(const View& view, Episode& episode,
                       std::span<double> achieved) const noexcept = 0;
  [[nodiscard]] virtual double reward(std::span<const double> achieved,
                                      std::span<const double> desired) const noexcept = 0;
  [[nodiscard]] virtual bool is_success(std::span<const double> achieved,
                                        std::span<const double> desired,
                                        const Episode& episode) const noexcept = 0;
  /// What the reward loses for how the robot moves, whatever it achieves.
  [[nodiscard]] virtual double cost(const View& /*view*/) const noexcept { return 0.0; }
  /// Distance from the goal, for tasks without goals of fingers: that of its first three numbers.
  [[nodiscard]] virtual double distance(std::span<const double> achieved,
                                        std::span<const double> desired) const noexcept;

  /// Fills in the numbers of `entries`, one entry after the other.
  virtual void show(const View& /*view*/, const Episode& /*episode*/,
                    std::span<double> /*shown*/) const noexcept {}

  /// What is observed in addition to joints, object, last action and goal, because the future
  /// depends on it: what the task remembers of the episode, time. Not with `entries`.
  [[nodiscard]] virtual std::vector<Entry> memory_entries() const { return {}; }
  /// Fills in the numbers of `memory_entries`, one entry after the other.
  virtual void show_memory(const View& /*view*/, const Episode& /*episode*/,
                           std::span<double> /*shown*/) const noexcept {}

  /// Fills in the `scores`.
  virtual void score(const View& /*view*/, std::span<const double> /*achieved*/,
                     std::span<const double> /*desired*/,
                     std::span<double> /*scores*/) const noexcept {}
  /// True if nothing can follow: the episode is terminated.
  [[nodiscard]] virtual bool has_ended(const View& /*view*/,
                                       const Episode& /*episode*/) const noexcept {
    return false;
  }
};

/// A robot whose episode begins.
struct Beginning {
  std::size_t robot{0};     ///< Its place among the robots of an environment.
  std::uint64_t seed{0};    ///< The episode is that with this number among those of the seed.
  std::uint64_t number{0};  ///< See `seed`.
  Episode* episode{nullptr};
  Start* start{nullptr};
};

/// A robot that is observed: what was measured, and what is found of it.
struct Observed {
  Observed() = default;
  Observed(const Observed&) = delete;  // `view` looks at the numbers below
  Observed& operator=(const Observed&) = delete;
  ~Observed() = default;

  std::size_t robot{0};  ///< Its place among the robots of an environment.
  Measurement measurement{};
  Episode* episode{nullptr};
  std::span<float> observation{};
  std::span<double> achieved{};
  std::span<double> desired{};
  Outcome outcome{};
  std::int64_t goals{1};  ///< Number of goals that the episode has had until now.
  View view{};
  ObjectPose shown_object{};
  /// @name What `view` looks at. Only what is filled in is read.
  /// @{
  std::array<double, kMaxCountedJoints> position;                  // NOLINT(*-member-init)
  std::array<double, kMaxCountedJoints> velocity;                  // NOLINT(*-member-init)
  std::array<double, FileBody::kMaxConfiguration> model_position;  // NOLINT(*-member-init)
  /// @}
};

/// A task that is asked about many robots at once, such as one in Python: a call for many costs
/// little more than one for a single robot. An environment asks in the thread that calls it, and
/// never while physics run. The functions are those of `Task`, and may throw.
class TaskOfMany : public AnyTask {
 public:
  /// Fills in starts and goals. The joints are at the robot's usual position before, and the object
  /// is where the robot's configuration says.
  virtual void begin(std::span<const Beginning> robots) const = 0;
  virtual void draw_goals(std::span<const Beginning> robots) const = 0;
  /// Fills in what is achieved, number of goals, and of the outcome: reward, success, and in
  /// `terminated` whether nothing can follow.
  virtual void judge(std::span<Observed> robots) const = 0;
  /// Fills in the rewards for goals that follow one another in `achieved` and `desired`.
  virtual void reward(std::span<const double> achieved, std::span<const double> desired,
                      std::span<double> rewards) const = 0;
  /// Fills in the numbers of `entries`, robot after robot.
  virtual void show(std::span<const Observed> robots, std::span<double> shown) const = 0;
};

/// A task with its name and what it needs.
struct TaskDescription {
  std::string name{};
  /// Options that this task has by default.
  EnvironmentOptions options{};
  /// What the configuration of a simulated TriFinger must say, as in "boundary=false": a key and
  /// JSON.
  std::vector<std::string> config_overrides{"objects=[]"};
  int num_fingers{3};  ///< Number of fingers that a TriFinger must have; 0: no TriFinger will do.
  bool is_for_files{false};            ///< Robots from files will do.
  std::string robot{"trifinger_edu"};  ///< Configuration of the robot that it is usually for.
  /// Makes the task, a `Task` or a `TaskOfMany`, for a robot, whose range of actions it may change.
  std::function<std::unique_ptr<const AnyTask>(Workspace&)> make{};
};

/// Makes a task known by its name: environments, vector environments and Python's classes find it.
/// @throws InvalidArgument if another task has this name
void add_task(TaskDescription task);

/// Finds a task by its name.
/// @throws InvalidArgument naming the tasks there are
[[nodiscard]] TaskDescription find_task(std::string_view name);

/// What the configuration of a simulated robot must say for this task with these options: a key and
/// JSON each. `is_from_file` is about the robot.
[[nodiscard]] std::vector<std::string> config_overrides(const TaskDescription& task,
                                                        const EnvironmentOptions& options,
                                                        bool is_from_file = false);

}  // namespace trifinger::learning
