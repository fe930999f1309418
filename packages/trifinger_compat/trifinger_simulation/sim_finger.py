# SPDX-License-Identifier: BSD-3-Clause
"""A robot in simulation, step by step."""

from copy import copy
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from robot_properties_fingers.kinematics import Kinematics, tip_links
from trifinger.log.original import NEWTONS, OFFSET
from trifinger_compat.generation import Generation, chosen
from trifinger_compat.handles import Body
from trifinger_compat.show import Show
from trifinger_compat.types import ActionLike, Array, Numbers
from trifinger_compat.urdf import share_folder
from trifinger_compat.world import World, link_indices

from trifinger_simulation import finger_types_data
from trifinger_simulation.action import Action
from trifinger_simulation.observation import Observation


def int_to_rgba(color: int, alpha: int = 0xFF) -> tuple[float, float, float, float]:
    """The colour 0xRRGGBB as four numbers from 0 to 1."""
    return (
        ((color >> 16) & 0xFF) / 255,
        ((color >> 8) & 0xFF) / 255,
        (color & 0xFF) / 255,
        alpha / 255,
    )


class SimFinger:
    """A simulated robot of one or three fingers.

    Observation t is the state just before action t acts. Observation t + 1 is the state after it.
    """

    _generation = chosen()  # rrc_simulation has another one

    def __init__(
        self,
        finger_type: str,
        time_step: float = 0.001,
        enable_visualization: bool = False,
        robot_position_offset: Numbers = (0, 0, 0),
    ) -> None:
        """`time_step` is in whole milliseconds [s]. Raises ValueError for an unknown type."""
        self.finger_type = finger_types_data.check_finger_type(finger_type)
        self.number_of_fingers = finger_types_data.get_number_of_fingers(finger_type)
        if np.any(np.asarray(robot_position_offset) != 0):
            raise NotImplementedError(
                "robot_position_offset moves the robot against its table; that cannot be done "
                "here, so move the objects the other way, or use a configuration of `trifinger` "
                "with another fingers.height"
            )
        self._configure(self._generation)
        self.time_step_s = time_step
        self.enable_visualization = enable_visualization
        self._world = World(self.finger_type, time_step, self._generation)
        self._show = Show(self._world) if enable_visualization else None
        self._pybullet_client_id = self._world.client_id
        self._number_of_joints = 3 * self.number_of_fingers
        self._t = -1
        self._action_type: type[Any] = Action
        self.finger_id = Body(1, self._world.client_id)
        self.tip_link_names = tip_links(self.number_of_fingers)
        suffixes = [name.removeprefix("finger_tip_link") for name in self.tip_link_names]
        self.link_names = [
            f"finger_{part}_link{suffix}"
            for suffix in suffixes
            for part in ("upper", "middle", "lower")
        ]
        links, tips = link_indices(self.finger_type)
        self.pybullet_link_indices, self.pybullet_tip_link_indices = links, tips
        self.pybullet_joint_indices = links
        initial = finger_types_data.get_initial_joint_positions(finger_type)
        self._world.core.set_joints(initial, np.zeros(self._number_of_joints))

    def _configure(self, generation: Generation) -> None:
        """Sets what differs between generations."""
        gains = generation.gains(self.finger_type)
        self.max_motor_torque = generation.max_torque
        self.position_gains = np.array(gains.kp * self.number_of_fingers)
        self.velocity_gains = np.array(gains.kd * self.number_of_fingers)
        self.safety_kd = np.array(generation.safety_kd * self.number_of_fingers)

    @cached_property
    def kinematics(self) -> Kinematics:
        """Kinematics of this robot."""
        return Kinematics.of_type(self.finger_type)

    @property
    def pinocchio_utils(self) -> Kinematics:
        """Kinematics by the name of 2020."""
        return self.kinematics

    @property
    def robot_properties_path(self) -> str:
        """The folder with the folders `urdf` and `meshes`."""
        return str(share_folder())

    @property
    def finger_urdf_path(self) -> str:
        """The file that describes this robot."""
        name = finger_types_data.get_finger_urdf(self.finger_type)
        return str(Path(share_folder(), "urdf", name))

    def Action(self, torque: Numbers | None = None, position: Numbers | None = None) -> Action:  # noqa: N802
        """An action; without arguments no torque and no position."""
        count = self._number_of_joints
        return Action(
            np.zeros(count) if torque is None else torque,
            np.full(count, np.nan) if position is None else position,
        )

    def append_desired_action(self, action: ActionLike) -> int:
        """Applies an action at once, for one step; returns its index.

        Raises ValueError for a wrong number of numbers, RuntimeError if the simulation diverges.
        """
        core = self._world.core
        is_finite = core.act(
            action.torque,
            action.position,
            action.position_kp,
            action.position_kd,
            self.position_gains,
            self.velocity_gains,
            self.safety_kd,
            self.max_motor_torque,
        )
        self._action_type = type(action)
        self._t += 1
        if not is_finite:
            self._raise_divergence()
        if self._world.statics:
            self._world.hold_statics()
        if self._show is not None:
            self._show.update()
        return self._t

    def _raise_divergence(self) -> None:
        torque = self._world.core.applied()[0]
        why = (
            "its torque is not a number" if np.isnan(torque).any() else "the motion is too violent"
        )
        raise RuntimeError(
            f"the simulation has diverged in step {self._t}: {why}. Create a new one, or check the "
            "actions before they are appended"
        )

    def get_observation(self, t: int) -> Observation:
        """Measurements of step `t`, the newest one or the one after it; else ValueError."""
        if t == self._t + 1:
            return self._get_latest_observation()
        self._check(t, "observation")
        return self._to_observation(self._world.core.observation_before())

    def _get_latest_observation(self) -> Observation:
        return self._to_observation(self._world.core.observation())

    @staticmethod
    def _to_observation(values: tuple[Array, ...]) -> Observation:
        observation = Observation.__new__(Observation)
        observation.position, observation.velocity, observation.torque, force = values
        # As tip_forces_of(), in place.
        force /= NEWTONS
        force += OFFSET
        np.minimum(force, 1.0, out=force)
        observation.tip_force = force
        return observation

    def _check(self, t: int, what: str, and_next: bool = True) -> None:
        """Raises ValueError unless `t` is the newest step."""
        if t == self._t and t >= 0:
            return
        if self._t < 0 and not and_next:
            raise ValueError(f"there is no {what} before the first action was appended")
        if t < 0:
            raise ValueError(f"the time index is {t}, must not be negative")
        allowed = f"{max(self._t, 0)} or {self._t + 1}" if and_next else f"{self._t}"
        if t < self._t:
            raise ValueError(f"the {what} of step {t} was lost; only {allowed} can be read")
        raise ValueError(f"the {what} of step {t} lies in the future; only {allowed} can be read")

    def get_desired_action(self, t: int) -> Any:
        """The action that was appended as `t`, the newest one, with torque and position."""
        self._check(t, "desired action", and_next=False)
        torque, position, _, _ = self._world.core.desired()
        return self._action_type(torque=torque, position=position)

    def get_applied_action(self, t: int) -> Any:
        """The action that acted in step `t`, the newest one: torque and gains are final."""
        self._check(t, "applied action", and_next=False)
        return self._applied()

    def _applied(self) -> Any:
        torque, position, kp, kd = self._world.core.applied()
        action = self._action_type(torque=torque, position=position)
        action.position_kp, action.position_kd = kp, kd
        return action

    def get_timestamp_ms(self, t: int) -> float:
        """Time of step `t`, the newest one or the one after it, from the first one [ms]."""
        if t != self._t + 1:
            self._check(t, "time")
        return 1000 * self.time_step_s * t

    def get_current_timeindex(self) -> int:
        """Index of the newest action; ValueError before the first one."""
        if self._t < 0:
            raise ValueError("no action was appended yet")
        return self._t

    def reset_finger_positions_and_velocities(
        self, joint_positions: Numbers, joint_velocities: Numbers | None = None
    ) -> Observation:
        """Sets positions [rad] and velocities [rad/s] of all joints at once.

        Steps do not count from 0 again. Returns the measurements after it.
        """
        if joint_velocities is None:
            joint_velocities = np.zeros(self._number_of_joints)
        self._world.core.set_joints(joint_positions, joint_velocities)
        return self._get_latest_observation()

    def _set_desired_action(self, desired_action: ActionLike) -> Any:
        """Takes an action for the next `_step_simulation` and returns what will act."""
        desired = copy(desired_action)
        self._world.core.desire(
            desired.torque,
            desired.position,
            desired.position_kp,
            desired.position_kd,
            self.position_gains,
            self.velocity_gains,
            self.safety_kd,
            self.max_motor_torque,
        )
        self._action_type = type(desired_action)
        return self._applied()

    def _step_simulation(self) -> None:
        """One step of the physics, without an index of its own."""
        if not self._world.core.step():
            self._raise_divergence()
        if self._world.statics:
            self._world.hold_statics()
        if self._show is not None:
            self._show.update()

    @staticmethod
    def _sanitise_torques(
        desired_torques: Numbers, max_torque: float, safety_kd: Numbers, joint_velocities: Numbers
    ) -> Array:
        """Clips torques [Nm], damps them, and clips them again."""
        torques = np.clip(np.asarray(desired_torques, dtype=float), -max_torque, max_torque)
        torques = torques - np.asarray(safety_kd) * np.asarray(joint_velocities)
        final: Array = np.clip(torques, -max_torque, max_torque)
        return final
