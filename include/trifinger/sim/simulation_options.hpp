// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/document.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/orderly_stop.hpp"
#include "trifinger/joint/read_limits.hpp"
#include "trifinger/model/identified.hpp"
#include "trifinger/model/model_file.hpp"
#include "trifinger/model/robot_description.hpp"
#include "trifinger/model/robot_model.hpp"
#include "trifinger/model/scene_model.hpp"
#include "trifinger/sim/condition.hpp"

namespace trifinger {

/// One step of the physics of a robot from a description, unless somebody asks for another.
inline constexpr Nanoseconds kPhysicsStep = std::chrono::milliseconds(1);

/// The limits of the real robot of this variant, from its figures.
[[nodiscard]] std::vector<JointLimit> default_limits(const RobotDescription& description);

/// What `ModelFile` knows of the limits of its joints, for `read_limits_by_name`: largest torques,
/// stops as hard limits, and the gains of position actuators.
/// @throws InvalidArgument if it has more joints than a robot may have
[[nodiscard]] std::vector<NamedJoint> joints_of(const ModelFile& model);

/// The settings of a simulated robot. The default is the paper's robot with a cube on the table.
struct SimulationOptions {
  RobotDescription description{};
  /// The robot and the scene of this file, in place of `description`.
  std::shared_ptr<const ModelFile> file{};
  /// What was measured on this robot. A `file` has adopted what concerns its model already.
  Identified identified{};
  /// Limits of the joints; default: `default_limits`. A robot from a file has no default.
  std::optional<std::vector<JointLimit>> limits{};
  /// Positions of the driven joints at the beginning of every session [rad], [m]; default: the
  /// variant's initial pose, or where the file says.
  std::optional<std::vector<double>> initial_position{};
  /// What happens after the end of a session; default: nothing moves any more.
  OrderlyStopOptions stop{};
  /// Seed of all random numbers. The same seed gives the same series.
  std::uint64_t seed{0};
  /// The state in which the robot is; the seed decides which robot in this state it is.
  Condition condition{Condition::kAsDocumented};
  /// Length of a step: a whole number of `kPhysicsStep`, that is of milliseconds; of a robot from a
  /// file that of the file.
  Nanoseconds period{std::chrono::milliseconds(1)};
  /// One step of the physics of a robot from a description: a whole part of `period`; or, for those
  /// who learn from many simulations (`Simulator`, `EnvironmentBatch`), so many whole periods,
  /// which are then one step for motors and safety checks, too. Contacts are as soft as it needs.
  Nanoseconds physics_step{kPhysicsStep};
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

/// The objects of the description, or those that were added to the scene of the file.
[[nodiscard]] const std::vector<ObjectDescription>& objects_of(const SimulationOptions& options);

/// Makes the model for the physics, or for pictures, or takes that of the file, which serves both.
/// @throws InvalidArgument if the description cannot be built
[[nodiscard]] std::shared_ptr<const SceneModel> make_model(const SimulationOptions& options,
                                                           Detail detail = Detail::kPhysics);

/// The elements of a session of this robot: those of `TriFinger` or `Finger`, or as many joints as
/// the file has. If a file has joints that are not driven one by one, the observation also has
/// "joint_position" and "joint_velocity" of all hinges and slides, in the order of the model.
[[nodiscard]] RobotTypes robot_types_of(const SimulationOptions& options);
[[nodiscard]] RobotTypes robot_types_of(const ModelFile& model);

/// The documents of its sessions: "model.xml" in MuJoCo's format, which needs no other file. Those
/// of a description have also "robot.urdf" and "frames.txt" for viewers; the last one says how the
/// links follow from the measurements.
/// @throws InvalidArgument if the description cannot be built, Error
[[nodiscard]] std::vector<Document> model_documents(const SimulationOptions& options);

/// What errors and logs call such a robot if nobody gives it a name: "trifinger-pro", or the name
/// of the file's model.
[[nodiscard]] std::string default_name(const SimulationOptions& options);

}  // namespace trifinger
