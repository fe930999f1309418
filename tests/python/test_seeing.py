# SPDX-License-Identifier: BSD-3-Clause
"""Robots that know their objects only from the images of their cameras."""

import json
import os
import select
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, PROGRAM, StartProgram
from trifinger.cameras import Cameras

SMALL = ["--set", "cameras.size=270", "--set", "cameras.rate=10", "--set", "cameras.delay=0.05"]
SHORT = ["lift.height=0.05", "lift.time=1", "lift.hold_time=0.5", "lift.lower_time=1"]


def manipulate(*words: str) -> subprocess.CompletedProcess[str]:
    command = [PROGRAM, "manipulate", "lift", "--poses", "cameras", *words]
    return subprocess.run(command, capture_output=True, text=True)


@pytest.mark.slow
def test_a_cube_is_lifted_by_sight(start_program: StartProgram, tmp_path: Path) -> None:
    words = ["sim_tracked", "--non-real-time", *SMALL, "--set", "fingers.height=0.3"]
    start_program("run", *words).wait_for("waits for a user")
    subprocess.run([PROGRAM, "look", "sim", "--timeout", "60"], cwd=tmp_path, check=True)
    assert list(tmp_path.glob("*.png"))
    short = [word for each in SHORT for word in ("--set", each)]
    done = manipulate("--output", str(tmp_path), *short)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["grasps"] == 1
    assert report["position_rms"] < 3e-3
    assert report["height"] == pytest.approx(0.05, abs=5e-3)


def test_a_robot_that_does_not_see_is_refused(start_program: StartProgram) -> None:
    start_program("run", "sim", "--non-real-time").wait_for("waits for a user")
    refused = manipulate()
    assert refused.returncode == 2
    assert "'sim' does not see" in refused.stderr
    assert "trifinger run sim_tracked" in refused.stderr


def test_tracked_poses_need_cameras(start_program: StartProgram) -> None:
    program = start_program("run", "sim", "--set", "simulation.object_poses=tracked")
    status, output = program.process.wait(), program.process.stdout
    assert status == 2
    assert output is not None
    assert "a section 'cameras' is missing" in output.read()


def test_the_same_simulation_sees_the_same() -> None:
    def poses() -> list[float]:
        overrides = {"cameras.rate": 20, "cameras.size": 270, "simulation.seed": 5}
        with trifinger.simulate("sim_tracked", overrides) as robot:
            companion = robot.companion("object")
            hold = robot.new_action(position=robot.latest_observation().position)
            t = robot.append_desired_action(hold)
            while t < 200:
                t = robot.append_desired_action(hold)
            robot.wait_until_time_index(t)
            pose = companion.get_latest_at(t)
            images = Cameras(robot).get_latest_at(t)
            assert images is not None
            brightness = float(np.mean(images["camera60"]))
            return [*pose.cube.position, *pose.cube.orientation, brightness]

    first = poses()
    assert first[:3] == pytest.approx([0, 0, 0.0325], abs=3e-3)
    assert poses() == first


@pytest.mark.slow
def test_eyes_that_die_are_started_again_and_end_with_the_robot(
    start_program: StartProgram,
) -> None:
    robot = start_program("run", "sim_tracked", *PATIENT, *SMALL)
    process = "sensor 'cameras': process"
    (line,) = (line for line in robot.read_until(process, "cube is found") if process in line)
    cameras = int(line.split("process ")[1].split()[0])
    os.kill(cameras, signal.SIGKILL)
    robot.wait_for("'trifinger cameras' was killed by signal 9; it is started again")
    line = robot.wait_for(process)
    again = int(line.split("process ")[1].split()[0])
    assert again != cameras
    status, _ = robot.end()
    assert status == 0
    assert not Path(f"/proc/{again}").exists()


def test_eyes_end_with_a_robot_that_is_killed(start_program: StartProgram) -> None:
    robot = start_program("run", "sim_tracked", *PATIENT, *SMALL)
    line = robot.wait_for("sensor 'cameras': process")
    cameras = int(line.split("process ")[1].split()[0])
    eyes = os.pidfd_open(cameras)
    robot.process.kill()
    # The descriptor becomes readable when the process ends. The suite's watchdog ends a hang.
    poll = select.poll()
    poll.register(eyes, select.POLLIN)
    assert poll.poll()
    os.close(eyes)
