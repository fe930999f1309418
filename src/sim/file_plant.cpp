// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/file_plant.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <utility>

#include "file_robot_parts.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {

std::function<void(std::span<const double>, std::span<double>)> weight_of(
    const FileRobotOptions& options) {
  const std::shared_ptr<const ModelFile> model = options.model;
  // A function can be copied, so what it owns is shared.
  const auto data = std::make_shared<RobotModel::Data>(model->make_data());
  options.put_at_start(**data);
  return [model, data](std::span<const double> position, std::span<double> torque) {
    mjData& simulation = **data;
    for (std::size_t i = 0; i < position.size(); ++i) {
      model->set_position(i, position[i], simulation);
    }
    detail::compute_weight(*model, simulation, torque);
  };
}

FilePlant::FilePlant(FileRobotOptions options, const servos::ServoConfig& servos)
    : options_((options.validate(), std::move(options))),
      servos_(servos.robot.motors),
      data_(model().make_data()),
      step_(model().period() / model().substeps()) {
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

FilePlant::~FilePlant() = default;

double FilePlant::position(std::size_t motor) const noexcept {
  const std::size_t driven = model().joints().size();
  return servos_[motor].motor_position(
      motor < driven ? model().position(motor, *data_)
                     : model().model_position(sensed_[motor - driven], *data_));
}

double FilePlant::velocity(std::size_t motor) const noexcept {
  const std::size_t driven = model().joints().size();
  const double joint = motor < driven ? model().velocity(motor, *data_)
                                      : model().model_velocity(sensed_[motor - driven], *data_);
  return servos_[motor].direction * servos_[motor].ratio * joint;
}

void FilePlant::step(std::span<const double> torque, Nanoseconds duration) noexcept {
  if (has_diverged_) return;
  for (std::size_t i = 0; i < model().joints().size(); ++i) {
    model().set_torque(i, servos_[i].joint_torque(torque[i]), *data_);
  }
  for (rest_ += duration; rest_ >= step_ && !has_diverged_; rest_ -= step_) {
    mj_step(model().mujoco(), data_.get());
    has_diverged_ = !detail::is_finite(*model().mujoco(), *data_);
  }
}

void FilePlant::set_position(std::size_t joint, double position) noexcept {
  model().set_position(joint, position, *data_);
  std::fill_n(data_->qvel, model().mujoco()->nv, 0.0);
}

void FilePlant::reset() noexcept {
  options_.put_at_start(*data_);
  rest_ = Nanoseconds::zero();
  has_diverged_ = false;
}

}  // namespace trifinger
