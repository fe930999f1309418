// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/learning/environment_options.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/realtime/annotations.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger::learning {

inline constexpr std::size_t kMaxGoal = 9;

/// What the robot has measured at one instant.
struct Measurement {
  std::span<const double> position;   ///< Of the joints [rad].
  std::span<const double> velocity;   ///< [rad/s]
  const ObjectPose* object{nullptr};  ///< Of the task's object, if it has one.
};

/// What a task remembers of an episode. Plain data.
struct Episode {
  Random random{};                          ///< Of goals.
  Random noise{};                           ///< Of measured joints.
  std::int64_t actions{0};                  ///< How many have acted.
  std::array<double, kMaxGoal> goal{};      ///< [m], [1]
  std::array<double, kMaxJoints> target{};  ///< Where the joints should be [rad].
  std::array<double, kMaxJoints> action{};  ///< The last one, from -1 to 1.
  std::int64_t goals{1};                    ///< How many have been drawn.
  /// Of a throw: whether the object has flown, and where it came down [m].
  bool has_flown{false};
  bool has_landed{false};
  std::array<double, 2> landing{};
};

/// How an episode begins in a simulation.
struct Start {
  std::array<double, kMaxJoints> position{};  ///< Of the joints [rad].
  ObjectPose object{};                        ///< Of the task's object, if it has one.
  ObjectVelocity object_velocity{};           ///< Likewise.
  Variation variation{};
  Random random{};  ///< For the noise on poses.
};

/// What follows from an observation.
struct Outcome {
  double reward{0.0};
  bool terminated{false};  ///< The task cannot go on: nothing follows.
  bool truncated{false};   ///< The time is over.
  bool success{false};
  /// From the goal [m]: of each tip, or of the object.
  std::array<double, kMaxFingers> distance{};
  /// The part of each finger in the reward, where tasks have one.
  std::array<double, kMaxFingers> finger_rewards{};
};

/// A part of an observation.
struct Entry {
  std::string name;
  std::string unit;
  std::vector<double> low;  ///< What is below is cut off.
  std::vector<double> high;
};

/// What makes a decision process of a robot, whatever moves it: starts, goals, observations,
/// rewards, ends. The same functions serve a robot behind a front-end and thousands of simulations.
///
/// Constant: threads may share one, each with its own episodes.
class Environment {
 public:
  /// @throws InvalidArgument if a task or an option does not suit this robot
  Environment(std::string_view task, const EnvironmentOptions& options,
              const RobotDescription& description,
              Nanoseconds period = std::chrono::milliseconds(1));
  Environment(Environment&&) noexcept;
  Environment& operator=(Environment&&) noexcept;
  ~Environment();

  [[nodiscard]] const EnvironmentOptions& options() const noexcept;
  [[nodiscard]] std::size_t num_joints() const noexcept;
  [[nodiscard]] std::size_t num_fingers() const noexcept;
  /// Actions in an episode that is not terminated.
  [[nodiscard]] std::int64_t episode_actions() const noexcept;
  /// The object that the task is about; empty for none.
  [[nodiscard]] std::string_view object_name() const noexcept;
  /// The parts of an observation, in the order of `Layout::kDictionary`.
  [[nodiscard]] const std::vector<Entry>& entries() const noexcept;
  /// Of one number of `Layout::kFlat`: its name, as in "joint_position[0]".
  [[nodiscard]] std::vector<std::string> flat_names() const;
  /// Numbers in an observation of the layout chosen.
  [[nodiscard]] std::size_t observation_size() const noexcept;
  [[nodiscard]] std::size_t goal_size() const noexcept;
  /// Bounds of goals, and of what is achieved.
  [[nodiscard]] const Entry& goal() const noexcept;
  /// Joint positions at -1 and 1 of `ActionKind::kPosition` [rad].
  [[nodiscard]] std::span<const double> position_low() const noexcept;
  [[nodiscard]] std::span<const double> position_high() const noexcept;

  /// Draws the begin of episode `number` of `seed`: the same three numbers, the same episode.
  [[nodiscard]] Start begin(std::uint64_t seed, std::uint64_t number,
                            Episode& episode) const noexcept;

  /// How many actions a robot that nobody can put anywhere takes to where an episode begins: 2 s,
  /// or 20 of them if they are long.
  [[nodiscard]] std::int64_t way_actions() const noexcept;
  /// Where its joints should be in action `index` of these, counted from 0 [rad]: on the way with
  /// the least jerk.
  void way_point(std::span<const double> from, const Start& start, std::int64_t index,
                 std::span<double> position) const noexcept TRIFINGER_REALTIME;

  /// Makes an action of the robot of `numbers`, which are cut off at -1 and 1. NaN in `position`
  /// stands for "not given". False, and nothing is changed, if one is not finite.
  [[nodiscard]] bool take_action(std::span<const float> numbers, Episode& episode,
                                 std::span<double> torque,
                                 std::span<double> position) const noexcept TRIFINGER_REALTIME;

  /// What is to be seen, after as many actions as `episode` says. It is judged by the goal that was
  /// shown before, which is `desired`; a goal that begins now is in `observation`.
  Outcome observe(const Measurement& measurement, Episode& episode, std::span<float> observation,
                  std::span<double> achieved,
                  std::span<double> desired) const noexcept TRIFINGER_REALTIME;

  /// The reward as a function of what was achieved and what was to be.
  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const noexcept TRIFINGER_REALTIME;

 private:
  struct Implementation;
  std::unique_ptr<const Implementation> implementation_;
};

}  // namespace trifinger::learning
