# SPDX-License-Identifier: BSD-3-Clause
"""Makes films of skills, in docs/images/films: python -m website.films [NAME ...]

The first page shows some. Each is a skill of a simulated robot, drawn from its log. `push` and
`learned_lift` are policies, which `./run evaluate push` and `lift` train.
"""

import contextlib
import itertools
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trifinger
from numpy.typing import NDArray
from PIL import Image
from tracked_files import ROOT
from trifinger.environments import Environment, Options
from trifinger.evaluation import act_of
from trifinger.log.film import Scene
from trifinger.picture import FILM_RATE, View, save_film

FOLDER = ROOT / "docs/images/films"
LEARNED = {"push": "push", "learned_lift": "lift"}  # the task of the policy that a film shows
EPISODES = 4  # of a policy
REST = 1.2  # s at the goal, which are shown
FAR = 0.08  # [m]
SIZE = (480, 360)  # pixels
PROGRAM = str(ROOT / ".venv/bin/trifinger")

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Shot:
    """A skill, and how it is filmed."""

    config: str
    task: str
    camera: str
    speed: float  # of the film, 1 is real
    part: tuple[float, float, float] = (0.5, 0.5, 1.0)  # middle and size of what of it is shown
    still: float = 0.6  # when the still picture is taken, as a share of the film
    robot: tuple[str, ...] = ()  # settings of the robot
    skill: tuple[str, ...] = ()  # settings of the skill


SHOTS = {
    "draw": Shot("sim_pen", "draw", "90,-50", 4.0, (0.5, 0.72, 0.5), 0.97),
    "flip": Shot("pushing", "flip", "front", 0.5, (0.5, 0.6, 0.8), 0.45),
    "throw": Shot("throw", "throw", "front", 0.5),
    "carry": Shot("pushing", "carry", "115,-20", 2.0, (0.5, 0.6, 0.85)),
    "turn": Shot("sim", "turn", "front", 3.0, (0.5, 0.6, 0.8)),
    "stand": Shot("sim_cuboid", "stand", "front", 3.0, (0.5, 0.6, 0.8), 0.9),
    "lift": Shot(
        "sim", "lift", "front", 4.0, robot=("fingers.height=0.3",), skill=("lift.hold_time=4",)
    ),
    "slide": Shot("sim", "slide", "front", 4.0, (0.5, 0.6, 0.8), skill=("slide.turns=1",)),
    "place": Shot(
        *("pushing", "place", "115,-20", 4.0, (0.5, 0.6, 0.85)),
        skill=('goals=[{place: [0.05, 0.02], face: "-x", turn: 0.8}]',),
    ),
    "balance": Shot("sim_balance", "balance", "front", 1.0, skill=("duration=6",)),
    "catch": Shot("catch", "catch", "front", 0.25),
}


def record(shot: Shot, folder: Path) -> Path:
    """Lets a simulated robot do what is filmed, and returns the folder of its log."""
    name = f"film_{shot.task}_{os.getpid()}"
    run = [PROGRAM, "run", shot.config, "--name", name, "--record", "logs", "--non-real-time"]
    for setting in ("simulation.condition=as built", *shot.robot):
        run += ["--set", setting]
    with subprocess.Popen(run, cwd=folder, stdout=subprocess.PIPE, text=True) as robot:
        try:
            for line in robot.stdout or ():
                if "waits for a user" in line:
                    break
            else:
                raise SystemExit(f"'{' '.join(run)}' has ended")
            do = [PROGRAM, "manipulate", shot.task, "--robot", name, "-o", "report"]
            for setting in shot.skill:
                do += ["--set", setting]
            subprocess.run(do, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        finally:
            robot.terminate()
    return folder / "logs"


def log_page(path: Path) -> None:
    """Writes the page of a log to play with."""
    with tempfile.TemporaryDirectory() as folder:
        logs = record(SHOTS["flip"], Path(folder))
        subprocess.run([PROGRAM, "view", logs, "-o", path], check=True, stdout=subprocess.DEVNULL)


def pictures(shot: Shot, logs: Path) -> Iterator[Picture]:
    """Draws the session of a log."""
    session = trifinger.Log(logs).session()
    x, y, share = shot.part
    width, height = (round(length / share) for length in SIZE)
    left, top = round(x * width - SIZE[0] / 2), round(y * height - SIZE[1] / 2)
    with contextlib.closing(Scene(session, View(shot.camera, width, height))) as scene:
        first, last = scene.steps[0], scene.steps[-1]
        for step in np.arange(first, last, shot.speed / session.period / FILM_RATE):
            yield scene.image(int(step))[top : top + SIZE[1], left : left + SIZE[0]]


def episodes_of(task: str) -> Iterator[Picture]:
    """Draws the first episodes in which a policy brings a cube from afar to its goal."""
    policy = trifinger.Policy(ROOT / f"build/learning/{task}_1/{task}.policy")
    act, options = act_of(policy), Options.from_json(policy.metadata["options"])
    view = View("front", *SIZE)
    environment = Environment(task, options=options, render_mode="rgb_array", view=view)

    def episode(seed: int) -> Iterator[dict[str, Any]]:
        observation, info = environment.reset(seed=seed)
        has_ended, there = False, 0
        while not has_ended and there < REST * environment.metadata["render_fps"]:
            yield info
            there = there + 1 if info.get("is_success") else 0
            action = act(np.reshape(np.asarray(observation), (1, -1))).ravel()
            observation, _, terminated, truncated, info = environment.step(action)
            has_ended = terminated or truncated
        yield info

    def comes_from_afar(seed: int) -> bool:
        infos = list(episode(seed))
        way = np.linalg.norm(infos[0]["achieved_goal"] - infos[0]["desired_goal"])
        return bool(way > FAR and infos[-1]["is_success"])

    every = round(environment.metadata["render_fps"] / FILM_RATE)
    with contextlib.closing(environment):
        for seed in itertools.islice(filter(comes_from_afar, itertools.count()), EPISODES):
            for _ in itertools.islice(episode(seed), 0, None, every):
                yield np.asarray(environment.render())


def save(images: list[Picture], name: str, still: float) -> None:
    """Writes a film for browsers, and a picture of it."""
    save_film(images, FOLDER / f"{name}.webm", FILM_RATE)
    Image.fromarray(images[int(still * (len(images) - 1))]).save(
        FOLDER / f"{name}.jpg", quality=82, optimize=True
    )


def main(names: list[str]) -> None:
    """Makes the films with these names, or all."""
    for name in names or [*SHOTS, *LEARNED]:
        if name in LEARNED:
            save(list(episodes_of(LEARNED[name])), name, 0.68)
            continue
        shot = SHOTS[name]
        with tempfile.TemporaryDirectory() as folder:
            save(list(pictures(shot, record(shot, Path(folder)))), name, shot.still)


if __name__ == "__main__":
    main(sys.argv[1:])
