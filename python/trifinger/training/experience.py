# SPDX-License-Identifier: BSD-3-Clause
"""What robots have lived through, as their companion "experience" tells it: docs/log_format.md."""

import bisect
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from trifinger._trifinger import Frontend, Log, LoggedSession, list_sessions, observe
from trifinger.arrays import Array
from trifinger.errors import Error, HistoryLost, InvalidArgument, RobotStopped, SessionNotFound

COMPANION = "experience"
TERMINATED, TRUNCATED, SUCCESS, LATE, INTERVENTION, JUDGED = 1, 2, 4, 8, 16, 32  # flags
PART = 10_000  # elements that a learner gets at once
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
    parts = {name: elements[name] for name in FACTS}
    parts |= {name: elements[name][:, : elements[0][count]] for name, count in ARRAYS.items()}
    kinds = [(name, part.dtype, part.shape[1:]) for name, part in parts.items()]
    packed = np.zeros(len(elements), kinds)
    for name, part in parts.items():
        packed[name] = part
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
                self._next = end
                if len(part := compact(elements, self._process)):
                    parts.append(part)
            if not has_ended:
                break
            self._companion = None
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


def sessions_in(path: Path, say: Callable[[str], None] = lambda _: None) -> Iterator[LoggedSession]:
    """The sessions in a log, or in all logs of a folder.

    Of a folder, logs that cannot be read, such as one that was killed at its begin, are left out;
    `say` gets the reason.
    """
    if not path.is_dir():
        yield from Log(path).sessions
        return
    for file in sorted(path.glob("*.mcap")):
        try:
            yield from Log(file).sessions
        except Error as error:
            say(f"left out: {error}")


def of_logs(
    path: Path,
    process: int,
    say: Callable[[str], None] = lambda _: None,
    check: Callable[[str | None], None] = lambda _: None,
) -> Iterator[Array]:
    """The experience of one decision process in what sessions_in() finds, by session.

    `check` gets the configuration of the robot of each session, and may raise an error.
    """
    for session in sessions_in(path, say):
        for companion in session.companions:
            first, end = companion.range("observation")
            if companion.name.rpartition(".")[2] == COMPANION and first < end:
                elements = compact(np.asarray(companion.observations), process)
                if len(elements):
                    check(session.documents.get("configuration.yml"))
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

    What there is when keep() is called stays, and so do interventions: they are demonstrations.
    One thread adds; any may read.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._data: Array = np.zeros(0, [("number", "i8"), ("element", "i8")])  # with free room
        self._count = 0  # of elements in _data
        self.end = 0
        """Number of the next element."""
        self._kept = 0  # number of the first element that need not stay
        self._staying = 0  # elements in _data that stay, as far as it is known
        self._newest: dict[int, int] = {}  # step of the newest element of each session
        self._changed = threading.Condition()

    def keep(self) -> int:
        """Lets all elements that are there stay, before any is read; returns their number."""
        self.end = self._kept = self._staying = self._count
        self._data["number"][: self._count] = range(self._count)
        return self._count

    def add(self, elements: Array) -> Array:
        """Adds those of these elements, in the order of their steps, that are not known.

        Returns them.
        """
        if not len(elements):
            return elements
        sessions = elements["session"].tolist()
        added = elements[elements["step"] > [self._newest.get(one, -1) for one in sessions]]
        # The last one of each session is the newest.
        self._newest |= dict(zip(added["session"].tolist(), added["step"].tolist(), strict=True))
        with self._changed:
            if not self.end:
                self._data = np.zeros(0, [("number", "i8"), ("element", added.dtype)])
            if self._count + len(added) - self._staying > self._size + self._size // 4:
                self._forget(len(added))
            first, self._count = self._count, self._count + len(added)
            if self._count > len(self._data):
                self._data = np.resize(self._data, self._count + self._count // 4)
            self._data["element"][first : self._count] = added
            self._data["number"][first : self._count] = range(self.end, self.end + len(added))
            self.end += len(added)
            self._changed.notify_all()
        return added

    # Removes the oldest elements, so that there are as many as there should be with those to come.
    def _forget(self, to_come: int) -> None:
        data = self._data[: self._count]
        by_person = data["element"]["flags"] & INTERVENTION != 0
        # What a person did begins at the element before it.
        stays = (data["number"] < self._kept) | by_person | np.append(by_person[1:], False)
        old = np.flatnonzero(~stays)
        surplus = max(len(old) + to_come - self._size, 0)
        self._data = np.delete(data, old[:surplus])
        self._count, self._staying = len(self._data), len(stays) - len(old)

    def since(
        self, number: int, timeout: float = 0.0, most: int | None = None
    ) -> tuple[Array, int]:
        """The elements from a number on, at most so many, and the number after them.

        Waits for one if needed. Numbers count also what was removed.
        """
        with self._changed:
            self._changed.wait_for(lambda: self.end > number, timeout)
            numbers = self._data["number"][: self._count]
            first = bisect.bisect_left(numbers, number)
            end = self._count if most is None else min(self._count, first + most)
            following = int(numbers[end - 1]) + 1 if end > first else number
            return self._data["element"][first:end].copy(), following
