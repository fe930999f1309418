// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "trifinger/core/document.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/counted_chain.hpp"
#include "trifinger/joint/read_limits.hpp"
#include "trifinger/model/model_file.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger {

/// What `ModelFile` knows of the limits of its joints, for `read_limits_by_name`: largest torques,
/// stops as hard limits, and the gains of position actuators.
[[nodiscard]] std::vector<NamedJoint> joints_of(const ModelFile& model);

/// The elements of a session of the robot in this file.
[[nodiscard]] RobotTypes robot_types_of(const ModelFile& model);

/// The settings of a simulated robot from a file.
struct FileRobotOptions {
  std::shared_ptr<const ModelFile> model;
  /// One entry for each joint of the model, in their order.
  std::vector<JointLimit> limits;
  /// The key frame in which every session begins, by its name. Default: the file's first one; the
  /// zero pose of the model if it has none.
  std::optional<std::string> keyframe{};
  /// Joints that begin elsewhere, driven or not, by their names [rad], [m].
  std::vector<std::pair<std::string, double>> initial_position{};
  TimeIndex object_period{10};  ///< Steps between two poses of the objects.

  /// @throws InvalidArgument that names the option, the value found and the values allowed
  void validate() const;
  /// Puts everything in a simulation of the model where sessions begin, at rest.
  void put_at_start(mjData_& data) const noexcept;
};

/// The documents of its sessions: "model.xml", which needs no other file.
/// @throws Error
[[nodiscard]] std::vector<Document> model_documents(const ModelFile& model);

/// Any robot from a file in MuJoCo, with the same safety chain as every other robot. It is a driver
/// like any other.
///
/// Users see the elements of a `JointRobot` with as many joints. If the file has joints that are
/// not driven one by one, the observation also has "joint_position" and "joint_velocity" of all
/// hinges and slides, in the order of the model. Bodies that float freely are in the companion
/// "object".
///
/// It is deterministic: options, state and actions decide the series, bit for bit, on one machine.
/// The functions after the driver's own are for the owner of the simulation, as those of
/// `SimulatedRobot`.
class FileRobot final : public UntypedDriver {
 public:
  using Options = FileRobotOptions;

  /// Fault codes in addition to those of `SafetyFault`.
  static constexpr std::int32_t kDiverged = 64;

  /// @throws InvalidArgument
  explicit FileRobot(Options options);
  ~FileRobot() override;

  [[nodiscard]] const RobotTypes& description() const noexcept override { return chain_.types(); }
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override {
    return companions_;
  }
  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override;
  [[nodiscard]] DriverReport hold(const void* observation, void* action) noexcept override;
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override;
  void cut() noexcept override {}
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override;
  [[nodiscard]] std::string_view fault_text(std::int32_t fault_code) const noexcept override;
  [[nodiscard]] std::string_view rejection_text() const noexcept override;

  [[nodiscard]] const Options& options() const noexcept { return options_; }
  [[nodiscard]] const ModelFile& model() const noexcept { return *options_.model; }
  using Check = CountedChain::Check;
  /// Adds a check after the existing ones, before the first session.
  void add_check(Check check);

  /// Positions of the driven joints at the beginning of every session, unless `reset` sets others
  /// [rad], [m].
  [[nodiscard]] const std::vector<double>& initial_position() const noexcept {
    return initial_position_;
  }
  /// Resets the simulation: initial pose, and objects as in the file.
  void reset();
  /// Resets the simulation with the driven joints at `position` [rad], [m].
  /// @throws InvalidArgument if there are more or fewer positions than joints, or if one is beyond
  /// its hard limit or not a number
  void reset(std::span<const double> position);
  /// @throws InvalidArgument that names the existing objects, or if the pose is not valid
  void place_object(const std::string& name, const ObjectPose& pose);
  /// @throws InvalidArgument that names the existing objects, or if the force is not finite
  void push_object(const std::string& name, const std::array<double, 3>& force);
  /// @throws InvalidArgument that names the existing objects, or if a number is not finite
  void set_object_velocity(const std::string& name, const ObjectVelocity& velocity);
  /// @throws InvalidArgument that names the existing objects
  [[nodiscard]] ObjectPose object_pose(const std::string& name) const;
  /// @throws InvalidArgument that names the existing objects
  [[nodiscard]] ObjectPose observed_object_pose(const std::string& name) const;
  /// @throws InvalidArgument that names the existing objects
  [[nodiscard]] ObjectVelocity object_velocity(const std::string& name) const;

  /// Saves the state: physics and safety chain.
  [[nodiscard]] SimulationState save() const;
  /// Continues from `state` exactly as the saved simulation continued, bit for bit.
  /// @throws InvalidArgument if it was saved from another model or by another version
  void restore(std::span<const std::byte> state);
  /// The last state before the simulation diverged. Empty if it has not diverged.
  [[nodiscard]] const SimulationState& state_before_divergence() const noexcept {
    return state_before_divergence_;
  }
  /// Positions and velocities in MuJoCo's layout, to draw the scene: `qpos`, then `qvel`.
  [[nodiscard]] std::vector<double> configuration() const;

 private:
  [[nodiscard]] std::size_t num_joints() const noexcept { return options_.limits.size(); }
  [[nodiscard]] const ObjectAddress& object(const std::string& name) const;
  [[nodiscard]] ObjectPose pose_of(const ObjectAddress& object) const noexcept;
  void forget() noexcept;
  void observe() noexcept;
  void write_observation(void* element) const noexcept;
  void begin_here() noexcept;

  // Saved states.
  [[nodiscard]] std::size_t state_size() const noexcept;
  void write_state(std::span<std::byte> state) const noexcept;
  void write_state(std::span<std::byte> state, const PerJoint<double>& torque,
                   std::span<const JointMemory> memory) const noexcept;
  void read_state(std::span<const std::byte> state) noexcept;

  // The state before a step, in case that the simulation diverges.
  void keep_state_before_step() noexcept;
  void keep_state_before_divergence() noexcept;

  Options options_;
  CountedChain chain_;
  std::vector<CompanionDescription> companions_;
  std::vector<double> initial_position_;
  std::uint64_t fingerprint_;

  RobotModel::Data data_;
  CountedObservation observation_;
  PerJoint<double> torque_;                         // of the previous period
  std::vector<ObjectPose> objects_at_observation_;  // at the newest one
  TimeIndex next_poses_{-1};

  CountedObservation held_;
  CountedAction desired_;
  std::vector<ObjectPose> sent_objects_;

  SimulationState begin_state_;  // Every session begins here.
  std::vector<double> before_step_;
  std::vector<JointMemory> memory_before_step_;
  PerJoint<double> torque_before_step_;
  std::vector<double> after_step_;
  SimulationState state_before_divergence_;
  SimulationState spare_state_;          // Memory for `state_before_divergence_`.
  mutable std::vector<double> physics_;  // MuJoCo's part of a state that is saved or restored.
};

}  // namespace trifinger
