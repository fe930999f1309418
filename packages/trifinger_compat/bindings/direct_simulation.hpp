// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>

#include "trifinger/joint/types.hpp"
#include "trifinger/model/scene_model.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/simulation_options.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger::bindings {

/// How `DirectSimulation` makes torques of an action.
template <std::size_t N>
struct DirectControl {
  JointVector<N> kp{};       ///< Gain of a position that has none of its own [Nm/rad].
  JointVector<N> kd{};       ///< [Nms/rad]
  JointVector<N> damping{};  ///< Acts always, whatever the action asks [Nms/rad].
  double max_torque{0.0};    ///< [Nm]
};

/// What another simulator assumes of fingers, where a description has the hardware's figures.
template <std::size_t N>
struct DirectPhysics {
  /// Where stops are, in place of those beyond the hard limits [rad].
  JointVector<N> stop_lower{};
  JointVector<N> stop_upper{};
  double margin{0.0};  ///< Distance at which fingers touch already [m], 0 to 0.01.
  /// Sliding friction of links, and of the boundary, against anything, from 0.001 to 5. If two meet
  /// that decide, it is that of the link, then that of the tip or the boundary, whichever is
  /// larger.
  double link_friction{0.5};
  double boundary_friction{0.5};
};

/// A simulated robot that its owner moves step by step. There are no sessions, no limits of
/// positions and speeds, and no faults: it is for programs that bring their own rules, such as
/// those written for other simulators. `Simulation` is for all others.
///
/// Nothing is random. One object must not be used by several threads at once.
template <class R>
class DirectSimulation {
 public:
  using Action = typename R::Action;
  using Observation = typename R::Observation;
  using Joints = JointVector<R::kJoints>;
  using Control = DirectControl<R::kJoints>;
  using Physics = DirectPhysics<R::kJoints>;

  /// The robot begins at rest at its initial position, objects where the description says.
  /// @throws InvalidArgument
  explicit DirectSimulation(SimulationOptions options);

  [[nodiscard]] const SimulationOptions& options() const noexcept { return simulator_.options(); }
  /// The measurements now. `torque` and `tip_force` [N] are those of the last step.
  [[nodiscard]] const Observation& observation() const noexcept { return observation_; }

  /// The torques of `action` now: its torques and those of its positions, clipped, damped and
  /// clipped again. A position that is NaN asks for nothing, and a gain that is NaN stands for that
  /// of `control`. Writes the gains to `applied`, too.
  void apply_control(const Action& action, const Control& control, Action& applied) const noexcept;

  /// Moves on by one step, in which `torque` acts as it is, up to 10 Nm. False if it is not a
  /// number, or if a number is not finite after the step: the simulation has diverged.
  [[nodiscard]] bool step(const Joints& torque) noexcept;

  /// Sets positions [rad] and velocities [rad/s] of all joints, also beyond limits.
  /// @throws InvalidArgument if a number is not finite
  void set_joints(const Joints& position, const Joints& velocity);

  /// Places an object at rest.
  /// @throws InvalidArgument that names the existing objects, or if the pose is not valid
  void place_object(const std::string& name, const ObjectPose& pose);
  /// @throws InvalidArgument that names the existing objects, or if a number is not finite
  void set_object_velocity(const std::string& name, const ObjectVelocity& velocity);
  /// Lets a force [N] and a moment [Nm] act on an object's centre in the next step, in the world
  /// frame. Several add up.
  /// @throws InvalidArgument that names the existing objects, or if a number is not finite
  void push_object(const std::string& name, const std::array<double, 3>& force,
                   const std::array<double, 3>& moment);
  /// Sets the mass of an object, which must be above 0 [kg]. Its inertia grows with it.
  /// @throws InvalidArgument that names the existing objects, or if the mass is not valid
  void set_object_mass(const std::string& name, double mass);
  /// Sets the distance at which an object touches already, from 0 to 0.01 [m]. Those of two bodies
  /// add up.
  /// @throws InvalidArgument that names the existing objects, or if the margin is not valid
  void set_object_margin(const std::string& name, double margin);
  /// Takes figures of another simulator. The robot stays where it is.
  /// @throws InvalidArgument that names the figure that is not valid
  void use_physics(const Physics& physics);
  /// @throws InvalidArgument that names the existing objects
  [[nodiscard]] ObjectPose object_pose(const std::string& name) const;
  /// @throws InvalidArgument that names the existing objects
  [[nodiscard]] ObjectVelocity object_velocity(const std::string& name) const;

  /// Continues where `other` is: with its joints, and with the objects that both have by their
  /// names. The other objects stay.
  void continue_from(const DirectSimulation& other);

  /// Positions and velocities of joints and objects in MuJoCo's layout: `qpos`, and `qvel`.
  [[nodiscard]] std::span<const double> configuration_position() const noexcept;
  [[nodiscard]] std::span<const double> configuration_velocity() const noexcept;

 private:
  void observe() noexcept;
  void update_constants();

  Simulator simulator_;
  SceneModel::Compiled model_;
  SceneModel::Data data_;
  Simulator::State state_;
  Observation observation_{};
  bool was_pushed_{false};
};

extern template class DirectSimulation<TriFinger>;
extern template class DirectSimulation<Finger>;

}  // namespace trifinger::bindings
