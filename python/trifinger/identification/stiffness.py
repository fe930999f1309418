# SPDX-License-Identifier: BSD-3-Clause
"""How stiff the positions of a robot may be: one whose torques are late trembles if it is stiff."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.polynomial import polynomial

from trifinger._trifinger import Simulation, configuration_text, read_joint_facts
from trifinger.arrays import Array
from trifinger.errors import RobotStopped

MARGIN = 2.0  # gain margin: what acts on positions, such as a policy, makes joints stiffer, too
SECONDS = 1.0  # in which joints come to rest
PUSH = 0.02  # from where they begin [rad], [m]
TREMBLE = 2e-4  # standard deviation of a joint that does not come to rest [rad], [m]
STEPS = 8  # halvings
HISTORY = 16384  # steps of a session: more than are read at once


def stiffness(config: str, without: Iterable[str] = ()) -> float | None:
    """The stiffness of positions that leaves a gain margin of `MARGIN` [Nm/rad], [N/m].

    None if the gains of the robot leave it, 0 if no stiffness does, because even the damping of
    the safety checks comes too late. Stiffness is tried up to `safety.max_kp`, and is one number
    for all joints, which must be of one kind. `config` is the name of a configuration or the path
    of a file. `without` names lists in its section `identified` that count as zero: dry friction
    and play calm joints at rest, but not joints that move.
    """
    _, joints, limits = read_joint_facts(configuration_text(config), opens_file=True)
    usual, most = limits["default_kp"], limits["max_kp"]
    changes: dict[str, object] = {f"identified.{name}": [0.0] * len(joints) for name in without}
    changes |= {"simulation.condition": "as documented", "backend.history": HISTORY}

    def last_positions(kp: Array) -> Array:
        with Simulation(config, changes).connect() as robot:
            steps = round(SECONDS / robot.session_info().period)
            actions = np.repeat(np.array([robot.new_action()]), steps // 4)
            actions["position"] = np.array(robot.latest_observation().position) + PUSH
            actions["position_kp"] = np.minimum(kp, most)
            for _ in range(4):
                end = robot.append_desired_actions(actions) + 1
            return np.array(robot.get_observations(end - len(actions), end)["position"])

    def trembles(kp: Array) -> bool:
        try:
            positions = last_positions(kp)
        except RobotStopped:  # because a joint has left its limits
            return True
        # A joint that is only slow moves along a parabola.
        times = np.linspace(-1.0, 1.0, len(positions))
        slow = polynomial.polyval(times, polynomial.polyfit(times, positions, 2)).T
        return bool(np.any(np.std(positions - slow, axis=0) > TREMBLE))

    if not trembles(MARGIN * usual):
        return None
    low, high = 0.0, MARGIN * float(np.max(usual))
    for _ in range(STEPS):
        middle = (low + high) / 2
        if trembles(np.full(len(joints), middle)):
            high = middle
        else:
            low = middle
    return float(f"{low / MARGIN:.2g}")


def settings(kp: float | None) -> dict[str, str | float]:
    """The settings of a training for a robot with this stiffness(); none if the usual ones do.

    By usual actions, positions in the whole range, a policy learns to ask for far ones, which lets
    a late robot tremble; by `position_change` it cannot.
    """
    if kp is None:
        return {}
    return {"action": "position_change"} | ({"position_kp": kp} if kp > 0 else {})


def words_of(training: Mapping[str, str | float]) -> list[str]:
    """The words with which `trifinger train` gets settings()."""
    return [word for name, value in training.items() for word in ("--set", f"{name}={value}")]


def advice(training: Mapping[str, str | float]) -> str:
    """What to do with settings(), in a sentence."""
    if "position_kp" not in training:
        return (
            "The robot trembles at any stiffness, because torques or measurements come too late "
            "for the damping of its safety checks: lower safety.safety_kd, then identify again"
        )
    return (
        "The robot trembles if it is stiff, because torques or measurements are late: train "
        f"policies with {' '.join(words_of(training))}"
    )
