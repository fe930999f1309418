# SPDX-License-Identifier: BSD-3-Clause
"""Motions: the file, and what each change promises."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import trifinger
from hypothesis import given, settings, strategies as st
from trifinger.motion import Motion, MotionFileError

ROBOT = {"joints": ("a", "b"), "robot": "rig"}
seeds = st.integers(0, 2**32 - 1)


def random_motion(seed: int, samples: int = 200, tips: int = 0) -> Motion:
    """A motion with samples at uneven times and jumps between them."""
    rng = np.random.default_rng(seed)
    return Motion(
        np.cumsum(rng.uniform(0.001, 0.02, samples)),
        rng.normal(size=(samples, 2)),
        tips=rng.normal(size=(samples, tips, 3)) if tips else None,
        configuration="name: rig\nsafety: {}\n",
        history=("made up",),
        **ROBOT,
    )


def smooth_motion(seed: int, duration: float = 2.0, period: float = 0.001) -> Motion:
    """A motion made of slow waves, as a hand would make it."""
    rng = np.random.default_rng(seed)
    times = np.arange(0, duration + period / 2, period)
    waves = [
        sum(
            rng.normal() * np.sin(rng.uniform(0.5, 6) * times + rng.uniform(0, 6)) for _ in range(3)
        )
        for _ in range(2)
    ]
    return Motion(times, np.transpose(waves), **ROBOT)


@given(seed=seeds, tips=st.integers(0, 3))
@settings(max_examples=30)
def test_a_file_gives_back_the_motion_to_the_last_bit(
    seed: int, tips: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    motion = random_motion(seed, tips=tips)
    path = tmp_path_factory.mktemp("motion") / "a.motion"
    motion.save(path)
    again = Motion.load(path)
    assert again.times.tobytes() == motion.times.tobytes()
    assert again.positions.tobytes() == motion.positions.tobytes()
    if tips:
        assert again.tips is not None
        assert motion.tips is not None
        assert again.tips.tobytes() == motion.tips.tobytes()
    for name in ("joints", "robot", "configuration", "history", "created"):
        assert getattr(again, name) == getattr(motion, name)


def test_numpy_reads_the_table_without_this_package(tmp_path: Path) -> None:
    motion = random_motion(1)
    motion.save(tmp_path / "a.motion")
    table = np.genfromtxt(tmp_path / "a.motion", delimiter=",")[1:]
    assert np.array_equal(table, np.column_stack([motion.times, motion.positions]))


def test_nothing_is_overwritten_unless_somebody_says_so(tmp_path: Path) -> None:
    path = tmp_path / "a.motion"
    random_motion(1).save(path)
    before = path.read_bytes()
    with pytest.raises(trifinger.InvalidArgument, match="exists"):
        random_motion(2).save(path)
    assert path.read_bytes() == before
    random_motion(2).save(path, overwrite=True)
    assert path.read_bytes() != before
    assert not [entry for entry in tmp_path.iterdir() if "part" in entry.name]


def changed(path: Path, header: dict[str, object]) -> None:
    """Changes values in the header of a file."""
    lines = path.read_text().splitlines()
    end = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    values = json.loads("\n".join(line[1:] for line in lines[1:end]))
    values |= header
    new = [lines[0], *(f"# {line}" for line in json.dumps(values, indent=1).splitlines())]
    path.write_text("\n".join([*new, *lines[end:]]) + "\n")


@pytest.mark.parametrize(
    ("header", "what"),
    [
        ({"rows": 10**12}, "rows is not from 2"),
        ({"rows": 7}, "incomplete"),
        ({"rows": "many"}, "rows is not"),
        ({"rows": True}, "rows is not"),
        ({"tips": -1}, "tips is not"),
        ({"tips": 1}, "columns"),
        ({"joints": ["a", "a"]}, "same name"),
        ({"joints": ["a", "b,c"]}, "is no name"),
        ({"joints": []}, "1 to 256 joints"),
        ({"joints": "ab"}, "no list of texts"),
        ({"robot": None}, "robot is no text"),
        ({"robot": "a\x1b[2J"}, "is no name"),
        ({"more": 1}, "exactly the keys"),
    ],
)
def test_a_wrong_header_is_refused_with_a_sentence(
    tmp_path: Path, header: dict[str, object], what: str
) -> None:
    path = tmp_path / "a.motion"
    random_motion(1).save(path)
    changed(path, header)
    with pytest.raises(MotionFileError, match=what) as error:
        Motion.load(path)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "does not begin"),
        (b"# trifinger motion 2\n", "does not begin"),
        (b"\xff\xfe", "is no motion"),
        (b"# trifinger motion 1\n", "no JSON"),
        (b"# trifinger motion 1\n# " + b"[" * 100_000 + b"\n", "no JSON"),
        (b"# trifinger motion 1\n# {", "no header that ends"),
        (b"# trifinger motion 1\n#" + b" " * (1 << 20) + b"\n# {}\n", "no header that ends"),
    ],
)
def test_a_file_that_is_no_motion_is_refused(tmp_path: Path, content: bytes, what: str) -> None:
    path = tmp_path / "a.motion"
    path.write_bytes(content)
    with pytest.raises(MotionFileError, match=what):
        Motion.load(path)


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("\n0.0,", "\n0.5,", "times begin with 0"),
        ("\n0.0,", "\nnan,", "not finite"),
        ("\n0.0,", "\n1e999,", "not finite"),
        ("\n0.0,", "\nzero,", "not all numbers"),
        ("\n0.0,", "\n0.0,0.0,", "not all numbers"),
        ("\n0.0,", "\n\n", "whole rows|not all numbers"),
        ("time,a,b", "time,b,a", "columns"),
    ],
)
def test_a_wrong_table_is_refused(tmp_path: Path, old: str, new: str, what: str) -> None:
    path = tmp_path / "a.motion"
    random_motion(1).save(path)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(MotionFileError, match=what):
        Motion.load(path)


def test_fault_73_nothing_waits_for_a_fifo_or_reads_a_device(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "device").symlink_to("/dev/zero")
    for name in ("fifo", "device"):
        with pytest.raises(MotionFileError, match="regular file"):
            Motion.load(tmp_path / name)
    with pytest.raises(OSError, match="directory"):
        Motion.load(tmp_path)
    with pytest.raises(FileNotFoundError):
        Motion.load(tmp_path / "missing")


@given(seed=seeds, cut=st.integers(0, 5000))
@settings(max_examples=50)
def test_a_file_that_was_cut_off_anywhere_is_refused(
    seed: int, cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("motion") / "a.motion"
    random_motion(seed, samples=40).save(path)
    content = path.read_bytes()
    path.write_bytes(content[: min(cut, len(content) - 1)])
    with pytest.raises(MotionFileError):
        Motion.load(path)


@pytest.mark.parametrize(
    ("times", "positions"),
    [
        ([0], [[0, 0]]),
        ([0, 0], [[0, 0], [0, 0]]),
        ([0, 1], [[0, 0, 0], [0, 0, 0]]),
        ([0, 1], [[0, 0], [0, np.nan]]),
        ([0, np.inf], [[0, 0], [0, 0]]),
        ([0, 1], "motion"),
    ],
)
def test_samples_that_are_no_motion_are_refused(times: object, positions: object) -> None:
    with pytest.raises(trifinger.InvalidArgument):
        Motion(times, positions, **ROBOT)


def test_times_count_from_the_first_sample() -> None:
    assert np.array_equal(Motion([5, 6, 8], np.zeros((3, 2)), **ROBOT).times, [0, 1, 3])


@given(seed=seeds, begin=st.floats(0, 0.9), length=st.floats(0.01, 1))
def test_a_trimmed_motion_is_the_same_curve(seed: int, begin: float, length: float) -> None:
    motion = smooth_motion(seed)
    first = begin * motion.duration
    last = min(first + length * motion.duration, motion.duration)
    part = motion.trim(first, last)
    assert part.duration == pytest.approx(last - first)
    at = np.linspace(0, part.duration, 50)
    assert np.allclose(part.at(at), motion.at(first + at), atol=1e-5)


@given(seed=seeds, factor=st.floats(0.1, 10))
def test_a_slowed_motion_goes_the_same_way_in_more_time(seed: int, factor: float) -> None:
    motion = smooth_motion(seed)
    slow = motion.slow(factor)
    assert np.array_equal(slow.positions, motion.positions)
    assert np.allclose(slow.velocities * factor, motion.velocities, atol=1e-9)
    assert np.allclose(slow.accelerations * factor**2, motion.accelerations, atol=1e-5)


@given(seed=seeds, cutoff=st.floats(0.2, 50))
def test_smoothing_keeps_ends_and_straight_lines(seed: int, cutoff: float) -> None:
    motion = random_motion(seed)
    smooth = motion.smooth(cutoff)
    assert np.array_equal(smooth.positions[[0, -1]], motion.positions[[0, -1]])
    times = np.linspace(0, 1, 300)
    line = Motion(times, np.outer(times, [1, -2]), **ROBOT)
    assert np.allclose(line.smooth(cutoff).positions, line.positions, atol=1e-12)


@pytest.mark.parametrize("times_cutoff", [0.25, 1, 2])
def test_smoothing_weakens_a_vibration_as_documented_without_a_delay(times_cutoff: float) -> None:
    cutoff = 10.0
    times = np.arange(0, 4.0005, 0.001)
    wave = np.sin(2 * np.pi * cutoff * times_cutoff * times)  # whole periods
    smooth = Motion(times, np.column_stack([wave, wave]), **ROBOT).smooth(cutoff)
    gain = np.exp(-np.log(2) / 2 * times_cutoff**2)
    assert np.allclose(smooth.positions[:, 0], gain * wave, atol=1e-6)


def test_a_part_that_is_not_there_is_refused() -> None:
    motion = smooth_motion(1)
    for begin, end in [(-1, 1), (1, 1), (1, 0.5), (0, 99), (0, np.nan)]:
        with pytest.raises(trifinger.InvalidArgument, match="cannot trim"):
            motion.trim(begin, end)
    for value in (0, -1, np.nan, np.inf):
        with pytest.raises(trifinger.InvalidArgument):
            motion.slow(value)
        with pytest.raises(trifinger.InvalidArgument):
            motion.smooth(value)
        with pytest.raises(trifinger.InvalidArgument):
            motion.resample(value)


def test_every_change_is_in_the_history() -> None:
    motion = smooth_motion(1).trim(0.5, 1.5).smooth(5).slow(2)
    assert motion.history == (
        "trimmed to 0.5 s to 1.5 s",
        "smoothed below 5 Hz",
        "slowed by 2",
    )
