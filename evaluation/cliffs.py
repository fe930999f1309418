# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate cliffs`: how much of each disturbance each skill stands.

A robot is as documented but for one value of trifinger.Variation. Of its levels the worst one at
which at least half of the trials succeed is found, by bisection. Trials are those of
evaluation/skills.py, with other seeds, and are kept in docs/results/cliffs.jsonl at once: an
evaluation that was cut off goes on.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from skills import (
    RESULTS,
    Batch,
    Results,
    Row,
    all_rows,
    chosen,
    only_one,
    run,
    successes,
)

mpl.use("Agg")


class Disturbance(NamedTuple):
    """A value of trifinger.Variation and the steps in which it gets worse."""

    name: str
    levels: tuple[float, ...]
    as_built: float
    """The worst that a robot as built has; see docs/simulation.md."""
    meaning: str


DISTURBANCES = (
    Disturbance("object_mass", (1.25, 1.5, 2, 2.5, 3), 1.0, "factor on the object's mass"),
    Disturbance("friction", (0.85, 0.7, 0.6, 0.5, 0.4), 1.0, "factor on friction"),
    Disturbance("motor_gain", (0.95, 0.9, 0.8, 0.7, 0.6), 1.0, "share of the torque"),
    Disturbance("motor_spread", (0.05, 0.1, 0.2, 0.3), 0.05, "motors differ by up to"),
    Disturbance("torque_ripple", (0.05, 0.1, 0.2, 0.3), 0.05, "ripple of the torque"),
    Disturbance(
        "joint_friction", (0.005, 0.01, 0.015, 0.02, 0.03, 0.04), 0.015, "dry friction [Nm]"
    ),
    Disturbance("joint_damping", (2, 4, 8, 16), 2.0, "factor on joints' damping"),
    Disturbance("backlash", (0.002, 0.005, 0.01, 0.02), 0.005, "play [rad]"),
    Disturbance("homing_error", (0.002, 0.005, 0.01, 0.02), 0.005, "error of homing [rad]"),
    Disturbance("velocity_noise", (0.005, 0.02, 0.05, 0.1, 0.2), 0.05, "noise of velocity [rad/s]"),
    Disturbance("torque_delay", (1, 2, 4, 6, 8), 2, "torques late by [ms]"),
    Disturbance("measurement_delay", (1, 2, 4, 6, 8), 1, "measurements late by [ms]"),
    Disturbance("motor_heat", (0.25, 0.5, 0.75, 0.9), 0.25, "heat of the motors"),
    Disturbance("tip_radius", (0.95, 0.9, 0.8, 0.7), 0.95, "factor on the tips' radius"),
    Disturbance("contact_time", (1.5, 2, 3, 4), 1.0, "softness of contacts"),
)
FIRST_SEED = 9000
HALF = 0.5
DARK = 3  # levels beyond as built, from which on a cell is dark
PAGE = """\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# Cliffs: how much each skill stands

Written by `./run evaluate cliffs` from [cliffs.jsonl](cliffs.jsonl). The robot is as documented but
for one value, of which the levels below are tried, the worst one first, then by bisection. Mass,
friction, poses and starts vary as in [skills.md](skills.md), and its judges decide. A cell is the
worst level at which at least half of the trials succeed, and how many of how many do; `-`: not
even the first level; `...`: the next level was not tried, or there is none; empty: not known yet.
In the picture, white is what a robot *as built* has, blue is more, red is less, grey is not known.

![The worst level that each skill stands](cliffs.png)

| what | levels | as built |
|---|---|---|
"""


def share(
    results: Results, row: Row, disturbance: Disturbance, level: float, enough: int
) -> float | None:
    """The share of trials that succeed; None if there are not yet enough."""
    trials = results.of(row, "as documented", f"{disturbance.name}={level:g}")
    return len(successes(trials.values())) / len(trials) if len(trials) >= enough else None


def has_trials(results: Results, row: Row) -> bool:
    """Whether there is any trial of a row."""
    return any(
        share(results, row, disturbance, level, 1) is not None
        for disturbance in DISTURBANCES
        for level in disturbance.levels
    )


class Cliff(NamedTuple):
    """How far a skill goes."""

    stands: int
    """Number of levels up to the worst one at which at least half succeed."""
    falls: int
    """Number of the mildest level that was tried and at which fewer succeed; there may be none."""


def cliff_of(results: Results, row: Row, disturbance: Disturbance, enough: int = 1) -> Cliff:
    """How far a skill goes, by the trials that are there."""
    stands = 0
    for number, level in enumerate(disturbance.levels):
        seen = share(results, row, disturbance, level, enough)
        if seen is not None and seen < HALF:
            return Cliff(stands, number)
        if seen is not None:
            stands = number + 1
    return Cliff(stands, len(disturbance.levels))


def next_batches(results: Results, rows: Sequence[Row], seeds: range) -> list[Batch]:
    """The next level of each disturbance: the last one, then one in the middle of what is open."""
    batches = []
    for row in rows:
        for disturbance in DISTURBANCES:
            levels = disturbance.levels
            stands, falls = cliff_of(results, row, disturbance, len(seeds))
            if stands < falls:
                number = (stands + falls) // 2 if falls < len(levels) else len(levels) - 1
                vary = f"{disturbance.name}={levels[number]:g}"
                batches.append(Batch(row, "as documented", vary, seeds))
    return batches


def cell(results: Results, row: Row, disturbance: Disturbance) -> str:
    """A cell of the table."""
    stands, falls = cliff_of(results, row, disturbance)
    if stands == 0:
        return "-" if falls == 0 else ""
    level = disturbance.levels[stands - 1]
    trials = results.of(row, "as documented", f"{disturbance.name}={level:g}")
    more = "" if falls == stands < len(disturbance.levels) else " ..."
    return f"{level:g} ({len(successes(trials.values()))} of {len(trials)}){more}"


def draw(results: Results, rows: Sequence[Row]) -> None:
    """Draws how far each skill goes, against what a robot as built has."""
    margins = np.full((len(rows), len(DISTURBANCES)), np.nan)
    figure, axes = plt.subplots(figsize=(12, 0.5 * len(rows) + 2.2), layout="constrained")
    for i, row in enumerate(rows):
        for k, disturbance in enumerate(DISTURBANCES):
            levels = disturbance.levels
            stands, falls = cliff_of(results, row, disturbance)
            if stands == 0 and falls > 0:
                continue
            built = levels.index(disturbance.as_built) + 1 if disturbance.as_built in levels else 0
            margins[i, k] = stands - built
            text = f"{levels[stands - 1]:g}" if stands else "-"
            color = "white" if abs(margins[i, k]) >= DARK else "black"
            text = text if falls == stands < len(levels) else f"{text} …"
            axes.text(k, i, text, ha="center", va="center", fontsize=8, color=color)
    axes.imshow(margins, cmap="RdBu", vmin=-4, vmax=4, aspect="auto")
    axes.set_facecolor("lightgrey")  # what is not known
    axes.set_yticks(range(len(rows)), [row.name for row in rows])
    labels = [disturbance.meaning for disturbance in DISTURBANCES]
    axes.set_xticks(range(len(labels)), labels, rotation=35, ha="right", fontsize=8)
    axes.set_title("The worst level at which at least half of the trials succeed")
    figure.savefig(RESULTS / "cliffs.png", dpi=110)
    plt.close(figure)


def write_page(results: Results, rows: Sequence[Row]) -> None:
    """Writes the page and its picture."""
    text = PAGE
    for name, levels, as_built, meaning in DISTURBANCES:
        steps = ", ".join(f"{level:g}" for level in levels)
        text += f"| `{name}`: {meaning} | {steps} | {as_built:g} |\n"
    names = [disturbance.name for disturbance in DISTURBANCES]
    text += f"\n| skill | {' | '.join(names)} |\n|---|{'---|' * len(names)}\n"
    for row in rows:
        cells = " | ".join(cell(results, row, disturbance) for disturbance in DISTURBANCES)
        text += f"| {row.name} | {cells} |\n"
    (RESULTS / "cliffs.md").write_text(text)
    draw(results, rows)


def main() -> int:
    """Goes on until every cliff is found."""
    parser = argparse.ArgumentParser(
        prog="evaluate cliffs", description="Finds how much of each disturbance skills stand."
    )
    parser.add_argument("skill", nargs="*", help="default: all")
    parser.add_argument("--seeds", type=int, default=6, help="trials of each level; %(default)s")
    processes = len(os.sched_getaffinity(0))
    parser.add_argument("--processes", type=int, default=processes, help="trials at the same time")
    arguments = parser.parse_args(sys.argv[2:])
    rows = [row for row in all_rows() if row.name == row.skill and not row.is_on_boards]
    wanted = chosen(parser, rows, arguments.skill)
    results = Results(RESULTS / "cliffs.jsonl", rows)
    seeds = range(FIRST_SEED, FIRST_SEED + arguments.seeds)
    with only_one("cliffs"):
        find(results, wanted, seeds, arguments.processes)
        write_page(results, [row for row in rows if has_trials(results, row)])
    print("docs/results/cliffs.md written.")
    return 0


def find(results: Results, wanted: Sequence[Row], seeds: range, processes: int) -> None:
    """Tries levels until every cliff is found."""
    while batches := next_batches(results, wanted, seeds):
        for row, condition, vary, _ in run(results, batches, processes):
            trials = results.of(row, condition, vary)
            count = f"{len(successes(trials.values()))} of {len(trials)}"
            print(f"{row.name:10} {vary:24} {count}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
