# SPDX-License-Identifier: BSD-3-Clause
"""The types of robots."""

from collections.abc import KeysView
from typing import NamedTuple


class FingerTypesDataFormat(NamedTuple):
    """What is known of a type of robot."""

    urdf_file: str  # below the folder "urdf" of robot_properties_fingers
    number_of_fingers: int
    initial_joint_positions: list[float]  # [rad]


finger_types_data = {
    "fingerone": FingerTypesDataFormat("finger.urdf", 1, [0, 0, 0]),
    "trifingerone": FingerTypesDataFormat("trifinger.urdf", 3, [0, -0.9, -1.7] * 3),
    "fingeredu": FingerTypesDataFormat("edu/fingeredu.urdf", 1, [0, 0.9, -1.7]),
    "trifingeredu": FingerTypesDataFormat("edu/trifingeredu.urdf", 3, [0, 0.9, -1.7] * 3),
    "fingerpro": FingerTypesDataFormat("pro/fingerpro.urdf", 1, [0, 0.9, -1.7]),
    "trifingerpro": FingerTypesDataFormat("pro/trifingerpro.urdf", 3, [0, 0.9, -1.7] * 3),
}

# Names of 2020.
_OLD_NAMES = {"single": "fingerone", "tri": "trifingerone"}


def get_valid_finger_types() -> KeysView[str]:
    """Names of all types."""
    return finger_types_data.keys()


def check_finger_type(name: str) -> str:
    """Returns the name of a type as it is in `finger_types_data`; raises ValueError."""
    name = _OLD_NAMES.get(name, name)
    if name not in finger_types_data:
        raise ValueError(
            f"Invalid finger type '{name}'. Valid types are {', '.join(finger_types_data)}"
        )
    return name


def get_finger_urdf(name: str) -> str:
    """File of a type below the folder "urdf"; raises ValueError."""
    return finger_types_data[check_finger_type(name)].urdf_file


def get_number_of_fingers(name: str) -> int:
    """Number of fingers of a type; raises ValueError."""
    return finger_types_data[check_finger_type(name)].number_of_fingers


def get_initial_joint_positions(name: str) -> list[float]:
    """Where the joints of a type begin [rad]; raises ValueError."""
    return list(finger_types_data[check_finger_type(name)].initial_joint_positions)
