# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a data set: what was measured at a fixed rate, and all steps between.

Row i of an episode belongs to the robot's step s_i = first + floor(i / (rate * period)). It has the
observation y of that step, and the desired action of the step after it, which is the first one that
can depend on y. A row is there if that action is. There are up to k = ceil(1 / (rate * period))
steps per row. Features whose names begin with "high_rate" have all of them: the observations of the
k steps up to s_i, and the actions of the k steps after s_i. At the ends of an episode its first and
its last step are repeated.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger.cameras import COMPANION, STATES
from trifinger.element_text import fields_of
from trifinger.errors import InvalidArgument
from trifinger.log.images import LoggedCameras

from trifinger_data_sets.episodes import Episode, Say

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from trifinger._trifinger import LoggedSession
    from trifinger.arrays import Array

DEFAULT_RATE = 30  # of data sets without images [rows/s]
STEPS = 20_000  # steps that are in memory at once
SCENE = "scene"  # the companion that says where everything in a simulation really is
STAMP = "stamp."  # begins the fields of a companion's element that are no measurement
GOOD = STATES.index("good")

STATE = "observation.state"
ENVIRONMENT = "observation.environment_state"
ACTION = "action"
STEP = "step"
IMAGE_AGE = "image_age"
SERIES = {
    "observation": "observations",
    "desired_action": "desired_actions",
    "applied_action": "applied_actions",
}
HIGH_RATE = {
    "observation": "high_rate.observation",
    "desired_action": "high_rate.action",
    "applied_action": "high_rate.applied_action",
}


@dataclass(frozen=True)
class Feature:
    """A column of a data set: `shape` numbers of a type for each row."""

    name: str
    dtype: str
    shape: tuple[int, ...]
    names: tuple[str, ...] = ()
    """Names of the numbers of the last dimension."""
    unit: str = ""


@dataclass(frozen=True)
class Field:
    """A field of an element, as `size` numbers."""

    name: str
    dtype: str
    size: int
    names: tuple[str, ...]

    def of(self, elements: Any) -> Array:
        """The numbers of the field: a row for each element."""
        values = elements
        for part in self.name.split("."):
            values = values[part]
        flat: Array = np.asarray(values).reshape(len(elements), self.size)
        return flat.astype(self.dtype)


def fields(dtype: np.dtype[Any]) -> list[Field]:
    """The fields of an element whose values are numbers."""
    found = []
    for name, values in fields_of(np.zeros(1, dtype)):
        kind = values.dtype.kind
        if kind not in "fiub":
            continue
        shape = values.shape[1:]
        indices = ["".join(f"[{i}]" for i in index) for index in np.ndindex(shape)]
        number = {"f": "float32", "b": "bool"}.get(kind, "int64")
        names = tuple(name + index for index in indices)
        found.append(Field(name, number, len(indices), names))
    return found


@dataclass(frozen=True)
class Block:
    """Some rows of an episode that follow each other."""

    steps: NDArray[np.int64]
    """The robot's step of each row."""
    values: dict[str, Array]
    """A row for each step, by the name of the feature."""

    def __len__(self) -> int:
        return len(self.steps)


@dataclass(frozen=True, kw_only=True)
class Choice:
    """What of the logs becomes a data set. None takes all that is there."""

    rate: int | None = None
    """Rows per second; None: the rate of the cameras, or 30."""
    cameras: Sequence[str] | None = None
    action: Sequence[str] | None = None
    """Fields of the desired action; None: those that were used."""
    companions: Sequence[str] | None = None
    """Short names, such as "object"; None: all but the images, and what only a simulation knows."""
    high_rate: bool = True


@dataclass
class _Use:
    # What is known of the values of a field of floating-point numbers.
    has_numbers: bool = False  # some are finite
    has_gaps: bool = False  # some are not
    has_values: bool = False  # some are finite and not zero


@dataclass
class Rows:
    """The rows of some episodes, which belong to robots of one type. Raises InvalidArgument."""

    episodes: Sequence[Episode]
    choice: Choice = field(default_factory=Choice)
    say: Say = print

    def __post_init__(self) -> None:
        self._seen: tuple[tuple[Path, int], Pictures] | None = None
        self._met: tuple[tuple[Path, int], list[_Companion]] | None = None
        session = self._same_robot()
        self.period = round(1e9 * session.period)  # [ns]
        self.cameras = self._chosen_cameras(session)
        self.rate = self._chosen_rate(session)
        self._stride = -(-1_000_000_000 // (self.rate * self.period))
        uses = self._uses()
        self._fields = {
            series: self._usable(series, fields(dtype), uses[series])
            for series, dtype in _dtypes(session).items()
        }
        self._action = self._chosen_action(fields(session.action_dtype), uses["desired_action"])
        self._companions = self._chosen_companions(session)
        self.features = list(self._described(session))

    @property
    def stride(self) -> int:
        """Number of steps in each row of a high-rate feature: the k of this module."""
        return self._stride

    def count(self, episode: Episode) -> int:
        """Number of rows of an episode."""
        # The largest i with floor(i * steps per row) <= steps - 2, and one more.
        steps = episode.end - episode.first
        if steps < 2:
            return 0
        return -(-(steps - 1) * self.rate * self.period // 1_000_000_000)

    def steps(self, episode: Episode) -> NDArray[np.int64]:
        """The robot's step of each row of an episode."""
        numbers = np.arange(self.count(episode), dtype=np.int64)
        per_row = self.rate * self.period
        return episode.first + numbers * 1_000_000_000 // per_row

    def blocks(self, episode: Episode) -> Iterator[Block]:
        """Yields the rows of an episode, some at a time."""
        steps = self.steps(episode)
        size = max(1, STEPS // self._stride)
        companions = self._companions_of(episode)
        for begin in range(0, len(steps), size):
            yield self._block(episode, steps[begin : begin + size], companions)

    def usable(self, episodes: Sequence[Episode]) -> list[Episode]:
        """The episodes that have rows; each begins when every camera has sent an image.

        Raises InvalidArgument if there are none.
        """
        found = []
        for episode in episodes:
            begun = episode
            if self.cameras:
                first = self.pictures(episode).first(episode)
                if first is None:
                    self.say(
                        f"{episode} is left out: not every camera has sent an image; --cameras "
                        "chooses cameras"
                    )
                    continue
                begun = replace(episode, first=first)
            if self.count(begun) == 0:
                self.say(f"{episode} is left out: it is too short for a row")
                continue
            found.append(begun)
        if not found:
            raise InvalidArgument("no episode has a row")
        return found

    def image_size(self, camera: str) -> tuple[int, int]:
        """Height and width of the images of a camera [pixels]."""
        for episode in self.episodes:
            pictures = self.pictures(episode)
            if pictures.first(episode) is not None:
                height, width = pictures.image(camera, 0).shape[:2]
                return height, width
        raise InvalidArgument(f"there are no images of {camera}")

    def pictures(self, episode: Episode) -> Pictures:
        """The images of an episode's session."""
        key = (episode.log, episode.session.session_id)
        if self._seen is None or self._seen[0] != key:
            self._seen = (key, Pictures(episode, self.cameras))
        return self._seen[1]

    def _companions_of(self, episode: Episode) -> list[_Companion]:
        # Many episodes may be in one session, whose companions are read once.
        key = (episode.log, episode.session.session_id)
        if self._met is None or self._met[0] != key:
            companions = [
                _Companion(episode.session, name, parts, self.period)
                for name, parts in self._companions.items()
            ]
            self._met = (key, companions)
        return self._met[1]

    def _block(
        self, episode: Episode, steps: NDArray[np.int64], companions: Sequence[_Companion]
    ) -> Block:
        first = max(episode.first, int(steps[0]) - self._stride + 1)
        end = min(episode.end, int(steps[-1]) + self._stride + 1)
        read = episode.session.read(first, end, list(SERIES))
        if len(read) != end - first:
            raise InvalidArgument(f"{episode}: steps are missing that the log said to have")
        back = np.arange(-self._stride + 1, 1)
        around = {"observation": back, "desired_action": back + self._stride}
        around["applied_action"] = around["desired_action"]
        values: dict[str, Array] = {STEP: steps}
        for series, attribute in SERIES.items():
            elements = getattr(read, attribute)
            offset = 0 if series == "observation" else 1
            rows = steps - first + offset
            if self.choice.high_rate:
                wanted = steps[:, None] + around[series]
                places = np.clip(wanted, episode.first, episode.end - 1) - first
                for part in self._fields[series]:
                    values[f"{HIGH_RATE[series]}.{part.name}"] = part.of(elements)[places]
            if series == "observation":
                state = [part for part in self._fields[series] if part.dtype == "float32"]
                if state:
                    values[STATE] = _joined(state, elements[rows])
                for part in self._fields[series]:
                    if part.dtype != "float32":
                        values[f"observation.{part.name}"] = part.of(elements[rows])
            elif series == "desired_action":
                values[ACTION] = _joined(self._action, elements[rows]).astype(np.float32)
        if companions:
            values[ENVIRONMENT] = np.concatenate(
                [one.at(steps) for one in companions], axis=1, dtype=np.float32
            )
        return Block(steps, values)

    def _described(self, session: LoggedSession) -> Iterator[Feature]:
        units = session.units
        state = [part for part in self._fields["observation"] if part.dtype == "float32"]
        if state:
            yield _vector(STATE, state)
        for part in self._fields["observation"]:
            if part.dtype != "float32":
                yield Feature(f"observation.{part.name}", part.dtype, (part.size,), part.names)
        if self._companions:
            names = [
                name
                for companion, parts in self._companions.items()
                for name in _companion_names(companion, parts)
            ]
            yield Feature(ENVIRONMENT, "float32", (len(names),), tuple(names))
        yield _vector(ACTION, self._action)
        if self.choice.high_rate:
            for series, parts in self._fields.items():
                for part in parts:
                    yield Feature(
                        f"{HIGH_RATE[series]}.{part.name}",
                        part.dtype,
                        (self._stride, part.size),
                        part.names,
                        units[series].get(part.name, ""),
                    )
        yield Feature(STEP, "int64", (1,))

    def _same_robot(self) -> LoggedSession:
        first = self.episodes[0]
        for other in self.episodes:
            if _dtypes(other.session) != _dtypes(first.session):
                raise InvalidArgument(
                    f"{other} has other fields than {first}; export them as two data sets"
                )
            if round(1e9 * other.session.period) != round(1e9 * first.session.period):
                raise InvalidArgument(
                    f"{other} has steps of {other.session.period:g} s, {first} has steps of "
                    f"{first.session.period:g} s; export them as two data sets"
                )
            others = {_short(one): one.observation_dtype for one in other.session.companions}
            own = {_short(one): one.observation_dtype for one in first.session.companions}
            if others.get(COMPANION) != own.get(COMPANION) and self.choice.cameras != []:
                raise InvalidArgument(
                    f"{other} has other cameras than {first}; export them as two data sets, or "
                    "without images: --cameras without a name"
                )
        return first.session

    def _chosen_cameras(self, session: LoggedSession) -> tuple[str, ...]:
        there: tuple[str, ...] = ()
        if any(_short(one) == COMPANION for one in session.companions):
            there = LoggedCameras(session).names
        if self.choice.cameras is None:
            return there
        for name in self.choice.cameras:
            if name not in there:
                raise InvalidArgument.of_name("camera", name, there)
        return tuple(self.choice.cameras)

    def _chosen_companions(self, session: LoggedSession) -> dict[str, list[Field]]:
        there = {_short(one): one for one in session.companions if _short(one) != COMPANION}
        names = self.choice.companions
        if names is None:
            names = [name for name in there if name != SCENE]
        for name in names:
            if name not in there:
                raise InvalidArgument.of_name("companion", name, there)
        for episode, name in itertools.product(self.episodes, names):
            others = {_short(one): one.observation_dtype for one in episode.session.companions}
            if others.get(name) != there[name].observation_dtype:
                raise InvalidArgument(
                    f"{episode} has no companion '{name}' like that of {self.episodes[0]}; "
                    "--companions chooses those that all have"
                )
        return {
            name: [part for part in fields(there[name].observation_dtype) if _is_measured(part)]
            for name in names
        }

    def _chosen_rate(self, session: LoggedSession) -> int:
        rate = self.choice.rate
        if rate is None:
            rate = (self.cameras and _camera_rate(session, self.period)) or DEFAULT_RATE
            rate = min(rate, 1_000_000_000 // self.period)
        if not 1 <= rate <= 1_000_000_000 // self.period:
            raise InvalidArgument(
                f"the rate is {rate} rows/s, must be from 1 to {1_000_000_000 // self.period}, "
                "the rate of the robot"
            )
        return rate

    def _uses(self) -> dict[str, dict[str, _Use]]:
        # Which fields have numbers, and which have NaN, which stands for "not given".
        uses: dict[str, dict[str, _Use]] = {series: {} for series in SERIES}
        for episode in self.episodes:
            for steps in episode.session.chunks(STEPS, episode.first, episode.end, list(SERIES)):
                for series, attribute in SERIES.items():
                    for name, values in fields_of(getattr(steps, attribute)):
                        use = uses[series].setdefault(name, _Use())
                        if values.dtype.kind == "f":
                            finite = np.isfinite(values)
                            use.has_gaps |= not finite.all()
                            use.has_numbers |= bool(finite.any())
                            use.has_values |= bool((finite & (values != 0)).any())
                        else:
                            use.has_numbers = True
                            use.has_values |= bool(values.any())
        return uses

    def _usable(self, series: str, parts: Iterable[Field], uses: Mapping[str, _Use]) -> list[Field]:
        kept = []
        for part in parts:
            use = uses.get(part.name, _Use())
            if use.has_gaps and use.has_numbers:
                self.say(
                    f"{series}.{part.name} was not given in some steps, so it is left out of the "
                    "high-rate features."
                    if series != "observation"
                    else f"{series}.{part.name} is not finite in some steps, so it is left out."
                )
            if use.has_numbers and not use.has_gaps:
                kept.append(part)
        return kept

    def _chosen_action(self, parts: Sequence[Field], uses: Mapping[str, _Use]) -> list[Field]:
        by_name = {part.name: part for part in parts}
        names = self.choice.action
        if names is None:
            names = [name for name in by_name if uses[name].has_values] or [
                name for name in by_name if uses[name].has_numbers
            ]
        for name in names:
            if name not in by_name:
                raise InvalidArgument.of_name("field of actions", name, by_name)
            if uses[name].has_gaps:
                whole = [one for one, use in uses.items() if use.has_numbers and not use.has_gaps]
                raise InvalidArgument(
                    f"the field '{name}' of the desired action was not given in some steps (NaN), "
                    f"so it cannot be learned; choose fields by --action: {', '.join(whole)}"
                )
        if not names:
            raise InvalidArgument("the desired actions have no numbers")
        return [by_name[name] for name in names]


class _Companion:
    """The newest element of a companion at a step."""

    def __init__(
        self, session: LoggedSession, name: str, parts: Sequence[Field], period: int
    ) -> None:
        self._companion = session.companion(name)
        self._parts = parts
        self._period = period
        read = self._companion.read()
        self._elements = read.observations
        stamps = None if read.observations is None else read.observations["stamp"]
        self._arrivals = np.asarray(stamps["arrival_index"] if stamps is not None else [], np.int64)
        self._captures = np.asarray(stamps["capture_index"] if stamps is not None else [], np.int64)

    def at(self, steps: NDArray[np.int64]) -> Array:
        """Rows of all numbers, and the age [s]; zeros and -1 before the first element."""
        width = sum(part.size for part in self._parts)
        values = np.zeros((len(steps), width + 1), np.float32)
        values[:, -1] = -1.0
        rows = np.searchsorted(self._arrivals, steps, side="right") - 1
        there = rows >= 0
        if there.any() and self._elements is not None:
            found = rows[there]
            if width:
                values[there, :-1] = _joined(self._parts, self._elements[found])
            values[there, -1] = (steps[there] - self._captures[found]) * (1e-9 * self._period)
        return values


class Pictures:
    """The images of an episode: for each row the newest one of each camera that had arrived."""

    def __init__(self, episode: Episode, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._cameras = LoggedCameras(episode.session)
        read = self._cameras.companion.read()
        elements = read.observations
        if elements is None:
            raise InvalidArgument(f"{episode} has no images")
        self._arrivals: dict[str, NDArray[np.int64]] = {}
        self._captures: dict[str, NDArray[np.int64]] = {}
        self._indices: dict[str, NDArray[np.int64]] = {}
        for name in self.names:
            number = self._cameras.names.index(name)
            is_good = elements[name]["state"] == GOOD
            good = [
                row
                for row in np.flatnonzero(is_good)
                if self._cameras._log.has(int(read.time_index[row]), number)
            ]
            stamps = elements["stamp"][good]
            self._arrivals[name] = stamps["arrival_index"].astype(np.int64)
            self._captures[name] = stamps["capture_index"].astype(np.int64)
            self._indices[name] = read.time_index[good]

    def first(self, episode: Episode) -> int | None:
        """The first step at which an image of each camera had arrived; None if it never came."""
        arrivals = [self._arrivals[name] for name in self.names]
        if any(len(one) == 0 or one[0] >= episode.end for one in arrivals):
            return None
        return max(episode.first, *(int(one[0]) for one in arrivals))

    def rows(self, name: str, steps: NDArray[np.int64]) -> NDArray[np.int64]:
        """The number of the camera's image for each step; equal numbers are the same image."""
        return np.searchsorted(self._arrivals[name], steps, side="right") - 1

    def ages(self, steps: NDArray[np.int64], period: int) -> Array:
        """The age of the image of each camera [s], a row for each step; `period` in ns."""
        captured = [self._captures[name][self.rows(name, steps)] for name in self.names]
        ages: Array = (steps[:, None] - np.stack(captured, axis=1)) * (1e-9 * period)
        return ages.astype(np.float32)

    def image(self, name: str, row: int) -> NDArray[np.uint8]:
        """An image in RGB, of an even number of rows and columns, as films need it."""
        image = self._cameras.at(int(self._indices[name][row]))[name]
        height, width = image.shape[:2]
        return image[: height // 2 * 2, : width // 2 * 2]


def _dtypes(session: LoggedSession) -> dict[str, np.dtype[Any]]:
    return {
        "observation": session.observation_dtype,
        "desired_action": session.action_dtype,
        "applied_action": session.applied_action_dtype,
    }


def _short(companion: LoggedSession) -> str:
    return companion.name.rpartition(".")[2]


def _is_measured(part: Field) -> bool:
    return part.dtype == "float32" and not part.name.startswith(STAMP)


def _companion_names(companion: str, parts: Sequence[Field]) -> list[str]:
    numbers = [f"{companion}.{name}" for part in parts for name in part.names]
    return [*numbers, f"{companion}.age"]


def _vector(name: str, parts: Sequence[Field]) -> Feature:
    names = tuple(itertools.chain.from_iterable(part.names for part in parts))
    return Feature(name, "float32", (len(names),), names)


def _joined(parts: Sequence[Field], elements: Any) -> Array:
    return np.concatenate([part.of(elements) for part in parts], axis=1)


def _camera_rate(session: LoggedSession, period: int) -> int | None:
    """The rate of the cameras as a whole number; None if there are too few images to tell."""
    captures = session.companion(COMPANION).read().observations
    if captures is None or len(captures) < 2:
        return None
    between = float(np.median(np.diff(captures["stamp"]["capture_index"].astype(np.int64))))
    return max(1, round(1e9 / (between * period))) if between > 0 else None
