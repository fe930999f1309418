// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "trifinger/model/robot_model.hpp"
#include "trifinger/sim/object_observation.hpp"

struct mjData_;

namespace trifinger::sim {

// The scene in motion: MuJoCo's data, with the few things that a robot asks of it. Allocates when
// it is made, never later.
class Physics {
 public:
  Physics(const RobotDescription& description, int substeps);
  Physics(const Physics&) = delete;
  Physics& operator=(const Physics&) = delete;
  ~Physics() = default;

  [[nodiscard]] const RobotModel& model() const noexcept { return model_; }

  // The initial pose of everything, at rest.
  void reset() noexcept;
  void set_joint(int joint, double position) noexcept;
  [[nodiscard]] double position(int joint) const noexcept;
  [[nodiscard]] double velocity(int joint) const noexcept;

  // Applies joint torques [Nm] for one step. False if the state is no longer finite.
  [[nodiscard]] bool step(std::span<const double> torque) noexcept;
  // Normal force on the tip of one finger in the last step [N].
  [[nodiscard]] double tip_force(int finger) const noexcept {
    return tip_forces_[static_cast<std::size_t>(finger)];
  }
  // Torques that hold the joints where they are, at rest [Nm].
  void gravity_torques(std::span<double> torque) noexcept;

  [[nodiscard]] ObjectPose object_pose(const ObjectAddress& object) const noexcept;
  void place_object(const ObjectAddress& object, const ObjectPose& pose) noexcept;
  // What acts on the object's centre in every step from now on [N].
  void push_object(const ObjectAddress& object, const std::array<double, 3>& force) noexcept;

  // The state from which MuJoCo goes on bit for bit: mjSTATE_INTEGRATION, since mjSTATE_FULLPHYSICS
  // lacks the warm start of the solver.
  [[nodiscard]] std::size_t state_size() const noexcept { return state_size_; }
  void get_state(std::span<double> state) const noexcept;
  // Likewise, of the instant before the last step.
  void get_state_before_step(std::span<double> state) noexcept;
  void set_state(std::span<const double> state) noexcept;
  // The compiled model as MuJoCo stores it: what tells one model from another.
  [[nodiscard]] std::vector<std::byte> model_bytes() const;
  // qpos, then qvel.
  [[nodiscard]] std::vector<double> configuration() const;

 private:
  struct Delete {
    void operator()(mjData_* data) const noexcept;
  };

  [[nodiscard]] bool is_finite() const noexcept;
  void measure_tip_forces() noexcept;

  RobotModel model_;
  int substeps_;
  std::unique_ptr<mjData_, Delete> data_;
  std::size_t state_size_;
  std::vector<double> before_step_;  // what a step changes; the rest of the state stays as it is
  std::vector<double> after_step_;   // likewise
  std::vector<double> tip_forces_;
  std::vector<double> bias_;
};

}  // namespace trifinger::sim
