# SPDX-License-Identifier: BSD-3-Clause
"""What a training on a robot has come to: counts, learning curve and a report."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

# This import comes first because its error says what to install.
from trifinger.arrays import Array
from trifinger.evaluation import SHOWN_EPISODES, Evaluation, Summary, save_curve, save_paths

# isort: split
import numpy as np

from trifinger.training.plan import Plan
from trifinger.whole_file import replace_file

WITH_PATHS = ("reach", "finger_reach", "push")  # tasks whose goals are points


@dataclasses.dataclass
class Tally:
    """What has happened, of this run and those that it resumed."""

    episodes: int = 0
    actions: int = 0
    successes: int = 0
    faults: dict[str, int] = dataclasses.field(default_factory=dict)
    """How often the robot stopped, by reason."""
    recoveries: int = 0
    cares: int = 0
    """How often the care has made the robot and its object ready."""
    rests: int = 0
    """How often warm motors were let rest."""
    time_lost: float = 0.0
    """From each end of the actor to the next episode that ended [s]."""
    restarts: dict[str, int] = dataclasses.field(default_factory=dict)
    """How often a process was started again, by name."""
    policies: int = 0
    updates: int = 0
    seconds: float = 0.0
    """How long it took."""

    def rows(self) -> list[tuple[str, str]]:
        """All of it, in words."""
        return [
            ("episodes, actions", f"{self.episodes}, {self.actions}"),
            ("time", f"{self.seconds / 60:.1f} min"),
            ("time lost by ends of the actor", f"{self.time_lost:.1f} s"),
            ("policies, gradient steps", f"{self.policies}, {self.updates}"),
            ("recoveries, cares, rests", f"{self.recoveries}, {self.cares}, {self.rests}"),
            *((f"fault: {reason}", str(count)) for reason, count in self.faults.items()),
            *((f"{name} started again", str(count)) for name, count in self.restarts.items()),
        ]


def write_report(
    folder: Path,
    title: str,
    plan: Plan,
    tally: Tally,
    curve: Sequence[tuple[int, Summary]],
    judged: Summary | None,
    paths: dict[str, Array],
) -> Path:
    """Writes report.md with its figures, and returns its path."""
    figures = []
    if curve:
        save_curve({plan.name: curve}, folder / "curve.png")
        figures.append("curve.png")
    if plan.task in WITH_PATHS and paths:
        save_paths(paths, folder / "tips.png")
        figures.append("tips.png")
    rows = [("task, algorithm", f"{plan.task}, {plan.recipe.algorithm}"), *tally.rows()]
    if judged is not None:
        words = judged.in_words(judged.lower_quartile, judged.median, judged.upper_quartile)
        name = f"last policy without noise, {judged.episodes} new episodes on the robot"
        rows.append((name, f"quartiles {words}, success {100 * judged.success:.0f} %"))
    lines = [f"# {title}", "", "| | |", "|---|---|"]
    lines += [f"| {name} | {value} |" for name, value in rows]
    lines += ["", *(f"![]({name})" for name in figures), ""]
    replace_file(folder / "report.md", "\n".join(lines).encode())
    return folder / "report.md"


def paths_to_goals(elements: Array) -> dict[str, Array]:
    """Paths of the paper's figure, of experience: at the beginning, later and at the end."""
    if not len(elements):
        return {}
    last = int(elements["episode"].max())
    begins = {"begin": 0, "after 200 episodes": 200, "end": last + 1 - SHOWN_EPISODES}
    paths: dict[str, Array] = {}
    for name, first in begins.items():
        of_part = [
            (one["achieved"] - one["desired"])
            for number in range(max(first, 0), first + SHOWN_EPISODES)
            if len(one := elements[elements["episode"] == number]) > 1
        ]
        if of_part:
            path = np.full((len(of_part), max(map(len, of_part)), of_part[0].shape[1]), np.nan)
            for row, one in zip(path, of_part, strict=True):
                row[: len(one)] = one
            paths[name] = path
    return paths


def summary_of(reports: Iterable[Mapping[str, Any]], unit: str) -> Summary:
    """How near episodes came to their goals, of the reports of `trifinger run-policy --json`."""
    ended = list(reports)
    distances = [one for report in ended for one in report["distance"] if one is not None]
    successes = [report["is_success"] for report in ended]
    no_paths = np.zeros((len(ended), 0, 0))
    return Evaluation(np.array(distances), np.array(successes), no_paths, unit).summary()
