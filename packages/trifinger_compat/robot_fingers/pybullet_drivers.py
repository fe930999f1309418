# SPDX-License-Identifier: BSD-3-Clause
"""Back-ends of simulated robots, by the original's name. They need no PyBullet."""

from functools import partial

from trifinger_compat import physics
from trifinger_compat.generation import chosen
from trifinger_compat.robot_data import BaseData, RobotBackend
from trifinger_compat.world import CONFIGURATIONS


def simulator_overrides(finger_type: str) -> dict[str, object]:
    """What a configuration needs to have gains and physics of SimFinger, and no limits but torque.

    A back-end obeys its configuration alone, so links have the friction of objects, stops are
    beyond the hard limits, and meshes have no margin.
    """
    generation = chosen()
    gains = generation.gains(finger_type)
    return {
        **physics.settings(finger_type),
        "safety.max_torque": generation.max_torque,
        "safety.continuous_torque": ".inf",
        "safety.safety_kd": list(generation.safety_kd),
        "safety.default_kp": list(gains.kp),
        "safety.default_kd": list(gains.kd),
        "safety.max_kp": 1000,
        "safety.max_kd": 100,
        "safety.max_velocity": ".inf",
        # No joint gets there: the original's simulator clips no positions.
        "safety.soft_lower": [-1e3] * 3,
        "safety.soft_upper": [1e3] * 3,
        "safety.hard_lower": [-2e3] * 3,
        "safety.hard_upper": [2e3] * 3,
    }


def _create(
    robot_data: BaseData,
    real_time_mode: bool,
    visualize: bool,  # noqa: ARG001  # `trifinger view` shows every robot
    first_action_timeout: float = float("inf"),
    max_number_of_actions: int = 0,
    *,
    finger_type: str,
    position: list[float],
) -> RobotBackend:
    """Starts a simulated robot; `trifinger view` shows it in a browser."""
    return RobotBackend(
        robot_data,
        CONFIGURATIONS[finger_type],
        {
            "fingers.initial_position": position,
            "backend.period": 0.001,
            **simulator_overrides(finger_type),
        },
        real_time=real_time_mode,
        first_action_timeout=first_action_timeout,
        max_number_of_actions=max_number_of_actions,
    )


# A TriFingerPro and a FingerOne.
create_trifinger_backend = partial(_create, finger_type="trifingerpro", position=[0, 0.9, -1.7])
create_single_finger_backend = partial(_create, finger_type="fingerone", position=[0, -0.7, -1.5])
