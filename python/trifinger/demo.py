# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger demo`: a simulated TriFinger at 1 kHz, driven by a program in another process.

Starts a back-end in real-time mode, draws circles with the three finger tips, pushes the cube, and
leaves a picture of the scene and a plot of the joints in a folder.
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
from trifinger import program

Array = np.ndarray[Any, np.dtype[np.float64]]

FINGERS = ("finger 0", "finger 120", "finger 240")
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
def back_end(name: str) -> Iterator[None]:
    """A simulated robot called `name` in a process of its own, for as long as the block lasts."""
    command = [program.path(), "run", "sim", "--name", name]
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


@dataclass(frozen=True)
class Run:
    """What happened, a row per step."""

    observations: Any
    desired_actions: Any
    statuses: Any
    cube_before: Any
    cube_after: Any


def cube_at(cubes: trifinger.Frontend, t: int) -> Any:
    """The newest pose of the cube that had arrived at step t; there is one before step 0."""
    latest = cubes.get_latest_at(t)
    if latest is None:
        raise trifinger.Error(f"no pose of the cube had arrived at step {t}")
    return latest.cube.copy()


def drive(name: str) -> Run:
    """Controls the robot along the path: inverse kinematics, and torques against gravity."""
    kinematics = trifinger.Kinematics("sim")
    with trifinger.connect(name) as robot:
        pose = robot.latest_observation()
        cubes = robot.companion("object")
        start = kinematics.tip_positions(pose.position)
        cube_before = cube_at(cubes, -1)
        targets = tip_targets(start, waypoints(cube_before.position))

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
        robot.wait_until_time_index(t)
        return Run(
            observations=robot.get_observations(0, t),
            desired_actions=robot.get_desired_actions(0, t),
            statuses=robot.get_statuses(0, t),
            cube_before=cube_before,
            cube_after=cube_at(cubes, t),
        )


def table(run: Run) -> str:
    """What there is to say about the run in a few lines."""
    statuses = run.statuses
    duration = (statuses["time"][-1] - statuses["time"][0]) * 1e-9
    repeats = int(np.count_nonzero(statuses["flags"] & trifinger.Status.ACTION_REPEATED))
    lateness = statuses["lateness"] * 1e-6
    moved = np.linalg.norm(run.cube_after.position - run.cube_before.position)
    rows = [
        ("steps", f"{len(statuses)}"),
        ("rate", f"{(len(statuses) - 1) / duration:.2f} Hz"),
        ("lateness, median", f"{np.median(lateness):.3f} ms"),
        ("lateness, worst", f"{np.max(lateness):.3f} ms"),
        ("repeated actions", f"{repeats}"),
        ("cube moved by", f"{100 * moved:.1f} cm"),
    ]
    return "\n".join(f"  {name:<18}{value:>14}" for name, value in rows)


def save_scene(run: Run, path: Path) -> None:
    """A picture of the scene at the end of the run."""
    os.environ.setdefault("MUJOCO_GL", "egl")
    import mujoco
    from mujoco.rendering.classic.renderer import Renderer

    model = mujoco.MjModel.from_xml_string(trifinger.export_mjcf("sim"))
    data = mujoco.MjData(model)
    cube = run.cube_after
    data.qpos[:] = np.concatenate(
        [run.observations["position"][-1], cube.position, cube.orientation]
    )
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


def save_plot(run: Run, path: Path) -> None:
    """A plot of the nine joints, desired and measured."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    times = np.arange(len(run.observations)) / RATE
    figure, axes = pyplot.subplots(3, 1, sharex=True, figsize=(9.0, 7.5), layout="constrained")
    for finger, axis in enumerate(axes):
        for joint in range(3):
            index = 3 * finger + joint
            color = f"C{joint}"
            axis.plot(
                times,
                run.desired_actions["position"][:, index],
                color=color,
                linestyle=":",
                linewidth=1.0,
            )
            axis.plot(
                times,
                run.observations["position"][:, index],
                color=color,
                linewidth=1.2,
                label=f"joint {joint}",
            )
        axis.set_title(FINGERS[finger], loc="left", fontsize=10)
        axis.set_ylabel("angle [rad]")
        axis.grid(alpha=0.3)
    axes[0].legend(loc="upper right", ncols=3, fontsize=8)
    axes[-1].set_xlabel("time [s]")
    figure.suptitle("Joint positions: measured (solid) and desired (dotted)", fontsize=11)
    figure.savefig(path, dpi=110)


def main() -> int:
    """Runs the demo."""
    parser = argparse.ArgumentParser(prog="trifinger demo", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--output", type=Path, default=Path("demo_output"), help="folder of the pictures"
    )
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)

    name = "demo"
    try:
        with back_end(name):
            print(
                f"The robot '{name}' runs at 1 kHz in a process of its own; this program moves it.",
                flush=True,
            )
            run = drive(name)
    except trifinger.Error as error:
        print(f"trifinger demo: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    print(table(run))

    scene, plot = arguments.output / "scene.png", arguments.output / "joints.png"
    save_scene(run, scene)
    save_plot(run, plot)
    print(f"Pictures: {scene}, {plot}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
