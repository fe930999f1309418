// SPDX-License-Identifier: BSD-3-Clause
#include "sim/servo_plant.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger {

std::function<void(std::span<const double>, std::span<double>)> weight_of(
    std::shared_ptr<const SceneModel> model) {
  // A function can be copied, so what it owns is shared.
  const auto data = std::make_shared<SceneModel::Data>(model->make_data());
  model->reset(**data);
  return
      [model = std::move(model), data](std::span<const double> position, std::span<double> torque) {
        for (std::size_t i = 0; i < position.size(); ++i)
          model->set_position(i, position[i], **data);
        model->compute_weight(*model->mujoco(), **data, torque);
      };
}

ServoPlant::ServoPlant(SimulationOptions options, const servos::ServoConfig& servos)
    : simulator_(std::move(options)),
      servos_(servos.robot.motors),
      data_(model().make_data()),
      step_(std::chrono::round<Nanoseconds>(
          std::chrono::duration<double>(model().mujoco()->opt.timestep))) {
  detail::require(servos_.size() == model().joints().size(),
                  "a plant must have one motor for each joint");
  servos_.insert(servos_.end(), servos.robot.sensors.begin(), servos.robot.sensors.end());
  for (const std::string& name : servos.sensor_names) {
    const auto found = std::ranges::find(model().model_joints(), name, &ModelJoint::name);
    detail::require(found != model().model_joints().end(),
                    "the model has no joint '" + name + "', which a sensor measures");
    sensed_.push_back(static_cast<std::size_t>(found - model().model_joints().begin()));
  }
  reset();
}

ServoPlant::~ServoPlant() = default;

double ServoPlant::position(std::size_t motor) const noexcept {
  const std::size_t driven = model().joints().size();
  return servos_[motor].motor_position(
      motor < driven ? model().position(motor, *data_)
                     : model().model_position(sensed_[motor - driven], *data_));
}

double ServoPlant::velocity(std::size_t motor) const noexcept {
  const std::size_t driven = model().joints().size();
  const double joint = motor < driven ? model().velocity(motor, *data_)
                                      : model().model_velocity(sensed_[motor - driven], *data_);
  return servos_[motor].direction * servos_[motor].ratio * joint;
}

void ServoPlant::step(std::span<const double> torque, Nanoseconds duration) noexcept {
  if (has_diverged_) return;
  for (std::size_t i = 0; i < model().joints().size(); ++i) {
    model().set_torque(i, servos_[i].joint_torque(torque[i]), *data_);
  }
  for (rest_ += duration; rest_ >= step_ && !has_diverged_; rest_ -= step_) {
    mj_step(model().mujoco(), data_.get());
    has_diverged_ = !SceneModel::is_finite(*model().mujoco(), *data_);
  }
}

void ServoPlant::set_position(std::size_t joint, double position) noexcept {
  model().set_position(joint, position, *data_);
  std::fill_n(data_->qvel, model().mujoco()->nv, 0.0);
}

void ServoPlant::reset() noexcept {
  simulator_.put_at_start(*data_);
  rest_ = Nanoseconds::zero();
  has_diverged_ = false;
}

}  // namespace trifinger
