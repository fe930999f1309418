# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate learning`: the paper's reaching experiment, trained from scratch over seeds.

Writes docs/results/learning.md with its figures. Its table lists what must hold. The last line says
by what margin the table holds; the exit status is 0 if it does. `./run evaluate environments` and
`push` judge the tasks with a cube, and `./run bench` measures times.
"""

import argparse
import csv
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from trifinger import Policy
from trifinger.evaluation import Summary, evaluate, save_curve

RESULTS = Path("docs/results")
RUNS = Path("build/learning")
EPISODES = 700
EARLY = 100  # episodes
CONDITIONS = ("as built", "worn")  # of robots that the training has not seen
PAPER = 0.02  # what the paper has on its robot, and what policies reach on one as built [m]
TIME = 300.0  # processor time of a training [s]


@dataclass(frozen=True)
class Kind:
    """A way to train, and the results that it must reach."""

    name: str
    title: str
    words: tuple[str, ...]
    final: float  # [m]
    early: float | None = None  # after EARLY episodes [m]


@dataclass(frozen=True)
class Run:
    """A finished training."""

    kind: Kind
    seed: int
    curve: list[tuple[int, Summary]]
    imperfect: dict[str, Summary]  # of robots in these conditions
    processor_time: float  # [s]
    wall_time: float  # [s]

    def median(self, episode: int) -> float:
        """Median of the final distances, in the evaluation nearest to an episode [m]."""
        return min(self.curve, key=lambda entry: abs(entry[0] - episode))[1].median


@dataclass(frozen=True)
class Row:
    """A row of the table."""

    what: str
    reach: float
    values: Sequence[float]
    unit: str

    @property
    def figure(self) -> float:
        """The median of the seeds, which is compared with the reach."""
        return float(np.median(self.values))

    @property
    def margin(self) -> float:
        """Distance below the reach, as a share of the reach; negative if the row does not hold."""
        return 1.0 - self.figure / self.reach

    def __str__(self) -> str:
        digits = 0 if self.unit == "s" else 2
        low, high = (f"{value:.{digits}f}" for value in (min(self.values), max(self.values)))
        return (
            f"| {self.what} | {self.reach:g} {self.unit} | {self.figure:.{digits}f} {self.unit} | "
            f"{low} to {high} {self.unit} | "
            f"{'yes' if self.margin >= 0 else '**no**'} |"
        )


KINDS = (
    Kind("reach", "three fingers, one network", (), final=0.012),
    Kind(
        "reach_shared",
        "one policy shared by the fingers",
        ("--shared",),
        final=0.003,
        early=0.01,
    ),
)


def train(kind: Kind, seed: int) -> Run:
    """Trains in a process of its own, on one core."""
    folder = RUNS / f"{kind.name}_{seed}"
    shutil.rmtree(folder, ignore_errors=True)
    program = "import sys; from trifinger.commands.train import main; sys.exit(main())"
    words = ("reach", *kind.words, "--seed", str(seed), "-o", str(folder))
    begin = time.monotonic()
    folder.parent.mkdir(parents=True, exist_ok=True)
    path = RUNS / f"{folder.name}.log"
    print(f"{kind.title}, seed {seed}: begins; {path} shows how far it is", flush=True)
    with path.open("w") as log:
        process = subprocess.Popen(
            [sys.executable, "-c", program, *words, "--episodes", str(EPISODES)],
            stdout=log,
            stderr=log,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )
        # These times belong to this training alone, not to all that have ended.
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{kind.title}, seed {seed}: the training has failed; {path} says why")
    processor_time = usage.ru_utime + usage.ru_stime
    wall_time = time.monotonic() - begin
    run = Run(kind, seed, read_curve(folder), judge(folder), processor_time, wall_time)
    print(
        f"{kind.title}, seed {seed}: {100 * run.median(EPISODES):.2f} cm in "
        f"{run.processor_time:.0f} s of a processor, {run.wall_time:.0f} s of wall time",
        flush=True,
    )
    return run


def judge(folder: Path) -> dict[str, Summary]:
    """How near the policy comes on robots that are not perfect, by condition."""
    policy = Policy(folder / "reach.policy")
    return {
        condition: evaluate(policy, "reach", condition=condition).summary()
        for condition in CONDITIONS
    }


def read_curve(folder: Path) -> list[tuple[int, Summary]]:
    """Returns the results of a training from its files."""
    with (folder / "curve.csv").open(newline="") as file:
        rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
    return [(int(row.pop("episode")), Summary(episodes=0, unit="m", **row)) for row in rows]


def table(runs: Sequence[Run]) -> list[Row]:
    """Returns the rows that must hold."""
    rows = []
    for kind in KINDS:
        own = [run for run in runs if run.kind is kind]
        for what, episode, reach in (
            (f"{kind.title}: after {EPISODES} episodes", EPISODES, kind.final),
            (f"{kind.title}: after {EARLY} episodes", EARLY, kind.early),
        ):
            if reach is not None:
                values = [100 * run.median(episode) for run in own]
                rows.append(Row(what, 100 * reach, values, "cm"))
        values = [100 * run.imperfect["as built"].median for run in own]
        rows.append(Row(f"{kind.title}: on robots as built", 100 * PAPER, values, "cm"))
        times = [run.processor_time for run in own]
        rows.append(Row(f"{kind.title}: processor time", TIME, times, "s"))
    return rows


def verdict(rows: Sequence[Row]) -> tuple[bool, str]:
    """Returns whether the table holds, and a line that says by what margin."""
    worst = min(rows, key=lambda row: row.margin)
    holds = worst.margin >= 0
    return holds, (
        f"{'The table holds' if holds else 'THE TABLE DOES NOT HOLD'}: the narrowest, "
        f"'{worst.what}', is {worst.figure:.2f} {worst.unit} of {worst.reach:g} {worst.unit}, "
        f"{abs(100 * worst.margin):.0f} % {'below' if holds else 'ABOVE'}."
    )


def processor() -> str:
    """Returns the name of the processor."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    return next((line.partition(": ")[2] for line in lines if "model name" in line), "unknown")


def imperfect_cells(run: Run) -> str:
    """The median distance and the success of each condition."""
    return " | ".join(
        f"{100 * summary.median:.2f} | {100 * summary.success:.0f}"
        for summary in run.imperfect.values()
    )


def page(runs: Sequence[Run], rows: Sequence[Row], seeds: int) -> str:
    """Returns the text of docs/results/learning.md."""
    figures = "\n\n".join(
        f"### {kind.title}\n\n![learning curves]({kind.name}_curve.png)\n\n"
        f"Tips relative to their goals in the xy plane, as in the paper's figure: starts are "
        f"crosses, ends are dots, the ellipse is 2 cm from the goal. Seed 1.\n\n"
        f"![paths of the tips]({kind.name}_tips.png)"
        for kind in KINDS
    )
    lines = "\n".join(
        f"| {run.kind.title} | {run.seed} | {100 * run.median(EARLY):.2f} | "
        f"{100 * run.median(EPISODES):.2f} | {100 * run.curve[-1][1].largest:.2f} | "
        f"{100 * run.curve[-1][1].success:.0f} | {imperfect_cells(run)} | "
        f"{run.processor_time:.0f} | {run.wall_time:.0f} |"
        for run in runs
    )
    table_lines = "\n".join(map(str, rows))
    return f"""\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# Learning to reach: results

Written by `./run evaluate learning --seeds {seeds}` on {time.strftime("%Y-%m-%d")}; {processor()},
two cores. DDPG from scratch on one simulated `trifinger_edu`, through the interface of the robot,
not in real time: {EPISODES} episodes of 2 s, 50 actions a second by the reduced-rate approximation,
the recipes of [training.md](../training.md). Judged by 50 episodes that are the same for all: the
median of the distances of all tips to their goals at the end of an episode. The paper: about 2 cm.

| what | reach | median of {seeds} seeds | spread | holds |
|---|---|---|---|---|
{table_lines}

Trainings run two at a time, each in one thread. Their times are those of the whole command, with
evaluations, figures and film. The processor time is judged: the wall time is the same on a quiet
machine, and longer beside other programs.

The columns *as built* and *worn* judge the same policies in the same episodes, each with another
robot in this condition ([simulation.md](../simulation.md)); the trainings were on perfect joints.

| training | seed | after {EARLY} [cm] | at the end [cm] | farthest [cm] | success [%] \
| as built [cm] | success [%] | worn [cm] | success [%] | processor time [s] | wall time [s] |
|---|---|---|---|---|---|---|---|---|---|---|---|
{lines}

{figures}
"""


def main() -> int:
    """Runs the whole experiment."""
    parser = argparse.ArgumentParser(prog="./run evaluate learning", description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    seeds = parser.parse_args().seeds
    if seeds < 1:
        parser.error(f"--seeds is {seeds}, must be at least 1")
    jobs = [(kind, seed) for kind in KINDS for seed in range(1, seeds + 1)]
    with ThreadPoolExecutor(2) as pool:
        runs = list(pool.map(lambda job: train(*job), jobs))
    rows = table(runs)
    for kind in KINDS:
        own = {f"seed {run.seed}": run.curve for run in runs if run.kind is kind}
        save_curve(own, RESULTS / f"{kind.name}_curve.png")
        shutil.copy(RUNS / f"{kind.name}_1" / "tips.png", RESULTS / f"{kind.name}_tips.png")
    (RESULTS / "learning.md").write_text(page(runs, rows, seeds))
    print(*rows, f"{RESULTS / 'learning.md'} written.", sep="\n")
    holds, line = verdict(rows)
    print(line)
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
