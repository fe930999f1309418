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

/// One step of a simulated robot, for one simulation or for thousands at once: what of it is
/// constant. `SimulatedRobot` is one of these with a state and MuJoCo's data.
///
/// All that changes is in the caller's hands: MuJoCo's data, its model (a copy with the masses and
/// frictions of this simulation, or `model()` itself), and a `State`. Of the data nothing is read
/// but what `mjSTATE_INTEGRATION` restores, so one `mjData` may serve many simulations in turn.
///
/// Constant once set up: threads may share one, each with its own data and states.
template <class R>
class Simulator {
 public:
  using Action = typename R::Action;
  using AppliedAction = typename R::AppliedAction;
  using Observation = typename R::Observation;
  using Joints = JointVector<R::kJoints>;

  /// Fault codes besides those of `SafetyFault`.
  static constexpr std::int32_t kDiverged = 64;

  /// What decides how a simulation goes on, besides MuJoCo's state and the poses under way.
  struct Memory {
    SafetyState<R::kJoints> safety;
    Joints torque{};                           ///< Measured in the last step [Nm].
    std::array<double, R::kTips> tip_force{};  ///< Likewise [N].
    /// Torques on their way to the motors, in a ring [Nm].
    std::array<Joints, static_cast<std::size_t>(Variation::kMaxTorqueDelay)> sent{};
    std::uint64_t num_sent{0};
    Variation variation{};
    Random random{};  ///< Of the noise on poses.
    TimeIndex step{0};
    TimeIndex next_capture{0};
    std::uint64_t pending_begin{0};
    std::uint64_t pending_count{0};
    /// 1 if the pose in front of the pending ones is known to the readers. A whole word: bytes
    /// between members would make equal states differ.
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
    std::vector<Capture> captures{};  ///< A ring, with the newest that was delivered in front.
    Observation observation{};        ///< The newest one, which the checks look at.
    FixedText thrown{};               ///< What a check that was added has thrown last.
    bool has_initial_pose{false};
  };

  /// @throws InvalidArgument
  explicit Simulator(SimulationOptions<R> options);

  [[nodiscard]] const SimulationOptions<R>& options() const noexcept { return options_; }
  [[nodiscard]] const RobotModel& model() const noexcept { return model_; }
  [[nodiscard]] const SafetyChain<R>& safety() const noexcept { return safety_; }
  /// To add checks, while nobody uses it.
  [[nodiscard]] SafetyChain<R>& safety() noexcept { return safety_; }
  /// Where a robot begins unless it is told otherwise [rad].
  [[nodiscard]] const Joints& initial_position() const noexcept { return initial_position_; }
  /// @throws InvalidArgument if a joint would be beyond its hard limit or is no number
  void check(const Joints& position) const;

  /// A state with room for all that may be under way. `reset` it before use.
  [[nodiscard]] State make_state() const;

  /// Makes `varied`, from `make_varied_model`, differ from the model as `variation` says. What
  /// `data` holds is lost. Gain and delay of the motors take effect by way of `Memory::variation`.
  void vary(const Variation& variation, mjModel_& varied, mjData_& data) const noexcept;

  /// The joints at `position` [rad] and at rest, objects as the description has them at the start,
  /// at step 0 of nothing; no noise was drawn from `random` yet. The variation stays.
  void reset(const Joints& position, const Random& random, const mjModel_& model, mjData_& data,
             State& state) const noexcept;

  /// A copy of the model to be varied. It can tell apart the friction of all pairs of surfaces
  /// whose factor in `variation` is not 1, which the model itself does only if the description says
  /// so.
  /// @throws Error if there is no memory for it
  [[nodiscard]] RobotModel::Compiled make_varied_model(const Variation& variation) const;

  /// Puts an object somewhere, at rest. The orientation, which must not be zero, is normalised.
  void place(const ObjectAddress& object, const ObjectPose& pose, mjData_& data,
             State& state) const noexcept;

  /// Lets an object move from where it is.
  void set_velocity(const ObjectAddress& object, const ObjectVelocity& velocity,
                    mjData_& data) const noexcept;

  /// A session begins: its steps count from 0.
  void begin(State& state) const noexcept;
  /// Counts on from `step`.
  void move_to_step(TimeIndex step, State& state) const noexcept;

  /// Measures `state.observation`.
  void observe(const mjData_& data, State& state) const noexcept;
  /// Checks `desired` against `state.observation`, and moves on by one step. The first step without
  /// a number that is not finite is the last good one.
  [[nodiscard]] DriverReport step(const Action& desired, const mjModel_& model, mjData_& data,
                                  State& state, AppliedAction& applied) const noexcept;
  /// The part of `step` behind the checks. False if a number is no longer finite.
  [[nodiscard]] bool move(const Joints& torque, const mjModel_& model, mjData_& data,
                          State& state) const noexcept;

  /// What arrives from the camera at `time_index`, once per step; null if nothing does. Before step
  /// 0 (below 0) that is one pose, whenever it was to arrive. Lives until the next call.
  [[nodiscard]] const Capture* receive_poses(TimeIndex time_index, const mjData_& data,
                                             State& state) const noexcept;

  /// Torques that hold the joints where they are, at rest [Nm].
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
