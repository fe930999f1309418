# SPDX-License-Identifier: BSD-3-Clause
"""Who says that an episode has succeeded, if its task does not: a key, or what cameras see.

    judge = judge_of("keys", print)
    with judge(training):
        training.run()

A judge by images is taught by the logs of a training that was judged by keys: taught(folder).
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import select
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from trifinger._trifinger import observe
from trifinger.arrays import Array
from trifinger.cameras import Images, LiveCameras, calibration_of
from trifinger.errors import CameraLost, HistoryLost, InvalidArgument, NotInLog
from trifinger.log.images import LoggedCameras
from trifinger.training import checkpoint
from trifinger.training.experience import (
    COMPANION,
    FACTS,
    JUDGED,
    SUCCESS,
    TERMINATED,
    TRUNCATED,
    Book,
    LiveExperience,
    sessions_in,
)
from trifinger.training.on_robot import RobotTraining, Verdict
from trifinger.whole_file import replace_file

Tell = Callable[[Verdict], None]
JUDGE = "judge.npz"  # the file in the folder of the training that has taught it
POLL = 0.1  # s between two looks for the end
HELD = 1.0  # s without a key, after which it is a new one: terminals repeat keys that are held
PERIOD = 0.1  # s between two sets of images that are looked at
SHOWS_SUCCESS = 0.3  # s before the verdict: whoever gave it had to see the success first
MAY_SHOW_SUCCESS = 1.0  # s before the verdict; images between the two teach nothing
IN_A_ROW = 2  # sets of images that must show a success
SIZE = 16  # pixels of an image in either direction
FEWEST, MOST = 5, 100  # successes, and failures, that teach; the newest ones
FOLDS = 4  # parts of the episodes: a judge of each is taught by the others
RIDGE = 0.5  # of the variance of a pixel: how little it shall count if there are few images
NO_CHANCE = 2.33  # standard deviations: pure chance gets there in one of 100 cases


def judge_of(
    word: str, say: Callable[[str], None]
) -> Callable[[RobotTraining], AbstractContextManager[None]]:
    """What judges a training while a block lasts, by "keys" or by the folder that teaches it.

    `say` gets lines for people. Raises InvalidArgument as judging_by_keys() and taught() do.
    """
    if word == "keys":
        say("s: success, f: failure")
        return lambda training: judging_by_keys(training.tell)
    judge = taught(Path(word))
    say(judge.words)
    return lambda training: judge.judging(training.robot, training.process, training.tell, say)


# ---- keys ----


@contextlib.contextmanager
def judging_by_keys(tell: Tell, descriptor: int | None = None) -> Iterator[None]:
    """Tells what keys of the terminal say while the block lasts: s for success, f for failure.

    `descriptor` is that of the terminal; by default standard input. However the block ends, the
    terminal is as it was before. Raises InvalidArgument if it is none.
    """
    terminal = sys.stdin.fileno() if descriptor is None else descriptor
    if not os.isatty(terminal):
        raise InvalidArgument("standard input is not a terminal, so there are no keys to judge by")
    before = termios.tcgetattr(terminal)
    try:
        tty.setcbreak(terminal)
        with _beside(lambda ended: _read_keys(terminal, tell, ended)):
            yield
    finally:
        termios.tcsetattr(terminal, termios.TCSAFLUSH, before)


def _read_keys(terminal: int, tell: Tell, ended: threading.Event) -> None:
    verdicts: dict[bytes, Verdict] = {b"s": "success", b"f": "failure"}
    last, typed = b"", 0.0
    with contextlib.suppress(OSError):  # the terminal is gone
        while not ended.is_set():
            if select.select([terminal], [], [], POLL)[0]:
                if not (key := os.read(terminal, 1)):
                    return
                if key in verdicts and (key != last or time.monotonic() > typed + HELD):
                    tell(verdicts[key])
                last, typed = key, time.monotonic()


@contextlib.contextmanager
def _beside(work: Callable[[threading.Event], None]) -> Iterator[None]:
    ended = threading.Event()
    thread = threading.Thread(target=work, args=(ended,), daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


# ---- images ----


@dataclasses.dataclass(frozen=True)
class ImageJudge:
    """Says whether what cameras see is a success."""

    names: tuple[str, ...]
    """The names of the cameras."""
    weights: Array
    """What each of their pixels adds to the score."""
    threshold: float
    """Images with a score above it show a success."""
    words: str
    """How good it is, as a sentence."""

    def score(self, sets: Array) -> Array:
        """The scores of sets of images; a set is what pixels_of() returns."""
        scores: Array = _features(sets) @ self.weights
        return scores

    def store(self, path: Path) -> None:
        """Writes a file that load() reads."""
        replace_file(path, checkpoint.dump(dataclasses.astuple(self)))

    @classmethod
    def load(cls, path: Path) -> ImageJudge:
        """Reads what store() has written; nothing in it can run. Raises InvalidArgument."""
        try:
            judge = cls(*checkpoint.load(path.read_bytes()))
            judge.score(np.zeros((1, SIZE, SIZE, 3 * len(judge.names)), np.uint8))
        except (OSError, ValueError, TypeError) as error:
            raise InvalidArgument(f"{path} is no judge: {error}") from None
        return judge

    @contextlib.contextmanager
    def judging(
        self, robot: str, process: int, tell: Tell, say: Callable[[str], None]
    ) -> Iterator[None]:
        """Tells the successes that the robot's cameras see while the block lasts.

        `process` is the number of the decision process of the robot's episodes. `say` gets a
        sentence if the judge cannot go on. Raises InvalidArgument if the robot has no cameras.
        """
        with observe(robot) as one:
            cameras = LiveCameras(robot, calibration_of(one))
        live, streak = LiveExperience(robot, process), Streak(self.threshold)

        def watch(ended: threading.Event) -> None:
            due = 0.0
            try:
                while not ended.wait(max(due - time.monotonic(), 0.0)):
                    if (images := cameras.next(POLL)) is None:
                        continue
                    due = time.monotonic() + PERIOD
                    if images.names != self.names:
                        raise InvalidArgument(f"it sees by {images.names}, and knows {self.names}")
                    streak.follow(live.take(), time.monotonic())
                    with contextlib.suppress(CameraLost, HistoryLost):
                        if streak.add(self.score(pixels_of(images)[None])[0], images.time):
                            tell("success")
            except Exception as error:
                say(f"nobody judges any more: {error}")

        with _beside(watch):
            yield


class Streak:
    """Counts the scores of an episode above a threshold that follow one another."""

    def __init__(self, threshold: float) -> None:
        self._threshold = threshold
        self._episode: object = None
        self._begin = 0.0  # when it was first seen, on the monotonic clock [s]
        self._left = 0  # scores that are missing; 0 if nothing is to be told any more

    def follow(self, elements: Array, now: float) -> None:
        """Takes experience of the robot that is new, if there is any."""
        if len(elements):
            newest = elements[-1]
            episode = tuple(int(newest[name]) for name in ("session", "seed", "episode"))
            if episode != self._episode:
                self._episode, self._begin, self._left = episode, now, IN_A_ROW
            if newest["flags"] & (TERMINATED | TRUNCATED):
                self._left = 0

    def add(self, score: float, time: float) -> bool:
        """Whether a success is to be told, by images of this time: once an episode."""
        # Older images show what the episode before has done.
        if self._left == 0 or time < self._begin:
            return False
        self._left = self._left - 1 if score > self._threshold else IN_A_ROW
        return self._left == 0


def pixels_of(images: Images) -> Array:
    """The images of all cameras, smaller: uint8[SIZE, SIZE, 3 * cameras]."""
    size, mean = (SIZE, SIZE), Image.Resampling.BOX
    small = [Image.fromarray(images[name]).resize(size, mean) for name in images.names]
    return np.concatenate([np.asarray(one) for one in small], axis=2)


# ---- what teaches ----


class Seen(NamedTuple):
    """Sets of images of an episode: uint8[sets, SIZE, SIZE, 3 * cameras]."""

    before: Array
    """Those that show no success."""
    success: Array
    """Those that show one; none if the episode has failed."""


def taught(folder: Path) -> ImageJudge:
    """The judge that a training in a folder teaches, in which somebody judged by keys.

    It is kept there as JUDGE. Raises InvalidArgument if there is too little to learn from, or if
    images do not show what has succeeded.
    """
    if not (folder / JUDGE).exists():
        teach(*seen_in(folder / "logs")).store(folder / JUDGE)
    return ImageJudge.load(folder / JUDGE)


def seen_in(logs: Path) -> tuple[tuple[str, ...], list[Seen]]:
    """The names of the cameras, and what they saw of the newest episodes that were judged."""
    if not logs.is_dir():
        return (), []
    episodes = _judged_episodes(logs)
    sets: list[tuple[list[Array], list[Array]]] = [([], []) for _ in episodes]
    names: tuple[str, ...] = ()
    for session in sessions_in(logs):
        try:
            cameras = LoggedCameras(session)
        except InvalidArgument:  # it has none
            continue
        if names not in ((), cameras.names):
            raise InvalidArgument(f"the logs in {logs} are of different cameras")
        names = cameras.names
        captured = cameras.companion.observations["stamp"]["capture_index"]
        for episode, kinds in zip(episodes, sets, strict=True):
            if episode[0]["session"] != session.session_id:
                continue
            rows = (captured >= episode[0]["step"]) & (captured <= episode[-1]["step"])
            age = (episode[-1]["step"] - captured[rows]) * session.period
            # One set of images in each period: a judge looks no more often.
            _, kept = np.unique(np.floor(age / PERIOD + 1e-6), return_index=True)
            for index, one in zip(cameras.companion.time_index[rows][kept], age[kept], strict=True):
                is_near = _has_succeeded(episode) and bool(one <= MAY_SHOW_SUCCESS)
                if not is_near or one <= SHOWS_SUCCESS:
                    with contextlib.suppress(CameraLost, NotInLog):
                        kinds[is_near].insert(0, pixels_of(cameras.at(int(index))))
    shape = (-1, SIZE, SIZE, 3 * max(len(names), 1))
    seen = [Seen(*(np.array(kind, np.uint8).reshape(shape) for kind in kinds)) for kinds in sets]
    # One whose images of its kind are missing says nothing.
    both = zip(seen, episodes, strict=True)
    return names, [one for one, episode in both if len(one[_has_succeeded(episode)])]


# The experience of the newest episodes that were judged.
def _judged_episodes(logs: Path) -> list[Array]:
    book = Book(sys.maxsize)
    for session in sessions_in(logs):
        for one in session.companions:
            if one.name.rpartition(".")[2] == COMPANION:
                facts = one.get_observations(*one.range("observation"), fields=FACTS)
                book.add(facts[facts["flags"] & JUDGED != 0])
    elements, _ = book.since(0)
    if not len(elements):
        return []
    kinds: tuple[list[Array], list[Array]] = ([], [])
    for episode in np.split(elements, np.flatnonzero(elements["actions"] == 0)):
        is_whole = len(np.unique(episode[["session", "seed", "episode"]])) == 1
        if is_whole and episode[-1]["flags"] & (TERMINATED | TRUNCATED):
            kinds[_has_succeeded(episode)].append(episode)
    return [*kinds[0][-MOST:], *kinds[1][-MOST:]]


def _has_succeeded(episode: Array) -> bool:
    return bool(episode[-1]["flags"] & SUCCESS)


# ---- teaching ----


def teach(names: Sequence[str], episodes: Sequence[Seen]) -> ImageJudge:
    """A judge that was taught by what the cameras of these names saw; as taught()."""
    good, bad = ([one for one in episodes if bool(len(one.success)) == kind] for kind in (1, 0))
    if min(len(good), len(bad)) < FEWEST:
        raise InvalidArgument(
            f"there are images of {len(good)} successes and {len(bad)} failures that somebody "
            f"judged; to teach a judge takes {FEWEST} of each"
        )
    # Successes first, so that each part has as many of them as any other.
    order = [*good, *bad]
    fits = [
        _fit([one for i, one in enumerate(order) if i % FOLDS != fold]) for fold in range(FOLDS)
    ]
    # What each says of the episodes that it was not shown.
    lasting = [_lasting(_features(one.before) @ fits[i % FOLDS]) for i, one in enumerate(order)]
    early, failed = np.split(lasting, [len(good)])
    success = np.array(
        [np.median(_features(one.success) @ fits[i % FOLDS]) for i, one in enumerate(good)]
    )
    # The test of Mann and Whitney, by whole episodes: images of one are alike.
    wins = np.mean(success[:, None] > failed)
    spread = np.sqrt((len(episodes) + 1) / (12 * len(good) * len(bad)))
    if wins < 0.5 + NO_CHANCE * spread:
        raise InvalidArgument(
            "the images do not show what has succeeded: of episodes that it was not shown, a judge "
            "knows no more than chance does"
        )
    _, threshold, found, false = max(_tried(success, early, failed))
    words = (
        f"taught by {len(good)} successes and {len(bad)} failures; of episodes that it was not "
        f"shown, it knows {found} of the successes, and takes {false} others for a success"
    )
    return ImageJudge(tuple(names), np.mean(fits, axis=0), threshold, words)


# Thresholds with what they lead to: the F-score for which a false success is worse than one that is
# missed, and the numbers of true and of false successes.
def _tried(success: Array, early: Array, failed: Array) -> Iterator[tuple[float, float, int, int]]:
    scores = np.unique(np.concatenate([success, early, failed]))
    for threshold in np.convolve(scores[np.isfinite(scores)], (0.5, 0.5), "valid").tolist():
        found = int(np.sum((success > threshold) & (early <= threshold)))
        false = int(np.sum(early > threshold) + np.sum(failed > threshold))
        yield 1.25 * found / (found + 0.25 * len(success) + false), threshold, found, false


# The highest score that IN_A_ROW sets of images have.
def _lasting(scores: Array) -> float:
    runs = (scores[i : i + IN_A_ROW] for i in range(len(scores) - IN_A_ROW + 1))
    return max((float(run.min()) for run in runs), default=-np.inf)


# What does not change with the light: each colour of a camera, less its mean, by its spread.
def _features(sets: Array) -> Array:
    pixels = sets.astype(np.float32)
    pixels -= pixels.mean(axis=(1, 2), keepdims=True)
    pixels /= pixels.std(axis=(1, 2), keepdims=True) + 1.0
    return pixels.reshape(len(sets), math.prod(sets.shape[1:]))


# The weights by which successes come nearest to 1, and all else to -1: ridge regression.
def _fit(shows: Sequence[Seen]) -> Array:
    before, success = (_features(np.concatenate(kind)) for kind in zip(*shows, strict=True))
    spread = RIDGE * np.eye(before.shape[1], dtype=np.float32)
    for kind in (before, success):
        spread += kind.T @ kind / len(kind)
    return np.linalg.solve(spread, success.mean(axis=0) - before.mean(axis=0))
