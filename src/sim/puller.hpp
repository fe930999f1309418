// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "trifinger/model/scene_model.hpp"
#include "trifinger/realtime/annotations.hpp"
#include "trifinger/sim/hand.hpp"

namespace trifinger::detail {

// Moves the physics while a hand pulls. It has its own memory, so it allocates nothing then.
class Puller {
 public:
  explicit Puller(const SceneModel& model);

  [[nodiscard]] std::int64_t num_bodies() const noexcept { return std::ssize(bodies_); }

  // Takes a valid pull at one of the bodies of `pullable_bodies`.
  void set(std::int64_t body, const Pull& pull) noexcept TRIFINGER_REALTIME;

  // Does this number of steps of the physics, each with the force that belongs to its beginning. No
  // force is left in `data` afterwards.
  void step(const mjModel_& model, mjData_& data, int steps) noexcept TRIFINGER_REALTIME;

  // The mean force in the world frame since the last `set` [N]; zero if there was no step.
  [[nodiscard]] const std::array<double, 3>& force() const noexcept { return force_; }

 private:
  struct Body {
    int index;                     // in MuJoCo's model
    std::array<double, 3> centre;  // in the frame of this body [m]
  };

  std::vector<Body> bodies_;
  std::vector<double> jacobian_;  // of the point, three rows
  std::vector<double> solved_;    // inverse mass matrix times these rows
  const Body* body_{nullptr};
  Pull pull_{};
  std::array<double, 3> force_{};
};

}  // namespace trifinger::detail
