# SPDX-License-Identifier: BSD-3-Clause
"""An evaluation script: the goal comes from a file, the run is stored or recorded."""

import json
import sys

import robot_fingers
from trifinger_simulation import TriFingerPlatform
from trifinger_simulation.tasks import move_cube


def main():
    where, goal_file, output = sys.argv[1:4]
    config = json.loads(move_cube.json_goal_from_config(goal_file))
    difficulty = config["difficulty"]
    goal = move_cube.Pose.from_dict(config["goal"])
    if where == "real":
        platform = robot_fingers.TriFingerPlatformWithObjectFrontend()
    else:
        platform = TriFingerPlatform(initial_object_pose=move_cube.Pose([0, 0, 0.0325]))
    length = 200
    action = platform.Action(position=[0, 0.9, -1.7] * 3)
    accumulated = 0.0
    t = -1
    while t < length - 1:
        t = platform.append_desired_action(action)
        pose = platform.get_camera_observation(t).filtered_object_pose
        accumulated -= move_cube.evaluate_state(goal, pose, difficulty)
    if where != "real":
        platform.store_action_log(output)
    print(json.dumps({"difficulty": difficulty, "reward": round(accumulated, 3)}))


if __name__ == "__main__":
    main()
