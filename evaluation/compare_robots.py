# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate robots`: TriFinger and D'Claw side by side, as their models are.

Prints the table of docs/dclaw.md. Each figure is measured on the model that a session of the robot
has ("model.xml"), or on the robot behind its safety chain. One finger is looked at, in the pose in
which sessions begin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import mujoco
import numpy as np
import trifinger
from trifinger.arrays import Array


@dataclass(frozen=True)
class Robot:
    """A robot to be compared, and what no model says about it."""

    config: str
    tip: str  # the site at the tip of its first finger
    gear: float  # revolutions of a motor per revolution of its joint
    motor_speed: float  # of a joint without load [rad/s]
    friction: float  # what gears and motor take from a joint's torque [Nm]; 0: nobody knows
    torque: list[float] = field(default_factory=list)  # of each joint [Nm]


# Gear and speed are those of the paper's table. The friction of D'Claw's gears is that of an
# XM430-W350, whose performance graph is torque = 1.79 Nm/A x current - 0.23 Nm, with the gear of an
# XM430-W210.
ROBOTS = {
    "TriFinger": Robot("trifinger_edu", "finger_tip_link_0", 9.0, 43.56, 0.0, [0.36] * 3),
    "D'Claw": Robot("dclaw", "FFtip", 212.6, 8.06, 0.23 * 212.6 / 353.5, [3.0] * 3),
}
JOINTS = 3
DIRECTIONS = 500
PUSH_TIME = 0.2  # [s]
PUSH_DISTANCE = 0.01  # [m]
SWING_STEPS = 1000


class Finger:
    """The first finger of a model, at rest in the pose in which sessions begin."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        simulation = trifinger.simulate(robot.config)
        self.pose = np.array(simulation.latest_observation().position)
        self.model = mujoco.MjModel.from_xml_string(simulation.documents()["model.xml"])
        # Nothing but the finger is looked at.
        self.model.opt.gravity[:] = 0.0
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.model.opt.timestep = 0.001
        self.data = mujoco.MjData(self.model)
        self.reset()

    def reset(self) -> None:
        """Puts the finger at rest into its pose."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[: len(self.pose)] = self.pose
        mujoco.mj_forward(self.model, self.data)

    @property
    def site(self) -> int:
        """The number of the tip."""
        return int(mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, self.robot.tip))

    def jacobian(self) -> Array:
        """How the tip moves with the joints of the finger, 3 x 3 [m/rad]."""
        whole = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, whole, None, self.site)
        return whole[:, :JOINTS]

    def tip_inertia(self, armature: float | None = None) -> Array:
        """The mass that one feels at the tip, smallest direction first [kg], shape (3,).

        `armature` replaces the inertia of the rotors at the joints [kgm^2].
        """
        kept = self.model.dof_armature.copy()
        if armature is not None:
            self.model.dof_armature[:] = armature
        mujoco.mj_forward(self.model, self.data)
        inertia = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, inertia)
        self.model.dof_armature[:] = kept
        mobility = self.jacobian() @ np.linalg.solve(inertia[:JOINTS, :JOINTS], self.jacobian().T)
        return np.sort(1.0 / np.linalg.eigvalsh(mobility))

    def tip_forces(self, torque: Array) -> tuple[float, float]:
        """The least and the largest force that these torques hold at the tip, any direction [N]."""
        random = np.random.default_rng(0)
        directions = random.normal(size=(DIRECTIONS, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        needed = np.abs(directions @ self.jacobian())
        forces = np.min(torque / np.maximum(needed, 1e-12), axis=1)
        return float(forces.min()), float(forces.max())

    def displacement(self, force: Array) -> float:
        """How far the released finger gives way to a force at its tip within `PUSH_TIME` [m]."""
        self.reset()
        body = self.model.site_bodyid[self.site]
        begin = self.data.site_xpos[self.site].copy()
        direction = force / max(np.linalg.norm(force), 1e-12)
        furthest = 0.0
        for _ in range(round(PUSH_TIME / self.model.opt.timestep)):
            self.data.qfrc_applied[:] = 0.0
            point = self.data.site_xpos[self.site].copy()
            mujoco.mj_applyFT(
                self.model, self.data, force, np.zeros(3), point, body, self.data.qfrc_applied
            )
            mujoco.mj_step(self.model, self.data)
            furthest = max(furthest, (self.data.site_xpos[self.site] - begin) @ direction)
        return float(furthest)

    def push_back(self, friction: float = 0.0) -> float:
        """The force that moves the released tip by `PUSH_DISTANCE` [N], in its heaviest direction.

        `friction` is dry friction of each joint [Nm], in addition to what the model has.
        """
        self.model.dof_frictionloss[:] = friction
        forces = []
        for direction in np.vstack([np.eye(3), -np.eye(3)]):
            low, high = 0.0, 100.0
            for _ in range(30):
                middle = (low + high) / 2
                if self.displacement(direction * middle) < PUSH_DISTANCE:
                    low = middle
                else:
                    high = middle
            forces.append(high)
        self.model.dof_frictionloss[:] = 0.0
        return max(forces)


def fastest(robot: Robot) -> float:
    """How fast the last joint gets behind its safety chain, driven to both sides [rad/s]."""
    simulation = trifinger.simulate(robot.config)
    pose = np.array(simulation.latest_observation().position)
    torque = np.zeros(len(pose))
    best = 0.0
    for sign in (1.0, -1.0):
        torque[JOINTS - 1] = sign * robot.torque[JOINTS - 1]
        t = -1
        for _ in range(SWING_STEPS):
            action = simulation.new_action(
                torque=torque, position=np.where(torque == 0, pose, np.nan)
            )
            t = simulation.append_desired_action(action)
            speed = simulation.get_observation(t).velocity[JOINTS - 1]
            best = max(best, abs(float(speed)))
    return best


def rows() -> list[tuple[str, list[str]]]:
    """The table: what is measured, and the figure of each robot."""
    fingers = [Finger(robot) for robot in ROBOTS.values()]

    def each(measure: Callable[[Finger], str]) -> list[str]:
        return [measure(finger) for finger in fingers]

    def forces(finger: Finger) -> str:
        least, most = finger.tip_forces(np.array(finger.robot.torque))
        return f"{least:.1f} to {most:.0f} N"

    def masses(finger: Finger) -> str:
        least, _, most = finger.tip_inertia()
        return f"{1e3 * least:.0f} to {1e3 * most:.0f} g"

    def share(finger: Finger) -> str:
        with_rotors = finger.tip_inertia()[0]
        return f"{100 * (1 - finger.tip_inertia(0.0)[0] / with_rotors):.0f} %"

    def with_friction(finger: Finger) -> str:
        friction = finger.robot.friction
        return f"{finger.push_back(friction):.1f} N" if friction > 0 else "not known"

    return [
        ("gear", each(lambda f: f"{f.robot.gear:g} : 1")),
        ("speed of a joint without load", each(lambda f: f"{f.robot.motor_speed:.1f} rad/s")),
        ("fastest joint behind the safety chain", each(lambda f: f"{fastest(f.robot):.1f} rad/s")),
        ("largest torque of a joint", each(lambda f: f"{f.robot.torque[0]:g} Nm")),
        ("force that the tip can hold, weakest to strongest direction", each(forces)),
        (
            "inertia of motor and gear at the joint",
            each(lambda f: f"{1e3 * f.model.dof_armature[0]:.2f} gm²"),
        ),
        ("mass that one feels at the tip, lightest to heaviest direction", each(masses)),
        ("of it from motor and gear, lightest direction", each(share)),
        ("damping of a joint", each(lambda f: f"{f.model.dof_damping[0]:g} Nms/rad")),
        (
            "force at the released tip that moves it 1 cm in 0.2 s",
            each(lambda f: f"{f.push_back():.2f} N"),
        ),
        ("the same with the friction of the gear", each(with_friction)),
    ]


def table() -> str:
    """Returns the table in Markdown."""
    lines = [f"| | {' | '.join(ROBOTS)} |", f"|---|{'---|' * len(ROBOTS)}"]
    lines += [f"| {what} | {' | '.join(figures)} |" for what, figures in rows()]
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
