# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger motion`: files in, files out, and motions on a running robot."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, PROGRAM, StartProgram, output_of
from trifinger_view.commands.motion import main
from trifinger_view.motion import JointFacts, Motion, play

FACTS = JointFacts.load("sim")
COMMAND = "import sys; from trifinger_view.commands.motion import main; sys.exit(main())"


def wave(seconds: float = 2.0, size: float = 0.3) -> Motion:
    """A wave of all joints, at rest at both ends."""
    times = np.linspace(0, seconds, round(seconds / 0.002) + 1)
    s = times / seconds
    bump = 16 * s**2 * (1 - s) ** 2 * np.sin(8 * s)
    positions = np.tile([0.0, 0.9, -1.7], 3) + np.outer(bump, size * np.array([1, -0.4, 0.5] * 3))
    return Motion(
        times, positions, FACTS.joints, FACTS.robot, configuration=FACTS.configuration,
        history=("a wave",),
    )  # fmt: skip


@pytest.fixture
def file(tmp_path: Path) -> str:
    wave().save(tmp_path / "wave.motion")
    return str(tmp_path / "wave.motion")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["trim", "--from", "0.5", "--to", "1.5"], lambda one: one.trim(0.5, 1.5)),
        (["smooth", "--cutoff", "3"], lambda one: one.smooth(3.0)),
        (["slow", "--factor", "0.2"], lambda one: one.slow(0.2)),
        (["slow", "--within-limits"], lambda one: one.slow_within_limits()),
        (["slow", "--within-limits", "--config", "sim"], lambda one: one),
        (["mirror", "--finger", "1"], lambda one: one.mirror(1)),
        (["turn", "--fingers", "2"], lambda one: one.turn(2)),
    ],
)
def test_a_command_writes_what_the_function_returns(
    file: str, tmp_path: Path, words: list[str], expected: object
) -> None:
    output = tmp_path / "new.motion"
    assert main([words[0], file, *words[1:], "-o", str(output)]) == 0
    wanted = expected(wave())
    made = Motion.load(output)
    assert np.array_equal(made.positions, wanted.positions)
    assert np.array_equal(made.times, wanted.times)
    assert made.history == wanted.history


def test_two_motions_are_joined(file: str, tmp_path: Path) -> None:
    output = tmp_path / "new.motion"
    assert main(["join", file, file, "--blend", "0.7", "-o", str(output)]) == 0
    assert Motion.load(output).duration == pytest.approx(4.7)


def test_a_file_that_is_there_is_replaced_only_with_force(
    file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = Path(file).read_bytes()
    words = ["trim", file, "--to", "1", "-o", file]
    assert main(words) == 2
    assert f"{file} exists; --force replaces it" in capsys.readouterr().err
    assert Path(file).read_bytes() == before
    assert main([*words, "--force"]) == 0
    assert Motion.load(file).duration == 1
    assert not [entry for entry in tmp_path.iterdir() if "part" in entry.name]


def test_info_says_what_the_motion_is_and_whether_it_is_within_the_limits(
    file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", file]) == 0
    text = capsys.readouterr().out
    assert "2.000 s, 1001 samples" in text
    assert "for 'trifinger-edu' with 9 joints" in text
    assert "a wave" in text
    assert text.endswith("within the limits of its robot\n")
    fast = tmp_path / "fast.motion"
    wave().slow(0.1).save(fast)
    assert main(["info", str(fast)]) == 0
    text = capsys.readouterr().out
    assert "beyond the limits" in text
    assert re.search(r"upper_joint_0 moves at [\d.]+ rad/s at 0\.\d+ s; its speed limit", text)
    assert main(["info", file, "--config", "trifinger_pro"]) == 2
    assert (
        "'trifinger-edu'; the robot of these limits is 'trifinger-pro'" in capsys.readouterr().err
    )


def test_what_cannot_be_done_is_said_in_one_sentence(
    file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "text.motion").write_text("hello\n")
    cases = [
        (["info", str(tmp_path / "missing")], "No such file"),
        (["info", str(tmp_path / "fifo")], "no regular file"),
        (["info", str(tmp_path / "text.motion")], "is no motion of this version"),
        (["trim", file, "--from", "3", "-o", "x.motion"], "cannot trim to 3 s"),
        (["smooth", file, "--cutoff", "-1", "-o", "x.motion"], "cutoff is -1 Hz"),
        (["mirror", file, "--finger", "3", "-o", "x.motion"], "finger is 3, must be 0 to 2"),
        (["plot", file, "-o", "x.doc"], "does not end in .png"),
    ]
    for words, text in cases:
        assert main(words) in (1, 2)
        errors = capsys.readouterr().err
        assert text in errors
        assert errors.startswith("trifinger motion")
        assert errors.count("\n") <= 2
    with pytest.raises(SystemExit, match="1"):
        main(["play", file, "--robot", "nobody"])
    assert "there is no robot 'nobody'" in capsys.readouterr().err
    assert not Path("x.motion").exists()


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_a_figure_is_drawn(file: str, tmp_path: Path, ending: str) -> None:
    output = tmp_path / f"wave.{ending}"
    assert main(["plot", file, "-o", str(output)]) == 0
    beginning = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[ending]
    assert output.read_bytes().startswith(beginning)
    assert output.stat().st_size > 10_000


def test_a_motion_without_a_configuration_is_drawn_without_limits(tmp_path: Path) -> None:
    Motion([0, 1], [[0], [1]], ("a",), "rig").save(tmp_path / "a.motion")
    assert main(["plot", str(tmp_path / "a.motion"), "-o", str(tmp_path / "a.png")]) == 0


def test_a_log_becomes_a_motion(tmp_path: Path) -> None:
    robot = trifinger.simulate("trifinger_edu", record=tmp_path / "log")
    play(robot, wave())
    robot.finish()
    robot.close()
    output = tmp_path / "a.motion"
    words = ["from-log", str(tmp_path / "log"), "--from", "0.1", "--to", "1", "-o", str(output)]
    assert main(words) == 0
    made = Motion.load(output)
    assert made.duration == pytest.approx(0.9, abs=0.002)
    assert made.configuration == FACTS.configuration or "trifinger-edu" in made.configuration


@pytest.fixture
def robot(start_program: StartProgram) -> str:
    """A simulated robot in real time, in a process of its own."""
    start_program("run", "trifinger_edu", "--name", "sim", *PATIENT).wait_for("holds its pose")
    return "sim"


@pytest.mark.slow
def test_a_running_robot_plays_a_motion_and_takes_the_next(file: str, robot: str) -> None:
    for _ in range(2):
        text = output_of(sys.executable, "-c", COMMAND, "play", file, "--robot", robot)
        assert "Done: the robot rests." in text
    text = output_of(PROGRAM, "status", robot)
    assert "holding" in text


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_fault_69_a_signal_ends_a_motion_and_the_robot_brakes(
    file: str, robot: str, number: signal.Signals
) -> None:
    words = ["play", file, "--robot", robot, "--times", "100000"]
    with subprocess.Popen(
        [sys.executable, "-c", COMMAND, *words], stdout=subprocess.PIPE, text=True
    ) as player:
        observer = trifinger.observe(robot)
        try:
            observer.wait_until_time_index(300, timeout=100)
        finally:
            player.send_signal(number)
        output, _ = player.communicate()
    assert player.returncode == 128 + number
    assert "Stopped: the robot has braked and rests." in output
    fault = observer.fault()
    assert fault is not None
    assert fault.code == "finished"
    asked = observer.get_desired_actions(*observer.range("desired_action"))["position"]
    steps = np.diff(asked, axis=0)
    assert (np.abs(steps) <= FACTS.max_velocity * 0.001).all()
    assert not steps[-50:].any()


def test_fault_67_a_running_robot_refuses_a_motion_of_another_one(
    tmp_path: Path, robot: str
) -> None:
    other = JointFacts.load("trifinger_pro")
    path = tmp_path / "pro.motion"
    Motion(wave().times, wave().positions, other.joints, other.robot).save(path)
    text = output_of(
        sys.executable, "-c", COMMAND, "play", str(path), "--robot", robot, succeeds=False
    )
    assert "the motion is for the robot 'trifinger-pro'; this robot is 'trifinger-edu'" in text
    assert "holding" in output_of(PROGRAM, "status", robot)
