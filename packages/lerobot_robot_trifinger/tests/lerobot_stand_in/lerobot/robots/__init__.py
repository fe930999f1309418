# SPDX-License-Identifier: BSD-3-Clause
import abc
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from lerobot.registry import Device, Registry


@dataclass(kw_only=True)
class RobotConfig(Registry):
    known: ClassVar[dict[str, type]] = {}
    id: str | None = None
    calibration_dir: Path | None = None

    def __post_init__(self) -> None:
        for camera in getattr(self, "cameras", {}).values():
            assert None not in (camera.width, camera.height, camera.fps)


class Robot(Device, abc.ABC):
    @property
    @abc.abstractmethod
    def observation_features(self) -> dict[str, Any]: ...

    @property
    @abc.abstractmethod
    def action_features(self) -> dict[str, Any]: ...

    @property
    @abc.abstractmethod
    def is_connected(self) -> bool: ...

    @property
    @abc.abstractmethod
    def is_calibrated(self) -> bool: ...

    @abc.abstractmethod
    def connect(self, calibrate: bool = True) -> None: ...

    @abc.abstractmethod
    def calibrate(self) -> None: ...

    @abc.abstractmethod
    def configure(self) -> None: ...

    @abc.abstractmethod
    def get_observation(self) -> dict[str, Any]: ...

    @abc.abstractmethod
    def send_action(self, action: dict[str, Any]) -> dict[str, Any]: ...

    @abc.abstractmethod
    def disconnect(self) -> None: ...
