// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/core/document.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/counted_chain.hpp"
#include "trifinger/model/model_file.hpp"
#include "trifinger/sim/file_simulator.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/simulated_robot.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger {

/// The elements of a session of the robot in this file.
[[nodiscard]] RobotTypes robot_types_of(const ModelFile& model);

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
  static constexpr std::int32_t kDiverged = FileSimulator::kDiverged;

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

  [[nodiscard]] const Options& options() const noexcept { return simulator_.options(); }
  [[nodiscard]] const ModelFile& model() const noexcept { return simulator_.model(); }
  using Check = CountedChain::Check;
  /// Adds a check after the existing ones, before the first session.
  void add_check(Check check);

  /// Positions of the driven joints at the beginning of every session, unless `reset` sets others
  /// [rad], [m].
  [[nodiscard]] const std::vector<double>& initial_position() const noexcept {
    return simulator_.initial_position();
  }
  /// Resets the simulation: initial pose, and objects as in the file.
  void reset();
  /// Resets the simulation with the driven joints at `position` [rad], [m]. `model_position` are
  /// positions of the first hinges and slides of the model, driven or not; NaN: as always.
  /// @throws InvalidArgument if there are more or fewer positions than joints, or if one is beyond
  /// its hard limit or not a number
  void reset(std::span<const double> position, std::span<const double> model_position = {});
  /// Makes the simulation differ from its file by `variation` from now on. A reset does not change
  /// this.
  /// @throws InvalidArgument that names the value found and the values allowed, or what only a
  /// TriFinger can vary
  void vary(const Variation& variation);
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
  [[nodiscard]] std::size_t num_joints() const noexcept { return simulator_.num_joints(); }
  // The model of this simulation, as it was varied.
  [[nodiscard]] const mjModel_& mujoco() const noexcept;
  [[nodiscard]] const ObjectAddress& object(const std::string& name) const;
  void vary_model(const Variation& variation);
  void write_observation(void* element) const noexcept;
  void begin_here() noexcept;

  // Saved states.
  [[nodiscard]] std::size_t state_size() const noexcept;
  void write_state(std::span<std::byte> state) const noexcept;
  void write_state(std::span<std::byte> state, const FileSimulator::Memory& memory,
                   std::span<const JointMemory> safety) const noexcept;
  void read_state(std::span<const std::byte> state) noexcept;

  // The state before a step, in case that the simulation diverges.
  void keep_state_before_step() noexcept;
  void keep_state_before_divergence() noexcept;

  FileSimulator simulator_;
  CountedChain chain_;
  std::vector<CompanionDescription> companions_;
  std::uint64_t fingerprint_;

  RobotModel::Data data_;
  RobotModel::Compiled varied_;  // Null as long as nothing differs from the file.
  FileSimulator::State state_;

  CountedObservation held_;
  CountedAction desired_;

  SimulationState begin_state_;  // Every session begins here.
  std::vector<double> before_step_;
  FileSimulator::Memory memory_before_step_;
  std::vector<JointMemory> safety_before_step_;
  std::vector<double> after_step_;
  SimulationState state_before_divergence_;
  SimulationState spare_state_;          // Memory for `state_before_divergence_`.
  mutable std::vector<double> physics_;  // MuJoCo's part of a state that is saved or restored.
};

}  // namespace trifinger
