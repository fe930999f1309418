# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger demo`: a simulated TriFinger at 1 kHz, driven by a program in another process.

Starts a back-end in real-time mode that records itself, draws circles with the three finger tips,
pushes the cube, and leaves the log, a plot of it and a picture of the scene in a folder.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import trifinger
from trifinger import plot, program

Array = np.ndarray[Any, np.dtype[np.float64]]

RATE = 1000  # [steps/s]


@dataclass(frozen=True)
class Waypoint:
    """Where the tips shall be [m], a row each, `duration` [s] after the waypoint before."""

    duration: float
    tips: Array


def rotated(finger: int, point: Array) -> Array:
    """A point given for finger 0, the same for another one: at -120 and -240 degrees."""
    angle = -2.0 * np.pi / 3.0 * finger
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y, z = point
    return np.array([cosine * x - sine * y, sine * x + cosine * y, z])


def waypoints(cube: Array) -> list[Waypoint]:
    """Circles with all tips, then a push of the cube by the first finger."""
    path = []
    for angle in np.linspace(0.0, 4.0 * np.pi, 25):
        point = np.array([0.03 * np.sin(angle), 0.13, 0.09 - 0.03 * np.cos(angle)])
        path.append(Waypoint(0.12, np.stack([rotated(finger, point) for finger in range(3)])))
    path[0] = Waypoint(1.0, path[0].tips)

    aside = path[-1].tips
    behind = cube + np.array([0.0, 0.07, 0.0])
    above = behind + np.array([0.0, 0.0, 0.06])
    pushed = behind - np.array([0.0, 0.09, 0.0])
    for tip, duration in (
        (above, 0.8),
        (behind, 0.5),
        (pushed, 1.2),
        (behind, 0.6),
        (above, 0.5),
    ):
        path.append(Waypoint(duration, np.stack([tip, aside[1], aside[2]])))
    path.append(Waypoint(0.8, aside))
    return path


def tip_targets(start: Array, path: list[Waypoint]) -> Array:
    """One row of tips per step along the path; at rest at waypoints of half a second or more."""
    rows = []
    last = start
    for waypoint in path:
        steps = round(waypoint.duration * RATE)
        a = np.linspace(0.0, 1.0, steps, endpoint=False)
        if waypoint.duration >= 0.5:
            a = 10.0 * a**3 - 15.0 * a**4 + 6.0 * a**5  # minimum jerk
        rows.append(last + a[:, None, None] * (waypoint.tips - last))
        last = waypoint.tips
    return np.concatenate(rows)


@contextlib.contextmanager
def back_end(name: str, folder: Path) -> Iterator[None]:
    """A simulated robot called `name` in a process of its own, for as long as the block lasts.

    It records itself into `folder`.
    """
    command = [program.path(), "run", "sim", "--name", name, "--record", str(folder)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        try:
            while name not in (session.name for session in trifinger.list_sessions()):
                if process.poll() is not None:
                    output = process.stdout.read() if process.stdout else ""
                    raise trifinger.Error(
                        f"`{' '.join(command)}` ended at once and said:\n{output}"
                    )
                time.sleep(0.01)
            yield
        finally:
            process.terminate()
            process.wait()


def cube_at(cubes: trifinger.Frontend | trifinger.LoggedSession, t: int) -> Any:
    """The newest pose of the cube that had arrived at step t; there is one before step 0."""
    latest = cubes.get_latest_at(t)
    if latest is None:
        raise trifinger.Error(f"no pose of the cube had arrived at step {t}")
    return latest.cube


def drive(name: str) -> None:
    """Controls the robot along the path: inverse kinematics, and torques against gravity."""
    kinematics = trifinger.Kinematics("sim")
    with trifinger.connect(name) as robot:
        pose = robot.latest_observation()
        cube = cube_at(robot.companion("object"), -1)
        targets = tip_targets(kinematics.tip_positions(pose.position), waypoints(cube.position))

        near = pose.position.copy()
        t = robot.append_desired_action(
            robot.new_action(position=near, torque=kinematics.gravity_torques(near))
        )
        for tips in targets:
            y = robot.get_observation(t)
            for finger in range(3):
                joints = slice(3 * finger, 3 * finger + 3)
                near[joints], _ = kinematics.inverse_kinematics(finger, tips[finger], near[joints])
            action = robot.new_action(position=near, torque=kinematics.gravity_torques(y.position))
            t = robot.append_desired_action(action)
        robot.finish()


def table(session: trifinger.LoggedSession) -> str:
    """What there is to say about the run in a few lines."""
    statuses = session.statuses
    cubes = session.companion("object")
    duration = (statuses["time"][-1] - statuses["time"][0]) * 1e-9
    repeats = int(np.count_nonzero(statuses["flags"] & trifinger.Status.ACTION_REPEATED))
    # As `trifinger log info` has it: steps that were left out before one made it later.
    lateness = statuses["lateness"] * 1e-6 + statuses["skipped_ticks"] * session.period * 1e3
    moved = np.linalg.norm(cube_at(cubes, len(statuses)).position - cube_at(cubes, -1).position)
    rows = [
        ("steps", f"{len(statuses)}"),
        ("rate", f"{(len(statuses) - 1) / duration:.2f} Hz"),
        ("lateness, median", f"{np.median(lateness):.3f} ms"),
        ("lateness, worst", f"{np.max(lateness):.3f} ms"),
        ("repeated actions", f"{repeats}"),
        ("cube moved by", f"{100 * moved:.1f} cm"),
    ]
    return "\n".join(f"  {name:<18}{value:>14}" for name, value in rows)


def save_scene(session: trifinger.LoggedSession, path: Path) -> None:
    """A picture of the scene at the end of the run."""
    os.environ.setdefault("MUJOCO_GL", "egl")
    import mujoco
    from mujoco.rendering.classic.renderer import Renderer

    model = mujoco.MjModel.from_xml_string(session.documents["model.xml"])
    data = mujoco.MjData(model)
    observations = session.observations
    cube = cube_at(session.companion("object"), len(observations))
    data.qpos[:] = np.concatenate([observations["position"][-1], cube.position, cube.orientation])
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    camera.lookat[:] = (0.0, 0.0, 0.13)
    camera.distance = 1.05
    with Renderer(model, height=720, width=960) as renderer:
        renderer.update_scene(data, camera)
        pixels = renderer.render()

    import matplotlib.image

    matplotlib.image.imsave(path, pixels)


def main() -> int:
    """Runs the demo."""
    parser = argparse.ArgumentParser(prog="trifinger demo", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("demo_output"),
        help="folder of the log and the pictures",
    )
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)

    name = "demo"
    try:
        with back_end(name, arguments.output):
            print(
                f"The robot '{name}' runs at 1 kHz in a process of its own; this program moves it.",
                flush=True,
            )
            drive(name)
    except trifinger.Error as error:
        print(f"trifinger demo: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130

    # Names of logs have the date in them: the last is the newest.
    path = max(arguments.output.glob(f"{name}_*.mcap"))
    log = trifinger.Log(path)
    session = log.session(name)
    # The next lines are those of another process.
    print(table(session), end="\n\n", flush=True)
    subprocess.run([program.path(), "log", "info", path], check=True)

    scene, picture = arguments.output / "scene.png", arguments.output / "plot.png"
    save_scene(session, scene)
    plot.plot(log, picture)
    print(f"\nLog:      {path}\nPictures: {scene}, {picture}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
