# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate learn-on-robot`: the paper's second experiment, `trifinger learn` in real time.

A robot learns to reach from scratch: simulated, three seeds, and on emulated motor boards; and to
push a cube, from scratch and with demonstrations. A reach takes 25 minutes of real time, a push two
hours; two run at once. What was killed goes on the next time, and what is finished is kept:
`rm -r build/learn-on-robot` begins anew. Policies are judged by `trifinger evaluate`, which knows
nothing of the training. Writes docs/results/learn_on_robot.md.
"""

import argparse
import contextlib
import json
import math
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from push_demonstrations import demonstrate
from trifinger.commands.program import path as program

RUNS = Path("build/learn-on-robot")
PAGE = Path("docs/results/learn_on_robot.md")
MINUTES = 26.0  # wall time of a reach
EPISODES = {"reach": 700, "push": 720}
JUDGED = 50  # episodes


@dataclass(frozen=True)
class Job:
    """A training on a robot of its own, and what it must reach."""

    kind: str
    """In the name of the folder, and of a simulated robot."""
    robot: str
    """Configuration."""
    words: tuple[str, ...]
    """What `trifinger learn` is told."""
    seed: int
    median: float = math.inf
    """Largest median of the final distances in new episodes [m]."""
    success: float = 0.0
    """Smallest share of new episodes that end with success."""
    demonstrations: int = 0
    """Number of successful episodes that it is shown before."""

    @property
    def name(self) -> str:
        """Name of the folder, and of a simulated robot."""
        return f"{self.kind}-{self.seed}"

    @property
    def is_emulated(self) -> bool:
        """Whether the robot is one of emulated motor boards."""
        return self.robot.endswith("emulated")

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.words[0]

    def holds(self, found: dict[str, float]) -> bool:
        """Whether it has reached what it must."""
        is_in_time = self.task != "reach" or found["minutes"] <= MINUTES
        return found["median"] <= self.median and found["success"] >= self.success and is_in_time


def trifinger(*words: object) -> list[str]:
    """A command line."""
    return [program(), *map(str, words)]


@contextlib.contextmanager
def running(*words: object, until: str) -> Iterator[None]:
    """Runs a command beside the block, once it has said `until`."""
    process = subprocess.Popen(trifinger(*words), stdout=subprocess.PIPE, text=True)
    try:
        while process.stdout is None or until not in process.stdout.readline():
            if process.poll() is not None:
                sys.exit(f"'trifinger {' '.join(map(str, words))}' has ended")
        yield
    finally:
        process.terminate()
        process.communicate()


def learn(job: Job) -> dict[str, Any]:
    """Trains, or goes on, and judges; returns the figures."""
    folder = RUNS / job.name
    result = folder / "result.json"
    if not result.exists():
        with contextlib.ExitStack() as robots:
            if job.is_emulated:
                robots.enter_context(running("emulate", job.robot, until="are on"))
            named = () if job.is_emulated else ("--name", job.name)
            robots.enter_context(running("run", job.robot, *named, until="waits for a user"))
            name = job.robot.replace("_", "-") if job.is_emulated else job.name
            begun = (folder / "plan.json").exists()
            words = (*job.words, "--seed", job.seed, "-o", folder)
            if job.demonstrations and not begun:
                shown = RUNS / f"shown-{job.seed}"
                shutil.rmtree(shown, ignore_errors=True)
                demonstrate(name, shown, job.demonstrations)
                words = (*words, "--from", shown)
            subprocess.run(
                trifinger("learn", "--robot", name, *(("--resume", folder) if begun else words)),
                check=True,
            )
        words = (folder / f"{job.task}.policy", "--episodes", JUDGED, "--json")
        judged = subprocess.run(
            trifinger("evaluate", *words), stdout=subprocess.PIPE, check=True, text=True
        )
        known = json.loads((folder / "tally.json").read_text())
        tally = known["tally"]
        found = json.loads(judged.stdout) | {"minutes": tally["seconds"] / 60}
        found |= {name: tally[name] for name in ("updates", "recoveries", "cares")}
        found["curve"] = [[episode, one["success"]] for episode, one in known["curve"]]
        result.write_text(json.dumps(found, indent=2))
    figures: dict[str, Any] = json.loads(result.read_text())
    print(
        f"{job.name}: {100 * figures['median']:.2f} cm, success {100 * figures['success']:.0f} % "
        f"in {figures['minutes']:.1f} min",
        flush=True,
    )
    return figures


def page(jobs: Sequence[Job], results: Sequence[dict[str, Any]]) -> str:
    """The text of the page."""

    def rows(task: str) -> str:
        return "\n".join(
            f"| {job.name} | {wanted(job)} | {100 * one['median']:.2f} | "
            f"{100 * one['lower_quartile']:.2f} to {100 * one['upper_quartile']:.2f} | "
            f"{100 * one['largest']:.1f} | {100 * one['success']:.0f} | {one['minutes']:.1f} | "
            f"{one['updates']:.0f} | {one['recoveries']:.0f}, {one['cares']:.0f} |"
            for job, one in zip(jobs, results, strict=True)
            if job.task == task
        )

    curves = "\n".join(
        f"| {job.name} | {', '.join(f'{100 * part:.0f}' for _, part in one['curve'])} |"
        for job, one in zip(jobs, results, strict=True)
        if job.task == "push"
    )
    head = """\
| training, seed | must reach | median [cm] | quartiles [cm] | farthest [cm] | success [%] \
| wall time [min] | gradient steps | recoveries, cares |
|---|---|---|---|---|---|---|---|---|"""
    return f"""\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# Learning on a robot that runs: results

Written by `./run evaluate learn-on-robot` on {time.strftime("%Y-%m-%d")}. `trifinger learn` in real
time at 1 kHz; back-end, actor, learner and recorder are processes on two processors, two trainings
at once. The robot of `boards` is on emulated motor boards, the others are simulated. What varies
from seed to seed are networks, starts, goals and noise. Judged in {JUDGED} new episodes by
`trifinger evaluate`, which knows nothing of the training: distances at the end, of all tips to
their goals or of the cube to its goal.

## Reach

From scratch, {EPISODES["reach"]} episodes of 2 s. The paper: about 2 cm in 23 minutes "plus a few".

{head}
{rows("reach")}

The wall time has the start of all processes, and 20 episodes on the robot that judge the last
policy; it shall be at most {MINUTES:g} min.

## Push

{EPISODES["push"]} episodes of 10 s, two hours, by `rlpd`: from scratch, and with demonstrations by
[a program](../../evaluation/push_demonstrations.py) that has taken over. Success: within 2 cm.

{head}
{rows("push")}

Of each 50 episodes of the training, with its noise, so many ended with success [%]:

| training, seed | |
|---|---|
{curves}
"""


def wanted(job: Job) -> str:
    """What a training must reach, in words."""
    if job.success > 0:
        return f"{100 * job.success:.0f} % within 2 cm"
    return f"{100 * job.median:g} cm" if math.isfinite(job.median) else "is stated"


def main() -> int:
    """Runs the whole experiment."""
    parser = argparse.ArgumentParser(prog="./run evaluate learn-on-robot", description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only", default="", metavar="TEXT", help="trainings with this name")
    arguments = parser.parse_args()
    edu, reach = "trifinger_edu", ("reach", "--episodes", str(EPISODES["reach"]))
    push = ("push", "--algorithm", "rlpd", "--episodes", str(EPISODES["push"]))
    jobs = [
        job
        for seed in range(1, arguments.seeds + 1)
        for job in (
            Job("sim-shared", edu, (*reach, "--shared"), seed, median=0.003),
            Job("sim-joint", edu, reach, seed, median=0.012),
        )
    ]
    jobs += [
        Job("boards-shared", "trifinger_edu_emulated", (*reach, "--shared"), 1, median=0.003),
        Job("push-demonstrated", "sim", push, 1, success=0.5, demonstrations=20),
        Job("push-scratch", "sim", push, 1),
    ]
    jobs = [job for job in jobs if arguments.only in job.name]
    RUNS.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(learn, jobs))
    PAGE.write_text(page(jobs, results))
    print(f"{PAGE} written.")
    holds = all(job.holds(one) for job, one in zip(jobs, results, strict=True))
    print("The table holds." if holds else "THE TABLE DOES NOT HOLD.")
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
