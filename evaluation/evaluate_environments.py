# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate environments`: tests whether push and lift can be solved.

The cube is pushed by its exact poses, and by those that a tracker finds in images. Goals are drawn
like in the environment. A goal counts if it is in the reachable set, which is computed before
anything moves. Each part of a row is kept in docs/results/environments.jsonl at once, so an
evaluation that was cut off goes on; docs/results/environments.md is written from these.
"""

import argparse
import hashlib
import itertools
import json
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import solvers
from solvers import Trial
from trifinger.arrays import Array
from trifinger.environments import Environment

RATE, DELAY = 30.0, 0.035  # of images and the poses in them [Hz], [s]
# Name of a row, its task and what is special. What takes longest comes first.
ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "push, seen": (
        "push",
        {
            "object_poses": "tracked",
            "camera_rate": RATE,
            "camera_delay": DELAY,
            "camera_size": 540,
        },
    ),
    "lift": ("lift", {}),
    "lift, as built": ("lift", {"condition": "as built"}),
    "lift, worn": ("lift", {"condition": "worn"}),
    "push": ("push", {}),
    "push, as built": ("push", {"condition": "as built"}),
    "push, worn": ("push", {"condition": "worn"}),
    "push, as late": ("push", {"object_period": 0.033, "object_delay": DELAY}),
}
IN_PAGE = (
    *("push", "push, as built", "push, worn", "lift", "lift, as built", "lift, worn"),
    *("push, seen", "push, as late"),
)
PROCESSES = 2
SEEDS = (1, 2, 3, 4)  # Each seed contributes its share of the goals.
NEEDED = 0.95  # share of the goals
TEXT = f"""\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# Push and lift: a controller that solves them

Written by `./run evaluate environments --goals {{goals}} --goals-by-sight {{by_sight}}`. The
controller is [solvers.py](../../evaluation/solvers.py): parts of `trifinger.control` that see
nothing but the environment's observations and answer with torques at 1 kHz. Success is the
environment's own, at the last step of the episode: the cube within 2 cm of its goal after 15 s of
`push`, 30 s of `lift`.

Starts and goals are the environment's own, of the seeds {SEEDS[0]} to {SEEDS[-1]} and the
episodes from 0 on, as far as they are in the reachable set: those for which the planner of grasps,
asked before anything moves, finds a way in one grasp or two. Planning takes no time of the episode.
A cube that slides has {100 * solvers.TABLE_SHARE:.0f} % of its weight on the table.

`push, seen` knows the cube only from a tracker (`object_poses="tracked"`), in three images of
540 x 540 pixels, {RATE:.0f} times a second, and each pose is {1e3 * DELAY:.0f} ms old when it
arrives. The true pose decides about success. `push, as late` has exact poses as seldom and as
late, for comparison, with the same starts and goals. In the rows *as built* and *worn* each episode
has another robot in this condition (docs/simulation.md).

| task | in the reachable set | solved | median distance | worst | planned with two grasps \
| grasped again after a loss | at least {100 * NEEDED:.0f} % |
|---|---|---|---|---|---|---|---|"""
FAILURES = """\
| failed | seed | episode | distance | grasps |
|---|---|---|---|---|"""
RESULTS = Path(__file__).parent.parent / "docs/results/environments.md"
PROGRAMS = (Path(__file__), Path(solvers.__file__))


class Trials(NamedTuple):
    """The results for some goals."""

    name: str
    """Name of the row."""
    drawn: int
    """Number of goals that had to be drawn."""
    trials: list[Trial]


def run_trials(name: str, seed: int, goals: int) -> Trials:
    """Tries that many reachable goals of a seed, beginning with episode 0, for a row."""
    task, changes = ROWS[name]
    environment = Environment(task, options=solvers.options(task, **changes))
    planner = solvers.RoutePlanner()
    trials: list[Trial] = []
    episode = 0
    while len(trials) < goals:
        trial = solvers.try_goal(environment, planner, seed, episode)
        episode += 1
        if trial is not None:
            trials.append(trial)
            print(name, trial, flush=True)
    return Trials(name, episode, trials)


def program() -> str:
    """A digest of what solves and judges."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in PROGRAMS)).hexdigest()[:12]


def kept(file: Path) -> dict[tuple[str, int, int], Trials]:
    """What this program has tried already: by row, seed and number of goals."""
    if not file.exists():
        return {}
    lines = map(json.loads, file.read_text(encoding="utf-8").splitlines())
    return {
        (line["row"], line["seed"], len(line["trials"])): Trials(
            line["row"], line["drawn"], [Trial(*trial) for trial in line["trials"]]
        )
        for line in lines
        if line["program"] == program()
    }


def joined(name: str, parts: Sequence[Trials]) -> Trials:
    """Returns all trials of a row."""
    own = [part for part in parts if part.name == name]
    trials = itertools.chain.from_iterable(part.trials for part in own)
    return Trials(name, sum(part.drawn for part in own), list(trials))


def is_solved(result: Trials) -> bool:
    """True if enough goals were reached."""
    return sum(trial.is_success for trial in result.trials) >= NEEDED * len(result.trials)


def row(result: Trials) -> str:
    """Returns a row of the table."""
    trials = result.trials
    distances = 1e3 * np.array([trial.distance for trial in trials])
    return (
        f"| `{result.name}` | {len(trials)} of {result.drawn}"
        f" ({100 * len(trials) / result.drawn:.0f} %)"
        f" | {sum(trial.is_success for trial in trials)} of {len(trials)}"
        f" | {np.median(distances):.2f} mm | {distances.max():.2f} mm"
        f" | {sum(trial.legs > 1 for trial in trials)}"
        f" | {sum(trial.grasps > trial.legs for trial in trials)}"
        f" | {'yes' if is_solved(result) else 'no'} |"
    )


def report(results: Sequence[Trials], goals: int, by_sight: int) -> str:
    """Returns the text of docs/results/environments.md."""
    failures = [
        f"| `{result.name}` | {trial.seed} | {trial.episode} | {1e3 * trial.distance:.1f} mm |"
        f" {trial.grasps} |"
        for result in results
        for trial in result.trials
        if not trial.is_success
    ]
    if failures:
        failures = ["", *FAILURES.splitlines(), *failures]
    return "\n".join(
        [TEXT.format(goals=goals, by_sight=by_sight), *map(row, results), *failures, ""]
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns 0 if all rows are solved, otherwise 1."""
    parser = argparse.ArgumentParser(prog="./run evaluate environments", description=__doc__)
    parser.add_argument("--goals", type=int, default=100, help="goals of each task (default 100)")
    parser.add_argument(
        "--goals-by-sight", type=int, default=20, help="goals of each other row (default 20)"
    )
    parser.add_argument("--output", type=Path, default=RESULTS, help="the table that is written")
    options = parser.parse_args(arguments)
    for name in ("goals", "goals_by_sight"):
        if getattr(options, name) < 1:
            parser.error(
                f"--{name.replace('_', '-')} is {getattr(options, name)}, must be at least 1"
            )

    def shares(name: str) -> Array:
        goals = options.goals_by_sight if ROWS[name][1] else options.goals
        return np.diff(np.linspace(0, goals, len(SEEDS) + 1).astype(int))

    os.environ["OMP_NUM_THREADS"] = "1"
    file = options.output.with_suffix(".jsonl")
    found = kept(file)
    wanted = [
        (name, seed, int(share))
        for name in ROWS
        for seed, share in zip(SEEDS, shares(name), strict=True)
    ]
    with ProcessPoolExecutor(PROCESSES) as executor:
        jobs = {executor.submit(run_trials, *part): part for part in wanted if part not in found}
        for job in as_completed(jobs):
            name, seed, _ = jobs[job]
            found[jobs[job]] = part = job.result()
            line = {"row": name, "seed": seed, "program": program(), **part._asdict()}
            with file.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps(line) + "\n")
    parts = [found[part] for part in wanted]
    results = [joined(name, parts) for name in IN_PAGE]
    options.output.write_text(report(results, options.goals, options.goals_by_sight))
    for result in results:
        print(row(result))
    return 0 if all(map(is_solved, results)) else 1


if __name__ == "__main__":
    sys.exit(main())
