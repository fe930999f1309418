# SPDX-License-Identifier: BSD-3-Clause
"""What a motion must know of a robot: its joints and their limits."""

from __future__ import annotations

import dataclasses
import functools
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from trifinger import _trifinger
from trifinger.errors import Error, InvalidArgument

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger._trifinger import Frontend, Kinematics, LoggedSession


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class JointFacts:
    """The joints of a robot and their limits: one number for each joint, in the order of actions.

    The names are those of the section `safety` in configurations; infinity means "no limit".
    """

    robot: str
    """Which robot it is: the name in its URDF, such as "trifinger-edu" or "trifinger-pro-single".

    For a robot without URDF it is the type of its sessions."""
    joints: tuple[str, ...]
    """Names of the joints."""
    soft_lower: NDArray[np.float64]
    """Least position of a target [rad]."""
    soft_upper: NDArray[np.float64]
    """Largest position of a target [rad]."""
    max_velocity: NDArray[np.float64]
    """A faster joint is braked [rad/s]."""
    braking: NDArray[np.float64]
    """Deceleration that must suffice to stop a joint at a soft limit [rad/s^2]."""
    max_torque: NDArray[np.float64]
    """Largest torque of the cold motor [Nm]."""
    safety_kd: NDArray[np.float64]
    """Damping that always acts [Nms/rad]."""
    default_kd: NDArray[np.float64]
    """Damping that belongs to a target without gains [Nms/rad]."""
    configuration: str = ""
    """The text of the configuration; empty for a robot of somebody else."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, str | tuple):
                continue
            array = np.asarray(value, np.float64)
            if array.shape != (len(self.joints),) or np.isnan(array).any():
                raise InvalidArgument(
                    f"{field.name} are {array.shape} numbers; expected is one for each of the "
                    f"{len(self.joints)} joints"
                )
            object.__setattr__(self, field.name, array)

    @classmethod
    def of_configuration(cls, text: str) -> JointFacts:
        """The facts in the text of a configuration; raises Error at what is wrong in it."""
        robot, joints, limits = _trifinger.read_joint_facts(text)
        names = {field.name for field in dataclasses.fields(cls)}
        known = {name: values for name, values in limits.items() if name in names}
        return cls(robot=robot, joints=joints, configuration=text, **known)

    @classmethod
    def load(cls, config: str, overrides: Mapping[str, object] | None = None) -> JointFacts:
        """The facts of a configuration: its name, such as "trifinger_pro", or a file."""
        text = _trifinger.configuration_text(config, dict(overrides or {}))
        return cls.of_configuration(text)

    @classmethod
    def of_session(cls, session: Frontend | LoggedSession) -> JointFacts:
        """The facts of a robot, running or in a log, from the documents of its session.

        They come from its configuration or, for somebody else's robot, from its URDF. Raises
        InvalidArgument for a robot that has neither.
        """
        documents = session.documents
        texts: Mapping[str, str] = documents() if callable(documents) else documents
        wrong = "its session has no documents with them"
        if "configuration.yml" in texts:
            try:
                return cls.of_configuration(texts["configuration.yml"])
            except Error as error:
                wrong = str(error)
        if "robot.urdf" in texts:
            return cls._of_urdf(texts["robot.urdf"])
        raise InvalidArgument(
            f"nobody knows the joints of this robot and their limits ({wrong}); "
            "say them: facts=JointFacts(...)"
        )

    @classmethod
    def _of_urdf(cls, text: str) -> JointFacts:
        names: list[str] = []
        rows: list[tuple[float, ...]] = []
        try:
            root = ET.fromstring(text)  # noqa: S314  # Expat of Python 3.11 bounds entities
            for joint in root.iter("joint"):
                limit, safety = joint.find("limit"), joint.find("safety_controller")
                if joint.get("type") not in ("revolute", "prismatic") or limit is None:
                    continue
                lower, upper = float(limit.get("lower", 0)), float(limit.get("upper", 0))
                if safety is not None:
                    lower = float(safety.get("soft_lower_limit", lower))
                    upper = float(safety.get("soft_upper_limit", upper))
                names.append(joint.get("name", ""))
                rows.append(
                    (
                        lower,
                        upper,
                        float(limit.get("velocity", "inf")),
                        float(limit.get("effort", "inf")),
                    )
                )
        except (ET.ParseError, ValueError) as error:
            raise InvalidArgument(f"the URDF of the robot cannot be read: {error}") from None
        if not names:
            raise InvalidArgument("the URDF of the robot has no joints with limits")
        lower_limits, upper_limits, velocity, torque = np.transpose(rows)
        nothing = np.zeros(len(names))
        return cls(
            robot=root.get("name", "robot"),
            joints=tuple(names),
            soft_lower=lower_limits,
            soft_upper=upper_limits,
            max_velocity=velocity,
            braking=nothing + np.inf,
            max_torque=torque,
            safety_kd=nothing,
            default_kd=nothing,
        )

    @functools.cached_property
    def kinematics(self) -> Kinematics | None:
        """Kinematics and dynamics; None for a robot of somebody else."""
        return _trifinger.kinematics_of(self.configuration) if self.configuration else None

    def torques(
        self,
        positions: NDArray[np.float64],
        velocities: NDArray[np.float64],
        accelerations: NDArray[np.float64],
    ) -> NDArray[np.float64] | None:
        """Torques of the motors that a motion in free space needs [Nm], without `safety_kd`.

        All arguments have a row for each sample, as the result. None if nobody knows the dynamics.
        """
        model = self.kinematics
        if model is None:
            return None
        return np.array(
            [
                model.bias_torques(q, v) + model.mass_matrix(q) @ a
                for q, v, a in zip(positions, velocities, accelerations, strict=True)
            ]
        ).reshape(positions.shape)

    def holding_torques(self, positions: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Torques that hold each pose against gravity [Nm]; None if nobody knows the dynamics."""
        model = self.kinematics
        if model is None:
            return None
        return np.array([model.gravity_torques(q) for q in positions]).reshape(positions.shape)

    def tips(self, positions: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Positions of the tips [m]: shape (n, fingers, 3), world frame; None if nobody knows."""
        model = self.kinematics
        if model is None:
            return None
        return np.array([model.tip_positions(q) for q in positions])
