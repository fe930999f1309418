# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate push` and `lift`: policies that move a cube, trained with three seeds.

Writes docs/results/push.md or lift.md with its figures. Trainings that were killed are continued,
finished ones are only judged again.
"""

import argparse
import shutil
import sys
import textwrap
import time
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from lift_states import EPISODES as CARRIED, kept_states
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from trifinger.arrays import Array
from trifinger.environments import Options
from trifinger.evaluation import SEED, Evaluation, Evaluator, Summary, save_curve
from trifinger.training import Plan, Training

from learning import processor

RESULTS = Path("docs/results")
FOLDER = Path("build/learning")
SEEDS = (1, 2, 3)
JUDGED = 500  # episodes that neither the training nor its curve has seen
DISTANCES = (0.0, 0.05, 0.1, 0.15, 0.2, np.inf)  # how far the cube has to go [m]


@dataclass(frozen=True)
class Experiment:
    """A task, and what its page says of it."""

    title: str
    beginning: str
    goals: str

    def plan(self, task: str, seed: int) -> Plan:
        """The recipe of the task."""
        settings = {"reset_states": str(kept_states())} if task == "lift" else {}
        return Plan.of(task, "ppo", seed=seed, settings=settings)


EXPERIMENTS = {
    "push": Experiment("Learning to push", "from scratch", "in a disc with a radius of 13.9 cm"),
    "lift": Experiment(
        "Learning to lift",
        "whose episodes begin, half of them, in states of a controller "
        f"([lift_states.py](../../evaluation/lift_states.py) grasps and carries {CARRIED} cubes, "
        "with other seeds)",
        "in a disc with a radius of 13.9 cm, goals up to 10 cm high; 30 % of them are so low that "
        "a cube on the table can be near enough",
    ),
}


@dataclass(frozen=True)
class Judged:
    """How a policy does in JUDGED episodes."""

    evaluation: Evaluation
    noisy: Summary
    longer: Summary
    as_built: Summary


def processor_minutes(folder: Path) -> float:
    """Returns how long a processor was busy with a training, with the evaluations of its curve."""
    board = EventAccumulator(str(folder / "tensorboard"))
    board.Reload()
    times = [event.value for event in board.Scalars("time/processor")]
    # A training that goes on after a kill counts from 0 again.
    spent = (time if time < before else time - before for before, time in pairwise([0.0, *times]))
    return float(sum(spent)) / 60


def table(evaluation: Evaluation) -> str:
    """Returns a table of the episodes, by how far the cube had to go."""
    needed = np.linalg.norm(evaluation.paths[:, 0], axis=1)

    def row(name: str, chosen: Array) -> str:
        low, median, high = 100 * np.percentile(evaluation.distances[chosen], (25, 50, 75))
        success = 100 * evaluation.successes[chosen].mean()
        return (
            f"| {name} | {chosen.sum()} | {success:.0f} % | {median:.2f} cm | "
            f"{low:.2f} to {high:.2f} cm |"
        )

    rows = []
    for low, high in pairwise(DISTANCES):
        chosen = (needed >= low) & (needed < high)
        if not chosen.any():
            continue
        limits = (
            f"{100 * low:g} to {100 * high:g} cm" if high < np.inf else f"over {100 * low:g} cm"
        )
        rows.append(row(limits, chosen))
    return "\n".join([*rows, row("all", needed >= 0.0)])


def told(summary: Summary) -> str:
    """Returns two cells of the table."""
    return f"{100 * summary.success:.0f} % | {100 * summary.median:.2f} cm"


def page(task: str, trainings: list[Training], judged: list[Judged], spent: list[float]) -> str:
    """Returns the text of the page."""
    experiment = EXPERIMENTS[task]
    plan, options = trainings[0].plan, trainings[0].plan.options
    actions = plan.episodes * trainings[0].episode_actions
    untouched = np.linalg.norm(judged[0].evaluation.paths[:, 0], axis=1)
    lucky = (untouched <= 0.02).mean()
    seeds = "\n".join(
        f"| {training.plan.seed} | {minutes:.0f} min | {told(one.evaluation.summary())} | "
        f"{told(one.noisy)} | {told(one.longer)} | {told(one.as_built)} |"
        for training, one, minutes in zip(trainings, judged, spent, strict=True)
    )
    rate = actions * len(spent) / (60 * sum(spent))
    text = f"""\
Written by `./run evaluate {task}` on {time.strftime("%Y-%m-%d")}; {processor()}, two cores.
PPO {experiment.beginning}, with the recipe of [training.md](../training.md), on
{plan.recipe.num_envs} simulated `trifinger_edu` at once: {plan.episodes} episodes of
{options.duration:g} s, {actions / 1e6:.1f} million actions, {rate:.0f} of them per second of a
processor, all evaluations of the curve included. Starts and goals of the cube are those of the
environment, {experiment.goals}. Success is that of the environment: the cube is within 2 cm of its
goal when the time is over. The robot is as documented, and only starts and goals vary. Each policy
is judged in {JUDGED} episodes that no training and no curve has seen, with steps of 1 ms.

*With noise*: with the noise of the training on the actions. *Longer*: with the {long(task):g} s
that the environment gives by default. *As built*: each episode on another robot that is
[not perfect](../simulation.md), which the training has not seen. Medians are of the distances at
the end of all episodes."""
    return f"""\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# {experiment.title}: results

{fill(text)}

| seed | time of one processor | success | median | with noise | median | longer | median \
| as built | median |
|---|---|---|---|---|---|---|---|---|---|
{seeds}

The policy of seed {plan.seed}, by how far the cube had to go:

| way | episodes | success | distance at the end, median | quartiles |
|---|---|---|---|---|
{table(judged[0].evaluation)}

A cube that nobody touches is at its goal in {100 * lucky:.0f} % of these episodes, its median
distance is {100 * np.median(untouched):.2f} cm. Not every goal can be reached:
[environments.md](../environments.md) has what a controller comes to that plans its grasps.

![learning curves]({task}_curve.png)

Paths of the cube relative to its goal in the xy plane, seed {plan.seed}: starts are crosses, ends
are dots, the circle is 2 cm from the goal.

![paths of the cube]({task}_paths.png)
"""


def fill(text: str) -> str:
    """Returns paragraphs in lines of 100 characters."""
    return "\n\n".join(textwrap.fill(one, 100) for one in text.split("\n\n"))


def long(task: str) -> float:
    """Length of the task's episodes [s]."""
    return Options.of(task).duration


def begun(plan: Plan, folder: Path) -> Training:
    """The training in a folder; one by another plan is removed."""
    if folder.exists() and Plan.of_folder(folder) != plan:
        shutil.rmtree(folder)
    return Training(plan, folder, print)


def judge(training: Training) -> Judged:
    """Returns how a policy does as trained, with noise, in longer episodes, and as built."""
    task, options = training.plan.task, training.plan.options
    first, *others = (
        Evaluator(task, changed, JUDGED, SEED + 1000)(act)
        for act, changed in (
            (training.act, options),
            (partial(training.act, with_noise=True), options),
            (training.act, replace(options, duration=long(task))),
            (training.act, replace(options, condition="as built")),
        )
    )
    return Judged(first, *(one.summary() for one in others))


def main() -> int:
    """Runs the whole experiment."""
    parser = argparse.ArgumentParser(prog="./run evaluate", description=__doc__)
    parser.add_argument("task", choices=EXPERIMENTS)
    parser.add_argument("--folder", type=Path, default=FOLDER, help=f"default: {FOLDER}")
    arguments = parser.parse_args()
    task, folder = arguments.task, arguments.folder
    trainings, judged, spent = [], [], []
    for seed in SEEDS:
        own = folder / f"{task}_{seed}"
        with closing(begun(EXPERIMENTS[task].plan(task, seed), own)) as training:
            training.run()
            judged.append(judge(training))
            if seed == SEEDS[0]:
                training.save_figures()
                shutil.copy(own / "object.png", RESULTS / f"{task}_paths.png")
        trainings.append(training)
        spent.append(processor_minutes(own))
        print(judged[-1].evaluation.summary())
    save_curve(
        {f"seed {one.plan.seed}": one.curve for one in trainings}, RESULTS / f"{task}_curve.png"
    )
    (RESULTS / f"{task}.md").write_text(page(task, trainings, judged, spent))
    print(f"{RESULTS / task}.md written.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
