# SPDX-License-Identifier: BSD-3-Clause
"""Where an object is, without images."""

import json
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from trifinger.whole_file import whole_file
from trifinger_compat.camera_backends import SingleProcessCameras
from trifinger_simulation.trifinger_platform import ObjectPose as ObjectPose

MODELS = ("cube_v1", "cube_v2", "cube_v3", "cuboid_2x2x8_v2")
_shared: dict[str, "Data"] = {}


def get_model_by_name(name: str) -> str:
    """The model of an object; RuntimeError if there is none of this name."""
    if name not in MODELS:
        raise RuntimeError(f"Invalid object '{name}', must be one of {', '.join(MODELS)}")
    return name


class Data:
    """The poses of an object, for the front-ends of this process."""

    def __init__(
        self, shared_memory_id_prefix: str, is_master: bool, history_size: int = 1000
    ) -> None:
        if is_master:
            self.poses = SingleProcessCameras(history_size, what="poses")
            _shared[shared_memory_id_prefix] = self
        elif shared_memory_id_prefix in _shared:
            self.poses = _shared[shared_memory_id_prefix].poses
        else:
            raise RuntimeError(
                f"no tracker '{shared_memory_id_prefix}' runs in this process; poses of a running "
                "robot are read with robot_fingers.TriFingerPlatformWithObjectFrontend"
            )


class _Backend:
    """Writes a pose ten times per second, in a thread of its own."""

    def __init__(self, object_tracker_data: Data) -> None:
        self._data = object_tracker_data.poses
        self._kept: list[tuple[float, ObjectPose]] = []
        self._is_ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            while True:
                pose = self._pose()
                self._kept.append((time.time() * 1000, pose))
                self._data.append(pose)
                if self._is_ending.wait(0.1):
                    return
        except Exception as error:  # those who wait for poses get it
            self._data.fail(error)

    def _pose(self) -> ObjectPose:
        raise NotImplementedError

    def stop(self) -> None:
        """Ends the thread."""
        self._is_ending.set()
        self._thread.join()

    def store_buffered_data(self, filename: str | Path) -> None:
        """Writes all poses as JSON: time [ms], position, orientation, confidence."""
        rows = [
            [stamp, *map(float, pose.position), *map(float, pose.orientation), pose.confidence]
            for stamp, pose in self._kept
        ]
        with whole_file(filename) as part:
            part.write_text(json.dumps(rows))


class SimulationBackend(_Backend):
    """Says where an object of a simulation is."""

    def __init__(
        self, object_tracker_data: Data, simulation_object: Any, real_time_mode: bool = True
    ) -> None:
        """`simulation_object` has get_state(), like those of trifinger_simulation."""
        del real_time_mode
        self._object = simulation_object
        super().__init__(object_tracker_data)

    def _pose(self) -> ObjectPose:
        pose = ObjectPose()
        position, orientation = self._object.get_state()
        pose.position, pose.orientation = np.array(position), np.array(orientation)
        pose.timestamp = time.time()
        return pose


class FakeBackend(_Backend):
    """Says that the object is at the origin."""

    def _pose(self) -> ObjectPose:
        pose = ObjectPose()
        pose.orientation = np.array([0.0, 0.0, 0.0, 1.0])
        return pose


class Frontend:
    """Reads the poses of an object."""

    def __init__(self, object_tracker_data: Data) -> None:
        self._data = object_tracker_data.poses

    def get_pose(self, t: int) -> ObjectPose:
        """Pose number `t`; waits for it.

        Raises ValueError if it was overwritten, RuntimeError if it will not come.
        """
        pose: ObjectPose = self._data.element(t)[1]
        return pose

    def get_current_pose(self) -> ObjectPose:
        """The newest pose; waits for the first one."""
        return self.get_pose(self._data.newest())

    def get_current_timeindex(self) -> int:
        """The number of the newest pose; waits for the first one."""
        return self._data.newest()

    def get_oldest_timeindex(self) -> int:
        """The number of the oldest pose that can be read; waits for the first one."""
        self._data.newest()
        return self._data.range()[0]

    def get_timestamp_ms(self, t: int) -> float:
        """When pose number `t` was written, since 1970 [ms]."""
        return self._data.element(t)[0]

    def wait_until_timeindex(self, t: int) -> None:
        """Waits for pose number `t`."""
        self._data.element(t)

    def has_observations(self) -> bool:
        """True if there is a pose."""
        return self._data.range()[1] > 0


class CubeDetector:
    """Finding the cube in images; `trifinger.tracking.Tracker` does that here."""

    def __init__(self, *_: Any, **__: Any) -> None:
        raise NotImplementedError(
            "use trifinger.tracking.Tracker, which finds objects in images of calibrated cameras"
        )
