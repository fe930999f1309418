# SPDX-License-Identifier: BSD-3-Clause
"""Forward and inverse kinematics of fingers."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trifinger
from trifinger_compat.types import Array, Numbers
from trifinger_compat.urdf import FILES, Chains, angles_of, share_folder
from trifinger_compat.world import CONFIGURATIONS

STEP = 0.1  # share of the error that one iteration is to remove


class Kinematics:
    """Kinematics of the fingers of a robot description, without collisions and limits."""

    def __init__(self, finger_urdf_path: str | Path, tip_link_names: Sequence[str]) -> None:
        """`tip_link_names` are the links at the tips, one for each finger."""
        self._finger_type = ""
        self.tip_link_names = list(tip_link_names)
        self._chains: Chains | None = Chains(finger_urdf_path, self.tip_link_names)
        self._native = self._find_native(Path(finger_urdf_path))
        self.num_joints = self._chains.num_joints

    @classmethod
    def of_type(cls, finger_type: str) -> "Kinematics":
        """Those of a type of robot, without a file. This is not in the original."""
        self = cls.__new__(cls)
        self._chains = None
        self._native = trifinger.Kinematics(CONFIGURATIONS[finger_type])
        self.num_joints = self._native.num_joints
        self._finger_type = finger_type
        self.tip_link_names = tip_links(self._native.num_fingers)
        return self

    def _find_native(self, path: Path) -> trifinger.Kinematics | None:
        # Files that this package has made need not be evaluated in Python.
        urdf = share_folder() / "urdf"
        for finger_type, name in FILES.items():
            if path == urdf / name:
                native = trifinger.Kinematics(CONFIGURATIONS[finger_type])
                if self.tip_link_names == tip_links(native.num_fingers):
                    return native
        return None

    def _description(self) -> Chains:
        if self._chains is None:
            path = share_folder() / "urdf" / FILES[self._finger_type]
            self._chains = Chains(path, self.tip_link_names)
        return self._chains

    @property
    def num_fingers(self) -> int:
        """Number of tips."""
        return len(self.tip_link_names)

    def forward_kinematics(
        self, joint_positions: Numbers, joint_velocities: Numbers | None = None
    ) -> Any:
        """Positions of the tips in the world [m], a list of [x, y, z].

        With `joint_velocities` [rad/s], the pair of that list and a list of the tips' velocities in
        the world [m/s], each an array of three.
        """
        angles = angles_of(joint_positions, self.num_joints)
        if self._native is not None:
            positions = self._native.tip_positions(angles).tolist()
        else:
            chains = self._description()
            positions = [chains.tip(i, angles).tolist() for i in range(self.num_fingers)]
        if joint_velocities is None:
            return positions
        rates = angles_of(joint_velocities, self.num_joints)
        return positions, [self._jacobian(i, angles) @ rates for i in range(self.num_fingers)]

    def compute_jacobian(self, finger_index: int, joint_positions: Numbers) -> Array:
        """Derivative of a tip's position and rotation by all joints: 6 rows, in the world frame."""
        angles = angles_of(joint_positions, self.num_joints)
        return self._description().jacobian(finger_index, angles)

    def inverse_kinematics_one_finger(
        self,
        finger_idx: int,
        tip_target_position: Numbers,
        joint_angles_guess: Numbers,
        tolerance: float = 0.005,
        max_iterations: int = 1000,
    ) -> tuple[Array, Array]:
        """Angles of all joints that bring one tip to a position [m], and the error that is left.

        The other fingers are as guessed. Angles may be beyond limits. If the target cannot be
        reached, the result is what the last iteration has.
        """
        angles = angles_of(joint_angles_guess, self.num_joints)
        target = np.asarray(tip_target_position, dtype=float)
        own = slice(3 * finger_idx, 3 * finger_idx + 3)
        error = np.zeros(3)
        for _ in range(max_iterations):
            error = target - self._tip(finger_idx, angles)
            jacobian = self._jacobian(finger_idx, angles)[:, own]
            try:
                change = np.linalg.solve(jacobian, error)
            except np.linalg.LinAlgError:
                change = np.linalg.pinv(jacobian) @ error
            angles[own] += STEP * change
            if np.linalg.norm(error) < tolerance:
                break
        return angles, error

    def inverse_kinematics(
        self,
        tip_target_positions: Any,
        joint_angles_guess: Any,
        tolerance: Any = 0.005,
        max_iterations: int = 1000,
    ) -> Any:
        """Angles of all joints that bring all tips to their positions, and the errors of the tips.

        Programs of 2020 call it for one finger, with its number, the position of its tip and the
        guess; the result is then only the angles.
        """
        if isinstance(tip_target_positions, int | np.integer):
            return self.inverse_kinematics_one_finger(
                int(tip_target_positions), joint_angles_guess, tolerance
            )[0]
        angles = angles_of(joint_angles_guess, self.num_joints)
        errors = []
        for finger, target in enumerate(tip_target_positions):
            angles, error = self.inverse_kinematics_one_finger(
                finger, target, angles, tolerance, max_iterations
            )
            errors.append(error)
        return angles, errors

    def _tip(self, finger: int, angles: Array) -> Array:
        if self._native is not None:
            tip: Array = self._native.tip_positions(angles)[finger]
            return tip
        return self._description().tip(finger, angles)

    def _jacobian(self, finger: int, angles: Array) -> Array:
        if self._native is not None:
            return self._native.tip_jacobian(finger, angles)
        return self._description().jacobian(finger, angles)[:3]


def tip_links(num_fingers: int) -> list[str]:
    """Names of the links at the tips of a robot."""
    if num_fingers == 1:
        return ["finger_tip_link"]
    return ["finger_tip_link_0", "finger_tip_link_120", "finger_tip_link_240"]
