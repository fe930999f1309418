# SPDX-License-Identifier: BSD-3-Clause
"""Options of environments, and the robots and policies that they make."""

import dataclasses
import inspect
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Self, get_args, get_origin, get_type_hints

import numpy as np

from trifinger import _trifinger
from trifinger.environment_options import OptionFields
from trifinger.errors import InvalidArgument
from trifinger.tasks import Entry, Task, load


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options(OptionFields):
    """Settings of an environment; `Options.of(task)` has the defaults of a task.

    A range is (low, high): for each episode, a simulation draws a value from it, uniformly. A
    factor multiplies the value of the configuration.
    """

    @staticmethod
    def of(task: "AnyTask", **changes: Any) -> "Options":
        """The defaults of a task, with some changes. Raises InvalidArgument for unknown tasks."""
        known = _known(task)
        if isinstance(known, str):
            text = _trifinger.default_environment_options(known)
            return Options.from_json(text).changed(**changes)
        return Options(**dataclasses.asdict(known.options)).changed(**changes)

    def changed(self, **changes: Any) -> Self:
        """A copy with some changes. Raises InvalidArgument for unknown names."""
        names = {field.name for field in dataclasses.fields(self)}
        for name in changes:
            if name not in names:
                raise InvalidArgument.of_name("option", name, names)
        return dataclasses.replace(self, **changes)

    def to_json(self) -> str:
        """The options as JSON, as files of policies hold them."""
        values = dataclasses.asdict(self)
        for name, kind in get_type_hints(OptionFields).items():
            if not _is_a(kind, values[name]):
                raise InvalidArgument(f"{name} is {values[name]!r}, must be {_allowed(name, kind)}")
        return json.dumps(values)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Options from the text that to_json() returned.

        Raises InvalidArgument for another text, as from a version with options that are unknown.
        """

        def of(value: Any) -> Any:
            if isinstance(value, dict):
                return {name: of(part) for name, part in value.items()}
            return tuple(value) if isinstance(value, list) else value

        try:
            return cls().changed(**of(json.loads(text)))
        except (json.JSONDecodeError, TypeError):
            raise InvalidArgument("the options of an environment must be a JSON object") from None


def _is_a(kind: Any, value: Any) -> bool:
    """Whether a value of an option is of its type; numbers are finite, as JSON has no others."""
    parts = get_args(kind)
    origin = get_origin(kind)
    if origin is Literal:
        return value in parts
    if origin is tuple:
        if not isinstance(value, list | tuple):
            return False
        kinds = parts[:1] * len(value) if parts[-1] is ... else parts
        return len(value) == len(kinds) and all(map(_is_a, kinds, value))
    if origin is Mapping:
        return isinstance(value, dict) and all(
            _is_a(parts[0], name) and _is_a(parts[1], part) for name, part in value.items()
        )
    if kind in (int, float):
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return is_number and math.isfinite(value) and (kind is float or value == int(value))
    return isinstance(value, kind)


def _allowed(name: str, kind: Any) -> str:
    if get_origin(kind) is Literal:
        *words, last = map(repr, get_args(kind))
        return f"{', '.join(words)} or {last}"
    usual = getattr(OptionFields(), name)
    return f"like {usual!r}" if usual not in ((), {}) else f"a {kind}"


def require(is_right: bool, name: str, value: object, allowed: str) -> None:
    """Raises InvalidArgument with the name of an argument, unless its value is right."""
    if not is_right:
        raise InvalidArgument(f"{name} is {value!r}, must be {allowed}")


def whole_number(name: str, value: object, bits: int) -> int:
    """An argument that C++ takes as a number of so many bits. Raises InvalidArgument."""
    if (
        not isinstance(value, int | np.integer)
        or isinstance(value, bool)
        or value < 0
        or value >> bits
    ):
        raise InvalidArgument(f"{name} is {value!r}, must be a whole number, 0 to 2^{bits} - 1")
    return int(value)


def reset_options(options: dict[str, Any] | None) -> dict[str, Any]:
    """The options of a reset; none if there are none. Raises InvalidArgument."""
    given = {} if options is None else options
    require(isinstance(given, dict), "options", given, 'a dictionary: {"episode": 3}')
    return given


AnyTask = str | Task
"""The name of a task in C++, MODULE:CLASS for one in Python, or an object of such a class."""


def task_of(task: AnyTask) -> AnyTask:
    """The name of a task in C++, or an object of one in Python."""
    known = _known(task)
    if not isinstance(known, type):
        return known
    try:
        inspect.signature(known).bind()
    except TypeError as error:
        raise InvalidArgument(
            f"'{task}' cannot be made by its name, because __init__ needs arguments ({error}): "
            "pass an object of it"
        ) from None
    made = known()
    _check(made)
    return made


# The name of a task in C++, or the class or object of one in Python, which is not made here.
def _known(task: AnyTask) -> AnyTask | type[Task]:
    allowed = 'the name of a task, such as "reach" or "my_tasks:Middle", or a Task'
    require(isinstance(task, AnyTask), "task", task, allowed)
    known = load(task) if isinstance(task, str) and ":" in task else task
    if not isinstance(known, str):
        _check(known)
    return known


MAX_FINGERS = 3  # of a TriFinger
_KINDS: dict[str, tuple[type, str]] = {
    "name": (str, "a text"),
    "options": (OptionFields, "Options"),
    "robot": (str, "the name of a configuration"),
    "config_overrides": (Mapping, 'keys and values: {"objects": []}'),
    "num_fingers": (int, "a whole number"),
    "is_for_files": (bool, "True or False"),
    "object_name": (str, "a text"),
    "has_goals_of_fingers": (bool, "True or False"),
    "goal_unit": (str, "a text"),
}


# Refuses what a task, or its class, cannot say of itself. What an object has of its own, only that
# can tell.
def _check(task: Task | type[Task]) -> None:
    one = task if isinstance(task, type) else type(task)
    for name, (kind, allowed) in _KINDS.items():
        value = getattr(task, name)
        if not (isinstance(task, type) and isinstance(value, property)):
            require(isinstance(value, kind), f"{one.__name__}.{name}", value, allowed)
    if isinstance(task, type):
        return
    is_number = not isinstance(task.num_fingers, bool) and 0 <= task.num_fingers <= MAX_FINGERS
    allowed = f"0 to {MAX_FINGERS}"
    require(is_number, f"{one.__name__}.num_fingers", task.num_fingers, allowed)
    for name in ("goal_low", "goal_high"):
        _require_numbers(f"{one.__name__}.{name}", getattr(task, name))
    entries = task.entries
    is_right = isinstance(entries, Sequence) and all(isinstance(e, Entry) for e in entries)
    require(is_right, f"{one.__name__}.entries", entries, "a list of Entry")
    for entry in entries:
        named = f"an entry of {one.__name__}: "
        require(isinstance(entry.name, str), f"{named}name", entry.name, "a text")
        require(isinstance(entry.unit, str), f"{named}unit", entry.unit, "a text")
        _require_numbers(f"{named}low", entry.low)
        _require_numbers(f"{named}high", entry.high)


def _require_numbers(name: str, value: Any) -> None:
    try:
        array = np.asarray(value)
        is_right = array.ndim == 1 and (array.size == 0 or array.dtype.kind in "iuf")
    except ValueError:
        is_right = False
    require(is_right, name, value, "a list of numbers")


def options_of(task: AnyTask, options: Options | None, **changes: Any) -> Options:
    """The options of an environment: those that were given, or those of the task, with changes."""
    if options is None:
        return Options.of(task, **changes)
    like = f"Options.of({task!r}, duration=1.0), or without `options`, duration=1.0"
    require(isinstance(options, Options), "options", options, f"Options: {like}")
    return options.changed(**changes)


def robot_of(task: AnyTask, config: str | None) -> str:
    """The configuration of a robot; None: the one that the task is usually for."""
    if config is not None:
        allowed = "the name of a configuration or the path of a file"
        require(isinstance(config, str), "config", config, allowed)
        return config
    known = _known(task)
    return _trifinger.robot_of_task(known) if isinstance(known, str) else known.robot


def overrides_of(
    task: AnyTask, options: Options, config: str, config_overrides: dict[str, object] | None
) -> dict[str, object]:
    """What a task and its options need of the robot's configuration, and the user's overrides."""
    own = {} if config_overrides is None else config_overrides
    allowed = 'keys and values: {"backend.period": 0.001}'
    require(isinstance(own, dict), "config_overrides", own, allowed)
    known = _known(task)
    named = known if isinstance(known, str) else dict(known.config_overrides)
    return _trifinger.environment_overrides(named, options.to_json(), config, own)


def policy_metadata(
    task: str,
    options: Options,
    config: str | None = None,
    config_overrides: dict[str, object] | None = None,
) -> dict[str, str]:
    """The metadata that `trifinger run-policy` needs in the file of a policy.

    The arguments are those of the `Environment` in which the policy was trained.
    """
    config = robot_of(task, config)
    overrides = overrides_of(task, options, config, config_overrides)
    return {
        "task": task,
        "options": options.to_json(),
        "robot": config,
        "configuration": _trifinger.robot_configuration(config, overrides),
    }
