// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/read_limits.hpp"
#include "trifinger/joint/safety.hpp"
#include "trifinger/model/model_file.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger {

/// What `ModelFile` knows of the limits of its joints, for `read_limits_by_name`: largest torques,
/// stops as hard limits, and the gains of position actuators.
[[nodiscard]] std::vector<NamedJoint> joints_of(const ModelFile& model);

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

/// Does one step of a simulated robot from a file, for one simulation or for thousands at once:
/// what `Simulator` is for TriFingers. `FileRobot` combines one with a state and MuJoCo's data.
///
/// The caller holds everything that changes: MuJoCo's data, its model and a `State`. The model is
/// that of the file, or a copy that was varied. From the data only what `mjSTATE_INTEGRATION`
/// restores is read, so one `mjData` may serve many simulations in turn.
///
/// Once set up, a simulator is constant. Threads may share one, each with its own data and states.
class FileSimulator {
 public:
  using Action = CountedAction;
  using AppliedAction = CountedAppliedAction;
  using Observation = CountedObservation;

  /// Fault codes in addition to those of `SafetyFault`.
  static constexpr std::int32_t kDiverged = 64;

  /// The values that decide how a simulation continues, apart from MuJoCo's state and the memory of
  /// the checks.
  struct Memory {
    PerJoint<double> torque{};   ///< Torques of the previous step [Nm], [N].
    std::vector<double> sent{};  ///< Torques on their way to the motors, in a ring.
    std::uint64_t num_sent{0};
    Variation variation{};
    Random random{};  ///< Nothing in this simulation is random.
    TimeIndex step{0};
    TimeIndex next_poses{-1};  ///< Step at which the next poses of the objects arrive.
  };

  /// The poses of all objects at one instant.
  struct Capture {
    TimeIndex capture_index{0};
    std::vector<ObjectPose> objects{};
  };

  /// One simulation.
  struct State {
    Memory memory{};
    CountedSafetyState safety{};
    Observation observation{};             ///< The newest observation, which the checks use.
    std::vector<double> model_position{};  ///< Of all hinges and slides, at that observation.
    std::vector<double> model_velocity{};
    std::vector<ObjectPose> objects{};  ///< Poses of all objects at that observation.
    Capture capture{};                  ///< The newest poses that have arrived.
  };

  /// @throws InvalidArgument
  explicit FileSimulator(FileRobotOptions options);

  [[nodiscard]] const FileRobotOptions& options() const noexcept { return options_; }
  [[nodiscard]] const ModelFile& model() const noexcept { return *options_.model; }
  [[nodiscard]] const std::vector<ObjectAddress>& objects() const noexcept {
    return model().free_bodies();
  }
  [[nodiscard]] std::size_t num_joints() const noexcept { return options_.limits.size(); }

  /// Positions of the driven joints at the beginning, unless others are set [rad], [m].
  [[nodiscard]] const std::vector<double>& initial_position() const noexcept {
    return initial_position_;
  }
  /// The positions of everything at the beginning, in the order of MuJoCo's `qpos`.
  [[nodiscard]] const std::vector<double>& initial_configuration() const noexcept {
    return initial_configuration_;
  }
  /// @throws InvalidArgument if there are more or fewer positions than joints, or if one is beyond
  /// its hard limit or not a number
  void check(std::span<const double> position) const;

  /// Makes a state with room for everything. `reset` it before use.
  [[nodiscard]] State make_state() const;

  /// Refuses what no robot from a file can vary: the friction of named pairs of surfaces, and
  /// stops.
  /// @throws InvalidArgument that names it, or the value found and the values allowed
  static void check(const Variation& variation);
  /// Makes `varied`, a copy of the model, differ from it by `variation`. The contents of `data` are
  /// lost. Gain and delay of the motors take effect through `Memory::variation`.
  void vary(const Variation& variation, mjModel_& varied, mjData_& data) const noexcept;
  /// Makes a copy of the model that can be varied.
  /// @throws Error if there is no memory for it
  [[nodiscard]] RobotModel::Compiled make_varied_model() const;

  /// Resets a simulation: everything is at rest where it begins, the driven joints are at
  /// `position` [rad], [m], and no session has begun. The variation stays. `model_position` are
  /// positions of the first hinges and slides of the model; NaN: where it begins.
  void reset(std::span<const double> position, const mjModel_& model, mjData_& data, State& state,
             std::span<const double> model_position = {}) const noexcept;
  /// Places an object at rest. The orientation must not be zero; it is normalized.
  void place(const ObjectAddress& object, const ObjectPose& pose, mjData_& data) const noexcept;
  /// Sets an object in motion from where it is.
  void set_velocity(const ObjectAddress& object, const ObjectVelocity& velocity,
                    mjData_& data) const noexcept;

  /// Begins a session: its steps count from 0.
  void begin(State& state) const noexcept;
  /// Measures `state.observation`, and notes where everything else is.
  void observe(const mjData_& data, State& state) const noexcept;
  /// Checks `desired` against `state.observation` and moves on by one step. If a number is not
  /// finite after the step, the simulation has diverged.
  [[nodiscard]] DriverReport step(const Action& desired, const mjModel_& model, mjData_& data,
                                  State& state, AppliedAction& applied) const noexcept;
  /// The part of `step` after the checks. False if a number is no longer finite.
  [[nodiscard]] bool move(const PerJoint<double>& torque, const mjModel_& model, mjData_& data,
                          State& state) const noexcept;

  /// Returns the poses of the objects that arrive at `time_index`; nullptr if none arrive. Call it
  /// once per step, and once before step 0 with a number below 0. The result is valid until the
  /// next call.
  [[nodiscard]] const Capture* receive_poses(TimeIndex time_index, const mjData_& data,
                                             State& state) const noexcept;

  [[nodiscard]] ObjectPose object_pose(const ObjectAddress& object,
                                       const mjData_& data) const noexcept;
  [[nodiscard]] ObjectVelocity object_velocity(const ObjectAddress& object,
                                               const mjData_& data) const noexcept;

 private:
  void set_torques(const PerJoint<double>& torque, Memory& memory, mjData_& data) const noexcept;

  FileRobotOptions options_;
  SafetyChain<CountedJoints> safety_;
  std::vector<double> initial_position_;
  std::vector<double> initial_configuration_;
  std::vector<int> loose_;  // bodies of the objects, with all that hangs at them
};

}  // namespace trifinger
