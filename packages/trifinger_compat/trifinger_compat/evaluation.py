# SPDX-License-Identifier: BSD-3-Clause
"""Running somebody's policy in the simulation, and replaying what it has logged."""

import pickle
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from trifinger.errors import Error
from trifinger.whole_file import whole_file
from trifinger_simulation.trifinger_platform import TriFingerPlatform


class EvaluationError(Error):
    """A policy failed, or its log does not show what the simulation does."""


LONGEST = 3600.0  # time after which a policy hangs: an episode has 120 s [s]


def run_policy(words: Sequence[str], log: Path, timeout: float = LONGEST) -> None:
    """Runs a policy, which must write its log within `timeout` [s]; raises EvaluationError."""
    log.unlink(missing_ok=True)
    try:
        done = subprocess.run(words, check=False, timeout=timeout)
    except subprocess.TimeoutExpired:
        raise EvaluationError(
            f"{' '.join(words[:2])} was ended because it took longer than {timeout:g} s"
        ) from None
    if done.returncode != 0:
        raise EvaluationError(f"{' '.join(words[:2])} failed with the status {done.returncode}")
    if not log.is_file():
        raise EvaluationError(f"{' '.join(words[:2])} has not written {log}")


# What a log of the original's format is made of. Making any of it does nothing else.
PLAIN = {
    "builtins": {"bytearray", "complex", "frozenset", "set"},
    "collections": {"OrderedDict"},
    "numpy": {"dtype", "ndarray"},
    "numpy.core.multiarray": {"_reconstruct", "scalar"},
    "numpy._core.multiarray": {"_reconstruct", "scalar"},
    "numpy.core.numeric": {"_frombuffer"},
    "numpy._core.numeric": {"_frombuffer"},
    "__main__": {"TestSample"},
}
OWN = (
    "robot_interfaces.",
    "trifinger_compat.",
    "trifinger_object_tracking.",
    "trifinger_simulation.",
)
OWN_TYPES = {"Action", "CameraObservation", "ObjectPose", "Observation", "Pose", "TestSample"}


class _PlainUnpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if name in PLAIN.get(module, ()) or (module.startswith(OWN) and name in OWN_TYPES):
            return super().find_class(module, name)
        raise EvaluationError(f"it has a {module}.{name}, which could run anything")


def read_pickle(path: str | Path) -> Any:
    """The content of a file in the original's format, which need not be trusted.

    Raises EvaluationError if it has more than numbers, containers and the types of logs.
    """
    with Path(path).open("rb") as file:
        try:
            return _PlainUnpickler(file).load()
        except EvaluationError as error:
            raise EvaluationError(f"{path} is refused: {error}") from None


def write_pickle(path: Path, content: Any) -> None:
    """Writes a file for read_pickle()."""
    with whole_file(path) as part, part.open("wb") as file:
        pickle.dump(content, file)


def replay(
    path: str | Path,
    cost: Callable[[int, Any], float],
    *,
    length: int,
    decimals: int | None,
    initial_pose: Any = None,
    make_platform: Callable[..., Any] = TriFingerPlatform,
) -> float:
    """Applies the actions of a log again and returns minus the sum of `cost(t, object pose)`.

    `make_platform` makes the one on which it was written.
    Raises EvaluationError if robot or object differ: from `decimals` digits on, or at all if that
    is None.
    """
    log = read_pickle(path)
    actions = log["actions"]
    if len(actions) != length:
        raise EvaluationError(f"{path} has {len(actions)} actions, must have {length}")
    begin = log["initial_object_pose"]
    if initial_pose is not None:
        _compare(begin.position, initial_pose.position, decimals, "the object's first position", 0)
    platform = make_platform(
        visualization=False,
        initial_robot_position=log["initial_robot_position"],
        initial_object_pose=begin,
    )
    total = 0.0
    for entry in actions:
        t = platform.append_desired_action(entry["action"])
        if entry["t"] != t:
            raise EvaluationError(f"{path} has index {entry['t']} at step {t}")
        robot, logged = platform.get_robot_observation(t), entry["robot_observation"]
        _compare(robot.position, logged.position, decimals, "the joints' position", t)
        _compare(robot.velocity, logged.velocity, decimals, "the joints' velocity", t)
        pose, logged_pose = platform.get_camera_observation(t).object_pose, entry["object_pose"]
        _compare(pose.position, logged_pose.position, decimals, "the object's position", t)
        _compare(pose.orientation, logged_pose.orientation, decimals, "its orientation", t)
        total += cost(t, platform.get_camera_observation(t).filtered_object_pose)
    last = platform.cube.get_state()
    final = log["final_object_pose"]["pose"]
    digits = 3 if decimals is not None else None
    _compare(last[0], final.position, digits, "the object's last position", length)
    return -total


def _compare(value: Any, logged: Any, decimals: int | None, what: str, t: int) -> None:
    is_equal = (
        np.array_equal(value, logged)
        if decimals is None
        else bool((np.abs(np.subtract(value, logged)) <= 1.5 * 10**-decimals).all())
    )
    if not is_equal:
        raise EvaluationError(f"{what} at step {t} is {value}, but the log has {logged}")
