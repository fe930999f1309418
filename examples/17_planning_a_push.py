# SPDX-License-Identifier: BSD-3-Clause
"""Plans a push of the cube by trying many in simulations, and then carries it out.

Nobody says which finger pushes, or where: only what is wanted. From the same start, a new plan with
predictive sampling never costs more than the one before.
"""

import itertools
import sys

import numpy as np
import trifinger
from trifinger import control
from trifinger.control import CostKind, CostShape, CostTerm

AWAY = np.array([0.03, 0.02, 0])  # [m]
HORIZON = 1.0  # [s]
PLANS = 30

robot = trifinger.connect(sys.argv[1]) if sys.argv[1:] else trifinger.simulate()
poses = robot.companion("object")
t = robot.append_desired_action(robot.new_action(position=robot.latest_observation().position))
y = robot.get_observation(t)
seen = poses.get_latest_at(t).cube

model = control.PlanningModel()
cube = model.object("cube")
rest = control.Pose(seen.position, seen.orientation)
start = model.initial_state()
model.set_joints(y.position, y.velocity, start)
model.set_object(cube, rest, control.Twist(), start)

goal = control.Pose(rest.position + AWAY, rest.orientation)
task = control.PlanningTask(
    [
        CostTerm(kind=CostKind.OBJECT_POSITION, weight=10, end_weight=5, goal=goal),
        CostTerm(kind=CostKind.OBJECT_VELOCITY, weight=10, shape=CostShape.SQUARE),
        CostTerm(kind=CostKind.TIP_OBJECT, weight=2, distance=0.046),
    ]
)
options = control.PlannerOptions(
    method=control.PlanningMethod.PREDICTIVE_SAMPLING, horizon=HORIZON, knots=6, seed=1
)
planner = control.PredictivePlanner(model, task, options)
plans = [planner.plan(start) for _ in range(PLANS)]
costs = [plans[0].previous_cost, *(plan.cost for plan in plans)]
print("costs of the plans:", " ".join(f"{cost:.3f}" for cost in costs[::5]))
assert all(after <= before for before, after in itertools.pairwise(costs))
assert costs[-1] < 0.8 * costs[0]

best = plans[-1]
for i in range(int(1000 * HORIZON)):
    target, _ = best.commands.at(i * 1e-3)
    t = robot.append_desired_action(
        robot.new_action(position=target, position_kp=options.kp, position_kd=options.kd)
    )
robot.wait_until_time_index(t)


def moved(position: np.ndarray) -> float:
    """Returns how far the cube is on its way [m]."""
    return float((position - rest.position) @ AWAY / np.linalg.norm(AWAY))


planned = moved(model.object_pose(cube, best.states.positions[-1]).position)
done = moved(poses.get_latest_at(t).cube.position)
print(f"the plan moves the cube by {1e3 * planned:.0f} mm, the robot by {1e3 * done:.0f} mm")
assert done > 0.015
