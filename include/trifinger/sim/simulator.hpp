// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/joint/safety.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/model/robot_model.hpp"
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
template <class R>
class Simulator {
 public:
  using Action = typename R::Action;
  using AppliedAction = typename R::AppliedAction;
  using Observation = typename R::Observation;
  using Joints = JointVector<R::kJoints>;

  /// Fault codes in addition to those of `SafetyFault`.
  static constexpr std::int32_t kDiverged = 64;

  /// The values that decide how a simulation continues, apart from MuJoCo's state and the poses
  /// under way.
  struct Memory {
    SafetyState<R::kJoints> safety;
    Joints torque{};                           ///< Torques measured in the last step [Nm].
    std::array<double, R::kTips> tip_force{};  ///< Tip forces measured in the last step [N].
    /// Torques on their way to the motors, in a ring [Nm].
    std::array<Joints, static_cast<std::size_t>(Variation::kMaxTorqueDelay)> sent{};
    std::uint64_t num_sent{0};
    Variation variation{};
    Random random{};  ///< Random numbers for the noise on poses.
    TimeIndex step{0};
    TimeIndex next_capture{0};
    std::uint64_t pending_begin{0};
    std::uint64_t pending_count{0};
    /// 1 if readers know the pose at the front of the ring, before the pending ones. It is a whole
    /// word, because padding bytes between members would make equal states differ.
    std::uint64_t has_delivered{0};
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
    std::vector<Capture> captures{};  ///< A ring. Its front is the newest delivered pose.
    Observation observation{};        ///< The newest observation, which the checks use.
    /// True poses of all objects at that observation.
    std::vector<ObjectPose> objects{};
    FixedText thrown{};  ///< Text of the last exception from an added check.
    bool has_initial_pose{false};
  };

  /// @throws InvalidArgument
  explicit Simulator(SimulationOptions<R> options);

  [[nodiscard]] const SimulationOptions<R>& options() const noexcept { return options_; }
  [[nodiscard]] const RobotModel& model() const noexcept { return model_; }
  [[nodiscard]] const SafetyChain<R>& safety() const noexcept { return safety_; }
  /// For adding checks, while nobody uses the simulator.
  [[nodiscard]] SafetyChain<R>& safety() noexcept { return safety_; }
  /// Joint positions at the beginning, unless others are set [rad].
  [[nodiscard]] const Joints& initial_position() const noexcept { return initial_position_; }
  /// @throws InvalidArgument if a joint would be beyond its hard limit or is not a number
  void check(const Joints& position) const;

  /// Makes a state with room for all poses that may be under way. `reset` it before use.
  [[nodiscard]] State make_state() const;

  /// Makes `varied`, from `make_varied_model`, differ from the model by `variation`. The contents
  /// of `data` are lost. Gain and delay of the motors take effect through `Memory::variation`.
  void vary(const Variation& variation, mjModel_& varied, mjData_& data) const noexcept;

  /// Resets a simulation: the joints are at rest at `position` [rad], the objects have the initial
  /// poses and velocities of the description, and no session has begun. No noise has been drawn
  /// from `random` yet. The variation stays.
  void reset(const Joints& position, const Random& random, const mjModel_& model, mjData_& data,
             State& state) const noexcept;

  /// Makes a copy of the model that can be varied. The copy has a separate friction for each pair
  /// of surfaces whose factor in `variation` is not 1. The model itself has this only if the
  /// description says so.
  /// @throws Error if there is no memory for it
  [[nodiscard]] RobotModel::Compiled make_varied_model(const Variation& variation) const;

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

  /// Measures `state.observation`, and notes where the objects are.
  void observe(const mjData_& data, State& state) const noexcept;
  /// Checks `desired` against `state.observation` and moves on by one step. If a number is not
  /// finite after the step, the simulation has diverged, and the previous step is the last good
  /// one. `puller` is internal: what moves the physics while a hand pulls.
  [[nodiscard]] DriverReport step(const Action& desired, const mjModel_& model, mjData_& data,
                                  State& state, AppliedAction& applied,
                                  detail::Puller* puller = nullptr) const noexcept;
  /// The part of `step` after the checks. False if a number is no longer finite.
  [[nodiscard]] bool move(const Joints& torque, const mjModel_& model, mjData_& data, State& state,
                          detail::Puller* puller = nullptr) const noexcept;

  /// Returns the poses that arrive from the camera at `time_index`; nullptr if none arrive. Call it
  /// once per step. Before step 0 (below 0) it returns one set of poses, whatever their time of
  /// arrival. The result is valid until the next call.
  [[nodiscard]] const Capture* receive_poses(TimeIndex time_index, const mjData_& data,
                                             State& state) const noexcept;

  /// Computes the torques that hold the joints at rest where they are [Nm].
  void gravity_torques(const mjModel_& model, mjData_& data, Joints& torque) const noexcept;

  [[nodiscard]] ObjectPose object_pose(const ObjectAddress& object,
                                       const mjData_& data) const noexcept;
  [[nodiscard]] ObjectVelocity object_velocity(const ObjectAddress& object,
                                               const mjData_& data) const noexcept;

 private:
  void vary_pairs(const Variation& variation, mjModel_& varied) const noexcept;
  void capture(const mjData_& data, State& state, Capture& capture) const noexcept;
  void measure_tip_forces(const mjModel_& model, mjData_& data, State& state) const noexcept;

  SimulationOptions<R> options_;
  ActuatorParameters actuator_;
  RobotModel model_;
  SafetyChain<R> safety_;
  int substeps_;
  Joints initial_position_{};
};

extern template class Simulator<TriFinger>;
extern template class Simulator<Finger>;

}  // namespace trifinger
