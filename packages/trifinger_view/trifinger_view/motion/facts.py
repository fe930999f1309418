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
from trifinger.foreign_models import model_of

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger._trifinger import Frontend, Kinematics, LoggedSession


UNLIMITED = 1e6
"""Limits of configurations that are off are at least so large [rad], [m]."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class JointFacts:
    """The joints of a robot and their limits: one number for each joint, in the order of actions.

    The names are those of the section `safety` in configurations; infinity means "no limit".
    Numbers of joints that slide have m in the place of rad and N in that of Nm.
    """

    robot: str
    """Which robot it is: the name in its URDF, such as "trifinger-edu" or "trifinger-pro-single".

    For a robot without URDF, such as one from a file, it is the type of its sessions."""
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
    model: str = ""
    """The model of a robot from a file in MuJoCo's format; empty if nobody knows it."""

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
    def of_configuration(
        cls,
        text: str,
        robot: str = "",
        joints: tuple[str, ...] = (),
        *,
        model: str = "",
        opens_file: bool = False,
    ) -> JointFacts:
        """The facts in the text of a configuration; raises Error at what is wrong in it.

        A robot from a file needs the name of the robot and of its joints, and what only the file
        says counts as no limit; unless `opens_file`, for a text that can be trusted.
        """
        name, names, limits = _trifinger.read_joint_facts(text, robot, joints, opens_file)
        fields = {field.name for field in dataclasses.fields(cls)}
        known = {
            key: np.where(np.abs(values) < UNLIMITED, values, np.copysign(np.inf, values))
            for key, values in limits.items()
            if key in fields
        }
        return cls(robot=name, joints=names, configuration=text, model=model, **known)

    @classmethod
    def load(cls, config: str, overrides: Mapping[str, object] | None = None) -> JointFacts:
        """The facts of a configuration: its name, such as "trifinger_pro", or a file."""
        values = dict(overrides or {})
        text = _trifinger.configuration_text(config, values)
        facts = cls.of_configuration(text, opens_file=True)
        if facts.kinematics is not None:
            return facts
        return dataclasses.replace(facts, model=_trifinger.Simulation(config, values).mjcf())

    @classmethod
    def of_session(cls, session: Frontend | LoggedSession) -> JointFacts:
        """The facts of a robot, running or in a log, from the documents of its session.

        They come from its configuration or, for somebody else's robot, from its URDF. The file of
        a running robot is read, too; that of a robot in a log is not. Raises InvalidArgument for a
        robot that has neither.
        """
        documents = session.documents
        is_running = callable(documents)
        texts: Mapping[str, str] = documents() if callable(documents) else documents
        wrong = "its session has no documents with them"
        if "configuration.yml" in texts:
            text = texts["configuration.yml"]
            # A TriFinger has a URDF, too; a robot from a file has only its model.
            model = "" if "robot.urdf" in texts else texts.get("model.xml", "")
            try:
                if is_running:
                    return cls.of_configuration(text, model=model, opens_file=True)
                names = driven_joints(text, model) if model else ()
                kind: str = session.type  # type: ignore[union-attr]  # of a log
                return cls.of_configuration(text, kind, names, model=model)
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
        """Kinematics and dynamics of a TriFinger; None for any other robot."""
        return _trifinger.kinematics_of(self.configuration) if self.configuration else None

    @functools.cached_property
    def dynamics(self) -> ModelDynamics | None:
        """Dynamics of a robot from a file; None if nobody knows its model."""
        return ModelDynamics(self.model, self.joints) if self.model else None

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint's position: "rad", "m" of a slide, "rad or m" if nobody knows."""
        if self.dynamics is not None:
            return self.dynamics.units
        is_described = not self.configuration or self.kinematics is not None
        return ("rad" if is_described else "rad or m",) * len(self.joints)

    def torques(
        self,
        positions: NDArray[np.float64],
        velocities: NDArray[np.float64],
        accelerations: NDArray[np.float64],
    ) -> NDArray[np.float64] | None:
        """Torques of the motors that a motion in free space needs [Nm], without `safety_kd`.

        All arguments have a row for each sample, as the result. None if nobody knows the dynamics.
        """
        samples = zip(positions, velocities, accelerations, strict=True)
        if self.dynamics is not None:
            rows = [self.dynamics.torques(*sample) for sample in samples]
        elif (model := self.kinematics) is not None:
            rows = [model.bias_torques(q, v) + model.mass_matrix(q) @ a for q, v, a in samples]
        else:
            return None
        return np.array(rows).reshape(positions.shape)

    def holding_torques(self, positions: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Torques that hold each pose against gravity [Nm]; None if nobody knows the dynamics."""
        nothing = np.zeros_like(positions)
        return self.torques(positions, nothing, nothing)

    def tips(self, positions: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Positions of the tips [m]: shape (n, fingers, 3), world frame; None if nobody knows."""
        model = self.kinematics
        if model is None:
            return None
        return np.array([model.tip_positions(q) for q in positions])


def is_trifinger(robot: str) -> bool:
    """Whether this name of a robot is that of a TriFinger: types of others have no hyphen."""
    return robot.startswith("trifinger-")


def driven_joints(configuration: str, model: str) -> tuple[str, ...]:
    """Names of the driven joints of a robot from a file, in the order of its actions.

    They are those that the configuration names or, without them, what the model's motors drive.
    """
    named = _trifinger.named_joints(configuration)
    return named or ModelDynamics(model).joints


class ModelDynamics:
    """What a model in MuJoCo's format says of the torques of its motors, in free space."""

    def __init__(self, text: str, joints: tuple[str, ...] = ()) -> None:
        """`joints` are names of joints and fixed tendons, by default what the motors drive.

        Raises InvalidArgument if the text is no model or has no such joint.
        """
        import mujoco

        self._model = model = model_of(text)
        self._data = mujoco.MjData(model)
        flags = mujoco.mjtDisableBit
        for flag in (flags.mjDSBL_CONTACT, flags.mjDSBL_CONSTRAINT, flags.mjDSBL_ACTUATION):
            model.opt.disableflags |= flag
        driven = []
        for motor in range(model.nu):
            kind = mujoco.mjtObj.mjOBJ_JOINT
            if model.actuator_trntype[motor] == mujoco.mjtTrn.mjTRN_TENDON:
                kind = mujoco.mjtObj.mjOBJ_TENDON
            name = mujoco.mj_id2name(model, kind, model.actuator_trnid[motor, 0])
            if model.actuator_gainprm[motor, 0] != 0 and name not in driven:
                driven.append(name)
        self.joints = joints or tuple(driven)
        """Names of the joints."""
        self._parts = [self._parts_of(name) for name in self.joints]
        self.units = tuple(
            "m"
            if all(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE for joint, _ in parts)
            else "rad"
            for parts in self._parts
        )
        """The unit of each joint's position."""

    def _parts_of(self, name: str) -> list[tuple[int, float]]:
        """The joints of the model that a driven joint moves, and their shares."""
        import mujoco

        model = self._model
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        if joint >= 0:
            return [(joint, 1.0)]
        tendon = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, name)
        if tendon < 0:
            raise InvalidArgument(f"the model of the robot has no joint '{name}'")
        first = model.tendon_adr[tendon]
        wraps = range(first, first + model.tendon_num[tendon])
        return [(int(model.wrap_objid[i]), float(model.wrap_prm[i])) for i in wraps]

    def torques(
        self,
        position: NDArray[np.float64],
        velocity: NDArray[np.float64],
        acceleration: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """The torque of each motor, with what damps the joints [Nm]."""
        import mujoco

        model, data = self._model, self._data
        mujoco.mj_resetData(model, data)
        for parts, q, v, a in zip(self._parts, position, velocity, acceleration, strict=True):
            size = sum(share**2 for _, share in parts)
            for joint, share in parts:
                dof = model.jnt_dofadr[joint]
                data.qpos[model.jnt_qposadr[joint]] += share / size * q
                data.qvel[dof] += share / size * v
                data.qacc[dof] += share / size * a
        mujoco.mj_inverse(model, data)
        return np.array(
            [
                sum(share * data.qfrc_inverse[model.jnt_dofadr[joint]] for joint, share in parts)
                / sum(share**2 for _, share in parts)
                for parts in self._parts
            ]
        )
