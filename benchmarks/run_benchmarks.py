# SPDX-License-Identifier: BSD-3-Clause
"""`./run bench`: measures all figures, each together with its reference in the same run.

Each measure has a process of its own. Its rows are printed, and written to the file of --json, as
soon as they are measured. After Ctrl-C, or if a measure fails, the rows of the others remain.
"""

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from measuring import Measure, MeasureError, folders, run
from rows import Row, markdown
from trifinger.progress import Progress

README = Path(__file__).with_name("README.md")
FIGURES = Path(__file__).with_name("figures.json")  # from which the site draws plots

# The order in which the measures are run, and in which the tables list their rows.
MEASURES = (
    Measure("lateness", "figures"),
    Measure("lateness_beside_hogs", "figures"),
    Measure("lateness_beside_planner", "figures"),
    Measure("append", "figures"),
    Measure("wake", "figures"),
    Measure("loop", "figures"),
    Measure("python_loop", "figures", is_python=True, reference="loop"),
    Measure("inline_loop", "figures"),
    Measure("python_inline_loop", "figures", is_python=True, reference="inline_loop"),
    Measure("can_frames", "figures"),
    Measure("emulator", "figures"),
    Measure("motor_bus", "figures"),
    Measure("emulated_robot", "figures"),
    Measure("safety_chain", "figures"),
    Measure("simulation", "figures"),
    Measure("cameras", "figures"),
    Measure("images", "figures"),
    Measure("control_cycle", "figures"),
    Measure("planner", "figures"),
    Measure("policy", "figures"),
    Measure("single_precision_policy", "figures"),
    Measure("vector_environment_1_thread", "figures"),
    Measure("vector_environment_2_threads", "figures"),
    Measure("environment", "figures"),
    Measure("python_environment", "figures", is_python=True, reference="environment"),
    Measure("python_task", "figures", is_python=True),
    Measure("any_robot", "figures"),
    Measure("compat", "figures", is_python=True),
    Measure("lift", "figures"),
    Measure("live_view", "figures", is_python=True),
    Measure("recorder", "logs", is_python=True),
    Measure("log", "logs"),
    Measure("python_log", "logs", is_python=True, reference="log"),
    Measure("log_view", "logs", is_python=True),
    Measure("recorded_simulation", "logs"),
    Measure("recorded_images", "logs"),
    Measure("data_set", "logs", is_python=True),
    Measure("dead_user", "deaths"),
    Measure("dead_user_with_repeats", "deaths"),
    Measure("dead_backend", "deaths"),
    Measure("kills", "deaths"),
)


def write_json(rows: Sequence[Row], path: Path) -> None:
    """Writes the rows in one step, so that the file is whole whenever this program ends."""
    draft = path.with_name(path.name + ".new")
    draft.write_text(json.dumps([row.json() for row in rows], indent=2) + "\n")
    draft.replace(path)


def machine() -> str:
    """Returns when and where the figures were measured."""
    cpu = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    compiler = subprocess.run(["g++", "-dumpfullversion"], stdout=subprocess.PIPE, check=True)
    name = cpu[1] if cpu else "unknown"
    return (
        f"{time.strftime('%-d %B %Y')}, {os.cpu_count()} processors ({name}), "
        f"Linux {platform.release()}, g++ {compiler.stdout.decode().strip()}, Release."
    )


def with_figures(text: str, tables: dict[str, Sequence[Row]]) -> str:
    """Returns the README with these rows in its tables."""
    parts = {name: markdown(rows) for name, rows in tables.items()}
    for name, part in ({"machine": machine()} | parts).items():
        begin, end = f"<!-- {name}: written by ./run bench --write -->\n", f"<!-- end of {name} -->"
        before, found, rest = text.partition(begin)
        _, has_end, after = rest.partition(end)
        if not found or not has_end:
            raise ValueError(f"{README} has no place for '{name}': '{begin.strip()}' and '{end}'")
        text = f"{before}{begin}{part}\n{end}{after}"
    return text


def parse() -> argparse.Namespace:
    """The arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog="./run bench",
        description=__doc__,
        epilog="measures: " + " ".join(measure.name for measure in MEASURES),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "measures", nargs="*", metavar="MEASURE", help="measure these alone; default: all"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows to FILE")
    parser.add_argument(
        "--quick", action="store_true", help="a look in seconds: fewer rounds, not to be quoted"
    )
    parser.add_argument(
        "--write",
        action="store_true",
        help="put the figures of a whole run into README.md and figures.json here",
    )
    arguments = parser.parse_args()
    names = [measure.name for measure in MEASURES]
    for name in arguments.measures:
        if name not in names:
            parser.error(f"there is no measure '{name}'; there are {', '.join(names)}")
    if arguments.write and (arguments.quick or arguments.measures):
        parser.error("--write is for whole runs: neither with --quick nor with measures")
    return arguments


def measure_all(
    arguments: argparse.Namespace, rows: list[Row], tables: dict[str, list[Row]]
) -> list[str]:
    """Measures what the command line asks for; adds each row to `rows` and its table at once.

    Returns the names of the measures that failed.
    """
    measures = chosen(arguments.measures)
    failures: list[str] = []
    with folders():
        for number, measure in enumerate(measures, 1):
            print(f"[{number:2}/{len(measures)}] {measure.name}", flush=True)
            with Progress(measure.name) as progress:

                def take(row: Row, measure: Measure = measure, line: Progress = progress) -> None:
                    line.clear()
                    print(row.text(), flush=True)
                    rows.append(row)
                    tables[measure.table].append(row)
                    if arguments.json:
                        write_json(rows, arguments.json)

                try:
                    run(
                        measure,
                        quick=arguments.quick,
                        rows=rows,
                        on_row=take,
                        on_progress=progress.update,
                    )
                except MeasureError as failure:
                    progress.clear()
                    print(failure, flush=True)
                    failures.append(measure.name)
    return failures


def chosen(names: Sequence[str]) -> list[Measure]:
    """The measures of these names, or all, with those that they are compared with."""
    wanted = set(names) or {measure.name for measure in MEASURES}
    wanted |= {measure.reference for measure in MEASURES if measure.name in wanted}
    return [measure for measure in MEASURES if measure.name in wanted]


def main() -> int:
    """Measures, prints and writes what the command line asks for."""
    arguments = parse()
    rows: list[Row] = []
    tables: dict[str, list[Row]] = {measure.table: [] for measure in MEASURES}
    try:
        failures = measure_all(arguments, rows, tables)
    except KeyboardInterrupt:
        print(f"interrupted after {len(rows)} rows, which are above", file=sys.stderr)
        return 130
    missed = [row.measure for row in rows if not row.holds]
    print(
        f"{len(rows)} rows; " + (f"not within reach: {'; '.join(missed)}" if missed else "all hold")
    )
    if failures:
        print(f"measures that failed: {', '.join(failures)}")
        return 1
    if arguments.write:
        README.write_text(with_figures(README.read_text(), tables))
        content = {"machine": machine(), "rows": [row.json() for row in rows]}
        FIGURES.write_text(json.dumps(content, indent=2) + "\n")
        print(f"{README} and {FIGURES} written.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
