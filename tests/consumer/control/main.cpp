// SPDX-License-Identifier: BSD-3-Clause
// Computes how three tips hold a cube of 94 g.
#include <cstdio>

#include "trifinger/control/force_optimizer.hpp"
#include "trifinger/control/impedance.hpp"

int main() {
  using namespace trifinger::control;
  const RigidBody body = rigid_body(trifinger::cube());
  const Motion rest;
  const Wrench wrench = object_impedance(rest, rest.pose, rest.twist, body);
  const Grasp grasp{Contact{.position = {0.0325, 0, 0}, .normal = {-1, 0, 0}},
                    Contact{.position = {-0.0325, 0, 0}, .normal = {1, 0, 0}},
                    Contact{.position = {0, 0.0325, 0}, .normal = {0, -1, 0}}};
  ForceOptimizer optimizer;
  const ForceDistribution found = optimizer.solve(grasp, rest.pose.position, wrench);
  if (!found) return 1;
  std::printf("each of two tips presses with %.2f N\n", found.forces[3]);
}
