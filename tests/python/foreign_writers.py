# SPDX-License-Identifier: BSD-3-Clause
"""Writes files of cameras as the programs of others do, each with its own tools."""

import io
import json
from collections.abc import Callable, Mapping
from typing import Any

import cv2
import numpy as np
import ruamel.yaml
import yaml

Content = Mapping[str, Any]  # matrices are arrays


def _plain(content: Content) -> dict[str, Any]:
    """Matrices as {rows, cols, data}, as the original has them."""
    return {
        key: {"rows": len(value), "cols": len(value[0]), "data": value.ravel().tolist()}
        if isinstance(value, np.ndarray)
        else value
        for key, value in content.items()
    }


def _rows(content: Content, data: str | None) -> dict[str, Any]:
    """Matrices as lists of rows, which are all of the matrix or its `data`."""
    plain = _plain(content)
    for key, value in content.items():
        if isinstance(value, np.ndarray):
            plain[key] = {**plain[key], data: value.tolist()} if data else value.tolist()
    return plain


def _pyyaml(**style: Any) -> Callable[[Content], str]:
    return lambda content: str(yaml.dump(_plain(content), **style))


def _ruamel(content: Content) -> str:
    stream = io.StringIO()
    ruamel.yaml.YAML().dump(_plain(content), stream)
    return stream.getvalue()


def _opencv(content: Content) -> str:
    storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for key, value in content.items():
        storage.write(key, value)
    return str(storage.releaseAndGetString())


def _ros(content: Content) -> str:
    """As camera_calibration of ROS puts its texts together."""
    lines = []
    for key, value in content.items():
        if isinstance(value, np.ndarray):
            numbers = ", ".join(f"{number:.17g}" for number in value.ravel())
            shape = f"  rows: {len(value)}\n  cols: {len(value[0])}"
            lines.append(f"{key}:\n{shape}\n  data: [{numbers}]")
        else:
            lines.append(f"{key}: {value}")
    return "\n".join([*lines, "distortion_model: plumb_bob", ""])


WRITERS: dict[str, Callable[[Content], str]] = {
    "pyyaml": _pyyaml(),
    "pyyaml_blocks": _pyyaml(default_flow_style=False),
    "pyyaml_brackets": _pyyaml(default_flow_style=True),
    "pyyaml_mixed": _pyyaml(default_flow_style=None, width=60),
    "pyyaml_with_marks": _pyyaml(explicit_start=True, explicit_end=True, version=(1, 1), indent=4),
    "pyyaml_rows": lambda content: str(yaml.dump(_rows(content, "data"))),
    "pyyaml_bare_rows": lambda content: str(yaml.dump(_rows(content, None))),
    "json": lambda content: json.dumps(_plain(content), indent=1),
    "ruamel": _ruamel,
    "opencv": _opencv,
    "ros": _ros,
}
