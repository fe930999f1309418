# SPDX-License-Identifier: BSD-3-Clause
"""Motions: the file, and what each change promises."""

import dataclasses
import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest
import trifinger
from hypothesis import assume, example, given, settings, strategies as st
from trifinger_view.motion import JointFacts, Motion, MotionFileError, Plan, play

# Motions are computed in Python, in which a sanitizer sees nothing.

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


FACTS = JointFacts.load("sim")
HOME = np.tile([0.0, 0.9, -1.7], 3)


def finger_motion(
    seed: int, duration: float = 1.0, size: float = 0.3, config: str = "sim", period: float = 0.002
) -> Motion:
    """Waves of all joints around the usual pose, at rest at both ends."""
    facts = FACTS if config == "sim" else JointFacts.load(config)
    rng = np.random.default_rng(seed)
    times = np.linspace(0, duration, round(duration / period) + 1)
    s = times / duration
    joints = len(facts.joints)
    wave = np.sin(
        np.outer(s, rng.uniform(1, 12, joints)) + rng.uniform(0, 2 * np.pi, joints)
    ) * rng.uniform(-size, size, joints)
    window = (16 * s**2 * (1 - s) ** 2)[:, None]
    return Motion(
        times,
        HOME[:joints] + window * wave,
        facts.joints,
        facts.robot,
        configuration=facts.configuration,
    )


@given(seed=seeds, duration=st.floats(0.05, 2))
@settings(max_examples=40)
def test_a_motion_is_slowed_just_as_far_as_the_limits_ask_for(seed: int, duration: float) -> None:
    motion = finger_motion(seed, duration, size=0.4, period=duration / 200)
    slow = motion.slow_within_limits()
    assert not slow.violations()
    factor = slow.duration / motion.duration
    assert factor >= 1
    if factor > 1:
        # A tolerance belongs to speeds, so a little faster than the limit is not yet too fast.
        assert slow.slow(0.98).violations()
        for more in (1.01, 1.5, 7.0):
            assert not slow.slow(more).violations()
    else:
        assert slow is motion


def test_no_speed_helps_a_motion_beyond_a_soft_limit_or_a_pose_that_cannot_be_held() -> None:
    motion = finger_motion(1)
    beyond = np.array(motion.positions)
    beyond[100, 4] = 1.7
    with pytest.raises(trifinger.InvalidArgument, match=r"does not help: .*middle_joint_120 goes"):
        dataclasses.replace(motion, positions=beyond).slow_within_limits()
    weak = dataclasses.replace(FACTS, max_torque=np.full(9, 0.01))
    with pytest.raises(trifinger.InvalidArgument, match="to hold its pose"):
        motion.slow_within_limits(weak)


@given(seed=seeds, finger=st.integers(0, 2))
@settings(max_examples=15)
def test_mirrored_tips_are_the_mirrored_points(seed: int, finger: int) -> None:
    motion = finger_motion(seed, period=0.02)
    mirrored = motion.mirror(finger)
    tips, images = FACTS.tips(motion.positions), FACTS.tips(mirrored.positions)
    assert tips is not None
    assert images is not None
    # Finger 0 is at the azimuth of 90 degrees, the others follow clockwise.
    azimuth = np.pi / 2 - 2 * np.pi / 3 * finger
    c, s = np.cos(2 * azimuth), np.sin(2 * azimuth)
    partner = [(2 * finger - i) % 3 for i in range(3)]
    assert np.allclose(images, tips[:, partner] @ np.array([[c, s, 0], [s, -c, 0], [0, 0, 1]]))
    assert np.allclose(mirrored.mirror(finger).positions, motion.positions, atol=1e-9)


@given(seed=seeds, fingers=st.integers(-3, 4))
@settings(max_examples=15)
def test_turned_tips_are_the_turned_points(seed: int, fingers: int) -> None:
    motion = finger_motion(seed, period=0.02)
    motion = dataclasses.replace(motion, tips=FACTS.tips(motion.positions))
    turned = motion.turn(fingers)
    assert turned.tips is not None
    tips = FACTS.tips(turned.positions)
    assert tips is not None
    assert np.allclose(tips, turned.tips)  # the measured tips were turned as points
    assert np.array_equal(turned.turn(-fingers).positions, motion.positions)


def test_a_single_finger_is_mirrored_at_its_own_plane() -> None:
    motion = finger_motion(3, config="finger_edu", period=0.02)
    mirrored = motion.mirror()
    facts = motion.facts()
    tips, images = facts.tips(motion.positions), facts.tips(mirrored.positions)
    assert tips is not None
    assert images is not None
    middle = (tips + images)[:, 0] / 2  # all of it lies in one vertical plane
    assert np.ptp(images[:, 0, 2] - tips[:, 0, 2]) < 1e-9
    normal = (tips - images)[0, 0]
    normal /= np.linalg.norm(normal)
    assert np.ptp(middle @ normal) < 1e-9
    with pytest.raises(trifinger.InvalidArgument, match="three fingers"):
        motion.turn()


def test_a_point_that_no_finger_reaches_is_refused() -> None:
    motion = finger_motion(1, period=0.02)
    far = np.array(motion.positions)
    far[:, 0] = 1.6  # the mirror image needs -2.15 rad
    with pytest.raises(
        trifinger.InvalidArgument, match=r"finger 0 cannot follow .* outside limits"
    ):
        dataclasses.replace(motion, positions=far).mirror()


@given(seed=seeds, blend=st.one_of(st.none(), st.floats(0.05, 3)), cut=st.floats(0.2, 0.8))
@settings(max_examples=25)
def test_joined_motions_have_no_jump_in_position_and_velocity(
    seed: int, blend: float | None, cut: float
) -> None:
    first = finger_motion(seed, 2.0, 0.1).trim(0, 2 * cut)  # ends while it moves
    second = finger_motion(seed + 1, 2.0, 0.1).trim(2 * (1 - cut), 2)
    joined = first.join(second, blend)
    n, m = len(first), len(second)
    assert np.array_equal(joined.positions[:n], first.positions)
    assert np.array_equal(joined.positions[-m:], second.positions)
    trajectory = joined.positions[n - 1 : len(joined) - m + 1]
    times = joined.times[n - 1 : len(joined) - m + 1]
    if blend is not None:
        assert times[-1] - times[0] == pytest.approx(blend)
    else:
        assert not joined.violations()
    # The slopes at both ends of the way are those of the motions.
    for slope, velocity in (
        ((trajectory[1] - trajectory[0]) / (times[1] - times[0]), first.velocities[-1]),
        ((trajectory[-1] - trajectory[-2]) / (times[-1] - times[-2]), second.velocities[0]),
    ):
        largest = np.abs(np.diff(trajectory, 2, axis=0)).max() / np.diff(times).min()
        assert np.abs(slope - velocity).max() <= 2 * largest + 1e-6


def test_motions_of_other_robots_are_not_joined() -> None:
    with pytest.raises(trifinger.InvalidArgument, match=r"'trifinger-edu'; .* 'trifinger-pro'"):
        finger_motion(1).join(finger_motion(1, config="trifinger_pro"))


def played(robot: trifinger.Frontend, last: int) -> tuple[np.ndarray, np.ndarray]:
    """The desired positions of all steps, and their differences from step to step."""
    robot.finish()
    asked = robot.get_desired_actions(0, last + 1)["position"]
    return asked, np.diff(asked, axis=0)


def stays(robot: trifinger.Frontend, pose: np.ndarray) -> bool:
    """Whether a simulation keeps this pose for a moment: no finger pushes another one away."""
    t = 0
    for _ in range(20):
        t = robot.append_desired_action(robot.new_action(position=pose))
    return bool(np.abs(robot.get_observation(t).position - pose).max() < 0.01)


@pytest.mark.slow
@given(seed=seeds, feedforward=st.booleans())
@settings(max_examples=25)
@example(seed=926, feedforward=False)  # fingers that are in each other
def test_fault_67_a_motion_is_played_from_any_pose_without_a_jump(
    seed: int, feedforward: bool
) -> None:
    rng = np.random.default_rng(seed)
    # High enough above the table, so that nothing but the motion acts on the robot.
    pose = HOME + rng.uniform(-0.6, 0.3, 9)
    motion = finger_motion(seed, 1.5, 0.2)
    changes = {"fingers.initial_position": pose.tolist(), "fingers.height": 0.5}
    assume(stays(trifinger.simulate("trifinger_edu", changes), pose))
    robot = trifinger.simulate("trifinger_edu", changes)
    plans: list[Plan] = []
    facts = JointFacts.of_session(robot)
    last = play(robot, motion, facts=facts, feedforward=feedforward, on_plan=plans.append)
    begin = robot.get_observation(0).position
    begin_row = len(plans[0].parts[0])
    asked, steps = played(robot, last)
    assert np.abs(asked[0] - begin).max() <= 0.001  # it begins where the robot is
    assert (np.abs(steps) <= facts.max_velocity * 0.001 + 1e-9).all()
    assert (np.abs(steps[: begin_row - 1]) <= 1.0 * 0.001 + 1e-9).all()  # the way there
    assert np.abs(np.diff(steps, axis=0)).max() <= 0.001  # nor does the velocity jump
    # Then it is the motion, sample by sample, and after it the robot rests.
    end = begin_row - 1 + 1500
    assert np.allclose(asked[begin_row - 1 : end + 1 : 2], motion.positions, atol=1e-9)
    assert np.allclose(asked[end:], motion.positions[-1])
    applied = robot.get_applied_actions(0, last + 1)
    assert not (applied["reasons"] & np.uint64(trifinger.Reason.TARGET_CLAMPED)).any()


def test_with_feedforward_the_robot_follows_ten_times_as_closely() -> None:
    motion = finger_motion(5, 2.0, 0.3)
    error = []
    for feedforward in (True, False):
        robot = trifinger.simulate("trifinger_edu", {"fingers.height": 0.5})
        last = play(robot, motion, feedforward=feedforward)
        asked, _ = played(robot, last)
        measured = robot.get_observations(1, last + 1)["position"]
        error.append(np.abs(measured - asked[:-1]).max())
    assert error[0] < 0.1 * error[1]


REFUSED = {
    "of another robot": (finger_motion(1, config="trifinger_pro"), {}, "this robot is 'trifinger"),
    "with other joints": (
        dataclasses.replace(finger_motion(1), joints=("x", *FACTS.joints[1:])),
        {},
        "for the joints x, ",
    ),
    "too fast": (finger_motion(1).slow(0.1), {}, r"moves at .* at 0\.\d+ s"),
    "beyond a soft limit": (
        dataclasses.replace(finger_motion(1), positions=finger_motion(1).positions + 0.9),
        {},
        r"upper_joint_0 goes to 1\.\d+ rad at 0",
    ),
    "that begins too fast at a limit": (
        Motion(
            [0, 0.1, 0.2],
            HOME + np.outer([1.59, 1.49, 1.39], [0, 1, 0] * 3) - [0, 0.9, 0] * 3,
            FACTS.joints,
            FACTS.robot,
        ),
        {},
        "no trajectory|beyond the limits",
    ),
    "never": (finger_motion(1), {"times": 0}, "times is 0"),
    "with no speed": (finger_motion(1), {"speed": 0.0}, "speed is 0"),
}


@pytest.mark.parametrize("why", REFUSED)
def test_fault_67_a_motion_that_is_refused_leaves_the_robot_untouched(why: str) -> None:
    motion, options, text = REFUSED[why]
    robot = trifinger.simulate("sim")
    before = robot.latest_observation()
    with pytest.raises(trifinger.InvalidArgument, match=text):
        play(robot, motion, **options)
    assert robot.range("desired_action") == (0, 0)
    assert robot.latest_observation().tobytes() == before.tobytes()


def test_a_robot_whose_joints_nobody_knows_plays_nothing() -> None:
    robot = trifinger.fake()
    with pytest.raises(trifinger.InvalidArgument, match="nobody knows the joints"):
        play(robot, finger_motion(1))
    with pytest.raises(trifinger.InvalidArgument, match="no position for each"):
        play(robot, finger_motion(1), facts=FACTS)


@given(seed=seeds, times=st.integers(2, 3))
@settings(max_examples=8)
def test_a_motion_that_does_not_end_where_it_began_can_be_repeated(seed: int, times: int) -> None:
    motion = finger_motion(seed, 2.0, 0.15).trim(0.3, 1.6)  # moves at both ends
    robot = trifinger.simulate("trifinger_edu", {"fingers.height": 0.5})
    last = play(robot, motion, times=times)
    asked, steps = played(robot, last)
    near = np.abs(asked - motion.positions[300]).max(axis=1) < 1e-9
    assert near.sum() == times
    assert np.abs(np.diff(steps, axis=0)).max() <= 0.001
    assert not steps[-50:].any()


@pytest.mark.slow
@given(seed=seeds, after=st.integers(0, 60), by_signal=st.booleans())
@settings(max_examples=20)
def test_a_motion_that_is_stopped_anywhere_brakes_within_the_limits(
    seed: int, after: int, by_signal: bool
) -> None:
    motion = finger_motion(seed, 2.0, 0.2)
    robot = trifinger.simulate("trifinger_edu", {"fingers.height": 0.5})
    asked_to_stop = 0

    def should_stop() -> bool:
        nonlocal asked_to_stop
        asked_to_stop += 1
        if asked_to_stop == after + 1 and by_signal:
            signal.raise_signal(signal.SIGINT)
        return asked_to_stop > after and not by_signal

    interrupted = False
    try:
        play(robot, motion, should_stop=should_stop)
    except KeyboardInterrupt:
        interrupted = True
    assert interrupted == (by_signal and asked_to_stop > after)
    robot.finish()
    asked, steps = played(robot, robot.range("desired_action")[1] - 1)
    assert len(asked) >= 1
    assert (np.abs(steps) <= FACTS.max_velocity * 0.001).all()
    assert np.abs(np.diff(steps, axis=0)).max(initial=0) <= 0.001
    assert not steps[-50:].any()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_log_becomes_the_motion_that_the_robot_did(tmp_path: Path) -> None:
    motion = finger_motion(7, 1.0, 0.2)
    robot = trifinger.simulate("trifinger_edu", record=tmp_path / "log")
    last = play(robot, motion)
    robot.finish()
    measured = robot.get_observations(0, last + 1)["position"]
    asked = robot.get_desired_actions(0, last + 1)["position"]
    robot.close()
    session = trifinger.Log(tmp_path / "log").session("")
    again = Motion.from_log(session)
    assert np.array_equal(again.positions[: last + 1], measured)
    assert again.robot == "trifinger-edu"
    assert again.joints == FACTS.joints
    assert again.times[100] == pytest.approx(0.1)
    part = Motion.from_log(session, 0.2, 0.5, series="desired_action")
    assert np.array_equal(part.positions, asked[200 : 200 + len(part)])
    assert not part.violations()
    assert "steps 200 to" in part.history[0]
    with pytest.raises(trifinger.InvalidArgument, match="'observation' and"):
        Motion.from_log(session, series="status")


def test_the_limits_of_a_robot_of_somebody_else_come_from_its_urdf() -> None:
    facts = JointFacts._of_urdf(
        '<robot name="arm"><joint name="fixed" type="fixed"/><joint name="a" type="revolute">'
        '<limit lower="-1" upper="2" velocity="3" effort="4"/>'
        '<safety_controller soft_lower_limit="-0.5"/></joint></robot>'
    )
    assert facts.robot == "arm"
    assert facts.joints == ("a",)
    values = [facts.soft_lower, facts.soft_upper, facts.max_velocity, facts.max_torque]
    assert [float(one[0]) for one in values] == [-0.5, 2, 3, 4]
    assert facts.torques(np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1))) is None
    slow = Motion([0, 0.1, 0.3], [[0], [1], [0]], ("a",), "arm").slow_within_limits(facts)
    assert not slow.violations(facts)
    for text in ("<robot", '<robot name="x"/>'):
        with pytest.raises(trifinger.InvalidArgument, match="URDF"):
            JointFacts._of_urdf(text)


def test_a_configuration_in_a_motion_is_not_believed(tmp_path: Path) -> None:
    motion = finger_motion(1)
    other = JointFacts.load("trifinger_pro").configuration
    for text, what in [
        ("", "does not have the configuration"),
        (other, "the robot of its configuration is 'trifinger-pro'"),
        ("name: x\n", "configuration.yml"),
        ("[" * 10_000, "configuration.yml"),
        ("extends: /dev/zero\n", "extends is '/dev/zero', but only a file may extend another"),
        ("extends: trifinger_pro\n", "extends is 'trifinger_pro', but only a file may"),
    ]:
        wrong = dataclasses.replace(motion, configuration=text)
        wrong.save(tmp_path / "a.motion", overwrite=True)
        with pytest.raises(trifinger.Error, match=what):
            Motion.load(tmp_path / "a.motion").slow_within_limits()
