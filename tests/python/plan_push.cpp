// SPDX-License-Identifier: BSD-3-Clause
// Prints what the planner finds for a push of the cube, for test_planning.py: three plans on one
// line each, the cost and then all knots. `plan_push METHOD COMMAND SPLINE` has the numbers of
// enumerators.
#include <cstdlib>
#include <iostream>
#include <string>
#include <utility>

#include "trifinger/control/predictive_planner.hpp"

using namespace trifinger::control;

int main(int argument_count, char** arguments) {
  if (argument_count != 4) return EXIT_FAILURE;
  const PlannerOptions options{.method = static_cast<PlanningMethod>(std::stoi(arguments[1])),
                               .samples = 10,
                               .rounds = 2,
                               .horizon = Seconds(0.12),
                               .spline = static_cast<SplineKind>(std::stoi(arguments[3])),
                               .command = static_cast<PlannedCommand>(std::stoi(arguments[2])),
                               .num_threads = 1,
                               .seed = 7};
  PlanningModel model({});
  PlanningState start = model.initial_state();
  start.velocity[1] = 0.3;
  const Pose goal{{0.03, 0.02, 0.0325}, Eigen::Quaterniond::Identity()};
  const PlanningTask task{
      .terms = {{.kind = CostKind::kObjectPosition, .weight = 10, .end_weight = 1, .goal = goal},
                {.kind = CostKind::kTipObject, .weight = 2, .distance = 0.046},
                {.kind = CostKind::kJointVelocity, .weight = 0.01, .shape = CostShape::kSquare}},
      .late_factor = 3};
  PredictivePlanner planner(std::move(model), task, options);
  for (int i = 0; i < 3; ++i) {
    const Plan& plan = planner.plan(start);
    std::cout << std::hexfloat << plan.cost;
    for (const double value : plan.commands.values()) std::cout << ' ' << value;
    std::cout << '\n';
    start.time += Seconds(0.02);
  }
  return EXIT_SUCCESS;
}
