# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate push`: policies that push a cube, trained from scratch with three seeds.

Writes docs/results/push.md with its figures. Trainings that were killed are continued, finished
ones are only judged again.
"""

import argparse
import shutil
import sys
import time
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from trifinger.arrays import Array
from trifinger.environments import Options
from trifinger.evaluation import SEED, Evaluation, Evaluator, Summary, save_curve
from trifinger.training import Plan, Training

from learning import processor

RESULTS = Path("docs/results")
FOLDER = Path("build/learning/push")
SEEDS = (1, 2, 3)
JUDGED = 500  # episodes that neither the training nor its curve has seen
LONG = Options.of("push").duration  # [s]
DISTANCES = (0.0, 0.05, 0.1, 0.15, 0.2, np.inf)  # how far the cube has to go [m]


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


def page(
    trainings: list[Training],
    judged: list[tuple[Evaluation, Summary, Summary]],
    spent: list[float],
) -> str:
    """Returns the text of docs/results/push.md."""
    plan, options = trainings[0].plan, trainings[0].plan.options
    actions = plan.episodes * trainings[0].episode_actions
    untouched = np.linalg.norm(judged[0][0].paths[:, 0], axis=1)
    lucky = (untouched <= 0.02).mean()
    seeds = "\n".join(
        f"| {training.plan.seed} | {time:.0f} min | {told(evaluation.summary())} | {told(noisy)} | "
        f"{told(longer)} |"
        for training, (evaluation, noisy, longer), time in zip(
            trainings, judged, spent, strict=True
        )
    )
    rate = actions * len(spent) / (60 * sum(spent))
    return f"""\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# Learning to push: results

Written by `./run evaluate push` on {time.strftime("%Y-%m-%d")}; {processor()}, two cores.
PPO from scratch with the recipe of [training.md](../training.md) on
{plan.recipe.num_envs} simulated `trifinger_edu` at once: {plan.episodes} episodes of
{options.duration:g} s, {actions / 1e6:.1f} million actions, {rate:.0f} of them per second of a
processor, all evaluations of the curve included. Starts and goals of the cube are those of the
environment, in a disc with a radius of 13.9 cm. So is success: the cube within 2 cm of its goal
when the time is over. The robot is as documented, and only starts and goals vary. Each policy is
judged in {JUDGED} episodes that no training and no curve has seen, with steps of 1 ms.

*With noise*: with the noise of the training on the actions. *Longer*: with the {LONG:g} s that the
environment gives by default. Medians are of the distances at the end.

| seed | time of one processor | success | median | with noise | median | longer | median |
|---|---|---|---|---|---|---|---|
{seeds}

The policy of seed {plan.seed}, by how far the cube had to go:

| way | episodes | success | distance at the end, median | quartiles |
|---|---|---|---|---|
{table(judged[0][0])}

A cube that nobody touches is at its goal in {100 * lucky:.0f} % of these episodes, its median
distance is {100 * np.median(untouched):.2f} cm. Not every goal can be reached:
[environments.md](../environments.md) has what a controller comes to that plans its grasps.

![learning curves](push_curve.png)

Paths of the cube relative to its goal in the xy plane, seed {plan.seed}: starts are crosses, ends
are dots, the circle is 2 cm from the goal.

![paths of the cube](push_paths.png)
"""


def judge(training: Training) -> tuple[Evaluation, Summary, Summary]:
    """Returns how a policy does as trained, with noise, and in longer episodes."""
    options = training.plan.options
    evaluation, noisy, longer = (
        Evaluator("push", replace(options, duration=seconds), JUDGED, SEED + 1000)(act)
        for act, seconds in (
            (training.act, options.duration),
            (partial(training.act, with_noise=True), options.duration),
            (training.act, LONG),
        )
    )
    return evaluation, noisy.summary(), longer.summary()


def main() -> int:
    """Runs the whole experiment."""
    parser = argparse.ArgumentParser(prog="./run evaluate push", description=__doc__)
    parser.add_argument("--folder", type=Path, default=FOLDER, help=f"default: {FOLDER}_SEED")
    folder: Path = parser.parse_args().folder
    trainings, judged, spent = [], [], []
    for seed in SEEDS:
        own = folder.with_name(f"{folder.name}_{seed}")
        with closing(Training(Plan.of("push", "ppo", seed=seed), own, print)) as training:
            training.run()
            judged.append(judge(training))
            if seed == SEEDS[0]:
                training.save_figures()
                shutil.copy(own / "object.png", RESULTS / "push_paths.png")
        trainings.append(training)
        spent.append(processor_minutes(own))
        print(judged[-1][0].summary())
    save_curve(
        {f"seed {one.plan.seed}": one.curve for one in trainings}, RESULTS / "push_curve.png"
    )
    (RESULTS / "push.md").write_text(page(trainings, judged, spent))
    print(f"{RESULTS / 'push.md'} written.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
