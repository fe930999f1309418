# SPDX-License-Identifier: BSD-3-Clause
"""A robot that is moved by hand as a teleoperator of LeRobot."""

from __future__ import annotations

from typing import Any

import trifinger
from lerobot.teleoperators import Teleoperator
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from lerobot_robot_trifinger.config_trifinger import TrifingerLeaderConfig
from lerobot_robot_trifinger.numbers import check_fields, names_of, numbers_of


class TrifingerLeader(Teleoperator):
    """Another robot does what this one measures. It only observes: who controls it is free."""

    config_class = TrifingerLeaderConfig
    name = "trifinger_leader"

    def __init__(self, config: TrifingerLeaderConfig) -> None:
        super().__init__(config)
        self.config = config
        self._seen: trifinger.Frontend | None = None

    @property
    def action_features(self) -> dict[str, Any]:
        """What get_action returns."""
        return dict.fromkeys(names_of(self.config.fields), float)

    @property
    def feedback_features(self) -> dict[str, Any]:
        """Nothing: it cannot be felt."""
        return {}

    @property
    def is_connected(self) -> bool:
        """True from connect() to disconnect()."""
        return self._seen is not None

    @property
    def is_calibrated(self) -> bool:
        """True: the back-end has calibrated the robot before it runs."""
        return True

    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002
        """Attaches to the robot. Raises what `trifinger.observe` raises; InvalidArgument."""
        if self.is_connected:
            raise DeviceAlreadyConnectedError(f"{self} is connected already")
        seen = trifinger.observe(self.config.robot)
        try:
            check_fields("fields", self.config.fields, seen.observation_dtype)
        except BaseException:
            seen.close()
            raise
        self._seen = seen

    def calibrate(self) -> None:
        """Does nothing: see `is_calibrated`."""

    def configure(self) -> None:
        """Does nothing: the back-end has the configuration."""

    def get_action(self) -> dict[str, Any]:
        """What was measured last, as an action."""
        if self._seen is None:
            raise DeviceNotConnectedError(f"{self} is not connected: call connect() first")
        return numbers_of(self._seen.latest_observation(), self.config.fields)

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Does nothing: see `feedback_features`."""

    def disconnect(self) -> None:
        """Detaches from the robot."""
        if self._seen is None:
            raise DeviceNotConnectedError(f"{self} is not connected: call connect() first")
        self._seen.close()
        self._seen = None
