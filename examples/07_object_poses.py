# SPDX-License-Identifier: BSD-3-Clause
"""Object poses have their own rate and delay.

`get_latest_at(t)` returns the pose that was known at step t. A program that uses it computes the
same results, whenever its processes happen to run.
"""

import sys

import trifinger

if sys.argv[1:]:
    robot = trifinger.connect(sys.argv[1])  # a robot of this name, with a cube on its table
else:
    # The poses are like those of a camera at 100 Hz that needs 25 ms to see the object.
    simulation = trifinger.Simulation(
        "sim", {"simulation.object_period": 0.01, "simulation.object_delay": 0.025}
    )
    simulation.place_object("cube", [0.0, 0.0, 0.1])  # it will fall
    robot = simulation.connect()
poses = robot.companion("object")

hold = robot.new_action(position=robot.latest_observation().position)
t = robot.append_desired_action(hold)
while t < 400:
    robot.wait_until_time_index(t)
    pose = poses.get_latest_at(t)  # None if no pose had arrived
    if t >= 100 and t % 100 == 0:
        height = pose.cube.position[2]
        print(f"step {t}: at step {pose.stamp.capture_index} the cube was {height:.4f} m high")
    # The pose from before step 0 is known from the beginning. All others arrive some time after
    # their capture, here 25 steps.
    assert t < 25 or sys.argv[1:] or pose.stamp.capture_index <= t - 25
    assert pose.stamp.capture_index <= pose.stamp.arrival_index <= t
    t = robot.append_desired_action(hold)

assert 0.030 < pose.cube.position[2] < 0.034
