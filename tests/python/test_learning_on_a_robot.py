# SPDX-License-Identifier: BSD-3-Clause
"""Programs of others that learn on a robot in real time, in another process."""

import re
from pathlib import Path

import pytest
import trifinger
from conftest import PATIENT, StartProgram

PAGE = Path(__file__).parents[2] / "docs/learning.md"
# Episodes of 20 actions, three of them after learning has begun.
CHANGES = {
    '    mapping="state_augmentation",\n': '    mapping="state_augmentation",\n    duration=0.4,\n',
    "gradient_steps=100": "gradient_steps=4, learning_starts=40",
    "70_000": "100",
}


@pytest.mark.slow
@pytest.mark.without_sanitizer  # Stable-Baselines3 takes too long under sanitizers
@pytest.mark.parametrize("train_freq", ['(1, "episode")', "1"])
def test_the_program_of_the_page_learns_on_a_robot(
    start_program: StartProgram, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, train_freq: str
) -> None:
    robot = start_program("run", "trifinger_edu", *PATIENT)
    robot.wait_for("waits for a user")
    (program,) = (
        part
        for part in re.findall("```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
        if "DDPG(" in part
    )
    for long, short in (CHANGES | {'(1, "episode")': train_freq}).items():
        assert long in program
        program = program.replace(long, short)
    monkeypatch.setenv("SB3_LOGDIR", str(tmp_path))
    names: dict[str, object] = {}
    exec(program, names)  # noqa: S102, our own page
    assert names["model"].num_timesteps == 100  # type: ignore[attr-defined]
    assert names["robot"].episode[1] == 5  # type: ignore[attr-defined]  # one begins after the last
    with trifinger.connect("trifinger-edu") as free:  # the robot is not stopped
        assert free.fault() is None
