# SPDX-License-Identifier: BSD-3-Clause
"""Back-ends of simulated robots, by the original's name. They need no PyBullet."""

from trifinger_compat.robot_data import BaseData, RobotBackend


def _create(
    config: str,
    position: list[float],
    robot_data: BaseData,
    real_time_mode: bool,
    first_action_timeout: float,
    max_number_of_actions: int,
) -> RobotBackend:
    return RobotBackend(
        robot_data,
        config,
        {"fingers.initial_position": position, "backend.period": 0.001},
        real_time=real_time_mode,
        first_action_timeout=first_action_timeout,
        max_number_of_actions=max_number_of_actions,
    )


def create_trifinger_backend(
    robot_data: BaseData,
    real_time_mode: bool,
    visualize: bool,  # noqa: ARG001  # `trifinger view` shows every robot
    first_action_timeout: float = float("inf"),
    max_number_of_actions: int = 0,
) -> RobotBackend:
    """Starts a simulated TriFingerPro; `trifinger view` shows it in a browser."""
    limits = (first_action_timeout, max_number_of_actions)
    return _create("trifinger_pro", [0, 0.9, -1.7], robot_data, real_time_mode, *limits)


def create_single_finger_backend(
    robot_data: BaseData,
    real_time_mode: bool,
    visualize: bool,  # noqa: ARG001  # `trifinger view` shows every robot
    first_action_timeout: float = float("inf"),
    max_number_of_actions: int = 0,
) -> RobotBackend:
    """Starts a simulated FingerOne; `trifinger view` shows it in a browser."""
    limits = (first_action_timeout, max_number_of_actions)
    return _create("finger_one", [0, -0.7, -1.5], robot_data, real_time_mode, *limits)
