# SPDX-License-Identifier: BSD-3-Clause
"""Pushes the cube with one finger, whose joints come from inverse kinematics."""

import sys

import numpy as np
import robot_fingers
import robot_properties_fingers
import trifinger_simulation
from trifinger_simulation.tasks import move_cube


class Pusher:
    def __init__(self, platform, kinematics):
        self.platform, self.kinematics = platform, kinematics
        t = platform.append_desired_action(platform.Action())
        self.position = platform.get_robot_observation(t).position
        self.t = t

    def go_to(self, finger, target, steps):
        joints, error = self.kinematics.inverse_kinematics_one_finger(
            finger, np.array(target), self.position, tolerance=0.002, max_iterations=3000
        )
        assert np.linalg.norm(error) < 0.01, error
        start = self.position
        for i in range(steps):
            wanted = start + (joints - start) * (i + 1) / steps
            self.t = self.platform.append_desired_action(self.platform.Action(position=wanted))
            self.platform.get_robot_observation(self.t)
        self.position = joints

    def cube(self):
        return self.platform.get_camera_observation(self.t).object_pose.position


def main():
    if sys.argv[1] == "real":
        platform = robot_fingers.TriFingerPlatformFrontend()
        base = robot_properties_fingers.get_urdf_base_path("pro")
        kinematics = robot_properties_fingers.Kinematics(
            str(base / "trifingerpro.urdf"),
            ["finger_tip_link_0", "finger_tip_link_120", "finger_tip_link_240"],
        )
    else:
        platform = trifinger_simulation.TriFingerPlatform()
        kinematics = platform.simfinger.kinematics
    pusher = Pusher(platform, kinematics)
    before = pusher.cube()
    half = move_cube._CUBE_WIDTH / 2
    # Behind the cube on finger 0's side, then through it.
    pusher.go_to(0, [0.0, half + 0.04, 0.08], 400)
    pusher.go_to(0, [0.0, half + 0.04, 0.03], 400)
    pusher.go_to(0, [0.0, half - 0.02, 0.03], 800)
    pusher.go_to(0, [0.0, half - 0.02, 0.03], 300)
    after = pusher.cube()
    print(f"pushed {after[1] - before[1]:.3f}")


if __name__ == "__main__":
    main()
