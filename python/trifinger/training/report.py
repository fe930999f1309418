# SPDX-License-Identifier: BSD-3-Clause
"""What a training on a robot has come to: counts, learning curve and a report."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

# This import comes first because its error says what to install.
from trifinger.arrays import Array
from trifinger.evaluation import SHOWN_EPISODES, Evaluation, Summary, save_paths

# isort: split
import numpy as np

from trifinger.training.plan import Plan
from trifinger.training.run import PATH_FIGURES
from trifinger.whole_file import replace_file


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

    def rows(self, plan: Plan) -> dict[str, str]:
        """All of it, in words."""
        faults = [f"{count} x {reason}" for reason, count in self.faults.items()]
        restarts = [f"{name} {count} x" for name, count in self.restarts.items()]
        return {
            "learning": f"episode {self.episodes} of {plan.episodes}, {self.actions} actions, "
            f"{self.successes} successes, {self.policies} policies, {self.updates} gradient steps",
            "time": f"{self.seconds / 60:.1f} min; {self.time_lost:.0f} s lost by faults and care",
            "faults": "; ".join(faults) or "none",
            "by itself": f"{self.recoveries} recoveries, {self.cares} cares, {self.rests} rests",
            "started again": "; ".join(restarts) or "nothing",
        }


def write_report(
    folder: Path, title: str, plan: Plan, tally: Tally, judged: Summary | None, elements: Array
) -> Path:
    """Writes report.md with its figures, and returns its path.

    `judged` is of the last policy, `elements` are the experience of the training.
    """
    figure = PATH_FIGURES.get(plan.task)
    if figure and (paths := _paths_to_goals(elements)):
        save_paths(paths, folder / figure)
    rows = {"task, algorithm": f"{plan.task}, {plan.recipe.algorithm}"} | tally.rows(plan)
    if judged is not None:
        words = judged.in_words(judged.lower_quartile, judged.median, judged.upper_quartile)
        name = f"last policy without noise, {judged.episodes} new episodes on the robot"
        rows[name] = f"quartiles {words}, success {100 * judged.success:.0f} %"
    lines = [f"# {title}", "", "| | |", "|---|---|"]
    lines += [f"| {name} | {value} |" for name, value in rows.items()]
    figures = [name for name in ("curve.png", figure) if name and (folder / name).exists()]
    lines += ["", *(f"![]({name})" for name in figures), ""]
    replace_file(folder / "report.md", "\n".join(lines).encode())
    return folder / "report.md"


# Paths of the paper's figure: at the beginning, later and at the end.
def _paths_to_goals(elements: Array) -> dict[str, Array]:
    if not len(elements):
        return {}
    last = int(elements["episode"].max())
    begins = {"begin": 0, "after 200 episodes": 200, "end": max(last + 1 - SHOWN_EPISODES, 0)}
    paths: dict[str, Array] = {}
    for name, first in begins.items():
        place = elements["episode"].astype(np.int64) - first
        shown = (place >= 0) & (place < SHOWN_EPISODES)
        if shown.any():
            offset = elements["achieved"][shown] - elements["desired"][shown]
            actions = elements["actions"][shown]
            paths[name] = np.full((SHOWN_EPISODES, max(actions) + 1, offset.shape[1]), np.nan)
            paths[name][place[shown], actions] = offset
    return paths


def summary_of(reports: Iterable[Mapping[str, Any]], unit: str) -> Summary:
    """How near episodes came to their goals, of the reports of `trifinger run-policy --json`."""
    ended = list(reports)
    distances = [one for report in ended for one in report["distance"] if one is not None]
    successes = [report["is_success"] for report in ended]
    none = np.zeros(0)  # paths
    return Evaluation(np.array(distances), np.array(successes), none, unit).summary()
