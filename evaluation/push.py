# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate push`: a policy that pushes a cube, trained from scratch in about an hour.

Writes docs/results/push.md with its figures. A training that was killed is continued. A finished
training is only judged again.
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
JUDGED = 500  # episodes that neither the training nor its curve has seen
LONG = Options.of("push").duration  # [s]
DISTANCES = (0.0, 0.05, 0.1, 0.15, 0.2, np.inf)  # how far the cube has to go [m]


def minutes(folder: Path) -> float:
    """Returns the time of the training. A break counts as a gap of the usual length."""
    board = EventAccumulator(str(folder / "tensorboard"))
    board.Reload()
    gaps = np.diff(sorted(event.wall_time for event in board.Scalars("evaluation/median")))
    return float(np.minimum(gaps, 2 * np.median(gaps)).sum()) / 60


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
    training: Training, evaluation: Evaluation, noisy: Summary, longer: Summary, spent: float
) -> str:
    """Returns the text of docs/results/push.md."""
    plan, options = training.plan, training.plan.options
    actions = plan.episodes * training.episode_actions / 1e6
    untouched = np.linalg.norm(evaluation.paths[:, 0], axis=1)
    lucky = (untouched <= 0.02).mean()
    return f"""\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# Learning to push: results

Written by `./run evaluate push` on {time.strftime("%Y-%m-%d")}; {processor()}, two cores.
PPO from scratch with the recipe of [training.md](../training.md), seed {plan.seed}, on
{plan.recipe.num_envs} simulated `trifinger_edu` at once: {plan.episodes} episodes of
{options.duration:g} s, {actions:.1f} million actions, in {spent:.0f} minutes. Starts and goals of
the cube are those of the environment, in a disc with a radius of 13.9 cm. So is success: the cube
within 2 cm of its goal when the time is over.

{JUDGED} episodes that neither the training nor its curve has seen, by how far the cube had to go:

| way | episodes | success | distance at the end, median | quartiles |
|---|---|---|---|---|
{table(evaluation)}

| the same episodes | success | distance at the end, median |
|---|---|---|
| with the noise of the training on the actions | {told(noisy)} |
| with the {LONG:g} s that the environment gives by default | {told(longer)} |
| with a cube that nobody touches | {100 * lucky:.0f} % | {100 * np.median(untouched):.2f} cm |

Not every goal can be reached: [environments.md](environments.md) has what a controller comes to
that plans its grasps.

![learning curve](push_curve.png)

Paths of the cube relative to its goal in the xy plane: starts are crosses, ends are dots, the
circle is 2 cm from the goal.

![paths of the cube](push_paths.png)
"""


def main() -> int:
    """Runs the whole experiment."""
    parser = argparse.ArgumentParser(prog="./run evaluate push", description=__doc__)
    parser.add_argument("--folder", type=Path, default=FOLDER, help=f"default: {FOLDER}")
    folder: Path = parser.parse_args().folder
    with closing(Training(Plan.of("push", "ppo"), folder, print)) as training:
        training.run()
        training.save_figures()
        options = training.plan.options
        evaluation, noisy, longer = (
            Evaluator("push", replace(options, duration=seconds), JUDGED, SEED + 1000)(act)
            for act, seconds in (
                (training.act, options.duration),
                (partial(training.act, with_noise=True), options.duration),
                (training.act, LONG),
            )
        )
        save_curve({"push": training.curve}, RESULTS / "push_curve.png")
        shutil.copy(folder / "object.png", RESULTS / "push_paths.png")
        (RESULTS / "push.md").write_text(
            page(training, evaluation, noisy.summary(), longer.summary(), minutes(folder))
        )
    print(evaluation.summary(), f"{RESULTS / 'push.md'} written.", sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
