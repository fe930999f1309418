# SPDX-License-Identifier: BSD-3-Clause
"""Calibration files of cameras."""

from pathlib import Path
from typing import Any

from trifinger import foreign_yaml
from trifinger_compat.types import Array


def config_to_array(data: dict[str, Any]) -> Array:
    """The matrix of {rows, cols, data}."""
    return foreign_yaml.matrix(data)


class CameraCalibrationFile:
    """A calibration file; matrices are arrays."""

    def __init__(self, calibration_file: str | Path) -> None:
        self._content = foreign_yaml.parse(Path(calibration_file).read_text())

    def __getitem__(self, name: str) -> Any:
        """A value of the file; KeyError if it has none of this name."""
        value = self._content[name]
        return foreign_yaml.matrix(value) if isinstance(value, dict) else value
