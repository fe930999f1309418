# SPDX-License-Identifier: BSD-3-Clause
"""A program of 2020 to 2022, which uses Gym."""

import gym
import numpy as np
import trifinger_simulation

platform = trifinger_simulation.TriFingerPlatform()
spaces = platform.spaces
space = gym.spaces.Dict({"torque": spaces.robot_torque.gym, "position": spaces.robot_position.gym})
assert isinstance(spaces.robot_torque.gym, gym.spaces.Box)
assert space["torque"].contains(np.zeros(9))
name = "trifinger_simulation.gym_wrapper:reach-v0"
env = gym.make(name).unwrapped
assert isinstance(env, gym.Env)
env.reset()
env.step(np.zeros(9))
assert name.split(":")[1] in gym.envs.registration.registry
print("worked with", gym.__version__)
