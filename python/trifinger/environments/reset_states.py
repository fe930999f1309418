# SPDX-License-Identifier: BSD-3-Clause
"""States in the midst of a movement, in which episodes of a training begin, too."""

import dataclasses
import io
from pathlib import Path
from typing import Self

import numpy as np

from trifinger._trifinger import Log
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.log.objects import object_poses
from trifinger.whole_file import replace_file

NAMES = ("position", "torque", "object")


@dataclasses.dataclass(frozen=True)
class ResetStates:
    """N states of a robot at rest, for `VectorEnvironment.set_reset_states`."""

    position: Array
    """Joint positions (N x joints) [rad], [m]."""
    torque: Array
    """Joint torques (N x joints) that hold the robot there, and what it holds [Nm], [N]."""
    object: Array
    """Position [m] and quaternion (w, x, y, z) of the object of the task (N x 7)."""

    def save(self, path: Path | str) -> None:
        """Writes an archive of NumPy's arrays."""
        archive = io.BytesIO()
        np.savez_compressed(archive, **{name: getattr(self, name) for name in NAMES})
        replace_file(Path(path), archive.getvalue())

    @classmethod
    def from_log(cls, path: Path | str, name: str = "cube", every: float = 0.1) -> Self:
        """What a robot did with the object of this name, whoever controlled it: a skill, a person.

        Of the log, or the newest recording in a folder, it takes a state `every` so many seconds.
        Raises InvalidArgument if nobody has seen the object.
        """
        session = Log(str(path)).session()
        seen, objects = object_poses(session)
        if name not in objects:
            raise InvalidArgument(f"{path} does not say where an object '{name}' was")
        steps = np.asarray(session.time_index)
        stride = max(round(every / session.period), 1)
        wanted = np.arange(steps[0], steps[-1] + 1, stride)
        rows = np.searchsorted(steps, wanted)
        poses = np.clip(np.searchsorted(seen, wanted), 0, len(seen) - 1)
        chosen = (steps[rows] == wanted) & (np.abs(seen[poses] - wanted) <= stride)
        observations = session.observations[rows[chosen]]
        return cls(
            np.asarray(observations["position"]),
            np.asarray(observations["torque"]),
            objects[name][poses[chosen]],
        )

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """Reads what save() has written, or, if the name does not end in .npz, a log.

        Raises InvalidArgument if the file has no such arrays.
        """
        if Path(path).suffix != ".npz":
            return cls.from_log(path)
        try:
            with np.load(path, allow_pickle=False) as archive:
                return cls(*(np.asarray(archive[name], np.float64) for name in NAMES))
        except (KeyError, OSError, TypeError, ValueError) as error:
            raise InvalidArgument(f"{path} has no states to begin in: {error}") from error
