// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/core/sensor.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/counted_chain.hpp"
#include "trifinger/joint/orderly_stop.hpp"
#include "trifinger/model/scene_model.hpp"
#include "trifinger/sim/hand.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/simulation_options.hpp"
#include "trifinger/sim/simulator.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger {

/// All data that decides how a simulation continues, as bytes. It can only be restored in the model
/// from which it was saved.
using SimulationState = std::vector<std::byte>;

/// A robot in MuJoCo, with the same safety chain as the real robot. It is a driver like any other.
///
/// It does one step of the robot per action. It is deterministic: options, state and actions decide
/// the series, bit for bit, on one machine. `robot_types_of` says what its elements are. Loose
/// objects are in the companion "object".
///
/// The functions after the driver's own are for the owner of the simulation. They must not be
/// called while another thread runs the back-end. Every session begins in the state that the last
/// `reset`, `place_object`, `set_object_velocity` or `restore` has left. During a session they take
/// effect at once and are visible from the next observation on. The end of a session moves nothing
/// unless `stop` says so: `save` after the session ended captures the state after the last action.
class SimulatedRobot final : public UntypedDriver {
 public:
  using Options = SimulationOptions;

  /// Fault codes in addition to those of `SafetyFault`.
  static constexpr std::int32_t kDiverged = Simulator::kDiverged;

  /// @throws InvalidArgument
  explicit SimulatedRobot(SimulationOptions options = {});
  ~SimulatedRobot() override;

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

  [[nodiscard]] const SimulationOptions& options() const noexcept { return simulator_.options(); }
  [[nodiscard]] const SceneModel& model() const noexcept { return simulator_.model(); }
  /// Limits of the driven joints.
  [[nodiscard]] const std::vector<JointLimit>& limits() const noexcept { return chain_.limits(); }

  /// Adds a check after the existing ones, between desired and applied actions, before the first
  /// session. It sees the elements of the session.
  void add_check(CountedChain::Check check);
  /// Adds a check for the elements of robot R: `check(observation, action)`.
  /// @throws InvalidArgument if this robot has other elements
  template <class R, class Check>
  void add_check(Check check) {
    require_elements(describe_robot<R>());
    add_check([check = std::move(check)](const void* observation, void* action) {
      check(*static_cast<const typename R::Observation*>(observation),
            *static_cast<typename R::Action*>(action));
    });
  }

  /// Positions of the driven joints at the beginning of every session, unless `reset` sets others
  /// [rad], [m].
  [[nodiscard]] const std::vector<double>& initial_position() const noexcept {
    return simulator_.initial_position();
  }
  /// Resets the simulation: initial pose, initial poses and velocities of the objects, and the
  /// seed.
  void reset();
  /// Resets the simulation with the driven joints at `position` [rad], [m], and with other random
  /// numbers. `model_position` are positions of the first hinges and slides of the model, driven or
  /// not; NaN: as always.
  /// @throws InvalidArgument if there are more or fewer positions than joints, or if one is beyond
  /// its hard limit or not a number
  void reset(std::span<const double> position, const Random& random,
             std::span<const double> model_position = {});
  /// Makes the robot differ from its description from now on. A reset does not change this.
  /// @throws InvalidArgument
  void vary(const Variation& variation);
  /// The random numbers of the noise on poses.
  [[nodiscard]] const Random& random() const noexcept { return state_.memory.counters.random; }
  /// Places an object at rest at `pose`. The orientation is normalized.
  /// @throws InvalidArgument that names the existing objects, or if the pose is not valid
  void place_object(const std::string& name, const ObjectPose& pose);
  /// Applies a force to an object's centre of mass [N], in the world frame, like a hand that
  /// pushes. It acts from the next step on until the next call, `reset` or session.
  /// @throws InvalidArgument that names the existing objects, or if the force is not finite
  void push_object(const std::string& name, const std::array<double, 3>& force);
  /// Pulls at a tip or an object, one of `pullable_bodies`, in place of what was pulled before. It
  /// acts from the next step on until `let_go`, `reset`, `restore` or the next session. It is no
  /// part of a saved state. A hand in another process counts more while it pulls.
  /// @throws InvalidArgument that names the existing bodies, or if the pull is not valid
  void pull(const std::string& body, const Pull& pull);
  void pull(std::int64_t body, const Pull& pull);
  /// Lets go of what `pull` pulls.
  void let_go() noexcept;
  /// Lets the `HandWriter` of the robot `name` pull from now on. Call it before the first session.
  /// @throws InvalidArgument
  void listen_to_hand(const std::string& name);
  /// What has happened to this hand since the last call, in sentences. Any thread may call this.
  [[nodiscard]] std::vector<std::string> take_hand_messages();
  /// Sets an object in motion from where it is, in the world frame: velocity of its centre [m/s]
  /// and angular velocity [rad/s].
  /// @throws InvalidArgument that names the existing objects, or if a number is not finite
  void set_object_velocity(const std::string& name, const ObjectVelocity& velocity);
  /// The object's pose now, without delay and noise: position [m] and quaternion w, x, y, z.
  /// @throws InvalidArgument that names the existing objects
  [[nodiscard]] ObjectPose object_pose(const std::string& name) const;
  /// The object's pose at the newest observation, without delay and noise. The action of that step
  /// may have moved it since.
  /// @throws InvalidArgument that names the existing objects
  [[nodiscard]] ObjectPose observed_object_pose(const std::string& name) const;
  /// True positions of the driven joints at the newest observation, whatever its encoders say
  /// [rad], [m].
  [[nodiscard]] std::span<const double> true_position() const noexcept { return state_.position; }
  /// The object's velocity now, without delay and noise: velocity of its centre [m/s] and angular
  /// velocity [rad/s].
  /// @throws InvalidArgument that names the existing objects
  [[nodiscard]] ObjectVelocity object_velocity(const std::string& name) const;
  /// How deep surfaces are in each other in the last step, at the deepest contact [m]. A simulation
  /// lets contacts give way; 0 if nothing does.
  [[nodiscard]] double contact_depth() const noexcept;

  /// Saves the state: physics, safety chain, delays, random numbers.
  [[nodiscard]] SimulationState save() const;
  /// Continues from `state` exactly as the saved simulation continued, bit for bit.
  /// @throws InvalidArgument if it was saved from another model or by another version
  void restore(std::span<const std::byte> state);
  /// The last state before the simulation diverged, for a report or another try. Empty if it has
  /// not diverged. `trifinger run` saves it in `log_folder()`.
  [[nodiscard]] const SimulationState& state_before_divergence() const noexcept {
    return state_before_divergence_;
  }

  /// Positions and velocities of joints and objects in MuJoCo's layout, to draw the scene: `qpos`,
  /// then `qvel`.
  [[nodiscard]] std::vector<double> configuration() const;

 private:
  using Memory = Simulator::Memory;

  // The model that is simulated: the description's own, or a varied copy.
  [[nodiscard]] const mjModel_& mujoco() const noexcept;
  [[nodiscard]] std::size_t num_joints() const noexcept { return simulator_.num_joints(); }
  void require_elements(const RobotTypes& types) const;
  void vary_model(const Variation& variation);
  void begin_here() noexcept;
  [[nodiscard]] bool get_poses(TimeIndex time_index, void* element) noexcept;
  [[nodiscard]] bool get_scene(TimeIndex time_index, void* element) noexcept;
  [[nodiscard]] bool get_hand(TimeIndex time_index, void* element) noexcept;
  [[nodiscard]] detail::Puller* next_pull() noexcept;
  void explain_fault(std::int32_t fault_code) noexcept;

  // Saved states.
  [[nodiscard]] std::uint64_t fingerprint() const;
  [[nodiscard]] std::size_t state_size() const noexcept;
  void write_state(std::span<std::byte> state) const noexcept;
  void write_state(std::span<std::byte> state, std::span<const JointMemory> safety,
                   const Memory& memory) const noexcept;
  void read_state(std::span<const std::byte> state) noexcept;

  // The state before a step, in case that the simulation diverges.
  [[nodiscard]] std::vector<std::span<const double>> parts_changed_by_step() const;
  void keep_state_before_step() noexcept;
  void keep_state_before_divergence() noexcept;

  Simulator simulator_;
  CountedChain chain_;
  std::vector<bool> shakes_;  // joints whose gains are too strong for their inertia
  SceneModel::Data data_;
  SceneModel::Compiled varied_;  // null as long as nothing differs from the model
  Simulator::State state_;
  CountedAction desired_;
  OrderlyStop stop_;
  bool has_safety_fault_{false};  // A safety check has ended the session.
  // "object" if there are any, then "scene" and "hand".
  std::vector<CompanionDescription> companions_;
  TimeIndex next_scene_{-1};

  std::unique_ptr<detail::Puller> puller_;
  std::vector<std::string> bodies_;         // that can be pulled
  std::unique_ptr<LoopSensorReader> hand_;  // in another process
  HandObservation own_pull_;                // of the owner
  HandObservation acting_;                  // in the last step
  bool was_acting_{false};                  // in the newest element of the companion
  TimeIndex next_hand_{-1};

  std::uint64_t fingerprint_;
  SimulationState begin_state_;  // Every session begins here.
  Memory memory_before_step_;
  std::vector<JointMemory> safety_before_step_;
  std::vector<double> before_step_;
  std::vector<std::span<const double>> changed_by_step_;
  std::vector<double> after_step_;
  SimulationState state_before_divergence_;
  SimulationState spare_state_;          // Memory for `state_before_divergence_`.
  mutable std::vector<double> physics_;  // MuJoCo's part of a state that is saved or restored.
};

}  // namespace trifinger
