# SPDX-License-Identifier: BSD-3-Clause
"""The trials of a sweep, each in a folder of its own, and the table of what came out.

A trial is a training, or some episodes of an evaluation. Its folder has its result once it has
ended, and until then what it needs to go on.
"""

import contextlib
import csv
import dataclasses
import fcntl
import io
import json
import secrets
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from trifinger._trifinger import Policy
from trifinger.errors import Error, InvalidArgument
from trifinger.evaluation import SEED, Evaluation, Summary, evaluate
from trifinger.own_class import name_of_file
from trifinger.sweep.executors import EXECUTORS, Command
from trifinger.whole_file import replace_file

if TYPE_CHECKING:
    from trifinger.training import Plan, Training

SWEEP = "sweep.json"  # the file in the folder of a sweep
TABLES = ("table.csv", "table.md")  # beside it, at the end
RESULT = "result.json"  # the file in the folder of a trial that has ended
ERROR = "error.txt"  # instead of it, what was wrong with one that has failed
LOG = "log.txt"  # beside them, what its processes have printed
EPISODES = 50  # largest number of episodes that a trial evaluates
STARTS = 3  # how often a trial is started that is killed each time

Row = dict[str, Any]
"""What a row of the table is about: "task", "seed" and others, as the table shows them."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Trial:
    """A training by a plan, or else episodes of a policy."""

    row: int
    """Number of the row that its result belongs to."""
    task: str
    plan: dict[str, Any] | None = None
    policy: str = ""
    """File of the policy, in the folder of the sweep."""
    condition: str | None = None
    seed: int = SEED
    """Seed of the first episode; each later one adds 1."""
    episodes: int = EPISODES


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sweep:
    """A sweep in a folder."""

    folder: Path
    rows: Sequence[Row]
    trials: Sequence[Trial]
    project: str | None = None
    """Project of Weights & Biases that shows the learning curves."""
    group: str = ""
    """Name of this sweep there."""

    @classmethod
    def of_trainings(
        cls, folder: Path, plans: Sequence[tuple[Row, "Plan"]], project: str | None = None
    ) -> Self:
        """Begins a sweep in an empty folder: a training for each row."""
        if project is not None:
            _require("wandb")
        trials = [
            Trial(row=number, task=plan.task, plan=json.loads(plan.to_json()))
            for number, (_, plan) in enumerate(plans)
        ]
        group = f"{folder.resolve().name}-{secrets.token_hex(3)}"
        rows = [row for row, _ in plans]
        return cls(folder=folder, rows=rows, trials=trials, project=project, group=group)._begun({})

    @classmethod
    def of_evaluations(
        cls,
        folder: Path,
        policies: Sequence[Path],
        tasks: Sequence[str] = (),
        conditions: Sequence[str | None] = (None,),
        seeds: Sequence[int] = (SEED,),
        episodes: int = EPISODES,
    ) -> Self:
        """Begins a sweep in an empty folder: each policy in each condition.

        `tasks` are what the user says that policies are for; one MODULE:CLASS must be said.
        """
        if episodes < 1:
            raise InvalidArgument(f"episodes is {episodes}, must be at least 1")
        for before, after in pairwise(sorted(seeds)):
            if after - before < episodes:
                raise InvalidArgument(
                    f"evaluations with the seeds {before} and {after} would have the same "
                    f"episodes: seeds must be {episodes} apart, because each episode adds 1"
                )
        rows: list[Row] = []
        trials: list[Trial] = []
        files: dict[str, bytes] = {}
        for number, path in enumerate(policies):
            named = Policy(path).metadata.get("task", "")
            task = name_of_file("task", named, named if named in tasks else (*tasks, None)[0], path)
            if not task:
                raise InvalidArgument(f"{path} does not say its task: --task is needed")
            common: dict[str, Any] = {"task": task, "policy": f"policies/{number:03}{path.suffix}"}
            files[common["policy"]] = path.read_bytes()  # a training may replace its own
            for condition in conditions:
                for seed in seeds:
                    for first in range(0, episodes, EPISODES):
                        common |= {
                            "seed": seed + first,
                            "episodes": min(EPISODES, episodes - first),
                        }
                        trials.append(Trial(row=len(rows), condition=condition, **common))
                    said = condition or "of its training"
                    row = {"policy": str(path), "task": task, "condition": said, "seed": seed}
                    rows.append(row)
        return cls(folder=folder, rows=rows, trials=trials)._begun(files)

    @classmethod
    def of_folder(cls, folder: Path, tasks: Sequence[str] = ()) -> Self:
        """The sweep in a folder; `tasks` must have each MODULE:CLASS of it, because they run."""
        path = folder / SWEEP
        if not path.is_file():
            raise InvalidArgument(f"there is no sweep in {folder}")
        fields = json.loads(path.read_text())
        trials = [Trial(**trial) for trial in fields.pop("trials")]
        for trial in trials:
            name_of_file("task", trial.task, trial.task if trial.task in tasks else None, path)
        return cls(folder=folder, trials=trials, **fields)

    def _begun(self, files: dict[str, bytes]) -> Self:
        if self.folder.exists() and any(self.folder.iterdir()):
            raise InvalidArgument(
                f"{self.folder} is not empty; --resume {self.folder} goes on with a sweep in it"
            )
        fields = dataclasses.asdict(self)
        del fields["folder"]
        for name, content in (files | {SWEEP: json.dumps(fields, indent=1).encode()}).items():
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            replace_file(self.folder / name, content)
        return self

    def run(
        self,
        executor: str = "processes",
        jobs: int | None = None,
        say: Callable[[str], None] = lambda _: None,
    ) -> list[int]:
        """Runs all trials that have no result yet, and writes the tables.

        A trial that somebody has killed is started again. Returns the numbers of those that have
        failed. Ctrl-C raises KeyboardInterrupt; another run() then goes on.
        """
        waiting = self.unfinished()
        for starts_left in reversed(range(STARTS)):
            if not waiting:
                break
            again: list[int] = []
            commands = [self._command(number) for number in waiting]
            with contextlib.closing(EXECUTORS[executor](commands, jobs)) as ended:
                for number in map(waiting.__getitem__, ended):
                    is_killed = not any(self._files(number, RESULT, ERROR))
                    if is_killed and starts_left:
                        again.append(number)
                    say(self._told(number) + ("; it starts again" if number in again else ""))
            waiting = again
        self._write_tables()
        return self.unfinished()

    def run_trial(self, number: int, say: Callable[[str], None]) -> None:
        """Runs a trial to its end, or from where it was; one that has a result is not run again.

        If another process runs it already, this waits for it.
        """
        if number not in range(len(self.trials)):
            raise InvalidArgument(f"there is no trial {number}, only 0 to {len(self.trials) - 1}")
        trial, folder = self.trials[number], self.folder_of(number)
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if self._result(number) is not None:
                return
            try:
                result = self._train(number, say) if trial.plan else self._evaluate(trial)
            except Exception as error:
                replace_file(folder / ERROR, str(error).encode())
                raise
            (folder / ERROR).unlink(missing_ok=True)
            replace_file(folder / RESULT, json.dumps(result).encode())

    def unfinished(self) -> list[int]:
        """Numbers of the trials without a result."""
        return [number for number in range(len(self.trials)) if self._result(number) is None]

    def why(self, number: int) -> str:
        """What was wrong with a trial that has no result."""
        paths = self._files(number, ERROR, LOG)
        lines = "".join(path.read_text(errors="replace") for path in paths[:1]).strip().split("\n")
        if paths and paths[0].name == ERROR:
            return lines[-1]
        return f"it was killed, and the last that it has printed is '{lines[-1]}'"

    def folder_of(self, number: int) -> Path:
        """The folder of a trial."""
        return self.folder / "trials" / f"{number:03}"

    def _files(self, number: int, *names: str) -> list[Path]:
        paths = (self.folder_of(number) / name for name in names)
        return [path for path in paths if path.exists()]

    def _result(self, number: int) -> dict[str, Any] | None:
        path = self.folder_of(number) / RESULT
        return dict(json.loads(path.read_text())) if path.exists() else None

    def _command(self, number: int) -> Command:
        folder = self.folder_of(number).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        (folder / ERROR).unlink(missing_ok=True)
        words = ["env", "OMP_NUM_THREADS=1", sys.executable, "-m", "trifinger.commands.sweep"]
        words += ["--resume", str(self.folder.resolve()), "--index", str(number)]
        for task in sorted({trial.task for trial in self.trials if ":" in trial.task}):
            words += ["--task", task]
        return Command(tuple(words), folder / LOG)

    def _told(self, number: int) -> str:
        row = self.trials[number].row
        about = ", ".join(f"{name} {value}" for name, value in self.rows[row].items())
        summary = self._summary(row)
        told = summary.in_short if summary else "a part of it is done"
        if self._result(number) is None:
            told = self.why(number)
        return f"trial {number}, one of {len(self.trials)} ({about}): {told}"

    def _train(self, number: int, say: Callable[[str], None]) -> dict[str, Any]:
        # Its import takes seconds, which evaluations need not wait.
        from trifinger.training import Plan, Training

        trial = self.trials[number]
        plan = Plan.from_json(json.dumps(trial.plan))
        plan.require_said(self.folder / SWEEP, trial.task, None)
        with self._board(number, plan) as show:
            training = Training(
                plan, self.folder_of(number), say, after_evaluation=show, num_threads=1
            )
            with contextlib.closing(training):
                return dataclasses.asdict(training.run())

    def _evaluate(self, trial: Trial) -> dict[str, Any]:
        policy, condition = Policy(self.folder / trial.policy), trial.condition
        done = evaluate(policy, trial.task, trial.episodes, trial.seed, condition=condition)
        return {
            "distances": done.distances.tolist(),
            "successes": done.successes.tolist(),
            "unit": done.unit,
        }

    # Shows the learning curve of a trial with Weights & Biases, if that was asked for.
    @contextlib.contextmanager
    def _board(self, number: int, plan: "Plan") -> Iterator[Callable[["Training"], None]]:
        if self.project is None:
            yield lambda _: None
            return
        folder = self.folder_of(number)
        names = {"group": self.group, "id": f"{self.group}-{folder.name}", "name": folder.name}
        settings = {"config": dataclasses.asdict(plan), "dir": str(folder), "resume": "allow"}
        with _require("wandb").init(project=self.project, **names, **settings) as run:

            def show(training: "Training") -> None:
                episode, summary = training.curve[-1]
                run.log({"median": summary.median, "success": summary.success}, step=episode)

            yield show

    def _summary(self, row: int) -> Summary | None:
        found = [self._result(number) for number, one in enumerate(self.trials) if one.row == row]
        results = [result for result in found if result is not None]
        if len(results) < len(found):
            return None
        if "median" in results[0]:
            return Summary(**results[0])
        distances, successes = (
            np.concatenate([one[name] for one in results]) for name in ("distances", "successes")
        )
        return Evaluation(distances, successes, np.empty(0), results[0]["unit"]).summary()

    # Tables depend on the results only, not on where and when they were made.
    def _write_tables(self) -> None:
        summaries = [self._summary(row) for row in range(len(self.rows))]
        figures = [field.name for field in dataclasses.fields(Summary)]
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([*self.rows[0], *figures])
        for row, summary in zip(self.rows, summaries, strict=True):
            writer.writerow([*row.values(), *(getattr(summary, name, "") for name in figures)])
        replace_file(self.folder / TABLES[0], text.getvalue().encode())
        replace_file(self.folder / TABLES[1], _page(self.rows, summaries).encode())


def _require(module: str) -> Any:
    try:
        return import_module(module)
    except ImportError as error:
        raise Error(f"{module} is missing: pip install {module} ({error})") from error


# A line for each setting, over its seeds.
def _page(rows: Sequence[Row], summaries: Sequence[Summary | None]) -> str:
    names = [name for name in rows[0] if name != "seed"]
    settings: dict[str, list[Summary]] = {}
    for row, summary in zip(rows, summaries, strict=True):
        found = settings.setdefault(" | ".join(str(row[name]) for name in names), [])
        found += [summary] if summary else []
    heads = [*names, "seeds", "final distance, median of an episode", "success"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for setting, found in settings.items():
        cells = ["", ""]
        if found:
            medians = sorted(one.median for one in found)
            successes = sorted(100 * one.success for one in found)
            words = found[0].in_words
            cells = [words(float(np.median(medians))), f"{np.median(successes):.0f} %"]
        if len(found) > 1:
            cells[0] += f" ({words(medians[0], medians[-1])})"
            cells[1] += f" ({successes[0]:.0f} to {successes[-1]:.0f} %)"
        lines.append(f"| {setting} | {len(found)} | {' | '.join(cells)} |")
    return "\n".join([*lines, "", "Of several seeds: the median, the least and the largest.", ""])
