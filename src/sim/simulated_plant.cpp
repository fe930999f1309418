// SPDX-License-Identifier: BSD-3-Clause
#include "sim/simulated_plant.hpp"

#include <mujoco/mujoco.h>

#include <utility>

#include "sim/scene_observation.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

// Boards live in milliseconds, whatever the period of the robot.
SimulationOptions in_milliseconds(SimulationOptions options) {
  const TimeIndex steps = options.period / kPhysicsStep;
  options.object_period *= steps;
  options.object_delay *= steps;
  options.period = kPhysicsStep;
  if (options.file != nullptr && steps != 1) {
    ModelFileOptions model = options.file->options();
    model.period = kPhysicsStep;
    options.file = std::make_shared<const ModelFile>(std::move(model));
  }
  return options;
}

ElementDescription element_of(const SceneModel& model) {
  const auto companion = object_companion(model);
  detail::require(companion.has_value(), "there are no objects to track");
  return companion->element;
}

}  // namespace

SimulatedPlant::SimulatedPlant(SimulationOptions options)
    : simulator_(in_milliseconds(std::move(options))),
      data_(simulator_.model().make_data()),
      state_(simulator_.make_state()) {
  simulator_.reset(simulator_.initial_position(), Random{.seed = simulator_.options().seed}, *data_,
                   state_);
  simulator_.observe(*data_, state_);
  for (const ObjectAddress& object : simulator_.model().objects()) {
    initial_poses_.push_back(simulator_.object_pose(object, *data_));
  }
}

const Simulator::Capture* SimulatedPlant::receive_poses() noexcept {
  if (initial_poses_.empty()) return nullptr;
  return simulator_.receive_poses(step_count(), *data_, state_);
}

ObjectPose SimulatedPlant::object_pose(const std::string& name) const {
  return simulator_.object_pose(simulator_.model().object(name), *data_);
}

void SimulatedPlant::reset_objects() noexcept {
  for (std::size_t i = 0; i < initial_poses_.size(); ++i) {
    simulator_.place(simulator_.model().objects()[i], initial_poses_[i], *data_, state_);
  }
}

void SimulatedPlant::step(std::span<const double> torque) noexcept {
  if (has_diverged_) return;
  has_diverged_ =
      !simulator_.move(PerJoint<double>(torque), *simulator_.model().mujoco(), *data_, state_);
  if (!has_diverged_) simulator_.observe(*data_, state_);
}

SimulatedTracker::SimulatedTracker(const std::string& robot, SimulatedPlant& plant)
    : plant_(plant),
      element_(element_of(plant.model()).size()),
      times_(static_cast<std::size_t>(plant.options().object_delay) + 1),
      writer_(robot, kObjectCompanion, element_of(plant.model())) {}

void SimulatedTracker::tick(Instant now) noexcept {
  const auto time_of = [this](TimeIndex step) -> Instant& {
    return times_[static_cast<std::size_t>(step) % times_.size()];
  };
  time_of(plant_.step_count()) = now;
  const auto* const received = plant_.receive_poses();
  if (received == nullptr) return;
  write_objects({}, received->objects, element_.data());
  writer_.write(time_of(received->capture_index), element_.data());
}

std::span<const double> SimulatedPlant::configuration_position() const noexcept {
  return {data_->qpos, static_cast<std::size_t>(simulator_.model().mujoco()->nq)};
}

std::span<const double> SimulatedPlant::configuration_velocity() const noexcept {
  return {data_->qvel, static_cast<std::size_t>(simulator_.model().mujoco()->nv)};
}

SimulatedScene::SimulatedScene(const std::string& robot, const SimulatedPlant& plant,
                               Nanoseconds period)
    : plant_(plant),
      period_(period / kPhysicsStep),
      element_(scene_companion(plant.model()).element.size()),
      writer_(robot, kSceneCompanion, scene_companion(plant.model()).element) {
  detail::require(period_ >= 1, "the period of a scene must be at least a millisecond");
}

void SimulatedScene::tick(Instant now) noexcept {
  if (plant_.step_count() < next_) return;
  next_ = plant_.step_count() + period_;
  write_scene({}, plant_.configuration_position(), plant_.configuration_velocity(),
              element_.data());
  writer_.write(now, element_.data());
}

}  // namespace trifinger
