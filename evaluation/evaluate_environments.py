# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate environments`: tests whether push and lift can be solved.

Goals are drawn like in the environment. A goal counts if it is in the reachable set, which is
computed before anything moves. Writes docs/results/environments.md.
"""

import argparse
import itertools
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import solvers
from solvers import Trial
from trifinger.environments import Environment

TASKS = ("lift", "push")  # The longer task comes first.
PROCESSES = 2
SEEDS = (1, 2, 3, 4)  # Each seed contributes its share of the goals.
NEEDED = 0.95  # share of the goals
TEXT = f"""\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# Push and lift: a controller that solves them

Written by `./run evaluate environments --goals {{goals}}`. The controller is
[solvers.py](../../evaluation/solvers.py): parts of `trifinger.control` that see nothing but the
environment's observations and answer with torques at 1 kHz. Success is the environment's own, at
the last step of the episode: the cube within 2 cm of its goal after 15 s of `push`, 30 s of `lift`.

Starts and goals are the environment's own, of the seeds {SEEDS[0]} to {SEEDS[-1]} and the
episodes from 0 on, as far as they are in the reachable set: those for which the planner of grasps,
asked before anything moves, finds a way in one grasp or two. Planning takes no time of the episode.
A cube that slides has {100 * solvers.TABLE_SHARE:.0f} % of its weight on the table.

| task | in the reachable set | solved | median distance | worst | planned with two grasps \
| grasped again after a loss | at least {100 * NEEDED:.0f} % |
|---|---|---|---|---|---|---|---|"""
FAILURES = """\
| failed | seed | episode | distance | grasps |
|---|---|---|---|---|"""
RESULTS = Path(__file__).parent.parent / "docs/results/environments.md"


class Trials(NamedTuple):
    """The results for some goals."""

    task: str
    drawn: int
    """Number of goals that had to be drawn."""
    trials: list[Trial]


def run_trials(task: str, seed: int, goals: int) -> Trials:
    """Tries that many reachable goals of a seed, beginning with episode 0."""
    environment = Environment(task, options=solvers.options(task))
    planner = solvers.RoutePlanner()
    trials: list[Trial] = []
    episode = 0
    while len(trials) < goals:
        trial = solvers.try_goal(environment, planner, seed, episode)
        episode += 1
        if trial is not None:
            trials.append(trial)
            print(task, trial, flush=True)
    return Trials(task, episode, trials)


def joined(task: str, parts: Sequence[Trials]) -> Trials:
    """Runs all trials of a task."""
    own = [part for part in parts if part.task == task]
    trials = itertools.chain.from_iterable(part.trials for part in own)
    return Trials(task, sum(part.drawn for part in own), list(trials))


def is_solved(result: Trials) -> bool:
    """True if enough goals were reached."""
    return sum(trial.is_success for trial in result.trials) >= NEEDED * len(result.trials)


def row(result: Trials) -> str:
    """Returns the row of a task in the table."""
    trials = result.trials
    distances = 1e3 * np.array([trial.distance for trial in trials])
    return (
        f"| `{result.task}` | {len(trials)} of {result.drawn}"
        f" ({100 * len(trials) / result.drawn:.0f} %)"
        f" | {sum(trial.is_success for trial in trials)} of {len(trials)}"
        f" | {np.median(distances):.2f} mm | {distances.max():.2f} mm"
        f" | {sum(trial.legs > 1 for trial in trials)}"
        f" | {sum(trial.grasps > trial.legs for trial in trials)}"
        f" | {'yes' if is_solved(result) else 'no'} |"
    )


def report(results: Sequence[Trials], goals: int) -> str:
    """Returns the text of docs/results/environments.md."""
    failures = [
        f"| `{result.task}` | {trial.seed} | {trial.episode} | {1e3 * trial.distance:.1f} mm |"
        f" {trial.grasps} |"
        for result in results
        for trial in result.trials
        if not trial.is_success
    ]
    if failures:
        failures = ["", *FAILURES.splitlines(), *failures]
    return "\n".join([TEXT.format(goals=goals), *map(row, results), *failures, ""])


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns 0 if both tasks are solved, otherwise 1."""
    parser = argparse.ArgumentParser(prog="./run evaluate environments", description=__doc__)
    parser.add_argument("--goals", type=int, default=100, help="goals of each task (default 100)")
    parser.add_argument("--output", type=Path, default=RESULTS, help="the table that is written")
    options = parser.parse_args(arguments)
    if options.goals < 1:
        parser.error(f"--goals is {options.goals}, must be at least 1")
    shares = np.diff(np.linspace(0, options.goals, len(SEEDS) + 1).astype(int))
    os.environ["OMP_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(PROCESSES) as executor:
        jobs = [
            executor.submit(run_trials, task, seed, int(share))
            for task in TASKS
            for seed, share in zip(SEEDS, shares, strict=True)
        ]
        parts = [job.result() for job in jobs]
    results = [joined(task, parts) for task in sorted(TASKS, reverse=True)]
    options.output.write_text(report(results, options.goals))
    for result in results:
        print(row(result))
    return 0 if all(map(is_solved, results)) else 1


if __name__ == "__main__":
    sys.exit(main())
