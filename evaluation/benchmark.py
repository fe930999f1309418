# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate benchmark`: what our policies and controllers come to in `trifinger benchmark`.

Writes docs/results/benchmark.md. Each row is kept in docs/results/benchmark.jsonl at once, so an
evaluation that was cut off goes on. A policy that is not there is trained by `./run evaluate
learning`, `push`, `lift` or `training`; its row is left out until then, or stays as it was.
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import solvers
from trifinger import benchmark
from trifinger.benchmark import Actor, Observation, Row
from trifinger.control import Pose
from trifinger.environments import VectorEnvironment

RESULTS = Path("docs/results/benchmark.md")
RUNS = Path("build/learning")
POLICIES = {
    "reach, one network (seed 1)": RUNS / "reach_1/reach.policy",
    "reach, shared (seed 1)": RUNS / "reach_shared_1/reach.policy",
    "push by PPO (seed 1)": RUNS / "push_1/push.policy",
    "lift by PPO (seed 1)": RUNS / "lift_1/lift.policy",
    "trajectory by PPO (seed 1)": RUNS
    / "move_cube_on_trajectory_ppo_1/move_cube_on_trajectory.policy",
    "turn by PPO (seed 1)": RUNS / "dclaw_turn_fixed_ppo_1/dclaw_turn_fixed.policy",
}
TEXT = """\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# The benchmark

Written by `./run evaluate benchmark`. [benchmark.md](../benchmark.md) says what is fixed, what the
columns are, and how to get a row of your own.

{table}

* **zero**, **random**: all numbers of an action are 0; they are drawn uniformly. Zeros hold the
  pose, or for actions that are positions go to the middle of their range. Any row must beat both.
* **reach, ...**: the policies of [learning.md](learning.md), trained for five minutes.
* **push**, **lift**, **trajectory**, **turn by PPO**: the policies of [push.md](push.md),
  [lift.md](lift.md) and [training.md](training.md).
* **planned grasps**: [solvers.py](../../evaluation/solvers.py) acts by torques at 1 kHz, from
  observations alone. Where it finds no grasp it leaves the cube.
{missing}
Nothing of ours does `lift_pose` or the trajectory in this form yet. The controller of
[challenge.md](challenge.md) does both, but in the platform of the compatibility packages, with
episodes of 120 s: its costs per step are in the same unit as the column here, its starts, goals and
robot are others.

The experts of the published data sets (TriFinger RL data sets, 2023) are not in the table: neither
their package nor this project has their policies.
[What judges them](../benchmark.md#experts-of-the-published-data-sets) when somebody has them.
"""


class OncePlanner(solvers.RoutePlanner):
    """Plans for a place and a goal only once, also if there is no way."""

    def __init__(self) -> None:
        super().__init__()
        self._found: dict[tuple[float, ...], list[solvers.Leg] | None] = {}

    def plan(self, start: Pose, goal: npt.ArrayLike) -> list[solvers.Leg] | None:
        """A route, as the class above finds it."""
        numbers = np.concatenate([start.position, start.orientation, np.asarray(goal)])
        key = tuple(np.round(numbers, 3).tolist())
        if key not in self._found:
            self._found[key] = super().plan(start, goal)
        return self._found[key]


class Planned:
    """The controller that plans its grasps."""

    options: Mapping[str, Any] = {
        "action": "torque",
        "steps_per_action": 1,
        "mapping": "state_augmentation",
    }
    planner = OncePlanner()

    def reset(self, observation: Observation, _environment: VectorEnvironment) -> None:
        """Begins an episode."""
        self._solver = solvers.Solver(self.planner, dict(observation))

    def act(self, observation: Observation) -> npt.ArrayLike:
        """The torques, as shares of the largest."""
        return self._solver.act(dict(observation), dict(observation))


def actors(task: str) -> list[Actor]:
    """What is judged in a task."""
    found = [benchmark.controller(name) for name in benchmark.REFERENCES]
    policies = (benchmark.policy(path, name) for name, path in POLICIES.items() if path.exists())
    found += [policy for policy in policies if policy.task == task]
    if task in ("push", "lift"):
        digest = hashlib.sha256(Path(solvers.__file__).read_bytes()).hexdigest()
        planned = benchmark.controllers("planned grasps", lambda _: Planned(), Planned.options)
        found.append(replace(planned, sha256=digest))
    return found


def kept(file: Path) -> dict[tuple[str, str], Row]:
    """The rows that there are, by task and actor; later lines replace earlier ones."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    rows = [Row(**json.loads(line)) for line in lines]
    return {(row.task, row.actor): row for row in rows}


def is_complete(row: Row) -> bool:
    """Whether it has all episodes."""
    return row.figures["episodes"] == benchmark.BENCHMARKS[row.task].episodes


def main(arguments: Sequence[str] | None = None) -> int:
    """Judges what is not yet judged, and writes the page."""
    parser = argparse.ArgumentParser(prog="./run evaluate benchmark", description=__doc__)
    parser.add_argument("--only", default="", help="judge tasks whose name has this text")
    parser.add_argument("--again", action="store_true", help="judge, whatever is kept")
    parser.add_argument("--output", type=Path, default=RESULTS, help="the page that is written")
    options = parser.parse_args(arguments)
    file = options.output.with_suffix(".jsonl")
    rows = kept(file)
    for task in (task for task in benchmark.BENCHMARKS if options.only in task):
        for actor in actors(task):
            old = rows.get((task, actor.name))
            if old and is_complete(old) and old.sha256 == actor.sha256 and not options.again:
                continue
            row = benchmark.judge(task, actor)
            rows[task, actor.name] = row
            print(f"{benchmark.table([row])}\n", flush=True)
            with file.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps(vars(row)) + "\n")
    tasks = list(benchmark.BENCHMARKS)
    ordered = sorted(rows.values(), key=lambda row: tasks.index(row.task))
    file.write_text("".join(f"{json.dumps(vars(row))}\n" for row in ordered), encoding="utf-8")
    missing = [f"`{name}`" for name in POLICIES if name not in {row.actor for row in ordered}]
    note = f"* Not trained yet, so without a row: {', '.join(missing)}.\n" if missing else ""
    text = TEXT.format(table=benchmark.table(ordered), missing=note)
    options.output.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
