# SPDX-License-Identifier: BSD-3-Clause
from collections.abc import Callable
from typing import Any, ClassVar


class Registry:
    known: ClassVar[dict[str, type]]

    @classmethod
    def register_subclass(cls, name: str) -> Callable[[type], type]:
        def register(subclass: type) -> type:
            assert name not in cls.known
            cls.known[name] = subclass
            return subclass

        return register


class Device:
    """What robots and teleoperators have in common."""

    config_class: Any
    name: str

    def __init__(self, config: Any) -> None:
        assert isinstance(config, self.config_class)
        self.id = config.id
        self.robot_type = self.name

    def __enter__(self) -> Any:
        self.connect()  # type: ignore[attr-defined]
        return self

    def __exit__(self, *_: object) -> None:
        self.disconnect()  # type: ignore[attr-defined]

    def __str__(self) -> str:
        return f"{self.id} {self.__class__.__name__}"
