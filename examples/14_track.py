# SPDX-License-Identifier: BSD-3-Clause
"""Finds the cube in the images of three cameras, as `trifinger track` does.

Compares with where the simulation has put it.
"""

import numpy as np
import trifinger
from trifinger.cameras import Cameras
from trifinger.tracking import Tracker, tracked_object

simulation = trifinger.Simulation("sim_cameras", {"cameras.rate": 20})
# A cube in a corner of the arena, turned about the vertical.
truth = np.array([0.05, 0.06, 0.0325])
simulation.place_object("cube", truth, [np.cos(0.3), 0.0, 0.0, np.sin(0.3)])
robot = simulation.connect()
cameras = Cameras(robot)
# The colours of its faces and their sizes come from the scene.
tracker = Tracker(cameras.calibration, tracked_object("sim_cameras"))

hold = robot.new_action(position=robot.latest_observation().position)
t = robot.append_desired_action(hold)
while t < 100:
    t = robot.append_desired_action(hold)
robot.wait_until_time_index(t)
images = cameras.get_latest_at(t)

found = tracker.track([images.raw(name) for name in images.names])
assert found.is_sure
distance = np.linalg.norm(found.position - truth)
print(f"the cube is at {found.position} m, {1e3 * distance:.2f} mm from the truth", end="")
print(f", by {found.cameras} cameras")
assert distance < 3e-3
