// SPDX-License-Identifier: BSD-3-Clause
#include "direct_simulation.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger::bindings {
namespace {

using detail::require;

template <std::size_t N>
void require_all_finite(const std::array<double, N>& values, const char* what) {
  for (const double value : values) {
    require(std::isfinite(value), std::string(what) + " has the value " + detail::text_of(value) +
                                      ", must have finite numbers");
  }
}

void require_margin(double margin) {
  constexpr double kLargestMargin = 0.01;  // [m]; what touches from farther away is another shape
  require(margin >= 0.0 && margin <= kLargestMargin,
          "margin is " + detail::text_of(margin) + " m, must be 0 to 0.01");
}

void require_friction(double friction, const char* what) {
  require(friction >= 0.001 && friction <= 5.0,
          std::string(what) + " is " + detail::text_of(friction) + ", must be 0.001 to 5");
}

constexpr double kLargestTorque = 10.0;  // [Nm]; a description allows no more

double or_else(double value, double other) noexcept { return std::isnan(value) ? other : value; }

// NaN stays NaN; the step then says that the simulation has diverged.
double clipped(double torque, double limit) noexcept { return std::clamp(torque, -limit, limit); }

// Motors that deliver each torque at each speed.
SimulationOptions with_ideal_motors(SimulationOptions options) {
  // The limits of the joints do not act, but a simulator has some.
  if (!options.limits) options.limits = default_limits(options.description);
  ActuatorParameters motors = actuator(options.description);
  motors.torque_limit = kLargestTorque;
  motors.stall_torque = 1e3;
  motors.no_load_speed = 1e4;
  options.description.actuator = motors;
  return options;
}

}  // namespace

template <class R>
DirectSimulation<R>::DirectSimulation(SimulationOptions options)
    : simulator_(with_ideal_motors(std::move(options))),
      model_(simulator_.model().copy()),
      data_(simulator_.model().make_data()),
      state_(simulator_.make_state()) {
  simulator_.reset(simulator_.initial_position(), Random{}, *data_, state_);
  observe();
}

template <class R>
void DirectSimulation<R>::observe() noexcept {
  simulator_.observe(*data_, state_);
  simulator_.write_observation(state_, &observation_);
}

template <class R>
void DirectSimulation<R>::apply_control(const Action& action, const Control& control,
                                        Action& applied) const noexcept {
  const Observation& now = observation_;
  applied.position = action.position;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    applied.position_kp[i] = or_else(action.position_kp[i], control.kp[i]);
    applied.position_kd[i] = or_else(action.position_kd[i], control.kd[i]);
    const double feedback = applied.position_kp[i] * (action.position[i] - now.position[i]) -
                            applied.position_kd[i] * now.velocity[i];
    const double torque = clipped(action.torque[i] + or_else(feedback, 0.0), control.max_torque);
    applied.torque[i] = clipped(torque - control.damping[i] * now.velocity[i], control.max_torque);
  }
}

template <class R>
bool DirectSimulation<R>::step(const Joints& torque) noexcept {
  const bool is_finite =
      simulator_.move(PerJoint<double>(std::span(torque)), *model_, *data_, state_) &&
      std::ranges::none_of(torque, [](double value) { return std::isnan(value); });
  std::ranges::copy(torque, state_.memory.torque.begin());
  if (std::exchange(was_pushed_, false)) {
    std::fill_n(data_->xfrc_applied, 6 * static_cast<std::size_t>(model_->nbody), 0.0);
  }
  observe();
  return is_finite;
}

template <class R>
void DirectSimulation<R>::set_joints(const Joints& position, const Joints& velocity) {
  require_all_finite(position, "position");
  require_all_finite(velocity, "velocity");
  std::ranges::copy(position, data_->qpos);
  std::ranges::copy(velocity, data_->qvel);
  observe();
}

template <class R>
void DirectSimulation<R>::place_object(const std::string& name, const ObjectPose& pose) {
  const ObjectAddress& object = simulator_.model().object(name);
  require_all_finite(pose.position, "position");
  require_all_finite(pose.orientation, "orientation");
  require(std::ranges::any_of(pose.orientation, [](double value) { return value != 0.0; }),
          "orientation is zero, must be a quaternion");
  simulator_.place(object, pose, *data_, state_);
  observe();
}

template <class R>
void DirectSimulation<R>::set_object_velocity(const std::string& name,
                                              const ObjectVelocity& velocity) {
  const ObjectAddress& object = simulator_.model().object(name);
  require_all_finite(velocity.linear, "linear");
  require_all_finite(velocity.angular, "angular");
  simulator_.set_velocity(object, velocity, *data_);
}

template <class R>
void DirectSimulation<R>::push_object(const std::string& name, const std::array<double, 3>& force,
                                      const std::array<double, 3>& moment) {
  const ObjectAddress& object = simulator_.model().object(name);
  require_all_finite(force, "force");
  require_all_finite(moment, "moment");
  double* const pushed = data_->xfrc_applied + 6 * static_cast<std::ptrdiff_t>(object.body);
  for (std::size_t i = 0; i < 3; ++i) {
    pushed[i] += force[i];
    pushed[3 + i] += moment[i];
  }
  was_pushed_ = true;
}

template <class R>
void DirectSimulation<R>::set_object_mass(const std::string& name, double mass) {
  const ObjectAddress& object = simulator_.model().object(name);
  require(std::isfinite(mass) && mass > 0.0,
          "mass is " + detail::text_of(mass) + " kg, must be above 0");
  if (mass == model_->body_mass[object.body]) return;
  const double factor = mass / model_->body_mass[object.body];
  model_->body_mass[object.body] = mass;
  for (std::ptrdiff_t axis = 0; axis < 3; ++axis) {
    model_->body_inertia[3 * static_cast<std::ptrdiff_t>(object.body) + axis] *= factor;
  }
  update_constants();
}

template <class R>
void DirectSimulation<R>::set_object_margin(const std::string& name, double margin) {
  const ObjectAddress& object = simulator_.model().object(name);
  require_margin(margin);
  for (int geom = 0; geom < static_cast<int>(model_->ngeom); ++geom) {
    if (model_->geom_bodyid[geom] == object.body) model_->geom_margin[geom] = margin;
  }
  update_constants();
}

template <class R>
void DirectSimulation<R>::use_physics(const Physics& physics) {
  require_margin(physics.margin);
  require_friction(physics.link_friction, "link_friction");
  require_friction(physics.boundary_friction, "boundary_friction");
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const double lower = physics.stop_lower[i];
    const double upper = physics.stop_upper[i];
    require(std::isfinite(lower) && std::isfinite(upper) && lower < upper,
            "the stops of joint " + std::to_string(i) + " are " + detail::text_of(lower) + " and " +
                detail::text_of(upper) + " rad, the first must be below the second");
    model_->jnt_range[2 * i] = lower;
    model_->jnt_range[2 * i + 1] = upper;
  }
  const auto& surfaces = dynamic_cast<const RobotModel&>(simulator_.model()).surfaces();
  for (std::size_t geom = 0; geom < surfaces.size(); ++geom) {
    const auto decide = [&](double friction, int priority) {
      model_->geom_friction[3 * geom] = friction;
      model_->geom_priority[geom] = priority;
    };
    if (surfaces[geom] == Surface::kLink) decide(physics.link_friction, 2);
    if (surfaces[geom] == Surface::kBoundary) decide(physics.boundary_friction, 1);
    if (surfaces[geom] == Surface::kLink || surfaces[geom] == Surface::kTip) {
      model_->geom_margin[geom] = physics.margin;
    }
  }
  update_constants();
}

// This works with data of its own, so that the simulation goes on where it is.
template <class R>
void DirectSimulation<R>::update_constants() {
  const SceneModel::Data scratch = simulator_.model().make_data();
  mj_setConst(model_.get(), scratch.get());
}

template <class R>
ObjectPose DirectSimulation<R>::object_pose(const std::string& name) const {
  return simulator_.object_pose(simulator_.model().object(name), *data_);
}

template <class R>
ObjectVelocity DirectSimulation<R>::object_velocity(const std::string& name) const {
  return simulator_.object_velocity(simulator_.model().object(name), *data_);
}

template <class R>
void DirectSimulation<R>::continue_from(const DirectSimulation& other) {
  std::copy_n(other.data_->qpos, R::kJoints, data_->qpos);
  std::copy_n(other.data_->qvel, R::kJoints, data_->qvel);
  for (const ObjectAddress& object : simulator_.model().objects()) {
    for (const ObjectAddress& its : other.simulator_.model().objects()) {
      if (its.name != object.name) continue;
      std::copy_n(other.data_->qpos + its.position, 7, data_->qpos + object.position);
      std::copy_n(other.data_->qvel + its.velocity, 6, data_->qvel + object.velocity);
      set_object_mass(object.name, other.model_->body_mass[its.body]);
    }
  }
  state_.memory.torque = other.state_.memory.torque;
  state_.memory.tip_force = other.state_.memory.tip_force;
  observe();
}

template <class R>
std::span<const double> DirectSimulation<R>::configuration_position() const noexcept {
  return {data_->qpos, static_cast<std::size_t>(model_->nq)};
}

template <class R>
std::span<const double> DirectSimulation<R>::configuration_velocity() const noexcept {
  return {data_->qvel, static_cast<std::size_t>(model_->nv)};
}

template class DirectSimulation<TriFinger>;
template class DirectSimulation<Finger>;

}  // namespace trifinger::bindings
