# SPDX-License-Identifier: BSD-3-Clause
"""Demonstrations of pushes, by a program that takes over a robot as a person does.

`python evaluation/push_demonstrations.py ROBOT FOLDER` lets it push the cube of a running robot to
20 goals with one tip at a time, and records logs for `trifinger learn push --from FOLDER`.
"""

import argparse
import contextlib
import json
import signal
import subprocess
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import trifinger
from trifinger import policy_file
from trifinger.arrays import Array
from trifinger.commands.program import path as program
from trifinger.environments import Environment, policy_metadata
from trifinger.training import Plan
from trifinger.training.experience import LiveExperience, digest_of

HALF, TIP = 0.0325, 0.009  # of the cube's edge, radius of a tip [m]
LOW = 0.03  # height at which a tip pushes [m]
AROUND = 0.075  # from the cube's middle, on the way around it [m]
CLEAR = 0.014  # from the cube, before a push [m]
AHEAD = 0.022  # of a desired tip before the measured one [m]
THERE = 0.006  # from the goal [m]
SAG = np.tile([0.004, 0.019, 0.0], 3)  # by which gravity bends a finger at the default gains [rad]
REST = np.tile([0.0, 1.15, -1.1], 3)  # [rad]
RANGE = np.deg2rad([[-70.0, 0.0, -160.0], [57.0, 70.0, -2.0]])  # of a finger's joints
WEIGHT = np.array([1.0, 1.0, 0.5])  # of x, y and z, where a point is out of reach
CHUNK = 10  # steps that are appended at once
PATIENCE = 60.0  # s


class Demonstrator:
    """Chooses a finger, leads its tip around the cube to where it can push it, and pushes."""

    def __init__(self) -> None:
        self._kinematics = trifinger.Kinematics("trifinger_edu")
        self._home = self._kinematics.tip_positions(REST)
        self._finger: int | None = None
        self._is_pushing = self._is_there = False

    def __call__(self, seen: dict[str, Array]) -> Array:
        """Desired joint positions [rad] for the entries of an observation."""
        joints, tips = seen["joint_position"], seen["tip_position"].reshape(3, 3)
        cube, offset = seen["object_position"][:2], seen["goal"][:2] - seen["object_position"][:2]
        distance = float(np.linalg.norm(offset))
        points = [way(tips[i, :2], self._home[i, :2], cube) for i in range(3)]
        heights = self._home[:, 2].copy()
        self._is_there = distance < (2 * THERE if self._is_there else THERE)
        if self._is_there:
            self._is_pushing = False
            for i in range(3):  # a little away from the cube, and no further
                back = tips[i, :2] - cube
                radius = float(np.linalg.norm(back))
                points[i] = tips[i, :2] + back / radius * (0.006 if radius < 0.052 else 0.0)
        else:
            w, x, y, z = seen["object_orientation"]
            yaw = float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
            i, point = self._push(tips, cube, yaw, offset / distance, distance)
            points[i], heights[i] = point, LOW
        wanted = [self._inverse(i, np.append(points[i], heights[i]), joints)[0] for i in range(3)]
        return np.asarray(np.concatenate(wanted) + SAG)

    def action(self, seen: dict[str, Array], change: float) -> Array:
        """The same as an action "relative_position" with this `position_change` [rad].

        Each finger moves in the desired direction, as far as an action can.
        """
        away = (self(seen) - seen["joint_position"]).reshape(3, 3) / change
        return np.ravel(away / np.maximum(1.0, np.abs(away).max(axis=1, keepdims=True)))

    # The finger that pushes, and where its tip shall go.
    def _push(
        self, tips: Array, cube: Array, yaw: float, towards: Array, distance: float
    ) -> tuple[int, Array]:
        depth = (HALF + TIP) / float(np.abs(turned(towards, -yaw)).max())
        if self._finger is None or not self._is_pushing:
            self._finger = self._nearest(cube, towards, depth)
        back = tips[self._finger, :2] - cube
        along, aside = float(-back @ towards), float(back @ turned(towards, np.pi / 2))
        widest = 0.016 if self._is_pushing else 0.008
        self._is_pushing = abs(aside) < widest and 0.6 * depth < along < depth + 0.03
        if self._is_pushing:
            ahead = min(AHEAD, 0.009 + distance)
            return self._finger, cube - towards * (min(along, depth) - ahead)
        behind = cube - towards * (depth + CLEAR)
        return self._finger, way(tips[self._finger, :2], behind, cube)

    # The finger that can reach behind the cube, and whose tip is not far from there.
    def _nearest(self, cube: Array, towards: Array, depth: float) -> int:
        scores = []
        for i in range(3):
            behind = np.append(cube - towards * (depth + 0.02), LOW)
            inside = np.append(cube - towards * (depth - 0.04), LOW)
            score = 20 * self._inverse(i, behind, REST)[1] + 10 * self._inverse(i, inside, REST)[1]
            score += float(np.linalg.norm(self._home[i, :2] - behind[:2]))
            scores.append(score - 0.06 * (i == self._finger))
        return int(np.argmin(scores))

    # Joints of a finger whose tip is nearest to the point, and how near; Gauss-Newton steps in
    # which joints that would leave their range stay at its end.
    def _inverse(self, finger: int, point: Array, start: Array) -> tuple[Array, float]:
        own = slice(3 * finger, 3 * finger + 3)
        low, high = RANGE
        joints = start.copy()
        joints[own] = np.clip(joints[own], low, high)
        for _ in range(12):
            error = WEIGHT * (point - self._kinematics.tip_positions(joints)[finger])
            jacobian = WEIGHT[:, None] * self._kinematics.tip_jacobian(finger, joints)[:, own]
            free, step = np.ones(3, bool), np.zeros(3)
            while free.any():
                part = jacobian[:, free]
                step[:] = 0
                square = part.T @ part + 1e-5 * np.eye(len(part.T))
                step[free] = np.linalg.solve(square, part.T @ error)
                is_out = (joints[own] <= low + 1e-9) & (step < 0)
                is_out |= (joints[own] >= high - 1e-9) & (step > 0)
                if not (is_out & free).any():
                    break
                free &= ~is_out
            joints[own] = np.clip(joints[own] + np.clip(step, -0.5, 0.5), low, high)
        away = np.linalg.norm(point - self._kinematics.tip_positions(joints)[finger])
        return joints[own], float(away)


def turned(vector: Array, angle: float) -> Array:
    """A vector in the plane, turned."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def way(tip: Array, end: Array, cube: Array) -> Array:
    """The next point of a path of a tip that goes around the cube."""
    back, aim = tip - cube, end - cube
    turn = float(np.arctan2(back[0] * aim[1] - back[1] * aim[0], back @ aim))
    radius = max(float(np.linalg.norm(back)), 1e-3)
    straight = end - tip
    share = np.clip((cube - tip) @ straight / max(straight @ straight, 1e-9), 0, 1)
    is_free = np.linalg.norm(tip + share * straight - cube) > AROUND - 0.014
    if abs(turn) < 0.3 or is_free:
        return end
    if radius < AROUND - 0.012:
        return cube + back / radius * AROUND
    return cube + turned(back / radius, float(np.clip(turn, -0.7, 0.7))) * AROUND


def successes(reports: list[dict[str, float]]) -> int:
    """How many episodes have succeeded."""
    return sum(bool(one["is_success"]) for one in reports)


def demonstrate(robot: str, folder: Path, count: int) -> tuple[int, int]:
    """Records demonstrations until `count` have succeeded; returns how many did, and all."""
    plan = Plan.of("push", "rlpd")
    with contextlib.closing(Environment(**plan.environment)) as environment:
        metadata = policy_metadata(**plan.environment)
        inputs = sum(len(places) for places, _, _ in environment._flat.values())
        reports: list[dict[str, float]] = []
        with tempfile.TemporaryDirectory() as scratch:
            still = Path(scratch) / "still.policy"
            policy_file.write(
                still, [(np.zeros((9, inputs)), np.zeros(9), "tanh")], metadata=metadata
            )
            recorder = subprocess.Popen([program(), "record", robot, "-o", folder])
            words = ["run-policy", still, "--robot", robot, "--seed", "20", "--takeover", "--json"]
            try:
                while successes(reports) < count:
                    words_now = [*words, "--first", str(len(reports)), "--end-out-of-reach"]
                    actor = subprocess.Popen(
                        [program(), *map(str, words_now)], stdout=subprocess.PIPE, text=True
                    )
                    _act(actor, robot, environment, digest_of(metadata), reports, count)
                    if successes(reports) < count:
                        subprocess.run([program(), "job", "restore", robot], check=True)
            finally:
                recorder.send_signal(signal.SIGINT)
                recorder.wait()
    return successes(reports), len(reports)


# Takes over until enough episodes have succeeded, or the actor ends because of the cube.
def _act(
    actor: subprocess.Popen[str],
    robot: str,
    environment: Environment,
    process: int,
    reports: list[dict[str, float]],
    count: int,
) -> None:
    def read() -> None:
        for line in actor.stdout or ():
            reports.append(json.loads(line))
            print(f"{len(reports)}: {line.strip()}", flush=True)

    reader = threading.Thread(target=read)
    reader.start()
    live, demonstrator, episode = LiveExperience(robot, process), Demonstrator(), -1
    live.take()  # what was before
    change = environment.options.position_change
    person = None
    try:
        person = _takeover(actor, robot)
        desired = person.latest_observation().position.copy()
        while actor.poll() is None and successes(reports) < count:
            if len(elements := live.take()):
                newest = elements[-1]
                if newest["episode"] != episode:
                    episode, demonstrator = int(newest["episode"]), Demonstrator()
                seen = environment.entries(newest["observation"])
                desired = seen["joint_position"] + change * demonstrator.action(seen, change)
            actions = np.repeat(np.array([person.new_action(position=desired)]), CHUNK)
            person.get_observation(person.append_desired_actions(actions))
    except trifinger.Error:
        if actor.wait() not in (0, 6):
            raise
    finally:
        with contextlib.suppress(trifinger.Error):
            if person is not None:
                person.finish()
        actor.send_signal(signal.SIGINT)
        actor.wait()
        reader.join()


def _takeover(actor: subprocess.Popen[str], robot: str) -> trifinger.Frontend:
    until = time.monotonic() + PATIENCE
    while True:
        try:
            return trifinger.connect(f"{robot}-takeover")
        except trifinger.Error:
            if actor.poll() is not None or time.monotonic() > until:
                raise
            time.sleep(0.05)


def main() -> None:
    """Records demonstrations."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robot")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=20)
    arguments = parser.parse_args()
    succeeded, tried = demonstrate(arguments.robot, arguments.folder, arguments.count)
    print(f"{succeeded} of {tried} demonstrations have succeeded")


if __name__ == "__main__":
    main()
