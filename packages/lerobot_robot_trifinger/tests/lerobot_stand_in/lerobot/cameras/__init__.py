# SPDX-License-Identifier: BSD-3-Clause
import abc
import importlib
from dataclasses import dataclass
from typing import Any, ClassVar

from lerobot.registry import Registry


@dataclass(kw_only=True)
class CameraConfig(Registry):
    known: ClassVar[dict[str, type]] = {}
    fps: int | None = None
    width: int | None = None
    height: int | None = None


class Camera(abc.ABC):
    def __init__(self, config: CameraConfig) -> None:
        self.fps = config.fps
        self.width = config.width
        self.height = config.height

    @property
    @abc.abstractmethod
    def is_connected(self) -> bool: ...

    @staticmethod
    @abc.abstractmethod
    def find_cameras() -> list[dict[str, Any]]: ...

    @abc.abstractmethod
    def connect(self, warmup: bool = True) -> None: ...

    @abc.abstractmethod
    def read(self) -> Any: ...

    @abc.abstractmethod
    def async_read(self, timeout_ms: float = 200) -> Any: ...

    def read_latest(self, max_age_ms: int = 500) -> Any:
        raise NotImplementedError

    @abc.abstractmethod
    def disconnect(self) -> None: ...


def make_cameras_from_configs(camera_configs: dict[str, CameraConfig]) -> dict[str, Camera]:
    cameras: dict[str, Camera] = {}
    for name, config in camera_configs.items():
        cls = type(config)
        package = importlib.import_module(cls.__module__.rpartition(".")[0])
        cameras[name] = getattr(package, cls.__name__.removesuffix("Config"))(config)
    return cameras
