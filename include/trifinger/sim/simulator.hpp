// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/safety.hpp"
#include "trifinger/model/robot_model.hpp"
#include "trifinger/model/scene_model.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/simulation_options.hpp"
#include "trifinger/sim/variation.hpp"

struct mjData_;

namespace trifinger {

namespace detail {
class Puller;
}  // namespace detail

/// Does one step of a simulated robot, for one simulation or for thousands at once. A simulator
/// holds only what is constant. `SimulatedRobot` combines one with a state and MuJoCo's data.
///
/// The caller holds everything that changes: MuJoCo's data, its model and a `State`. The model is
/// `model()` itself, or a copy with the masses and frictions of this simulation. From the data only
/// what `mjSTATE_INTEGRATION` restores is read, so one `mjData` may serve many simulations in turn.
///
/// Once set up, a simulator is constant. Threads may share one, each with its own data and states.
class Simulator {
 public:
  using Action = CountedAction;
  using AppliedAction = CountedAppliedAction;
  using Observation = CountedObservation;

  /// Fault codes in addition to those of `SafetyFault`.
  static constexpr std::int32_t kDiverged = 64;

  /// The values that decide how a simulation continues, apart from MuJoCo's state, the memory of
  /// the checks and the poses under way.
  struct Memory {
    /// The numbers whose count is the same for all robots.
    struct Counters {
      std::uint64_t num_sent{0};
      std::uint64_t num_measured{0};
      Variation variation{};
      Random random{};  ///< Random numbers for the noise on poses.
      TimeIndex step{0};
      TimeIndex next_capture{0};
      std::uint64_t pending_begin{0};
      std::uint64_t pending_count{0};
      /// 1 if readers know the pose at the front of the ring, before the pending ones. It is a
      /// whole word, because padding bytes between members would make equal states differ.
      std::uint64_t has_delivered{0};
    };
    Counters counters{};
    PerJoint<double> torque;          ///< Torques measured in the last step [Nm], [N].
    std::vector<double> tip_force{};  ///< Tip forces measured in the last step [N].
    std::vector<double> sent{};       ///< Torques on their way to the motors, in a ring [Nm].
    /// Positions and velocities on their way from the encoders, in a ring.
    std::vector<double> measured{};
    std::vector<double> velocity_noise{};  ///< Errors of the newest velocities [rad/s], [m/s].
    /// Where each motor is in its play [rad], [m], and how fast it turns against its joint.
    std::vector<double> in_play{};
    std::vector<double> play_speed{};
  };

  /// The poses of all objects at one instant.
  struct Capture {
    TimeIndex capture_index{0};
    TimeIndex arrival_index{0};
    std::vector<ObjectPose> objects{};
  };

  /// One simulation.
  struct State {
    Memory memory{};
    CountedSafetyState safety{};      ///< `step` uses it; a `CountedChain` has its own.
    std::vector<Capture> captures{};  ///< A ring. Its front is the newest delivered pose.
    Observation observation{};        ///< The newest observation, which the checks use.
    /// @name The rest of it
    /// @{
    std::vector<double> tip_force{};
    std::vector<double> model_position{};  ///< All hinges and slides; empty if all are driven.
    std::vector<double> model_velocity{};
    /// @}
    /// True positions of the driven joints and poses of all objects at that observation.
    PerJoint<double> position;
    std::vector<ObjectPose> objects{};
    bool has_initial_pose{false};
  };

  /// @throws InvalidArgument
  explicit Simulator(SimulationOptions options);
  /// Shares a model that others have made of these options, which are valid.
  Simulator(std::shared_ptr<const SceneModel> model, SimulationOptions options);

  [[nodiscard]] const SimulationOptions& options() const noexcept { return options_; }
  [[nodiscard]] const SceneModel& model() const noexcept { return *model_; }
  [[nodiscard]] const std::vector<JointLimit>& limits() const noexcept { return safety_.limits(); }
  [[nodiscard]] std::size_t num_joints() const noexcept { return model_->joints().size(); }
  /// Positions of the driven joints at the beginning, unless others are set [rad], [m].
  [[nodiscard]] const std::vector<double>& initial_position() const noexcept {
    return initial_position_;
  }
  /// Puts everything where sessions begin, at rest.
  void put_at_start(mjData_& data) const noexcept;
  /// The positions of everything then, in the order of MuJoCo's `qpos`.
  [[nodiscard]] const std::vector<double>& initial_configuration() const noexcept {
    return initial_configuration_;
  }
  /// @throws InvalidArgument if there are more or fewer positions than joints, or if one is beyond
  /// its hard limit or not a number
  void check(std::span<const double> position) const;

  /// Makes a state with room for all poses that may be under way. `reset` it before use.
  [[nodiscard]] State make_state() const;

  /// Refuses what this robot cannot vary: surfaces and stops of a file have no names.
  /// @throws InvalidArgument that names it, or the value found and the values allowed
  void check(const Variation& variation) const;
  /// Makes `varied`, from `make_varied_model`, differ from the model by `variation`. The contents
  /// of `data` are lost. What concerns motors and encoders takes
  /// effect through `Memory`.
  void vary(const Variation& variation, mjModel_& varied, mjData_& data) const noexcept;
  /// Makes a copy of the model that can be varied. The copy has a separate friction for each pair
  /// of surfaces whose factor in `variation` is not 1. The model itself has this only if the
  /// description says so.
  /// @throws Error if there is no memory for it
  [[nodiscard]] SceneModel::Compiled make_varied_model(const Variation& variation) const;

  /// Resets a simulation: the driven joints are at rest at `position` [rad], [m], everything else
  /// is where sessions begin, and no session has begun. No noise has been drawn from `random` yet.
  /// The variation stays. `model_position` are positions of the first hinges and slides of the
  /// model, driven or not; NaN: where it begins.
  void reset(std::span<const double> position, const Random& random, mjData_& data, State& state,
             std::span<const double> model_position = {}) const noexcept;

  /// Places an object at rest. The orientation must not be zero; it is normalized.
  void place(const ObjectAddress& object, const ObjectPose& pose, mjData_& data,
             State& state) const noexcept;

  /// Sets an object in motion from where it is.
  void set_velocity(const ObjectAddress& object, const ObjectVelocity& velocity,
                    mjData_& data) const noexcept;

  /// Begins a session: its steps count from 0.
  void begin(State& state) const noexcept;
  /// Makes the next steps count from `step`.
  void move_to_step(TimeIndex step, State& state) const noexcept;

  /// Measures `state.observation` and the rest of it, and notes where the objects are.
  void observe(const mjData_& data, State& state) const noexcept;
  /// Writes what `observe` has measured as an element of a session.
  void write_observation(const State& state, void* element) const noexcept;
  /// The steps of the robot that one call of `step` or `move` takes: 1, unless the physics has
  /// longer steps. Delays are then rounded to whole calls.
  [[nodiscard]] TimeIndex stride() const noexcept { return stride_; }
  /// Checks `desired` against `state.observation` and moves on by `stride`. If a number is not
  /// finite after the step, the simulation has diverged, and the previous step is the last good
  /// one.
  [[nodiscard]] DriverReport step(const Action& desired, const mjModel_& model, mjData_& data,
                                  State& state, AppliedAction& applied) const noexcept;
  /// @name `step` in parts
  /// For physics that move many simulations at once. They take `substeps` steps of the model
  /// between the two calls, and leave positions, velocities and accelerations in `data`. No tip
  /// forces are measured.
  /// @{
  /// Checks `desired` and hands torques to the motors, in `data.ctrl`.
  [[nodiscard]] DriverReport begin_step(const Action& desired, mjData_& data, State& state,
                                        AppliedAction& applied) const noexcept;
  /// Goes on after the physics. False if a number is no longer finite.
  [[nodiscard]] bool end_step(const mjModel_& model, const mjData_& data,
                              State& state) const noexcept;
  [[nodiscard]] int substeps() const noexcept { return substeps_; }
  /// @}
  /// The part of `step` after the checks. False if a number is no longer finite. `puller` is
  /// internal: what moves the physics while a hand pulls.
  [[nodiscard]] bool move(const PerJoint<double>& torque, const mjModel_& model, mjData_& data,
                          State& state, detail::Puller* puller = nullptr) const noexcept;

  /// Returns the poses that arrive from the camera at `time_index`; nullptr if none arrive. Call it
  /// once per step. Before step 0 (below 0) it returns one set of poses, whatever their time of
  /// arrival. The result is valid until the next call.
  [[nodiscard]] const Capture* receive_poses(TimeIndex time_index, const mjData_& data,
                                             State& state) const noexcept;

  [[nodiscard]] ObjectPose object_pose(const ObjectAddress& object,
                                       const mjData_& data) const noexcept;
  [[nodiscard]] ObjectVelocity object_velocity(const ObjectAddress& object,
                                               const mjData_& data) const noexcept;

 private:
  void require_soft_limits() const;
  [[nodiscard]] std::uint64_t in_strides(TimeIndex steps) const noexcept;
  void vary_pairs(const Variation& variation, mjModel_& varied) const noexcept;
  void vary_joints(const Variation& variation, mjModel_& varied) const noexcept;
  void capture(const mjData_& data, State& state, Capture& capture) const noexcept;
  void read_encoders(State& state) const noexcept;
  void pass_on_measurements(const mjData_& data, State& state) const noexcept;
  [[nodiscard]] std::uint64_t measurement_delay(const Memory& memory) const noexcept;
  [[nodiscard]] double backlash(std::size_t joint, const Memory& memory) const noexcept;
  [[nodiscard]] double motor_torque(std::size_t joint, const mjData_& data,
                                    const Memory& memory) const noexcept;
  [[nodiscard]] double delivered(std::size_t joint, const mjData_& data,
                                 const Memory& memory) const noexcept;
  void turn_in_play(const mjModel_& model, const mjData_& data, Memory& memory) const noexcept;
  void set_torques(const PerJoint<double>& torque, mjData_& data, State& state) const noexcept;
  [[nodiscard]] bool run_physics(const mjModel_& model, mjData_& data, State& state,
                                 detail::Puller* puller = nullptr) const noexcept;
  void measure_tip_forces(const mjModel_& model, mjData_& data, State& state) const noexcept;

  SimulationOptions options_;
  std::shared_ptr<const SceneModel> model_;
  const RobotModel* described_;                 // the same model; null if it is from a file
  std::optional<ActuatorParameters> actuator_;  // of a described robot
  SafetyChain<CountedJoints> safety_;
  TimeIndex stride_;
  int substeps_;
  std::vector<double> initial_position_;
  std::vector<double> initial_configuration_;
  std::vector<int> loose_;  // bodies of the objects, with all that hangs at them
};

}  // namespace trifinger
