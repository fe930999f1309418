# SPDX-License-Identifier: BSD-3-Clause
"""Reads a run: the reward from the poses in the log, and the brightness of the images."""

import json
import pathlib
import sys

import numpy as np
import robot_fingers
from trifinger_cameras.utils import convert_image
from trifinger_simulation.tasks import move_cube


def main():
    folder = pathlib.Path(sys.argv[1])
    goal = json.loads((folder / "goal.json").read_text())
    log = robot_fingers.TriFingerPlatformWithObjectLog(
        str(folder / "robot_data.dat"), str(folder / "camera_data.dat")
    )
    reward, brightness, seen = 0.0, [], 0
    for t in range(log.get_first_timeindex(), log.get_last_timeindex() + 1):
        try:
            camera_observation = log.get_camera_observation(t)
        except IndexError:
            continue
        seen += 1
        pose = camera_observation.filtered_object_pose
        reward -= move_cube.evaluate_state(goal["goal"], pose, goal["difficulty"])
    image = convert_image(camera_observation.cameras[0].image, format="bgr")
    brightness.append(float(np.mean(image)))
    duration = log.get_timestamp_ms(log.get_last_timeindex()) - log.get_timestamp_ms(
        log.get_first_timeindex()
    )
    print(f"{seen} steps {reward / seen:.4f} {image.shape} {duration > 0} {brightness[0] > 10}")


if __name__ == "__main__":
    main()
