// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "trifinger/base/time.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/orderly_stop.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger {

/// One step of the physics.
inline constexpr Nanoseconds kPhysicsStep = std::chrono::milliseconds(1);

/// The limits of the real robot of this variant, from its figures.
/// @throws InvalidArgument if R has another number of joints than the arrangement
template <class R>
[[nodiscard]] JointLimits<R::kJoints> default_limits(const RobotDescription& description);

/// The settings of a simulated robot. The default is the paper's robot with a cube on the table.
template <class R>
struct SimulationOptions {
  RobotDescription description{};
  /// Limits of the joints; default: `default_limits`.
  std::optional<JointLimits<R::kJoints>> limits{};
  /// Joint positions at the beginning of every session [rad]; default: the variant's initial pose.
  std::optional<JointVector<R::kJoints>> initial_position{};
  /// What happens after the end of a session; default: nothing moves any more.
  OrderlyStopOptions<R::kJoints> stop{};
  /// Seed of all random numbers. The same seed gives the same series.
  std::uint64_t seed{0};
  /// Length of a step: a whole number of `kPhysicsStep`, that is of milliseconds.
  Nanoseconds period{std::chrono::milliseconds(1)};
  TimeIndex object_period{10};           ///< Steps between two poses of the objects.
  TimeIndex object_delay{0};             ///< Steps from the capture of a pose to its arrival.
  double object_position_noise{0.0};     ///< Standard deviation of a pose's position, per axis [m].
  double object_orientation_noise{0.0};  ///< Standard deviation of its rotation, per axis [rad].
  double object_loss{0.0};               ///< Probability that a pose never arrives.
  /// The simulation itself says where objects are, in its companion "object". False: there is no
  /// such companion, because a tracker in another process says it.
  bool exact_poses{true};
  /// Steps between two elements of the companion "scene", which says where everything really is; 0:
  /// there is no such companion.
  TimeIndex scene_period{0};
  /// There is a companion "hand", which says what a hand pulls; see hand.hpp.
  bool has_hand{false};

  /// @throws InvalidArgument that names the option, the value found and the values allowed
  void validate() const;
};

extern template struct SimulationOptions<TriFinger>;
extern template struct SimulationOptions<Finger>;

}  // namespace trifinger
