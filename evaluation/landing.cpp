// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/landing.hpp"

#include <algorithm>
#include <cmath>

#include "trifinger/control/impedance.hpp"

namespace trifinger::evaluation {

double landing(const Eigen::Vector3d& position, const Eigen::Vector3d& velocity, double radius,
               double depth) noexcept {
  const double g = -control::gravity().z();
  const double drop = position.z() - radius + depth;
  const double root = std::sqrt(std::max(velocity.z() * velocity.z() + 2.0 * g * drop, 0.0));
  const double time = (velocity.z() + root) / g;
  return (position + time * velocity).head<2>().norm();
}

}  // namespace trifinger::evaluation
