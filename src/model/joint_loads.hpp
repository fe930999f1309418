// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "trifinger/model/scene_model.hpp"

namespace trifinger::detail {

// What the motor of a driven joint feels, in units of the joint.
struct JointLoad {
  double inertia{0.0};         // where it begins [kgm^2], [kg]
  double weight{0.0};          // torque that holds it there [Nm], [N]
  double largest_weight{0.0};  // in any pose that was tried
  double damping{0.0};         // of the joint itself [Nms/rad], [Ns/m]
  double friction{0.0};        // dry [Nm], [N]
};

// Judges a robot in poses of its driven joints. It may have other rotors than the model.
class JointLoads {
 public:
  explicit JointLoads(const SceneModel& model);

  // Where driven joint `joint` is when a session begins.
  [[nodiscard]] double start(std::size_t joint) const noexcept;
  // Moves a driven joint and those that follow it. Returns the names and places of these.
  std::vector<std::pair<std::string, double>> begin_at(std::size_t joint, double position);
  // Gives all hinges and slides that this motor moves so much more inertia that the motor feels
  // `more`. Returns the names of these and the inertia of their rotors then [kgm^2], [kg].
  std::vector<std::pair<std::string, double>> add_rotor(std::size_t joint, double more);
  // `ranges` are where the joints may be; the poses that are tried lie in them.
  [[nodiscard]] std::vector<JointLoad> loads(
      const std::vector<std::pair<double, double>>& ranges) const;
  // Pairs of bodies that are deep inside each other in this pose, as a sentence has them: "a and
  // b". Only those of one robot count.
  [[nodiscard]] std::vector<std::string> overlaps() const;
  // The inertia alone.
  [[nodiscard]] std::vector<double> inertias() const;

 private:
  void add_resistance(std::size_t joint, JointLoad& load) const;
  // The forces on all degrees of freedom for a torque of 1.
  [[nodiscard]] std::vector<double> motor(std::size_t joint) const;

  const SceneModel& model_;
  SceneModel::Compiled changed_;
  SceneModel::Data data_;  // the pose
  SceneModel::Data scratch_;
};

}  // namespace trifinger::detail
