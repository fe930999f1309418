# SPDX-License-Identifier: BSD-3-Clause
"""Calibration files of the original's cameras: `camera60_cropped.yml` and so on."""

import os
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import trifinger

from trifinger_compat.types import Array

NAMES = ("camera60", "camera180", "camera300")
IDS = (60, 180, 300)
MATRICES = ("camera_matrix", "distortion_coefficients", "tf_world_to_camera")


@cache
def figures() -> trifinger.CameraCalibration:
    """The cameras of the robot's model."""
    import tempfile

    renderer_text = _model_calibration()
    with tempfile.NamedTemporaryFile("w", suffix=".yml") as file:
        file.write(renderer_text)
        file.flush()
        return trifinger.CameraCalibration.read(file.name)


def _model_calibration() -> str:
    return trifinger.CameraRenderer("trifinger_pro").calibration


@cache
def data_folder() -> Path:
    """A folder with `camera_params`, the calibration files of the model's cameras."""
    from trifinger.camera_calibration.original import SUFFIXES, text_of

    cache_home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache_home / "trifinger-compat" / trifinger.__version__ / "data"
    parameters = folder / "camera_params"
    parameters.mkdir(parents=True, exist_ok=True)
    for each in figures().cameras:
        for suffix in SUFFIXES:
            path = parameters / f"{each.name}{suffix}.yml"
            text = text_of(each, suffix)
            if not path.is_file() or path.read_text() != text:
                part = path.with_name(f".{path.name}.{os.getpid()}")
                part.write_text(text)
                part.replace(path)
    return folder


def parse(text: str) -> dict[str, Any]:
    """The content of a calibration file: texts, whole numbers and matrices as dicts."""
    content: dict[str, Any] = {}
    section: dict[str, Any] | None = None
    for indent, key, value in _entries(text):
        target = content if indent == 0 or section is None else section
        if value == "" and indent == 0:
            section = content[key] = {}
        else:
            target[key] = _value(value)
            if indent == 0:
                section = None
    return content


def _entries(text: str) -> Iterator[tuple[int, str, str]]:
    """Indentation, key and value of each entry; lists are one text in brackets."""
    lines = [line.rstrip() for line in text.splitlines()]
    lines = [line for line in lines if line.strip() and not re.match(r"\s*(#|%|---|\.\.\.)", line)]
    i = 0
    while i < len(lines):
        match = re.match(r"(\s*)([\w-]+):\s*(.*)$", lines[i])
        if match is None:
            raise ValueError(f"'{lines[i]}' is no line of a calibration file")
        indent, key, value = len(match[1]), match[2], match[3]
        i += 1
        if value.startswith("[") and "]" not in value:
            while i < len(lines) and "]" not in value:
                value += " " + lines[i].strip()
                i += 1
        elif value.startswith("!!"):  # OpenCV's own types
            value = ""
        items = []
        while not value and i < len(lines) and (item := re.match(r"\s*-\s+(.*)$", lines[i])):
            items.append(item[1])
            i += 1
        yield indent, key, f"[{', '.join(items)}]" if items else value


def _value(text: str) -> Any:
    if text.startswith("["):
        return [float(word) for word in re.split(r"[\s,]+", text.strip("[] ")) if word]
    if re.fullmatch(r"[+-]?\d+", text):
        return int(text)
    return text.strip("\"'")


def to_matrix(data: dict[str, Any]) -> Array:
    """A matrix of {rows, cols, data}."""
    return np.array(data["data"], dtype=float).reshape(int(data["rows"]), int(data["cols"]))


def matrix_text(name: str, matrix: Array) -> str:
    """A matrix in a file."""
    rows, columns = np.atleast_2d(matrix).shape
    data = ", ".join(repr(float(number)) for number in np.ravel(matrix))
    return f"{name}:\n  rows: {rows}\n  cols: {columns}\n  data: [{data}]\n"
