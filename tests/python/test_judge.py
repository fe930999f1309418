# SPDX-License-Identifier: BSD-3-Clause
"""Who judges episodes in place of the task: keys, and images that were taught by keys."""

import contextlib
import itertools
import json
import os
import pty
import queue
import re
import subprocess
import termios
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, PROGRAM, StartProgram
from PIL import Image
from trifinger.errors import InvalidArgument, RobotStopped
from trifinger.training import Plan
from trifinger.training.experience import TERMINATED, TRUNCATED, digest_of
from trifinger.training.judge import (
    IN_A_ROW,
    SIZE,
    ImageJudge,
    Seen,
    Streak,
    judging_by_keys,
    taught,
    teach,
)
from trifinger.training.learner import Learner

NONE = np.zeros((0, SIZE, SIZE, 3), np.uint8)


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    ends = pty.openpty()
    yield ends
    for end in ends:
        os.close(end)


def test_a_key_judges_once_however_long_it_is_held(
    terminal: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trifinger.training.judge, "HELD", np.inf)  # however slow the test is
    person, program = terminal
    said: queue.Queue[str] = queue.Queue()
    with judging_by_keys(said.put, program):
        os.write(person, b"sssfx fs\x1b[A")
        verdicts = [said.get(timeout=60) for _ in range(4)]
    assert verdicts == ["success", "failure", "failure", "success"]
    assert said.empty()


def test_the_terminal_is_as_it_was_however_it_ends(terminal: tuple[int, int]) -> None:
    before = termios.tcgetattr(terminal[1])
    during = None
    with contextlib.suppress(KeyboardInterrupt), judging_by_keys(print, terminal[1]):
        during = termios.tcgetattr(terminal[1])
        raise KeyboardInterrupt
    assert during not in (None, before)
    assert termios.tcgetattr(terminal[1]) == before


def test_only_a_terminal_has_keys(tmp_path: Path) -> None:
    with (tmp_path / "no_terminal").open("w") as file:
        judging = judging_by_keys(print, file.fileno())
        with pytest.raises(InvalidArgument, match="not a terminal"):
            judging.__enter__()


def test_a_success_is_told_once_an_episode_by_images_of_its_own() -> None:
    kind = [(name, "i8") for name in ("session", "seed", "episode", "flags")]
    rng = np.random.default_rng(1)
    streak = Streak(0.0)
    now, told = 0.0, 0
    for episode in range(300):
        begin, in_a_row, is_told = now, 0, False
        for step in range(length := int(rng.integers(1, 12))):
            is_end = step == length - 1
            flags = (TERMINATED, TRUNCATED)[episode % 2] if is_end else 0
            news = rng.random() < 0.7 or step == 0 or is_end
            streak.follow(np.array([(7, 1, episode, flags)] * news, kind), now)
            score, time = rng.normal(), now - rng.choice([0.0, 0.1])
            in_a_row = 0 if score <= 0 else in_a_row + (time >= begin)
            expected = not (is_end or is_told) and time >= begin and in_a_row >= IN_A_ROW
            assert streak.add(score, time) == expected
            is_told |= expected
            told += expected
            now += 0.1
    assert told > 100


def episodes_of(count: int, seed: int) -> list[tuple[np.ndarray, bool]]:
    """Images of a square, 20 for each episode; in a success it comes to rest in the middle."""
    rng = np.random.default_rng(seed)
    episodes = []
    for number in range(count):
        angles = rng.uniform(0, 2 * np.pi) + np.array([0, rng.uniform(-1, 1)])
        begin, end = rng.uniform(16, 24, (2, 1)) * np.stack([np.cos(angles), np.sin(angles)], 1)
        end *= number % 2 == 0
        images = rng.integers(0, 60, (20, 64, 64, 3), np.uint8)
        for step, image in enumerate(images):
            share = min(step / 13, 1)
            x, y = np.round(28 + (1 - share) * begin + share * end).astype(int)
            image[y : y + 8, x : x + 8] += np.array([120, 20, 40], np.uint8)
        small = images.reshape(20, SIZE, 64 // SIZE, SIZE, 64 // SIZE, 3).mean(axis=(2, 4))
        episodes.append((small.astype(np.uint8), bool(number % 2)))
    return episodes


def seen(images: np.ndarray, succeeded: bool) -> Seen:
    return Seen(images[:-10], images[-4:]) if succeeded else Seen(images, NONE)


@pytest.fixture(scope="module")
def judge() -> ImageJudge:
    return teach(["camera"], [seen(*one) for one in episodes_of(20, seed=1)])


def test_it_judges_episodes_that_it_was_not_shown(judge: ImageJudge) -> None:
    right = [
        (np.median(judge.score(images[-4:])) > judge.threshold) == succeeded
        and not (judge.score(images[:7]) > judge.threshold).any()
        for images, succeeded in episodes_of(100, seed=2)
    ]
    assert np.mean(right) >= 0.95
    assert "taught by 10 successes and 10 failures" in judge.words


def test_verdicts_without_a_reason_teach_nothing() -> None:
    shown = episodes_of(20, seed=1)
    verdicts = np.random.default_rng(3).permutation([succeeded for _, succeeded in shown])
    with pytest.raises(InvalidArgument, match="no more than chance"):
        teach(
            ["camera"],
            [seen(images, one) for (images, _), one in zip(shown, verdicts, strict=True)],
        )


def test_too_few_verdicts_teach_nothing(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match="4 successes and 4 failures"):
        teach(["camera"], [seen(*one) for one in episodes_of(8, seed=1)])
    with pytest.raises(InvalidArgument, match="0 successes and 0 failures"):
        taught(tmp_path)


def test_a_judge_is_a_file(judge: ImageJudge, tmp_path: Path) -> None:
    path = tmp_path / "judge.npz"
    judge.store(path)
    again = ImageJudge.load(path)
    images, _ = episodes_of(1, seed=4)[0]
    assert np.array_equal(again.score(images), judge.score(images))
    assert (again.names, again.threshold, again.words) == (
        judge.names,
        judge.threshold,
        judge.words,
    )
    content = path.read_bytes()
    for damaged in (b"", b"PK", content[: len(content) // 2], content[:1000] + content[2000:]):
        path.write_bytes(damaged)
        with pytest.raises(InvalidArgument, match="is no judge"):
            ImageJudge.load(path)


def show(folder: Path, x: int, y: int) -> None:
    """Lets all cameras see a square there, whose middle is (x, y)."""
    image = np.full((54, 54, 3), 30, np.uint8)
    image[y - 4 : y + 4, x - 4 : x + 4] = (200, 60, 90)
    for camera in ("camera60", "camera180", "camera300"):
        Image.fromarray(image).save(folder / "new.png")
        (folder / "new.png").replace(folder / f"{camera}_0.png")


def run_episodes(policy: Path, folder: Path, seed: int, judge: ImageJudge | None) -> list[bool]:
    """Every second episode shows a success after half a second; returns what was judged.

    Each episode lasts until it is judged, however slow the machine is. Failures are told.
    """
    words = ["--robot", "sim", "--seed", str(seed), "--episodes", "16", "--judge", "--json"]
    process = digest_of(trifinger.Policy(policy).metadata)
    experience = trifinger.observe("sim.experience")
    rng = np.random.default_rng(seed)
    actor = subprocess.Popen(
        [PROGRAM, "run-policy", policy, *words, "--approach-every", "100"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )

    def tell(verdict: str) -> None:
        assert actor.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # after the last episode
            actor.stdin.write(f"{verdict}\n")
            actor.stdin.flush()

    def tell_seen(verdict: str) -> None:
        show(folder, 8, 8)  # The next episode must not begin with a success.
        tell(verdict)

    said: list[str] = []
    judging = judge.judging("sim", process, tell_seen, said.append) if judge else None
    with judging or contextlib.nullcontext():
        with contextlib.suppress(RobotStopped):
            for number in itertools.count():
                one = experience.get_observation(number)
                if one["seed"] != seed:
                    continue
                succeeds = one["episode"] % 2 == 1
                if one["actions"] in (0, 25):
                    is_there = succeeds and one["actions"] == 25
                    show(folder, *((27, 27) if is_there else rng.choice([8, 16, 38, 46], 2)))
                if one["actions"] == 50 and not (judge and succeeds):
                    tell("success" if succeeds else "failure")
        output, _ = actor.communicate()
    assert not said
    return [json.loads(line)["is_success"] for line in output.splitlines()]


@pytest.mark.slow
@pytest.mark.without_sanitizer
def test_a_judge_that_a_person_has_taught_judges_a_robot(
    start_program: StartProgram, tmp_path: Path
) -> None:
    folder, logs = tmp_path / "images", tmp_path / "logs"
    folder.mkdir()
    show(folder, 27, 27)
    settings = ("source=folder", f"folder={folder}", "size=54", "rate=20", "pixels=rgb8")
    words = [word for one in settings for word in ("--set", f"cameras.{one}")]
    robot = start_program("run", "sim_cameras", *words, *PATIENT, "--record", str(logs))
    robot.wait_for("deliver images")
    configuration = tmp_path / "robot.yml"
    configuration.write_text(trifinger.observe("sim").documents()["configuration.yml"])
    plan = Plan.of(
        "reach", "ddpg", robot_config=str(configuration), settings={"duration": 60, "layers": (8,)}
    )
    policy = tmp_path / "reach.policy"
    policy.write_bytes(Learner(plan).policy())
    verdicts = [bool(number % 2) for number in range(16)]
    assert run_episodes(policy, folder, 1, None) == verdicts
    judge = taught(tmp_path)
    # A busy machine loses images.
    assert re.match(r"taught by [5-8] successes and [5-8] failures", judge.words)
    assert run_episodes(policy, folder, 2, judge) == verdicts
