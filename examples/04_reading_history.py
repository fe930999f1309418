# SPDX-License-Identifier: BSD-3-Clause
"""The series keep which action was desired, which was applied, and why they differ."""

import sys

import trifinger

# The history is short here, to show what happens at its end. The default is 16384 steps.
robot = (
    trifinger.connect(sys.argv[1])  # a robot of this name, if this program is given one
    if sys.argv[1:]
    else trifinger.simulate("sim", {"backend.history": 256})
)

good = robot.new_action(position=robot.latest_observation().position)
strong = good.copy()
strong.torque[2] = 5.0  # more than the motor can deliver
wrong = good.copy()
wrong.position_kp[0] = 1e6  # no gain that the robot accepts: joint 0 keeps its last target instead
for action in [good] * 300 + [strong] * 5 + [wrong, good]:
    last = robot.append_desired_action(action)
robot.finish()

# One call reads a range of steps into one array.
first = last - 99
applied = robot.get_applied_actions(first, last + 1)
statuses = robot.get_statuses(first, last + 1)

# Every joint of an applied action has the reasons why it differs from the desired one.
counts = {reason: int((applied["reasons"] & reason.value > 0).sum()) for reason in trifinger.Reason}
for reason, count in counts.items():
    if count > 0:
        print(f"{reason.name}: {count}")

rejected = (statuses["flags"] & trifinger.Status.ACTION_REJECTED).nonzero()[0]
for i in rejected:
    reasons = trifinger.Reason(int(applied["reasons"][i, 0]))
    names = ", ".join(reason.name for reason in reasons)
    print(f"the action of step {first + i} was rejected: {names}")

# Reading steps that were overwritten raises an exception.
oldest = 0
try:
    robot.get_observation(0)
except trifinger.HistoryLost as error:
    oldest = error.oldest
    print(error)

assert len(rejected) == 1
assert counts[trifinger.Reason.KP_OUT_OF_BOUNDS] == 1
assert counts[trifinger.Reason.TORQUE_CLIPPED] >= 5
assert oldest > 0 or sys.argv[1:]  # a robot with its usual history still has all steps
