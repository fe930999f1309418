# SPDX-License-Identifier: BSD-3-Clause
import json
import re
import shlex
import signal
import subprocess
from pathlib import Path

import av
import numpy as np
import pytest
from conftest import BUILD, StartProgram
from trifinger.commands import film

PROGRAM = BUILD / "apps/trifinger-manipulate"
# A short lift with a plan that is made at once, by a robot that waits.
ROBOT = ("--non-real-time", "--set", "fingers.height=0.3")
FIGURE = re.compile(r"^  (\w+) +([-+.\de]+) ?(\S*) +\w", re.MULTILINE)
SHORT = {
    "lift.height": "0.05",
    "lift.time": "0.8",
    "lift.hold_time": "2.2",
    "lift.lower_time": "0.8",
    "lift.lead_turns": "[0]",
    "lift.lead_distances": "[1]",
}


def command(output: Path, **changes: str) -> list[str]:
    settings = [
        word for name, value in (SHORT | changes).items() for word in ("--set", f"{name}={value}")
    ]
    return [str(PROGRAM), "lift", "--robot", "m", *settings, "--output", str(output)]


@pytest.mark.slow
def test_lifts_a_cube_and_leaves_a_report_and_pictures(
    start_program: StartProgram, tmp_path: Path
) -> None:
    logs, output = tmp_path / "recording", tmp_path / "output"
    robot = start_program("run", "sim", "--name", "m", *ROBOT, "--record", str(logs))
    robot.wait_for("waits for a user")
    done = subprocess.run(command(output), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    status, text = robot.end()
    assert "fault" not in text, status
    report = json.loads((output / "report.json").read_text())
    assert report["is_done"]
    assert report["grasps"] == 1
    assert report["height"] == pytest.approx(0.05, abs=2e-3)
    assert report["position_rms"] < 1.5e-3
    size = ("--width", "322", "--height", "240")
    assert film.main([str(logs), "--report", str(output), "--camera", "side", *size]) == 0
    for name in ("strip.png", "report.png"):
        assert (output / name).read_bytes().startswith(b"\x89PNG")
    assert (output / "film.mp4").read_bytes()[4:8] == b"ftyp"
    with av.open(str(output / "film.mp4")) as made:
        assert (made.streams.video[0].width, made.streams.video[0].height) == (322, 240)
    assert film.main([str(logs), "--camera", "nowhere"]) == 2


def test_puts_the_cube_down_when_it_is_interrupted(
    start_program: StartProgram, tmp_path: Path
) -> None:
    robot = start_program("run", "sim", "--name", "m", *ROBOT)
    robot.wait_for("waits for a user")
    words = command(tmp_path, **{"lift.hold_time": "1000", "max_duration": "2000"})
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.strip() == "hold":
                process.send_signal(signal.SIGINT)
                break
        rest = process.stdout.read()
    assert process.returncode == 130
    assert [line.strip() for line in rest.splitlines()][:3] == [
        "lower",
        "release",
        "failed: it was stopped",
    ]
    robot.wait_for("finished")


# The commands of docs/skills.md with options; test_bare_commands.py runs those without. A cube that
# is brought far away would take the test long.
SKILLS = [
    ("sim", "turn --taught"),
    ("sim_balance", "balance --set duration=60"),
    ("throw_far", "throw --set stroke=far"),
    ("sim_pen", "draw --set word=HELLO"),
    ("pushing", "flip --set face=+y"),
    ("pushing", "place --set 'goals=[{place: [0.005, 0.005], face: \"+z\", turn: 0.1}]'"),
    (
        "pushing",
        "carry --set 'goal.position=[0.03, 0, 0.08]' --set 'goal.orientation=[0.924, 0.383, 0, 0]'",
    ),
]


# `flip` leaves free where the cube lies.
ERRORS = {
    "flip": {"orientation_error"},
    "place": {"position_error", "orientation_error"},
    "carry": {"position_error", "orientation_error"},
}
"""What a skill with a goal reports of its last pose."""


@pytest.mark.slow
@pytest.mark.parametrize(("config", "words"), SKILLS, ids=[words for _, words in SKILLS])
def test_carries_out_a_skill(
    start_program: StartProgram, tmp_path: Path, config: str, words: str
) -> None:
    robot = start_program("run", config, "--name", "s", "--non-real-time")
    robot.wait_for("waits for a user")
    output = tmp_path / "output"
    command = [PROGRAM, *shlex.split(words), "--robot", "s", "--output", output]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((output / "report.json").read_text())
    assert report["is_done"]
    task = words.split()[0]
    assert report["task"] == task
    assert {name for name in report if name.endswith("_error")} == ERRORS.get(task, set())
    assert ("carries" in report) == (task == "place")
    printed = {row[0]: row[1:] for row in FIGURE.findall(done.stdout)}
    assert printed
    assert printed.keys() <= report.keys()
    assert {unit for _, unit in printed.values()} <= {"", "%", "N", "Hz", "m", "m/s", "rad", "s"}
    for name, (number, unit) in printed.items():
        factor = 100 if unit == "%" else 1
        assert float(number) == pytest.approx(factor * report[name], rel=1e-3), name
    assert (output / "trace.csv").read_text().count("\n") > 100
    assert "fault" not in robot.end()[1]


@pytest.mark.slow
def test_a_skill_is_taught_anew(tmp_path: Path) -> None:
    command = [BUILD / "evaluation/evaluate_teach", "turn", "--output", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    shipped = Path(__file__).parents[3] / "config/skills/taught/turn.csv"
    made, taught = (
        np.genfromtxt(file, delimiter=",", skip_header=1)
        for file in (tmp_path / "turn.csv", shipped)
    )
    assert made.shape[1] == taught.shape[1]
    assert made[1, 0] == taught[1, 0]
    assert made[-1, 0] == pytest.approx(taught[-1, 0], rel=0.1)  # the duration
    np.testing.assert_allclose(made[0], taught[0], atol=1e-3)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["trow"], "there is no task 'trow', perhaps 'throw'"),
        (["throw"], "the scene has no 'ball'"),
        (["lift", "--set", "lift.hight=1"], "lift.hight"),
        (["lift", "--config", "nonsense"], "there are balance, carry"),
        (["lift", "--robot", "nobody"], "robot 'nobody'"),
        (["lift", "nobody"], "not expected: nobody"),
    ],
)
def test_says_what_is_wrong(
    start_program: StartProgram, tmp_path: Path, words: list[str], text: str
) -> None:
    start_program("run", "sim", *ROBOT).wait_for("waits for a user")
    done = subprocess.run(
        [PROGRAM, *words, "--output", tmp_path], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert text in done.stderr
