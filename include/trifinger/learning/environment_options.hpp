// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::learning {

/// How actions and observations follow each other: docs/learning.md.
enum class Mapping : std::uint8_t { kStateAugmentation, kApproximation };

/// What the numbers of an action are, each from -1 to 1.
enum class ActionKind : std::uint8_t {
  kPosition,        ///< Where the joints should be, within `Environment::position_range`.
  kPositionChange,  ///< By how much that changes: times `EnvironmentOptions::position_change`.
  kTorque,          ///< Times the largest torque.
};

/// How an observation is laid out.
enum class Layout : std::uint8_t {
  kFlat,        ///< One vector, each number scaled to -1 to 1.
  kDictionary,  ///< Its entries, in SI units.
  kGoal,        ///< The vector without its goal; what is achieved and desired apart, in SI units.
};

/// All values are equally probable.
template <class T>
struct Range {
  T low{};
  T high{};

  friend bool operator==(const Range&, const Range&) = default;
};

/// What is free to choose of a decision process. The defaults of a task are in `default_options`.
struct EnvironmentOptions {
  int steps_per_action{20};  ///< For how many steps of the robot an action acts.
  Mapping mapping{Mapping::kApproximation};
  ActionKind action{ActionKind::kPosition};
  double position_change{0.1};  ///< The largest, for `ActionKind::kPositionChange` [rad].
  Layout layout{Layout::kFlat};
  double duration{2.0};  ///< Of an episode [s].
  /// Observations finger by finger, goals in the frame of their finger: the fingers cannot be told
  /// apart. For tasks with a goal for each finger.
  bool per_finger{false};
  double position_noise{0.0};            ///< Standard deviation of measured joint positions [rad].
  double velocity_noise{0.0};            ///< Likewise [rad/s].
  double object_period{0.01};            ///< Between two poses of a simulated object [s].
  double object_delay{0.0};              ///< From a pose of a simulated object to its arrival [s].
  double object_position_noise{0.0};     ///< Standard deviation of its poses, per axis [m].
  double object_orientation_noise{0.0};  ///< Likewise [rad].
  /// What a simulation draws at the begin of each episode: `Variation`.
  Range<double> object_mass{1.0, 1.0};
  Range<double> friction{1.0, 1.0};
  Range<double> motor_gain{1.0, 1.0};
  Range<TimeIndex> torque_delay{0, 0};
  OfSurfacePairs<std::optional<Range<double>>> pair_friction{};
  Range<double> contact_time{1.0, 1.0};
  Range<double> rotor_inertia{1.0, 1.0};
  Range<double> joint_damping{1.0, 1.0};
  Range<double> joint_friction{0.0, 0.0};  ///< [Nm]
  Range<double> stop_margin{1.0, 1.0};
  /// How fast a simulated object slides at the begin of each episode, in any direction [m/s].
  Range<double> object_speed{0.0, 0.0};

  /// @throws InvalidArgument naming the option, the value found and the values allowed
  void validate() const;
  /// Whether episodes differ in more than starts and goals.
  [[nodiscard]] bool varies() const noexcept;
};

/// A name by which tasks are found, as in "reach".
[[nodiscard]] std::span<const std::string_view> task_names() noexcept;
/// @throws InvalidArgument naming the tasks there are
[[nodiscard]] EnvironmentOptions default_options(std::string_view task);
/// What the configuration of a simulated robot must say for this task with these options, as in
/// "boundary=false": a key and JSON.
/// @throws InvalidArgument naming the tasks there are
[[nodiscard]] std::vector<std::string> config_overrides(std::string_view task,
                                                        const EnvironmentOptions& options);

/// The options as JSON: an object with the names above, words for enumerators, lists for ranges.
[[nodiscard]] std::string write_options(const EnvironmentOptions& options);
/// Reads what `write_options` has written; what is missing is as in `EnvironmentOptions{}`.
/// @throws InvalidArgument naming what is unknown or of another type
[[nodiscard]] EnvironmentOptions read_options(std::string_view json);

}  // namespace trifinger::learning
