# SPDX-License-Identifier: BSD-3-Clause
"""States in the midst of a movement, in which episodes of a training begin, too."""

import dataclasses
import io
from pathlib import Path
from typing import Self

import numpy as np

from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
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
    def load(cls, path: Path | str) -> Self:
        """Reads what save() has written, or another archive of NumPy's arrays with these names.

        Raises InvalidArgument if the file has no such arrays.
        """
        try:
            with np.load(path, allow_pickle=False) as archive:
                return cls(*(np.asarray(archive[name], np.float64) for name in NAMES))
        except (KeyError, OSError, TypeError, ValueError) as error:
            raise InvalidArgument(f"{path} has no states to begin in: {error}") from error
