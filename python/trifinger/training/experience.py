# SPDX-License-Identifier: BSD-3-Clause
"""What robots have lived through, as their companion "experience" tells it: docs/log_format.md."""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from trifinger._trifinger import Frontend, Log, list_sessions, observe
from trifinger.arrays import Array
from trifinger.errors import (
    Error,
    HistoryLost,
    InvalidArgument,
    RobotStopped,
    SessionNotFound,
)

COMPANION = "experience"
TERMINATED, TRUNCATED, SUCCESS, LATE = 1, 2, 4, 8  # flags
FACTS = ("session", "step", "seed", "episode", "actions", "policy", "reward", "flags")
ARRAYS = {  # and the field that says how many of their numbers count
    "observation": "num_observed",
    "action": "num_acted",
    "achieved": "num_goal",
    "desired": "num_goal",
}


def digest_of(metadata: Mapping[str, str]) -> int:
    """The number of a decision process, by the metadata of its policies: FNV-1a, as in C++."""
    hashed = 0xCBF29CE484222325
    for byte in f"{metadata['task']}\n{metadata['options']}\n".encode():
        hashed = (hashed ^ byte) * 0x100000001B3 % 2**64
    return hashed


def compact(elements: Array, process: int) -> Array:
    """The elements of one decision process, without stamps and zeros at the end of arrays."""
    elements = elements[elements["process"] == process]
    if not len(elements):
        return np.zeros(0)
    kinds: list[Any] = [(name, elements.dtype[name]) for name in FACTS]
    lengths = {name: int(elements[0][count]) for name, count in ARRAYS.items()}
    kinds += [(name, np.dtype("f4"), (length,)) for name, length in lengths.items()]
    packed = np.zeros(len(elements), kinds)
    for name in FACTS:
        packed[name] = elements[name]
    for name, length in lengths.items():
        packed[name] = elements[name][:, :length]
    return packed


class LiveExperience:
    """The experience of a robot that runs, of one decision process, as it comes."""

    def __init__(self, robot: str, process: int) -> None:
        """Raises SessionNotFound, or InvalidArgument if the robot's back-end does not tell any."""
        self._name, self._process = f"{robot}.{COMPANION}", process
        if self._name not in {one.name for one in list_sessions()}:
            observe(robot).close()  # says what runs if the robot does not
            raise InvalidArgument(f"the back-end of '{robot}' tells no experience")
        self.missed = 0
        """Number of elements that were overwritten before take(): the logs have them."""
        self._companion: Frontend | None = None
        self._session = -1
        self._next = 0

    def take(self) -> Array:
        """The elements that have come since the last call, as compact() makes them."""
        parts: list[Array] = []
        while (companion := self._companion or self._open()) is not None:
            has_ended = companion.fault() is not None  # asked first: nothing comes after it
            first, end = companion.range("observation")
            self.missed += max(0, first - self._next) if self._next else 0
            first = max(first, self._next)
            if first < end:
                try:
                    elements = np.asarray(companion.get_observations(first, end))
                except HistoryLost:
                    continue  # it was long ago that the range was asked for
                parts.append(compact(elements, self._process))
                self._next = end
            if not has_ended:
                break
            self._companion = None
        parts = [part for part in parts if len(part)]
        return np.concatenate(parts) if parts else np.zeros(0)

    # Looks for a session that was not read yet.
    def _open(self) -> Frontend | None:
        try:
            companion = observe(self._name)
        except (SessionNotFound, RobotStopped):
            return None
        session = companion.session_info().session_id
        if session != self._session:
            self._companion, self._session, self._next = companion, session, 0
        return self._companion


def of_logs(
    path: Path, process: int, say: Callable[[str], None] = lambda _: None
) -> Iterator[Array]:
    """The experience of one decision process in a log, or in all logs of a folder, by session.

    Of a folder, logs that cannot be read, such as one that was killed at its begin, are left out;
    `say` gets the reason.
    """
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    for file in files:
        try:
            sessions = Log(file).sessions
        except Error as error:
            if not path.is_dir():
                raise
            say(f"left out: {error}")
            continue
        for session in sessions:
            for companion in session.companions:
                first, end = companion.range("observation")
                if companion.name.rpartition(".")[2] == COMPANION and first < end:
                    elements = compact(np.asarray(companion.observations), process)
                    if len(elements):
                        yield elements


class Transition(NamedTuple):
    """What followed an action."""

    before: Array
    """The element of the state in which the action was chosen."""
    after: Array
    """The element of the next state; its action, reward and flags are those of the transition."""
    is_cut: bool
    """It is not known how the episode goes on, because of a fault, a late action or an end."""

    @property
    def terminated(self) -> bool:
        """Whether nothing can follow: the value of the next state does not count."""
        return bool(self.after["flags"] & TERMINATED)

    @property
    def ended(self) -> bool:
        """Whether the next transition is one of another episode, or of another part of this one."""
        return self.is_cut or bool(self.after["flags"] & (TERMINATED | TRUNCATED))


class Episodes:
    """Makes transitions of elements, none across a gap, a fault or a late action.

    A transition comes when it is known whether another one follows it, so an element later.
    """

    def __init__(self) -> None:
        self._last: Array | None = None
        self._waiting: Transition | None = None

    def add(self, elements: Iterable[Array]) -> Iterator[Transition]:
        """The transitions that these elements, the next ones, complete."""
        for element in elements:
            last, self._last = self._last, element
            follows = last is not None and _follows(last, element)
            if self._waiting is not None:
                yield self._waiting._replace(is_cut=not follows)
                self._waiting = None
            if last is None or not follows:
                continue
            transition = Transition(last, element, is_cut=False)
            if transition.ended:
                yield transition
            else:
                self._waiting = transition


def _follows(last: Array, element: Array) -> bool:
    same = all(last[name] == element[name] for name in ("session", "seed", "episode"))
    next_one = element["actions"] == last["actions"] + 1 and element["step"] > last["step"]
    return bool(same and next_one and not element["flags"] & LATE)


class Book:
    """The newest experience, about `size` elements, each once whatever log or session it is of.

    One thread adds; any may read.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._elements: list[Array] = []
        self._first = 0  # number of the oldest that is kept
        self._newest: dict[int, int] = {}  # step of the newest element of each session
        self._changed = threading.Condition()

    def add(self, elements: Array) -> Array:
        """Adds those of these elements, in the order of their steps, that are not known.

        Returns them.
        """
        new = [one for one in elements if one["step"] > self._newest.get(int(one["session"]), -1)]
        for element in new:
            self._newest[int(element["session"])] = int(element["step"])
        with self._changed:
            self._elements += new
            surplus = len(self._elements) - self._size
            if surplus > self._size // 4:  # seldom, because all are moved
                del self._elements[:surplus]
                self._first += surplus
            self._changed.notify_all()
        return np.stack(new) if new else np.zeros(0)

    def since(self, number: int, timeout: float = 0.0) -> tuple[Array, int]:
        """The elements from a number on, and the number after them; waits for one if needed."""
        with self._changed:
            self._changed.wait_for(lambda: self._first + len(self._elements) > number, timeout)
            elements = self._elements[max(number - self._first, 0) :]
            number = self._first + len(self._elements)
        return (np.stack(elements) if elements else np.zeros(0)), number
