// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/learning/environment_options.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/realtime/annotations.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/simulator.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger::learning {

inline constexpr std::size_t kMaxFrames = 32;  ///< Frames of a robot from a file.
inline constexpr std::size_t kMaxGoal = 3 * kMaxFrames;
inline constexpr std::size_t kMaxScores = 8;

/// What the robot has measured at one instant.
struct Measurement {
  std::span<const double> position;   ///< Joint positions [rad], [m].
  std::span<const double> velocity;   ///< Joint velocities [rad/s], [m/s].
  const ObjectPose* object{nullptr};  ///< Pose of the task's object; nullptr if it has none.
  /// True pose of that object, by which the outcome is judged. nullptr: `object` is true enough.
  const ObjectPose* true_object{nullptr};
  std::span<const double> torque{};  ///< Joint torques [Nm], [N].
  /// @name All hinges and slides of a robot from a file, if not all of them are driven one by one
  /// @{
  std::span<const double> model_position{};
  std::span<const double> model_velocity{};
  /// @}
  std::span<const ObjectPose> bodies{};  ///< Free bodies of a robot from a file.
};

/// Memory of a task during an episode: plain data of a type of its own.
class TaskMemory {
 public:
  static constexpr std::size_t kSize = 256;  ///< [bytes]

  /// The data as a T, which is zero when an episode begins.
  template <class T>
  [[nodiscard]] T& as() noexcept {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= kSize);
    return *reinterpret_cast<T*>(bytes_.data());
  }
  template <class T>
  [[nodiscard]] const T& as() const noexcept {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= kSize);
    return *reinterpret_cast<const T*>(bytes_.data());
  }

 private:
  alignas(std::max_align_t) std::array<std::byte, kSize> bytes_{};
};

/// The memory of an environment about an episode. Plain data.
struct Episode {
  Random random{};                      ///< Random numbers for goals.
  Random noise{};                       ///< Random numbers for the noise on measured joints.
  std::int64_t actions{0};              ///< Number of actions so far.
  std::array<double, kMaxGoal> goal{};  ///< [m], [1]
  /// Desired joint positions, or for relative actions the last measured ones [rad], [m].
  std::array<double, kMaxCountedJoints> target{};
  /// The last action, each number from -1 to 1.
  std::array<double, kMaxCountedJoints> action{};
  std::int64_t goals{1};  ///< Number of goals drawn so far.
  TaskMemory memory{};    ///< Data of the task.
};

/// The beginning of an episode in a simulation.
struct Start {
  std::array<double, kMaxCountedJoints> position{};  ///< Joint positions [rad], [m].
  ObjectPose object{};                               ///< Pose of the task's object, if it has one.
  ObjectVelocity object_velocity{};                  ///< Velocity of that object.
  Variation variation{};
  Random random{};  ///< Random numbers for the noise on poses.
  /// Positions of the first hinges and slides of a robot from a file, driven or not [rad], [m].
  /// NaN: where its configuration begins, or `position` says.
  std::array<double, kMaxCountedJoints> model_position =
      trifinger::detail::filled<kMaxCountedJoints>(kNotGiven);
};

/// A state taken from a movement. Episodes of a training may begin there, without speed, so that a
/// policy also learns what it would rarely come to by itself (Salimans and Chen 2018).
struct ResetState {
  std::vector<double> position{};  ///< Joint positions [rad], [m].
  std::vector<double> torque{};    ///< What holds it there, and what the fingers hold [Nm], [N].
  std::optional<ObjectPose> object{};  ///< Pose of the task's object, if it has one.
};

/// Some of these states, and the share of the episodes that begin in one of them.
struct ResetStates {
  std::vector<ResetState> states{};
  double share{0.0};
};

/// The result of an observation.
struct Outcome {
  double reward{0.0};
  bool terminated{false};  ///< The task cannot continue; no action may follow.
  bool truncated{false};   ///< The time of the episode is over.
  bool success{false};
  /// Distance from the goal, of each part of the goal: `Environment::num_parts`. [m] of each tip,
  /// frame or of the object.
  std::array<double, kMaxFrames> distance{};
  /// Each part's share of the reward, in tasks whose goal has a part for each finger or frame.
  std::array<double, kMaxFrames> finger_rewards{};
  /// Other measures of how well it goes: `Environment::scores` names them.
  std::array<double, kMaxScores> scores{};
};

/// What only a simulation knows of a robot.
struct HiddenState {
  ObjectPose object{};  ///< Where the task's object really is.
  ObjectVelocity object_velocity{};
  Variation variation{};
};

/// A part of an observation.
struct Entry {
  std::string name;
  std::string unit;
  std::vector<double> low;  ///< Values below `low` or above `high` are cut off.
  std::vector<double> high;
};

struct Beginning;
struct Observed;
struct TaskDescription;

/// Makes a decision process of a robot: starts, goals, observations, rewards, ends. The same
/// functions serve a robot that is driven through a front-end and thousands of simulations.
///
/// The robot is a TriFinger, one of its fingers, or a robot from a file. The goals, points and
/// rewards of fingers are then those of the frames that the option `frames` names.
///
/// An environment is constant. Threads may share one, each with its own episodes.
class Environment {
 public:
  /// @throws InvalidArgument if the task or an option does not suit this robot
  Environment(const TaskDescription& task, const EnvironmentOptions& options,
              const RobotDescription& description,
              Nanoseconds period = std::chrono::milliseconds(1));
  /// Makes an environment of a simulated robot, also from a file.
  Environment(const TaskDescription& task, const EnvironmentOptions& options,
              const SimulationOptions& robot);
  /// Makes an environment of the task with this name.
  Environment(std::string_view task, const EnvironmentOptions& options,
              const RobotDescription& description,
              Nanoseconds period = std::chrono::milliseconds(1));
  Environment(std::string_view task, const EnvironmentOptions& options,
              const SimulationOptions& robot);
  Environment(Environment&&) noexcept;
  Environment& operator=(Environment&&) noexcept;
  ~Environment();

  [[nodiscard]] const EnvironmentOptions& options() const noexcept;
  [[nodiscard]] std::size_t num_joints() const noexcept;
  /// Number of fingers, or of frames of a robot from a file.
  [[nodiscard]] std::size_t num_fingers() const noexcept;
  /// Number of parts of a goal that are judged one by one: one for each finger or frame if each has
  /// a goal of its own, else 1.
  [[nodiscard]] std::size_t num_parts() const noexcept;
  /// True if each finger or frame has a goal of its own.
  [[nodiscard]] bool has_goals_of_fingers() const noexcept;
  /// Names of the scores of the task.
  [[nodiscard]] const std::vector<std::string>& scores() const noexcept;
  /// Entries that are not observed, for a critic (Pinto et al. 2018): where the object really is,
  /// how it moves, and what varies from robot to robot. Their numbers are in SI units.
  [[nodiscard]] const std::vector<Entry>& hidden_entries() const noexcept;
  /// Writes the numbers of `hidden_entries`, one entry after the other.
  void show_hidden(const HiddenState& state, const Episode& episode,
                   std::span<float> shown) const noexcept;
  /// The finger that comes first in observations and actions now: 0, unless `symmetric_view` turns
  /// them. The others follow in their order.
  [[nodiscard]] std::size_t first_finger(const Episode& episode) const noexcept;
  /// Number of actions in an episode that is not terminated.
  [[nodiscard]] std::int64_t episode_actions() const noexcept;
  /// Name of the object that the task is about; empty if there is none.
  [[nodiscard]] std::string_view object_name() const noexcept;
  /// Largest distance of that object from the middle at the start of an episode [m].
  [[nodiscard]] double object_reach() const noexcept;
  /// True if a simulation shall judge the outcome by where the object really is, because its pose
  /// is not observed, or tracked.
  [[nodiscard]] bool judges_by_truth() const noexcept;
  /// The parts of an observation, in the order of `Layout::kDictionary`. Images are not among them:
  /// whoever has cameras adds these.
  [[nodiscard]] const std::vector<Entry>& entries() const noexcept;
  /// Names of the numbers of `Layout::kFlat`, for example "joint_position[0]".
  [[nodiscard]] std::vector<std::string> flat_names() const;
  /// Number of numbers in an observation of the chosen layout.
  [[nodiscard]] std::size_t observation_size() const noexcept;
  [[nodiscard]] std::size_t goal_size() const noexcept;
  /// Bounds of goals and of achieved values.
  [[nodiscard]] const Entry& goal() const noexcept;
  /// Joint positions that mean -1 and 1 in `ActionKind::kPosition` [rad], [m].
  [[nodiscard]] std::span<const double> position_low() const noexcept;
  [[nodiscard]] std::span<const double> position_high() const noexcept;

  /// Draws the beginning of episode `number` of `seed`. The same arguments give the same episode.
  [[nodiscard]] Start begin(std::uint64_t seed, std::uint64_t number, Episode& episode) const;

  /// @throws InvalidArgument if this robot cannot begin in one of the states, or the share is not 0
  /// to 1, or there are no states for it
  void check_reset_states(const ResetStates& resets) const;
  /// Draws whether the episode that `begin` has drawn begins in one of these states instead, and
  /// then changes joints and object of its start. Goal, memory of the task and what varies stay.
  /// Returns the state, or nullptr.
  const ResetState* choose_reset_state(const ResetStates& resets, std::uint64_t seed,
                                       std::uint64_t number, Start& start) const noexcept;
  /// Begins an episode in this state, in which the joints are measured at `measured`, and makes the
  /// action that asks for the torques of the state until the first action. Where actions change
  /// desired positions, these go on from there, so zeros go on holding. Soft limits and the leash
  /// may weaken the torques.
  void begin_in(const ResetState& state, std::span<const double> measured, Episode& episode,
                std::span<double> torque, std::span<double> position) const noexcept;

  /// Begins an episode, which `begin` has drawn, where the robot is held now: at joint positions
  /// `position` [rad], [m].
  void begin_at(std::span<const double> position,
                Episode& episode) const noexcept TRIFINGER_REALTIME;

  /// Number of actions that a robot takes to move to the start of an episode by itself. They last 2
  /// s, or longer if that would be fewer than 20 actions.
  [[nodiscard]] std::int64_t approach_actions() const noexcept;
  /// Desired joint positions in action `index` of these, counted from 0 [rad]. The movement has
  /// least jerk.
  void approach_point(std::span<const double> from, const Start& start, std::int64_t index,
                      std::span<double> position) const noexcept TRIFINGER_REALTIME;

  /// Gain of joints in an action that `take_action` makes [Nm/rad]; NaN: not given.
  [[nodiscard]] double position_kp() const noexcept TRIFINGER_REALTIME;
  /// Makes an action of the robot from `numbers`, which are cut off at -1 and 1. NaN in `position`
  /// means "not given". Returns false and changes nothing if a number is not finite.
  [[nodiscard]] bool take_action(std::span<const float> numbers, Episode& episode,
                                 std::span<double> torque,
                                 std::span<double> position) const noexcept TRIFINGER_REALTIME;
  /// Writes the numbers with which `take_action` would make this action now, cut off at -1 and 1:
  /// from `torque` or `position`, whichever actions consist of.
  void invert_action(std::span<const double> torque, std::span<const double> position,
                     const Episode& episode,
                     std::span<float> numbers) const noexcept TRIFINGER_REALTIME;

  /// Computes the observation after the actions that `episode` counts. The outcome is judged by the
  /// goal that was shown before, which is written to `desired`. If a new goal begins now, it is in
  /// `observation`. Neither blocks nor allocates, unless the task is one of many.
  Outcome observe(const Measurement& measurement, Episode& episode, std::span<float> observation,
                  std::span<double> achieved, std::span<double> desired) const;

  /// @name Many robots at once
  /// All tasks can be asked like this, and for one robot. Those of many (`TaskOfMany`) are asked by
  /// one thread only, and throw what the task throws, from the functions for one robot, too.
  /// @{
  [[nodiscard]] bool is_of_many() const noexcept;
  /// @throws InvalidArgument if a task of many draws a start that no robot can have
  void begin(std::span<const Beginning> robots) const;
  /// Observes robots of which measurement, episode and places for the results are filled in.
  void observe(std::span<Observed> robots) const;
  /// One reward for each of some goals that follow one another in `achieved` and `desired`.
  /// @throws InvalidArgument if these are not so many goals
  void rewards(std::span<const double> achieved, std::span<const double> desired,
               std::span<double> rewards) const;
  /// @}

  /// The reward as a function of the achieved and the desired values.
  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const;

 private:
  struct Implementation;
  std::unique_ptr<const Implementation> implementation_;
};

}  // namespace trifinger::learning
