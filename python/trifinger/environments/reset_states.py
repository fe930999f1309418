# SPDX-License-Identifier: BSD-3-Clause
"""States in the midst of a movement, in which episodes of a training begin, too."""

import dataclasses
import io
import zipfile
import zlib
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
    """N states of a robot, for `VectorEnvironment.set_reset_states`: nothing moves in them."""

    position: Array
    """Joint positions (N x joints) [rad], [m]."""
    torque: Array
    """Joint torques (N x joints) that hold the robot there, and what it holds [Nm], [N]."""
    object: Array
    """Position [m] and quaternion (w, x, y, z) of the object of the task (N x 7), or N x 0."""

    def __post_init__(self) -> None:
        for name in NAMES:
            numbers = np.ascontiguousarray(getattr(self, name), np.float64)
            if numbers.ndim != 2:
                raise InvalidArgument(f"'{name}' has {numbers.ndim} dimensions, must have 2")
            object.__setattr__(self, name, numbers)

    def save(self, path: Path | str) -> None:
        """Writes an archive of NumPy's arrays."""
        archive = io.BytesIO()
        np.savez_compressed(archive, **{name: getattr(self, name) for name in NAMES})
        replace_file(Path(path), archive.getvalue())

    @classmethod
    def load(cls, path: Path | str, name: str = "cube") -> Self:
        """Reads what save() has written, or a log, as from_log() does.

        Raises InvalidArgument or Error if it is neither, FileNotFoundError if there is none.
        """
        if not Path(path).is_file() or not zipfile.is_zipfile(path):
            return cls.from_log(path, name)
        broken = (EOFError, KeyError, OSError, TypeError, ValueError, zlib.error)
        try:
            with np.load(path, allow_pickle=False) as archive:
                return cls(*(archive[name] for name in NAMES))
        except (*broken, zipfile.BadZipFile) as error:
            raise InvalidArgument(f"{path} has no states to begin in: {error}") from error

    @classmethod
    def from_log(cls, path: Path | str, name: str = "cube", every: float = 0.1) -> Self:
        """What a robot did with the object of this name, whoever controlled it: a skill, a person.

        Of a log, or of the newest recording in a folder, it takes a state where the object was
        seen, `every` so many seconds, also where it moved: episodes begin there without speed.
        Raises InvalidArgument if nobody has seen it, Error if this is no log, FileNotFoundError if
        there is none.
        """
        session = Log(str(path)).session()
        has_objects = any(companion.name.endswith(".object") for companion in session.companions)
        seen, objects = object_poses(session) if has_objects else (np.empty(0), {})
        if name not in objects:
            raise InvalidArgument(f"{path} does not say where an object '{name}' was")
        stride = max(round(every / session.period), 1)
        _, first = np.unique(seen // stride, return_index=True)
        _, rows, poses = np.intersect1d(session.time_index, seen[first], return_indices=True)
        observations = session.observations[rows]
        return cls(observations["position"], observations["torque"], objects[name][first][poses])
