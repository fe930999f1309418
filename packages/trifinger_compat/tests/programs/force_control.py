# SPDX-License-Identifier: BSD-3-Clause
"""A state machine that holds the tips where they are told by forces, through the Jacobian."""

import sys

import numpy as np
import robot_fingers
import robot_interfaces
import trifinger_simulation

TIPS = {
    "above": np.array([[0.0, 0.09, 0.09], [0.078, -0.045, 0.09], [-0.078, -0.045, 0.09]]),
    "aside": np.array([[0.0, 0.07, 0.05], [0.061, -0.035, 0.05], [-0.061, -0.035, 0.05]]),
    "away": np.array([[0.0, 0.11, 0.10], [0.095, -0.055, 0.10], [-0.095, -0.055, 0.10]]),
}


class StateMachine:
    states = ("above", "aside", "away")

    def __init__(self, platform, kinematics):
        self.platform, self.kinematics = platform, kinematics
        self.torque_limit = trifinger_simulation.trifingerpro_limits.robot_torque.high
        self.integral = np.zeros((3, 3))

    def torques(self, observation, target):
        tips = np.array(self.kinematics.forward_kinematics(observation.position))
        error = target - tips
        self.integral = np.clip(self.integral + 0.001 * error, -0.02, 0.02)
        torque = np.zeros(9)
        for finger in range(3):
            jacobian = self.kinematics.compute_jacobian(finger, observation.position)[:3]
            speed = jacobian @ observation.velocity
            force = 120 * error[finger] - 2 * speed + 600 * self.integral[finger]
            torque += jacobian.T @ (force + np.array([0, 0, 1.9]))
        return np.clip(torque, -self.torque_limit, self.torque_limit), np.abs(error).max()

    def run(self):
        t = self.platform.append_desired_action(robot_interfaces.trifinger.Action())
        for state in self.states:
            self.integral[:] = 0
            start = None
            for step in range(2000):
                observation = self.platform.get_robot_observation(t)
                if start is None:
                    start = np.array(self.kinematics.forward_kinematics(observation.position))
                share = min(1.0, step / 1000)
                target = start + share * (TIPS[state] - start)
                torque, error = self.torques(observation, target)
                action = robot_interfaces.trifinger.Action(torque=torque)
                t = self.platform.append_desired_action(action)
            print(f"{state} {error:.3f}")


def main():
    simulation = trifinger_simulation.TriFingerPlatform()
    kinematics = simulation.simfinger.kinematics
    platform = simulation
    if sys.argv[1] == "real":
        platform = robot_fingers.TriFingerPlatformFrontend()
    StateMachine(platform, kinematics).run()


if __name__ == "__main__":
    main()
