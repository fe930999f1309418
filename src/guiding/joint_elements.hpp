// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "trifinger/core/session.hpp"
#include "trifinger/guiding/guide_controller.hpp"

namespace trifinger::guiding::detail {

// One action and one observation of a session, and where the numbers of the joints are in them: the
// session describes its elements. Only the constructor allocates memory or throws.
class JointElements {
 public:
  // Throws InvalidArgument if its robot has no joints that torques and positions drive.
  explicit JointElements(const Session& session);

  [[nodiscard]] std::size_t num_joints() const noexcept { return joints_; }
  // Where an observation can be read to.
  [[nodiscard]] void* observation() noexcept { return observation_.data(); }
  // The joints in this observation.
  [[nodiscard]] const MeasuredJoints& measured() noexcept;
  // An action with this command; its other fields are as in the default action.
  [[nodiscard]] const void* action(const GuideCommand& command) noexcept;

 private:
  std::vector<std::byte> action_;
  std::vector<std::byte> observation_;
  std::size_t joints_{0};
  // Places in the elements [bytes].
  std::size_t measured_position_{0}, measured_velocity_{0}, measured_all_{0};
  std::size_t torque_{0}, position_{0};
  std::vector<double> all_;  // Positions of all hinges and slides, if they are measured.
  MeasuredJoints measured_;
};

}  // namespace trifinger::guiding::detail
