# SPDX-License-Identifier: BSD-3-Clause
"""The logger of a robot, with one whose history moves on while it is read."""

import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from robot_interfaces.py_trifinger_types import Action, BinaryLogReader, Logger, Observation
from trifinger.errors import HistoryLost

_ACTION = [(name, "f8", 9) for name in ("torque", "position", "position_kp", "position_kd")]
_OBSERVATION = [("position", "f8", 9), ("velocity", "f8", 9), ("torque", "f8", 9)]
TYPES: dict[str, Any] = {
    "status": [("time", "i8"), ("action_repeats", "u4"), ("fault_code", "i4")],
    "observation": [*_OBSERVATION, ("tip_force", "f8", 3)],
    "desired_action": _ACTION,
    "applied_action": _ACTION,
}
HISTORY = 200


class Robot:
    """Keeps some steps, and makes `speed` more before each read. The step is in the torque."""

    def __init__(self, steps: int, speed: int = 0) -> None:
        self.steps, self.speed, self.error = steps, speed, ""
        self.asked, self.read = threading.Event(), threading.Event()

    def range(self, name: str) -> tuple[int, int]:
        end = self.steps + (name in ("status", "observation"))  # begun, and without an action yet
        if name == "applied_action":  # the last that is asked for
            self.asked.set()
        return max(0, end - HISTORY), end

    def _get(self, name: str, first: int, last: int) -> Any:
        self.read.set()
        if self.error:
            raise RuntimeError(self.error)
        self.steps += self.speed
        oldest, end = self.range(name)
        assert last <= end
        if first < oldest:
            raise HistoryLost("overwritten", oldest)
        elements = np.zeros(last - first, dtype=TYPES[name])
        if name != "status":
            elements["torque"] = np.arange(first, last)[:, None]
        return elements

    def get_statuses(self, first: int, last: int) -> Any:
        return self._get("status", first, last)

    def get_observations(self, first: int, last: int) -> Any:
        return self._get("observation", first, last)

    def get_desired_actions(self, first: int, last: int) -> Any:
        return self._get("desired_action", first, last)

    def get_applied_actions(self, first: int, last: int) -> Any:
        return self._get("applied_action", first, last)


def logger_of(robot: Robot) -> Any:
    data: Any = SimpleNamespace(
        robot=robot, name="mine", action_class=Action, observation_class=Observation
    )
    return Logger(data)


def start(logger: Any, robot: Robot) -> None:
    """Returns when the logger knows where it begins."""
    robot.asked.clear()
    logger.start()
    assert robot.asked.wait()


def steps_in(path: Path) -> list[int]:
    data = BinaryLogReader(path).data
    for entry in data:
        for element in (entry.observation, entry.desired_action, entry.applied_action):
            assert list(element.torque) == [entry.timeindex] * 9
    return [entry.timeindex for entry in data]


@pytest.mark.parametrize("speed", [0, 1, 7, 30])
@pytest.mark.parametrize("steps", [20, 1000])
def test_what_can_be_read_now_is_written_however_fast_the_robot_is(
    steps: int, speed: int, tmp_path: Path
) -> None:
    robot, path = Robot(steps, speed), tmp_path / "now.dat"
    logger_of(robot).save_current_robot_data_binary(path)
    found = steps_in(path)
    assert found[-1] >= steps - 1
    assert found == list(range(found[0], found[-1] + 1))
    # Most of what was still there after the four series were read.
    assert found[0] <= max(0, robot.steps + 1 - HISTORY) + 4 * speed


def test_a_part_can_be_chosen(tmp_path: Path) -> None:
    path = tmp_path / "now.dat"
    logger_of(Robot(1000)).save_current_robot_data_binary(path, 990, 995)
    assert steps_in(path) == [990, 991, 992, 993, 994]


def test_steps_that_were_too_fast_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot, path = Robot(0), tmp_path / "kept.dat"
    logger = logger_of(robot)
    start(logger, robot)
    robot.steps = 1000
    logger.stop_and_save(path)
    found = steps_in(path)
    assert found == list(range(1001 - HISTORY, 1000))
    assert f"lacks {1000 - len(found)} steps of 'mine'" in capsys.readouterr().err
    logger.reset()
    start(logger, robot)
    robot.steps = 1100
    logger.stop_and_save(path)
    assert steps_in(path) == list(range(1000, 1100))
    assert capsys.readouterr().err == ""


def test_a_logger_that_fails_says_so_and_writes_nothing(tmp_path: Path) -> None:
    robot, path = Robot(0), tmp_path / "kept.dat"
    logger = logger_of(robot)
    start(logger, robot)
    robot.error = "the memory is gone"
    robot.steps = 10
    assert robot.read.wait()
    with pytest.raises(RuntimeError, match=r"'mine' ended after 0 steps: the memory is gone"):
        logger.stop_and_save(path)
    assert not path.exists()
    robot.error = ""
    start(logger, robot)
    robot.steps = 20
    logger.stop_and_save(path)
    assert steps_in(path) == list(range(10, 20))
