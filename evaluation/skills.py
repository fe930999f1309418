# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate skills|control|vision`: all skills on simulated robots that are not perfect.

Each trial is a process of its own, evaluation/run_trial.cpp, which also judges it by what was true.
What came out is kept in docs/results/TABLE.jsonl at once. What is there is not run again, unless
its judge has changed since. So an evaluation that was cut off goes on where it was.
"""

import argparse
import contextlib
import fcntl
import hashlib
import json
import math
import re
import signal
import statistics
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from trifinger.evaluation import interval_of_rate as interval
from trifinger.sweep.executors import EXECUTORS, Command

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "docs" / "results"
PROGRAM = ROOT / "build" / "release" / "evaluation" / "run_trial"
SKILLS = ROOT / "packages" / "trifinger_skills" / "src" / "manipulation" / "skills"
CONDITIONS = ("as documented", "as built", "worn")
# Of a table, or of a row whose skill was changed after a look at trials of the table's seeds.
FIRST_SEED = {"skills": 41000, "control": 42000, "vision": 43000, "throw": 51000}
ENOUGH = {"as documented": 20, "as built": 20, "worn": 10}  # trials of a rate
INTRODUCTIONS = {
    "skills": (
        "Skills: results",
        "Every skill but lift and slide, which are in [control.md](control.md).",
    ),
    "control": (
        "Optimal control: results",
        "The paper's first experiment: a cube is lifted and slid by forces of the tips.",
    ),
    "vision": (
        "Lifting and sliding by sight: results",
        "The cube is known only from the images of three simulated cameras, 540 x 540 pixels at "
        "30 Hz. Its poses are 35 ms old. Light, colours, dust, noise and gain vary, and the "
        "calibration is 0.5 pixels off.",
    ),
}
ABOUT = """\
Each trial is a simulation of its own. Mass (20 %), friction of the tips (0.6 to 1.0), delay of the
poses (10 to 30 ms), their noise (1 mm, 0.5°) and the start vary, and the controller knows none of
them ([how](../skills.md)). The robot is *as documented*, with perfect joints; *as built*; or
*worn*: [these figures](../simulation.md#a-robot-as-it-is-built) say what that is. A judge that
knows nothing of the skill decides by what was true in the simulation. A trial that failed has no
figure; medians are of the successes. Intervals are of 95 % (Wilson); fewer trials than 20, or 10 of
worn robots, claim no rate. Seeds begin at {seeds}.
"""


class Row(NamedTuple):
    """A row of a table, as run_trial prints it."""

    table: str
    name: str
    skill: str
    what: str
    reach: str
    needed: float
    most_trials: int
    figure: str
    unit: str
    scale: float
    like: str
    is_real_time: bool
    is_on_boards: bool

    def conditions(self) -> tuple[str, ...]:
        """The conditions in which it can be run: joints on boards are as documented."""
        return CONDITIONS[:1] if self.is_on_boards else CONDITIONS


Trial = dict[str, Any]  # what run_trial prints of one


class KilledError(Exception):
    """A trial was ended by somebody else, which says nothing about the skill."""


def all_rows() -> list[Row]:
    """The rows of all tables."""
    printed = subprocess.run([PROGRAM], check=True, stdout=subprocess.PIPE, text=True).stdout
    return [Row(**json.loads(line)) for line in printed.splitlines()]


def included_by(file: Path, found: set[Path]) -> set[Path]:
    """The file and what it includes from this folder, with the code of these headers."""
    if file in found or not file.is_file():
        return found
    found.add(file)
    for name in re.findall(r'#include "(evaluation/\w+)\.hpp"', file.read_text()):
        included_by(ROOT / f"{name}.hpp", found)
        if name != "evaluation/skill_rows":  # what it has for a row is asked for by name
            included_by(ROOT / f"{name}.cpp", found)
    return found


def judge_of(row: Row) -> str:
    """A digest of the code that judges a row and draws its robots, without includes, comments."""
    judge = SKILLS / row.skill / "judge.cpp"
    files = included_by(judge, {ROOT / "src" / "sim" / "condition.cpp"})
    if f'"{row.name}"' not in judge.read_text():
        files.add(ROOT / "evaluation" / "skill_rows.cpp")
    digest = hashlib.sha256()
    for file in sorted(files):
        text = re.sub(r"(//|#include ).*", "", file.read_text())
        digest.update("".join(text.split()).encode())
    return digest.hexdigest()[:12]


class Results:
    """Trials in a file: a line for each row, condition and other change of the robot."""

    def __init__(self, file: Path, rows: Iterable[Row]) -> None:
        """Reads the file, apart from trials whose judge is another by now."""
        self._file = file
        file.parent.mkdir(parents=True, exist_ok=True)
        self._judges = {row.name: judge_of(row) for row in rows}
        self._lines: dict[tuple[str, str, str], dict[str, Trial]] = {}
        self.is_old = False
        """Whether the file has trials of judges that are no more."""
        for text in file.read_text().splitlines() if file.is_file() else ():
            line = json.loads(text)
            if self._judges.get(line["row"]) != line["judge"]:
                self.is_old = True
                continue
            self._lines[line["row"], line["condition"], line["vary"]] = line["trials"]

    def of(self, row: Row, condition: str, vary: str = "") -> dict[str, Trial]:
        """The trials by their seeds."""
        return self._lines.setdefault((row.name, condition, vary), {})

    def named(self, name: str, condition: str) -> Mapping[str, Trial]:
        """The trials of the row with this name, if there are any."""
        return self._lines.get((name, condition, ""), {})

    def write(self) -> None:
        """Replaces the file; trials are in the order of their seeds from now on."""
        self._lines = {
            key: dict(sorted(trials.items(), key=lambda each: int(each[0])))
            for key, trials in sorted(self._lines.items())
        }
        lines = [
            json.dumps(
                {
                    "row": row,
                    "condition": condition,
                    "vary": vary,
                    "judge": self._judges[row],
                    "trials": trials,
                }
            )
            for (row, condition, vary), trials in self._lines.items()
            if trials
        ]
        partial = self._file.with_suffix(".partial")
        partial.write_text("".join(f"{line}\n" for line in lines))
        partial.replace(self._file)


def rounded(value: Any) -> Any:
    """The same with four digits, so that the file stays small."""
    if isinstance(value, float):
        return float(f"{value:.4g}")
    if isinstance(value, dict):
        return {key: rounded(one) for key, one in value.items()}
    return [rounded(one) for one in value] if isinstance(value, list) else value


class Batch(NamedTuple):
    """Trials of a row on robots of one kind."""

    row: Row
    condition: str
    vary: str
    seeds: range


def command(batch: Batch, seed: int, log: Path) -> Command:
    """What runs a trial; it prints the trial and its exit status into its log."""
    row, condition, vary, _ = batch
    words = [str(PROGRAM), row.name, "--seeds", str(seed), "--condition", condition]
    for change in vary.split():
        words += ["--vary", change]
    return Command(("sh", "-c", '"$@"; printf "\\nstatus $?\\n"', "sh", *words), log)


def read_trial(done: Command) -> Trial:
    """The trial that a command has run; one whose process died has failed, too."""
    text = done.log.read_text() if done.log.exists() else ""
    printed, _, word = text.rpartition("status ")
    status = int(word or 128 + signal.SIGKILL)  # nothing is said when all were killed
    if status == 0:
        (line,) = (line for line in printed.splitlines() if line.startswith("{"))
        trial: Trial = rounded(json.loads(line))
        del trial["seed"]
        return trial
    number = status - 128
    if number <= 0:  # it says what is wrong with the command
        sys.exit(printed.strip())
    if number in (signal.SIGINT, signal.SIGKILL, signal.SIGTERM):
        raise KilledError(f"somebody killed {' '.join(done.words[5:])}; begin again to go on")
    return {"succeeds": False, "why": f"the program ended by signal {number}"}


def running_folder() -> Path:
    """The folder of evaluations that run; other machines must see it, too, if trials run there."""
    folder = ROOT / "build" / "evaluation"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextlib.contextmanager
def only_one(name: str) -> Iterator[None]:
    """Ends the program if another one writes the results of the same name."""
    with (running_folder() / f"{name}.lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            sys.exit(f"another evaluation writes the results of {name}")
        yield


def run(
    results: Results,
    batches: Sequence[Batch],
    jobs: int | None = None,
    executor: str = "processes",
    *,
    again: bool = False,
) -> Iterator[Batch]:
    """Runs what is missing, or all `again`; each batch is returned when it is whole.

    Keeps each trial at once, in place of an older one. Trials in real time are run alone, after the
    others.
    """
    for alone in (False, True):
        some = [batch for batch in batches if batch.row.is_real_time == alone]
        waiting = [
            (batch, seed)
            for batch in some
            for seed in batch.seeds
            if again or str(seed) not in results.of(*batch[:3])
        ]
        left = {id(batch): sum(one is batch for one, _ in waiting) for batch in some}
        yield from (batch for batch in some if left[id(batch)] == 0)
        if not waiting:
            continue
        with contextlib.ExitStack() as stack:
            folder = Path(stack.enter_context(TemporaryDirectory(dir=running_folder())))
            commands = [
                command(*one, folder / f"{number}.txt") for number, one in enumerate(waiting)
            ]
            ended = EXECUTORS[executor](commands, 1 if alone else jobs)
            for number in stack.enter_context(contextlib.closing(ended)):
                batch, seed = waiting[number]
                results.of(*batch[:3])[str(seed)] = read_trial(commands[number])
                results.write()
                left[id(batch)] -= 1
                if left[id(batch)] == 0:
                    yield batch


def successes(trials: Iterable[Trial]) -> list[Trial]:
    """Those that succeed."""
    return [trial for trial in trials if trial["succeeds"]]


def rate(trials: Mapping[str, Trial], condition: str) -> str:
    """How many succeed, and the interval of the rate if there are enough of them."""
    if not trials:
        return ""
    good = len(successes(trials.values()))
    text = f"{good} of {len(trials)}"
    if len(trials) < ENOUGH[condition]:
        return text
    low, high = interval(good, len(trials))
    return f"{text} ({100 * low:.0f} to {100 * high:.0f} %)"


def spread(values: Iterable[float], unit: str = "") -> str:
    """The median, the least and the largest."""
    values = sorted(values)
    if not values:
        return ""
    middle = f"{statistics.median(values):.3g}{unit and f' {unit}'}"
    return f"{middle} ({values[0]:.3g} to {values[-1]:.3g})" if len(values) > 1 else middle


def figure(row: Row, trials: Mapping[str, Trial]) -> str:
    """The row's figure, of the trials that succeed."""
    good = successes(trials.values())
    return spread([row.scale * trial["figure"] for trial in good], row.unit)


def together(trials: Mapping[str, Trial], name: str) -> float:
    """The root mean square of a figure that is one itself, of all that succeed."""
    squares = [trial["figures"][name][0] ** 2 for trial in successes(trials.values())]
    return math.sqrt(statistics.fmean(squares)) if squares else math.inf


def holds(row: Row, results: Results, condition: str) -> bool:
    """Whether a row is what was asked."""
    trials = results.of(row, condition)
    if row.needed > 0 and len(trials) < min(ENOUGH[condition], row.most_trials):
        return False
    like = results.named(row.like, condition)
    for name in ("position_rms", "orientation_rms") if like else ():
        if together(trials, name) > 1.2 * together(like, name):
            return False
    return len(successes(trials.values())) >= math.ceil(row.needed * len(trials) - 1e-9)


def worst(trials: Iterable[Trial]) -> str:
    """Cells of what trials demand of robot and object: median, and at the worst."""
    strains = [trial["strain"] for trial in trials if "strain" in trial]
    cells = []
    for name, scale, unit, choose in (
        ("contact_depth", 1e3, " mm", max),
        ("torque_limit", 1e2, " %", max),
        ("speed", 1, " rad/s", max),
        ("thermal_margin", 1, "", min),
    ):
        values = [scale * strain[name] for strain in strains]
        cells.append(f"{statistics.median(values):.2g}, {choose(values):.2g}{unit}")
    return " | ".join(cells)


def other_figures(row: Row, results: Results) -> Iterator[str]:
    """Lines of the figures that a skill itself reports, from the true poses."""
    columns = [successes(results.of(row, condition).values()) for condition in CONDITIONS]
    units = {
        name: unit for some in columns for one in some for name, (_, unit) in one["figures"].items()
    }
    for name, unit in units.items():
        if name.startswith("cycle"):
            continue  # time on the processor of a machine that does other things
        words = f"{name} [{unit}]" if unit not in ("", "1") else name
        cells = [
            spread([one["figures"][name][0] for one in some if name in one["figures"]])
            for some in columns
        ]
        yield f"| {row.name} | {words} | {' | '.join(cells)} |"


def seeds_in_words(rows: Sequence[Row]) -> str:
    """Where the seeds of a table begin."""
    others = [
        f"those of {row.name} at {FIRST_SEED[row.name]}" for row in rows if row.name in FIRST_SEED
    ]
    return ", ".join([str(FIRST_SEED[rows[0].table]), *others])


def page(table: str, rows: Sequence[Row], results: Results) -> str:
    """The page of a table."""
    title, about = INTRODUCTIONS[table]
    heads = " | ".join(CONDITIONS)
    lines = [
        f"<!-- SPDX-License-Identifier: BSD-3-Clause -->\n# {title}\n",
        f"Written by `./run evaluate {table}` from [{table}.jsonl]({table}.jsonl), which has every "
        f"trial. {about}\n\n{ABOUT.format(seeds=seeds_in_words(rows))}",
        f"| row | what | reach | {heads} |\n|---|---|---|---|---|---|",
    ]
    for row in rows:
        rates = [rate(results.of(row, condition), condition) for condition in CONDITIONS]
        lines.append(f"| {row.name} | {row.what} | {row.reach} | {' | '.join(rates)} |")
    lines.append(f"\n## Figures\n\n| row | figure | {heads} |\n|---|---|---|---|---|")
    for row in rows:
        cells = [figure(row, results.of(row, condition)) for condition in CONDITIONS]
        lines.append(f"| {row.name} | {row.figure} | {' | '.join(cells)} |")
    lines.append(
        "\n## What it demands of robot and object\n\nThe median and the worst of all trials: how "
        "deep surfaces are in each other, share of the steps in which a motor gives all that its "
        "limit lets it, the fastest joint, the least thermal margin.\n\n| row | robot | contact "
        "depth | torque at its limit | speed | thermal margin |\n|---|---|---|---|---|---|"
    )
    for row in rows:
        for condition in row.conditions():
            trials = results.of(row, condition).values()
            if any("strain" in trial for trial in trials):
                lines.append(f"| {row.name} | {condition} | {worst(trials)} |")
    lines.append(
        f"\n## Figures of the skills\n\nFrom the true poses, of the trials that succeed: median, "
        f"least and largest, in SI units.\n\n| row | figure | {heads} |\n|---|---|---|---|---|"
    )
    lines += [line for row in rows for line in other_figures(row, results)]
    lines.append("\n## Failures\n\n| row | robot | seed | why |\n|---|---|---|---|")
    for row in rows:
        for condition in CONDITIONS:
            for seed, trial in results.of(row, condition).items():
                if not trial["succeeds"]:
                    why = "; ".join(filter(None, (trial["why"], trial.get("note"))))
                    lines.append(f"| {row.name} | {condition} | {seed} | {why} |")
    return "\n".join(lines) + "\n"


def check(rows: Sequence[Row]) -> list[str]:
    """What is wrong with the pages: older than their judges or not what the trials say."""
    wrong = []
    if Results(RESULTS / "cliffs.jsonl", rows).is_old:
        wrong.append("cliffs.jsonl has trials that other judges have judged")
    for table in INTRODUCTIONS:
        of_table = [row for row in rows if row.table == table]
        results = Results(RESULTS / f"{table}.jsonl", of_table)
        if results.is_old:
            wrong.append(f"{table}.jsonl has trials that other judges have judged")
        if (RESULTS / f"{table}.md").read_text() != page(table, of_table, results):
            wrong.append(f"{table}.md does not say what {table}.jsonl does")
    return wrong


def chosen(parser: argparse.ArgumentParser, rows: Sequence[Row], names: Sequence[str]) -> list[Row]:
    """The rows with these names; all if there are none."""
    known = {row.name: row for row in rows}
    for name in names:
        if name not in known:
            parser.error(f"there is no row '{name}', only {', '.join(known)}")
    return [known[name] for name in names or known]


def main() -> int:
    """Runs the evaluation; the status says whether the table holds."""
    table, *words = sys.argv[1:] or ("",)
    if table == "check":
        wrong = check(all_rows())
        print("\n".join([*wrong, "Repeat: ./run evaluate skills|control|vision"] if wrong else []))
        return 1 if wrong else 0
    if table not in INTRODUCTIONS:
        sys.exit(f"there is no table '{table}', only {', '.join(INTRODUCTIONS)}")
    parser = argparse.ArgumentParser(
        prog=f"evaluate {table}",
        description="Runs skills on simulated robots that are not perfect.",
    )
    parser.add_argument("row", nargs="*", help="default: all")
    parser.add_argument(
        "--condition", action="append", choices=CONDITIONS, help="repeatable; default: all three"
    )
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        help="NAME=VALUE of trifinger.Variation in every robot; repeatable; writes no page",
    )
    parser.add_argument("--seeds", type=int, help="trials; default: 20, and 10 of worn robots")
    parser.add_argument("--first-seed", type=int, help="other seeds; writes no page")
    parser.add_argument("--executor", choices=EXECUTORS, default="processes", help="where")
    parser.add_argument("--processes", type=int, help="trials at the same time")
    parser.add_argument("--again", action="store_true", help="run what is there again")
    arguments = parser.parse_args(words)
    rows = [row for row in all_rows() if row.table == table]
    wanted = chosen(parser, rows, arguments.row)
    try:
        with only_one(table):
            return evaluate(table, rows, wanted, arguments)
    except KilledError as error:
        sys.exit(str(error))


def evaluate(
    table: str, rows: Sequence[Row], wanted: Sequence[Row], arguments: argparse.Namespace
) -> int:
    """Runs the wanted rows, and writes the page unless other robots or seeds were asked for."""
    writes_page = not arguments.vary and arguments.first_seed is None
    folder = RESULTS if writes_page else ROOT / "build" / "evaluation"
    results = Results(folder / f"{table}.jsonl", rows)
    vary = " ".join(sorted(arguments.vary))
    batches = [
        Batch(row, condition, vary, seeds_of(row, condition, arguments))
        for condition in arguments.condition or CONDITIONS
        for row in wanted
        if condition in row.conditions()
    ]
    for row, condition, vary, seeds in run(
        results, batches, arguments.processes, arguments.executor, again=arguments.again
    ):
        of_row = results.of(row, condition, vary)
        trials = {str(seed): of_row[str(seed)] for seed in seeds}
        seen = f"{rate(trials, condition):22} {row.figure}: {figure(row, trials)}"
        print(f"{row.name:18} {condition:14} {seen}", flush=True)
        for seed, one in trials.items():
            if not one["succeeds"]:
                print(f"  seed {seed}: {one['why']}", flush=True)
    if not writes_page:
        return 0
    results.write()
    (RESULTS / f"{table}.md").write_text(page(table, rows, results))
    print(f"docs/results/{table}.md written.")
    asked = (
        (row, "as built" if "as built" in row.conditions() else CONDITIONS[0]) for row in wanted
    )
    return 0 if all(holds(row, results, condition) for row, condition in asked) else 1


def seeds_of(row: Row, condition: str, arguments: argparse.Namespace) -> range:
    """The seeds of a row's trials."""
    first = arguments.first_seed
    if first is None:
        first = FIRST_SEED.get(row.name, FIRST_SEED[row.table])
    return range(first, first + min(arguments.seeds or ENOUGH[condition], row.most_trials))


if __name__ == "__main__":
    sys.exit(main())
