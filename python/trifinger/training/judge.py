# SPDX-License-Identifier: BSD-3-Clause
"""Who says that an episode has succeeded, if its task does not: a key, or what cameras see.

    judge = judge_of("keys", print)
    with judge(training):
        training.run()

A judge by images is taught by the logs of a training that was judged by keys: taught(folder).
"""

from __future__ import annotations

import contextlib
import copy
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
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from torch import nn
from torch.nn import functional

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
    LiveExperience,
    sessions_in,
)
from trifinger.whole_file import replace_file

if TYPE_CHECKING:
    from trifinger.training.on_robot import RobotTraining, Verdict

    Tell = Callable[[Verdict], None]

JUDGE = "judge.npz"  # the file in the folder of the training that has taught it
POLL = 0.1  # s between two looks for the end
HELD = 1.0  # s without a key, after which it is a new one: terminals repeat keys that are held
PERIOD = 0.1  # s between two sets of images that are looked at
SHOWS_SUCCESS = 0.3  # s before the verdict: whoever gave it had to see the success first
MAY_SHOW_SUCCESS = 1.0  # s before the verdict; images between the two teach nothing
IN_A_ROW = 2  # sets of images that must show a success
SIZE = 64  # pixels of an image in either direction
FEWEST, MOST = 5, 100  # successes, and failures, that teach; the newest ones
FOLDS = 4  # networks, each tried with episodes that it was not shown
BATCH = 32
LOOK = 20  # steps between two looks at what it was not shown
PATIENCE = 4  # looks that are no better end the training
MOST_STEPS = 500
GOOD_ENOUGH = 0.03  # loss of what it was not shown
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
    while not ended.is_set():
        if not select.select([terminal], [], [], POLL)[0]:
            continue
        try:
            key = os.read(terminal, 1)
        except OSError:
            key = b""
        if not key:  # the terminal is gone
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


class ImageJudge:
    """Says whether what cameras see is a success."""

    def __init__(
        self, names: Sequence[str], networks: Sequence[nn.Module], threshold: float, words: str
    ) -> None:
        """The scores of the networks, which were taught by other episodes each, are averaged."""
        self.names, self._networks = tuple(names), networks
        self.threshold = threshold
        """Images with a score above it show a success."""
        self.words = words
        """How good it is, as a sentence."""

    def score(self, sets: Array) -> Array:
        """The scores of sets of images; a set is what pixels_of() returns."""
        scores: Array = np.mean([_scores(network, sets) for network in self._networks], axis=0)
        return scores

    def store(self, path: Path) -> None:
        """Writes a file that load() reads."""
        parameters = [network.state_dict() for network in self._networks]
        replace_file(path, checkpoint.dump((self.names, parameters, self.threshold, self.words)))

    @classmethod
    def load(cls, path: Path) -> ImageJudge:
        """Reads what store() has written; nothing in it can run. Raises InvalidArgument."""
        try:
            names, parameters, threshold, words = checkpoint.load(path.read_bytes())
            networks = [_network(len(names)) for _ in parameters]
            for network, values in zip(networks, parameters, strict=True):
                network.load_state_dict(values)
            return cls(names, networks, float(threshold), str(words))
        except (OSError, ValueError, TypeError, AttributeError, RuntimeError) as error:
            raise InvalidArgument(f"{path} is no judge: {error}") from None

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

        def guarded(ended: threading.Event) -> None:
            try:
                watch(ended)
            except Exception as error:
                say(f"nobody judges any more: {error}")

        with _beside(guarded):
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
    """The images of all cameras, smaller: uint8[3 * cameras, SIZE, SIZE]."""
    rgb = [torch.from_numpy(images[name]).permute(2, 0, 1).float() for name in images.names]
    small = torch.cat([functional.adaptive_avg_pool2d(one, SIZE) for one in rgb])
    return small.round().byte().numpy()


# ---- what teaches ----


class Seen(NamedTuple):
    """Sets of images of an episode: uint8[sets, 3 * cameras, SIZE, SIZE]."""

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
            # As many sets as a judge would see.
            _, kept = np.unique(np.floor(age / PERIOD + 1e-6), return_index=True)
            for index, one in zip(cameras.companion.time_index[rows][kept], age[kept], strict=True):
                is_near = _has_succeeded(episode) and bool(one <= MAY_SHOW_SUCCESS)
                if not is_near or one <= SHOWS_SUCCESS:
                    with contextlib.suppress(CameraLost, NotInLog):
                        kinds[is_near].insert(0, pixels_of(cameras.at(int(index))))
    none = np.zeros((0, 3 * len(names), SIZE, SIZE), np.uint8)
    seen = [Seen(*(np.array(kind) if kind else none for kind in kinds)) for kinds in sets]
    # One whose images of its kind are missing says nothing.
    both = zip(seen, episodes, strict=True)
    return names, [one for one, episode in both if len(one[_has_succeeded(episode)])]


# The experience of the newest episodes that were judged.
def _judged_episodes(logs: Path) -> list[Array]:
    parts = [
        np.array(one.get_observations(*one.range("observation"), fields=FACTS))
        for session in sessions_in(logs)
        for one in session.companions
        if one.name.rpartition(".")[2] == COMPANION
    ]
    if not parts:
        return []
    elements = np.concatenate(parts)
    # A log that follows another one begins with what that one had last.
    _, first = np.unique(elements[["session", "step"]], return_index=True)
    elements = elements[np.sort(first)]
    elements = elements[elements["flags"] & JUDGED != 0]
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
    torch.set_num_threads(1)
    torch.manual_seed(0)
    networks, success, early, failed = [], [], [], []
    for fold in range(FOLDS):
        # Successes first, so that each part has as many of them as any other.
        shows = [one for i, one in enumerate(good + bad) if i % FOLDS != fold]
        held = (good + bad)[fold::FOLDS]
        networks.append(network := _fit(len(names), shows, held))
        for one in held:
            lasting = _lasting(_scores(network, one.before))
            if len(one.success):
                success.append(np.median(_scores(network, one.success)))
                early.append(lasting)
            else:
                failed.append(lasting)
    # The test of Mann and Whitney, by whole episodes: images of one are alike.
    wins = np.mean(np.array(success)[:, None] > np.array(failed))
    spread = np.sqrt((len(episodes) + 1) / (12 * len(good) * len(bad)))
    if wins < 0.5 + NO_CHANCE * spread:
        raise InvalidArgument(
            "the images do not show what has succeeded: of episodes that it was not shown, a judge "
            "knows no more than chance does"
        )
    _, threshold, found, false = max(_tried(np.array(success), np.array(early), np.array(failed)))
    words = (
        f"taught by {len(good)} successes and {len(bad)} failures; of episodes that it was not "
        f"shown, it knows {found} of the successes, and takes {false} others for a success"
    )
    return ImageJudge(names, networks, threshold, words)


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


def _network(cameras: int) -> nn.Module:
    return nn.Sequential(
        *(nn.Conv2d(3 * cameras, 16, 3, 2, 1), nn.ReLU()),
        *(nn.Conv2d(16, 32, 3, 2, 1), nn.ReLU()),
        *(nn.Conv2d(32, 32, 3, 2, 1), nn.ReLU()),
        *(nn.Flatten(), nn.Dropout(0.3), nn.Linear(32 * (SIZE // 8) ** 2, 64), nn.ReLU()),
        *(nn.Dropout(0.3), nn.Linear(64, 1), nn.Flatten(0)),
    ).eval()


@torch.no_grad()
def _scores(network: nn.Module, sets: Array) -> Array:
    parts = torch.split(torch.from_numpy(sets), BATCH)
    scores: Array = torch.cat([network(_input(part)) for part in parts]).numpy()
    return scores


def _input(sets: torch.Tensor) -> torch.Tensor:
    return sets.float() / 255 - 0.5


# Other light, and cameras that have moved a little.
def _varied(sets: torch.Tensor) -> torch.Tensor:
    x, y = torch.randint(3, (2,)).tolist()
    moved = functional.pad(sets, (1, 1, 1, 1), "replicate")[:, :, y : y + SIZE, x : x + SIZE]
    light = 1 + 0.15 * torch.randn(len(sets), 1, 1, 1)
    return moved * light + 0.05 * torch.randn(len(sets), sets.shape[1], 1, 1)


# What knows best, while it is taught by some episodes, of others.
def _fit(cameras: int, shows: Sequence[Seen], held: Sequence[Seen]) -> nn.Module:
    network = _network(cameras)
    optimizer = torch.optim.Adam(network.parameters(), 1e-3, weight_decay=1e-4)
    kinds = [torch.from_numpy(np.concatenate(kind)) for kind in zip(*shows, strict=True)]
    before, success = (np.concatenate(kind) for kind in zip(*held, strict=True))
    half = BATCH // 2
    labels = torch.cat([torch.zeros(half), torch.ones(half)])
    best, kept, looks = np.inf, network.state_dict(), 0
    for step in range(1, MOST_STEPS + 1):
        batch = torch.cat([kind[torch.randint(len(kind), (half,))] for kind in kinds])
        optimizer.zero_grad()
        logits = network.train()(_varied(_input(batch)))
        torch.autograd.backward(functional.binary_cross_entropy_with_logits(logits, labels))
        optimizer.step()
        if step % LOOK == 0:
            network.eval()
            loss = np.logaddexp(0, _scores(network, before)).mean()
            loss += np.logaddexp(0, -_scores(network, success)).mean()
            looks += 1
            if loss < best:
                best, kept, looks = loss, copy.deepcopy(network.state_dict()), 0
            if looks == PATIENCE or best < GOOD_ENOUGH:
                break
    network.load_state_dict(kept)
    return network.eval()
