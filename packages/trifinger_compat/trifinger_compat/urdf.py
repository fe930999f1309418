# SPDX-License-Identifier: BSD-3-Clause
"""Robot descriptions as files in the folders of the original, and chains of joints read from them.

The files are made of this project's own models when they are first needed, in the user's cache.
"""

import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import cos, pi, sin
from pathlib import Path

import numpy as np
import trifinger
from scipy.spatial.transform import Rotation
from trifinger.whole_file import whole_file

from trifinger_compat.types import Array, Numbers
from trifinger_compat.world import CONFIGURATIONS

FILES = {
    "fingerone": "finger.urdf",
    "trifingerone": "trifinger.urdf",
    "fingeredu": "edu/fingeredu.urdf",
    "trifingeredu": "edu/trifingeredu.urdf",
    "fingerpro": "pro/fingerpro.urdf",
    "trifingerpro": "pro/trifingerpro.urdf",
}
# The ones that the original also has with a table; the wall is inside r = 0.195 m.
WITH_STAGE = ("fingerone", "trifingerone", "trifingeredu", "trifingerpro")
WALL_RADIUS = {"trifingeredu": 0.242}  # inner radius at the table [m]; 0.195 for the others
WALL_BOXES = 24
# PyBullet gives 1 kg to a link that does not say what it weighs.
_NEXT_TO_NOTHING = (
    '<inertial><mass value="1e-6"/>'
    '<inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial>'
)


@cache
def share_folder() -> Path:
    """A folder with `urdf/` and `meshes/`, as the original package installs them."""
    cache_home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    share = cache_home / "trifinger-compat" / trifinger.__version__ / "robot_properties_fingers"
    for finger_type, name in FILES.items():
        text = _numbered(trifinger.export_urdf(CONFIGURATIONS[finger_type]), finger_type)
        write_text(share / "urdf" / name, text)
        if finger_type in WITH_STAGE:
            with_stage = (share / "urdf" / name).with_stem(Path(name).stem + "_with_stage")
            write_text(with_stage, text.replace("</robot>", f"{_stage(finger_type)}</robot>"))
    alone = f'<?xml version="1.0"?>\n<robot name="stage">\n{_stage("fingerone", True)}</robot>\n'
    write_text(share / "urdf" / "stage.urdf", alone)
    (share / "meshes").mkdir(exist_ok=True)  # the models need none
    return share


def write_text(path: Path, text: str) -> None:
    """Writes a file, if it is not there already."""
    if path.is_file() and path.read_text() == text:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part:  # other processes may do the same now
        part.write_text(text)


def _numbered(text: str, finger_type: str) -> str:
    """The description with the links of the original's, so that PyBullet gives them its numbers."""
    if finger_type == "fingeredu":  # has no platform below it
        joint = r' *<joint name="base_to_platform_joint".*?</joint>\n'
        text = re.sub(joint, "", text, flags=re.DOTALL).replace('  <link name="base_link"/>\n', "")
        return text.replace('"platform"', '"base_link"')
    if not finger_type.endswith("pro"):
        return text
    for part, next_part in (("upper", "middle"), ("middle", "lower")):  # have links for pictures
        visuals = (
            rf'  <link name="finger_{part}_link_visuals\1">\n    {_NEXT_TO_NOTHING}\n  </link>\n'
            rf'  <joint name="finger_{part}_visuals_joint\1" type="fixed">\n'
            rf'    <parent link="finger_{part}_link\1"/>\n'
            rf'    <child link="finger_{part}_link_visuals\1"/>\n  </joint>\n'
        )
        moving = rf'  <joint name="finger_{part}_to_{next_part}_joint(\w*)"'
        text = re.sub(moving, rf"{visuals}\g<0>", text)
    return text


def _stage(finger_type: str, is_alone: bool = False) -> str:
    radius, height, thickness = WALL_RADIUS.get(finger_type, 0.195), 0.17, 0.006
    boxes = [("0 0 -0.005", "0 0 0", "0.76 0.76 0.01")]
    for i in range(WALL_BOXES):
        angle = 2 * pi * i / WALL_BOXES
        middle = radius + thickness / 2
        width = 2 * (radius + thickness) * sin(pi / WALL_BOXES) / cos(pi / WALL_BOXES)
        place = f"{middle * cos(angle):.6f} {middle * sin(angle):.6f} {height / 2}"
        boxes.append((place, f"0 0 {angle:.6f}", f"{thickness} {width:.6f} {height}"))
    text = "" if is_alone else '  <joint name="base_to_stage_joint" type="fixed">\n'
    if not is_alone:
        text += '    <parent link="base_link"/>\n    <child link="stage_link"/>\n  </joint>\n'
    text += '  <link name="stage_link">\n'
    for place, turn, size in boxes:
        shape = f'<origin xyz="{place}" rpy="{turn}"/><geometry><box size="{size}"/></geometry>'
        text += f"    <visual>{shape}</visual>\n    <collision>{shape}</collision>\n"
    return text + "  </link>\n"


@dataclass(frozen=True)
class _Link:
    """A joint with the place of its frame in the frame before."""

    translation: Array
    rotation: Array  # 3 x 3
    axis: Array | None  # None: fixed
    is_prismatic: bool
    index: int  # of the joint's angle


class Chains:
    """The way from the root of a robot description to each of some links."""

    def __init__(self, path: str | Path, tip_link_names: Sequence[str]) -> None:
        """Raises ValueError if a link is missing, FileNotFoundError, ElementTree.ParseError."""
        root = ET.fromstring(Path(path).read_text())  # noqa: S314  # the user's own file
        joints = root.findall("joint")
        moving = [each for each in joints if each.get("type") != "fixed"]
        self.names = [each.get("name", "") for each in moving]
        self.num_joints = len(moving)
        before: dict[str, tuple[str, _Link]] = {}
        for joint in joints:
            parent, child = joint.find("parent"), joint.find("child")
            if parent is None or child is None:
                raise ValueError(f"a joint of {path} has no parent or no child")
            index = moving.index(joint) if joint in moving else -1
            before[child.get("link", "")] = (parent.get("link", ""), _to_link(joint, index))
        links = {each.get("name") for each in root.findall("link")}
        self.chains: list[list[_Link]] = []
        for tip in tip_link_names:
            if tip not in links:
                raise ValueError(f"{path} has no link '{tip}'")
            chain: list[_Link] = []
            while tip in before:
                tip, link = before[tip]
                chain.append(link)
            self.chains.append(chain[::-1])

    def tip(self, finger: int, angles: Array) -> Array:
        """Position of a tip."""
        return self._walk(finger, angles)[0]

    def jacobian(self, finger: int, angles: Array) -> Array:
        """Derivative of position (3 rows) and rotation (3 rows) by all joints, in the world."""
        tip, axes = self._walk(finger, angles)
        jacobian = np.zeros((6, self.num_joints))
        for link, axis, origin in axes:
            if link.is_prismatic:
                jacobian[:3, link.index] = axis
            else:
                jacobian[:3, link.index] = np.cross(axis, tip - origin)
                jacobian[3:, link.index] = axis
        return jacobian

    def _walk(self, finger: int, angles: Array) -> tuple[Array, list[tuple[_Link, Array, Array]]]:
        position, rotation = np.zeros(3), np.eye(3)
        axes = []
        for link in self.chains[finger]:
            position = position + rotation @ link.translation
            rotation = rotation @ link.rotation
            if link.axis is None:
                continue
            axis = rotation @ link.axis
            axes.append((link, axis, position))
            angle = angles[link.index]
            if link.is_prismatic:
                position = position + axis * angle
            else:
                rotation = rotation @ _turn(link.axis, angle)
        return position, axes


def _numbers(text: str | None) -> Array:
    return np.array([float(word) for word in (text or "0 0 0").split()])


def _to_link(joint: ET.Element, index: int) -> _Link:
    origin, axis = joint.find("origin"), joint.find("axis")
    xyz = origin.get("xyz") if origin is not None else None
    rpy = origin.get("rpy") if origin is not None else None
    direction = _numbers(axis.get("xyz") if axis is not None else "1 0 0")
    return _Link(
        translation=_numbers(xyz),
        rotation=Rotation.from_euler("xyz", _numbers(rpy)).as_matrix(),
        axis=None if index < 0 else direction / np.linalg.norm(direction),
        is_prismatic=joint.get("type") == "prismatic",
        index=index,
    )


def _turn(axis: Array, angle: float) -> Array:
    x, y, z = axis
    c, s = cos(angle), sin(angle)
    d = 1 - c
    return np.array(
        [
            [c + x * x * d, x * y * d - z * s, x * z * d + y * s],
            [y * x * d + z * s, c + y * y * d, y * z * d - x * s],
            [z * x * d - y * s, z * y * d + x * s, c + z * z * d],
        ]
    )


def angles_of(values: Numbers, count: int) -> Array:
    """The joints' angles as an array of their own; raises ValueError for a wrong number."""
    angles = np.array(values, dtype=float).ravel()
    if len(angles) != count:
        raise ValueError(f"there are {len(angles)} joint positions, must be {count}")
    return angles
