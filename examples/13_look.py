# SPDX-License-Identifier: BSD-3-Clause
"""Three cameras look at the robot.

Like poses of objects, images have their own rate and delay: `get_latest_at(t)` returns those that
had arrived at step t. `images["camera60"]` is RGB, height x width x 3.
"""

import sys

import trifinger
from trifinger.cameras import Cameras

if sys.argv[1:]:
    robot = trifinger.connect(sys.argv[1])  # a robot of this name, with cameras
else:
    # Simulated cameras at 20 Hz, whose images are 20 ms old when they arrive.
    robot = trifinger.simulate("sim_cameras", {"cameras.rate": 20, "cameras.delay": 0.02})
cameras = Cameras(robot)

seen = 0
hold = robot.new_action(position=robot.latest_observation().position)
t = robot.append_desired_action(hold)
while t < 300:
    robot.wait_until_time_index(t)
    images = cameras.get_latest_at(t)  # None if none had arrived
    if t % 100 == 0 and images is not None:
        for name in images.names:
            red, green, blue = images[name].mean(axis=(0, 1))
            step = images.element["stamp"]["capture_index"]
            print(f"step {t}: {name} saw at step {step} a mean colour of", end=" ")
            print(f"{red:.1f} {green:.1f} {blue:.1f}")
            seen += 1
    t = robot.append_desired_action(hold)

assert seen > 0
