# SPDX-License-Identifier: BSD-3-Clause
"""A TriFingerPro with an object and three cameras, in simulation."""

import enum
import pickle
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
from trifinger.whole_file import whole_file
from trifinger_compat.generation import chosen
from trifinger_compat.physics import MESH_MARGIN
from trifinger_compat.types import ActionLike, Array, Image, Numbers, PoseLike

from trifinger_simulation import camera, collision_objects, trifingerpro_limits
from trifinger_simulation.action import Action
from trifinger_simulation.observation import Observation
from trifinger_simulation.sim_finger import SimFinger, int_to_rgba

_generation = chosen()
_NO_EVENT = 1 << 62


class ObjectPose:
    """Where an object is."""

    __slots__ = ("confidence", "orientation", "position", "timestamp")

    position: Array  # x, y, z [m]
    orientation: Array  # quaternion x, y, z, w
    confidence: float  # from 0 to 1
    timestamp: float  # [s]; only programs before 2022 know it

    def __init__(self) -> None:
        self.position = np.zeros(3)
        self.orientation = np.zeros(4)
        self.confidence = 1.0
        self.timestamp = 0.0

    def __repr__(self) -> str:
        return f"ObjectPose(position={self.position!r}, orientation={self.orientation!r})"


class CameraObservation:
    """An image and when it was taken."""

    __slots__ = ("image", "timestamp")

    image: Image | None  # RGB, height x width x 3
    timestamp: float  # [s]

    def __init__(self) -> None:
        self.image = None
        self.timestamp = 0.0


class TriCameraObservation:
    """Images of the cameras 60, 180 and 300."""

    __slots__ = ("cameras",)

    cameras: list[CameraObservation]

    def __init__(self) -> None:
        self.cameras = [CameraObservation() for _ in range(3)]


class TriCameraObjectObservation(TriCameraObservation):
    """Images of the three cameras, and where the object is in them."""

    __slots__ = ("filtered_object_pose", "object_pose")

    object_pose: ObjectPose
    filtered_object_pose: ObjectPose

    def __init__(self) -> None:
        super().__init__()
        self.object_pose = ObjectPose()
        self.filtered_object_pose = ObjectPose()


class ObjectType(enum.Enum):
    """What lies on the table."""

    NONE = 0
    COLORED_CUBE = 1
    DICE = 2


class TriFingerPlatform:
    """A simulated TriFingerPro with its table, object and cameras.

    Each appended action acts at once. Observation t is the state just before action t acts.
    """

    spaces: Any = trifingerpro_limits._limits

    # Its own figures, which rrc_simulation changes.
    _finger_class: type[SimFinger] = SimFinger
    _image_size: int = _generation.image_size

    def __init__(
        self,
        visualization: bool = False,
        initial_robot_position: Numbers | None = None,
        initial_object_pose: PoseLike | None = None,
        enable_cameras: bool = False,
        time_step_s: float = _generation.time_step,
        object_type: ObjectType = ObjectType.COLORED_CUBE,
        camera_delay_steps: int = _generation.camera_delay_steps,
        *,
        object_mass: float = 0.094,
        joint_friction: float = 0.0,
        cube_scale: float = 1.0,
    ) -> None:
        """`initial_robot_position` are nine angles [rad], by default those of `spaces`.

        `initial_object_pose` has `position` and `orientation` of the cube. `object_mass` [kg],
        `joint_friction` [Nm] and `cube_scale` are of programs with a platform of their own.
        """
        if joint_friction < 0:
            raise ValueError(f"joint_friction is {joint_friction} Nm, must not be negative")
        self._time_step = time_step_s
        self.object_type = ObjectType(object_type)
        self.camera_rate_fps = _generation.camera_rate
        self._camera_delay_steps = camera_delay_steps
        self.enable_cameras = enable_cameras
        self._tricamera: Any = None

        finger = self._finger_class("trifingerpro", time_step_s, visualization)
        finger._world.joint_friction = joint_friction
        self.simfinger = finger
        if initial_robot_position is None:
            initial_robot_position = self.spaces.robot_position.default
        self._initial_robot_position = deepcopy(initial_robot_position)
        self._initial_object_pose: Any = None
        if self.object_type is ObjectType.COLORED_CUBE:
            if initial_object_pose is None:
                from trifinger_simulation.tasks.move_cube import Pose

                initial_object_pose = Pose(
                    np.array(self.spaces.object_position.default),
                    np.array(self.spaces.object_orientation.default),
                )
            self._initial_object_pose = deepcopy(initial_object_pose)
            self.cube = collision_objects.ColoredCubeV2(
                initial_object_pose.position,
                initial_object_pose.orientation,
                finger._pybullet_client_id,
                mass=object_mass,
                scale=cube_scale,
                margin=MESH_MARGIN if finger._generation.cube_is_mesh else 0.0,
            )
        elif self.object_type is ObjectType.DICE:
            self._make_dice()
        finger.reset_finger_positions_and_velocities(self._initial_robot_position)

        finger._world.core.keep_steps()
        self._action_types: list[tuple[int, type[Any]]] = []
        self._published: list[tuple[int, ObjectPose | None]] = []  # without their images
        self._begin_cameras()

    def _make_dice(self) -> None:
        from trifinger_simulation.tasks import rearrange_dice

        half = rearrange_dice.DIE_WIDTH / 2
        self.dice = [
            collision_objects.Cuboid(
                position,
                (0, 0, 0, 1),
                (half, half, half),
                mass=0.012,
                color_rgba=int_to_rgba(int(rearrange_dice.DIE_COLOUR[1:], 16)),
                pybullet_client_id=self.simfinger._pybullet_client_id,
            )
            for position in rearrange_dice.sample_goal()
        ]

    @property
    def tricamera(self) -> Any:
        """The three cameras, made when they are first needed; any object with `get_images()`."""
        if self._tricamera is None:
            self._tricamera = camera.TriFingerCameras(
                image_size=(self._image_size, self._image_size),
                pybullet_client_id=self.simfinger._pybullet_client_id,
            )
        return self._tricamera

    @tricamera.setter
    def tricamera(self, cameras: Any) -> None:
        self._tricamera = cameras

    def Action(self, torque: Numbers | None = None, position: Numbers | None = None) -> Action:  # noqa: N802
        """An action; without arguments no torque and no position."""
        return self.simfinger.Action(torque, position)

    def append_desired_action(self, action: ActionLike) -> int:
        """Applies an action at once, for one step; returns its index."""
        finger = self.simfinger
        k = finger._t + 1
        if k >= self._next_camera_event:
            self._update_cameras(k)
        types = self._action_types
        if not types or types[-1][1] is not type(action):
            types.append((k, type(action)))
        return finger.append_desired_action(action)

    def _begin_cameras(self) -> None:
        first = self._get_current_camera_observation(0)
        if self._initial_object_pose is not None:
            # Exactly what was given, also what the physics would round.
            for pose in (first.object_pose, first.filtered_object_pose):
                pose.position = np.array(self._initial_object_pose.position, dtype=float)
                pose.orientation = np.array(self._initial_object_pose.orientation, dtype=float)
        self._camera_observation_t = first
        self._delayed_camera_observation: Any = first  # programs assign it, too
        self._delayed_due = _NO_EVENT
        self._next_camera_trigger = 0
        self._next_camera_event = 0
        self._published.append((0, getattr(first, "object_pose", None)))

    def _compute_camera_update_step_interval(self) -> int:
        """Steps between two images."""
        return round(1 / (self.camera_rate_fps * self._time_step))

    def _update_cameras(self, k: int) -> None:
        """Captures and publishes what is due before step `k`."""
        is_pending = self._delayed_due != _NO_EVENT
        if not is_pending and k >= self._next_camera_trigger:
            self._delayed_camera_observation = self._get_current_camera_observation(k)
            self._next_camera_trigger += self._compute_camera_update_step_interval()
            self._delayed_due = k + self._camera_delay_steps
        if k >= self._delayed_due:
            self._camera_observation_t = self._delayed_camera_observation
            self._delayed_due = _NO_EVENT
            pose = getattr(self._camera_observation_t, "object_pose", None)
            self._published.append((k, pose))
        # The next image is taken only after this one is published.
        is_pending = self._delayed_due != _NO_EVENT
        self._next_camera_event = self._delayed_due if is_pending else self._next_camera_trigger

    def _get_current_camera_observation(self, t: int | None = None) -> Any:
        """What the cameras would see now; `t` is the index of its time stamps."""
        if t is None:
            t = self.simfinger._t
        seconds = self._time_step * t
        observation: Any
        if self.object_type is ObjectType.COLORED_CUBE:
            observation = TriCameraObjectObservation()
            observation.object_pose = self._get_current_object_pose(t)
            observation.filtered_object_pose = self._get_current_object_pose(t)
        else:
            observation = TriCameraObservation()
        images: Sequence[Image | None] = (None, None, None)
        if self.enable_cameras:
            images = self.tricamera.get_images()
        for each, image in zip(observation.cameras, images, strict=False):
            each.image = image
            each.timestamp = seconds
        return observation

    def _get_current_object_pose(self, t: int | None = None) -> ObjectPose:
        pose = ObjectPose()
        position, orientation = self.cube.get_state()
        pose.position = np.array(position)
        pose.orientation = np.array(orientation)
        pose.timestamp = self._time_step * (self.simfinger._t if t is None else t)
        return pose

    def get_camera_observation(self, t: int) -> Any:
        """The published observation of the cameras; `t` is the newest step or the one after it.

        It is the same object until there is a new one.
        """
        if t != self.simfinger._t + 1:
            self.simfinger._check(t, "camera observation")
        return self._camera_observation_t

    def get_object_pose(self, t: int) -> ObjectPose:
        """Where the cube is at step `t`, as programs of 2020-08 ask for it.

        It is exact, has no delay, and is new at each step.
        """
        if t != self.simfinger._t + 1:
            self.simfinger._check(t, "object pose")
        return self._get_current_object_pose(t)

    def get_robot_observation(self, t: int) -> Observation:
        """Measurements of step `t`, the newest one or the one after it; else ValueError."""
        return self.simfinger.get_observation(t)

    def get_desired_action(self, t: int) -> Any:
        """The action that was appended as `t`, the newest one; else ValueError."""
        return self.simfinger.get_desired_action(t)

    def get_applied_action(self, t: int) -> Any:
        """The action that acted in step `t`, the newest one; else ValueError."""
        return self.simfinger.get_applied_action(t)

    def get_timestamp_ms(self, t: int) -> float:
        """Time of step `t`, the newest one or the one after it [ms]; else ValueError."""
        return self.simfinger.get_timestamp_ms(t)

    def get_current_timeindex(self) -> int:
        """Index of the newest action; ValueError before the first one."""
        return self.simfinger.get_current_timeindex()

    def get_time_step(self) -> float:
        """Length of a step [s]."""
        return self._time_step

    def forward_kinematics(
        self, joint_positions: Numbers, joint_velocities: Numbers | None = None
    ) -> Any:
        """Positions of the tips [m], and their velocities if those of the joints are given."""
        return self.simfinger.kinematics.forward_kinematics(joint_positions, joint_velocities)

    def store_action_log(self, filename: str | Path) -> None:
        """Writes all actions and what followed from them, as a pickle.

        Raises ValueError if no action was appended.
        """
        t = self.get_current_timeindex()
        has_object = self.object_type is ObjectType.COLORED_CUBE
        log: dict[str, Any] = {
            "initial_robot_position": self._initial_robot_position,
            "initial_object_pose": self._initial_object_pose,
            "actions": self._actions(has_object),
        }
        if has_object:
            log["final_object_pose"] = {"t": t, "pose": self._get_current_object_pose()}
        with whole_file(filename) as part, part.open("wb") as file:
            pickle.dump(log, file)

    def _actions(self, has_object: bool) -> list[dict[str, Any]]:
        rows = self.simfinger._world.core.kept_steps()
        actions = []
        types, published = iter(self._action_types), iter(self._published)
        next_type, next_published = next(types), next(published)
        action_type, pose = next_type[1], next_published[1]
        for t, row in enumerate(rows):
            while next_type is not None and next_type[0] <= t:
                action_type = next_type[1]
                next_type = next(types, None)  # type: ignore[assignment]
            while next_published is not None and next_published[0] <= t:
                pose = next_published[1]
                next_published = next(published, None)  # type: ignore[assignment]
            numbers = np.split(row, (9, 18, 27, 36, 45))
            entry = {
                "t": t,
                "action": action_type(torque=numbers[0], position=numbers[1]),
                "robot_observation": SimFinger._to_observation(tuple(map(np.copy, numbers[2:]))),
            }
            if has_object:
                entry["object_pose"] = pose
            actions.append(entry)
        return actions
