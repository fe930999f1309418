# SPDX-License-Identifier: BSD-3-Clause
"""The benchmarks: what they start from, and what they leave."""

from __future__ import annotations

import json
import mmap
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import measuring
import pytest
import run_benchmarks
import soak
from rows import Row, markdown

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PROGRAM = [sys.executable, str(ROOT / "benchmarks" / "run_benchmarks.py")]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which a run would leave sessions and files."""
    folder = tmp_path / "all"
    for name, variable in (("memory", "TRIFINGER_SESSION_DIR"), ("files", "TMPDIR")):
        (folder / name).mkdir(parents=True)
        monkeypatch.setenv(variable, str(folder / name))
    return folder


def remains(folder: Path) -> list[Path]:
    """What is in the folders for sessions and files."""
    return [path for part in folder.iterdir() for path in part.iterdir()]


def processes_in(folder: Path) -> list[str]:
    """The processes whose sessions are in that folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            environment = (process / "environ").read_bytes().split(b"\0")
            command = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:  # it has ended
            continue
        if any(
            entry.startswith(f"TRIFINGER_SESSION_DIR={folder / 'memory'}/".encode())
            for entry in environment
        ):
            found.append(command)
    return found


def wait_until_none_is_in(folder: Path) -> None:
    """Waits until the processes with sessions in that folder have ended."""
    while processes_in(folder):
        time.sleep(0.01)


def wait_for_row(process: subprocess.Popen[str], table: Path) -> None:
    """Waits until the first row is in its file and the next measure is running."""
    lines = iter(process.stdout or ())
    assert any(line.startswith("[ 2/") for line in lines)
    assert json.loads(table.read_text())


@pytest.fixture
def long_run(folder: Path, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A run with one quick row and then a measure that takes minutes; it writes table.json."""
    assert remains(folder) == []
    with subprocess.Popen(
        [*PROGRAM, "inline_loop", "kills", "--json", str(tmp_path / "table.json")],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        yield process
        process.kill()


def quick_rows(folder: Path, *measures: str) -> list[dict[str, Any]]:
    """The rows of a quick run of some measures, which leaves nothing."""
    table = folder.with_name("figures.json")
    done = subprocess.run(
        [*PROGRAM, *measures, "--quick", "--json", str(table)],
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    print(done.stdout)
    assert done.returncode == 0
    assert remains(folder) == []
    rows: list[dict[str, Any]] = json.loads(table.read_text())
    assert all(row["measure"] in done.stdout for row in rows)
    return rows


def number_of(processors: str) -> int:
    """Number of processors in a list such as "0-2,5"."""
    ends = [part.partition("-") for part in processors.split(",")]
    return sum(int(last or first) - int(first) + 1 for first, _, last in ends)


def assert_started_fresh(row: dict[str, Any]) -> None:
    """The process of a row started with the settings of this process, not of another measure."""
    process = row["process"]
    assert number_of(process["processors"]) == len(os.sched_getaffinity(0))
    assert process["scheduler"] == os.sched_getscheduler(0)
    assert process["priority"] == os.sched_getparam(0).sched_priority
    assert process["nice"] == os.getpriority(os.PRIO_PROCESS, 0)
    assert process["locked"] == 0


@pytest.mark.parametrize("measure", [measure.name for measure in run_benchmarks.MEASURES])
def test_every_measure_gives_its_rows(measure: str, folder: Path) -> None:
    rows = quick_rows(folder, measure)
    assert rows
    for row in rows:
        assert_started_fresh(row)
        # This test only checks that there are figures. Hangs and lost steps must be 0 even if the
        # machine is busy.
        assert row["value"] >= 0.0
        assert isinstance(row["holds"], bool)
        assert row["value"] == 0.0 or not row["measure"].startswith("random kills")


def test_no_measure_inherits_what_another_has_set(folder: Path) -> None:
    # These pin themselves to a processor, become real-time and lock their memory.
    rows = quick_rows(folder, "lateness", "append", "python_loop", "safety_chain")
    assert len(rows) == 6  # one is beside `loop`
    for row in rows:
        assert_started_fresh(row)


def test_the_measures_are_those_of_the_programs() -> None:
    done = subprocess.run(
        [str(measuring.cpp_program())], stderr=subprocess.PIPE, text=True, check=False
    )
    assert done.returncode == 2
    in_cpp = done.stderr.partition("measures:\n")[2].split()
    assert in_cpp
    assert sorted(in_cpp) == sorted(
        measure.name for measure in run_benchmarks.MEASURES if not measure.is_python
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_run_that_is_interrupted_keeps_its_rows_and_nothing_else(
    number: signal.Signals, folder: Path, tmp_path: Path, long_run: subprocess.Popen[str]
) -> None:
    wait_for_row(long_run, tmp_path / "table.json")
    long_run.send_signal(number)
    assert "interrupted after 1 rows" in long_run.communicate()[0]
    assert long_run.returncode == 130
    (row,) = json.loads((tmp_path / "table.json").read_text())
    assert row["measure"] == "inline loop of the fake robot, C++"
    assert remains(folder) == []
    wait_until_none_is_in(folder)


def test_what_a_killed_run_leaves_is_removed_by_the_next(
    folder: Path, tmp_path: Path, long_run: subprocess.Popen[str]
) -> None:
    wait_for_row(long_run, tmp_path / "table.json")
    long_run.kill()
    long_run.wait()
    wait_until_none_is_in(folder)
    assert json.loads((tmp_path / "table.json").read_text())
    assert len(remains(folder)) == 2
    subprocess.run([*PROGRAM, "safety_chain", "--quick"], stdout=subprocess.PIPE, check=True)
    assert remains(folder) == []


def test_a_measure_that_fails_is_named_and_the_others_are_measured(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))  # without the program `trifinger`
    done = subprocess.run(
        [*PROGRAM, "lift", "safety_chain", "--quick"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "safety chain, nine joints: " in done.stdout
    assert "measures that failed: lift" in done.stdout
    assert "start trifinger" in done.stderr
    assert remains(folder) == []


def row(**changes: Any) -> Row:
    """A row with arbitrary values, some of which can be changed."""
    return Row(
        **{
            "measure": "a loop",
            "value": 99_123.0,
            "low": 88_000.0,
            "high": 100_400.0,
            "unit": "steps/s",
            "reach": ">= 60 k steps/s",
            "holds": True,
        }
        | changes
    )


def test_figures_have_three_digits_and_one_unit() -> None:
    assert row().figure() == "99.1 k steps/s (88.0 to 100)"
    assert row(value=8.24e6, low=7.3e6, high=8.3e6).figure() == "8.24 M steps/s (7.30 to 8.30)"
    assert row(value=19.87, low=16.31, high=40.0, unit="us").figure() == "19.9 µs (16.3 to 40.0)"
    assert row(value=0.0, low=0.0, high=0.0, unit="ns").figure() == "0 ns"
    assert row(value=1799.6, low=1799.6, high=1799.6, unit="").figure() == "1800"


def test_a_table_has_a_line_for_each_row_and_what_there_is_to_remark() -> None:
    beside = row(
        reference="bare", reference_value=112_000.0, ratio=0.885, holds=False, remark="the same"
    )
    assert markdown([row(), beside]).splitlines()[2:] == [
        "| a loop | 99.1 k steps/s (88.0 to 100) | | | >= 60 k steps/s | yes |",
        "| a loop | 99.1 k steps/s (88.0 to 100) | bare: 112 k steps/s | 0.885 | "
        ">= 60 k steps/s | **no** |",
        "",
        "- a loop: the same.",
    ]


def test_the_page_has_a_place_for_every_table() -> None:
    text = run_benchmarks.README.read_text()
    tables = {measure.table: [row(measure=measure.table)] for measure in run_benchmarks.MEASURES}
    page = run_benchmarks.with_figures(text, tables)
    for table in tables:
        assert f"| {table} | 99.1 k steps/s" in page
    assert run_benchmarks.with_figures(page, tables) == page


def test_files_that_a_process_reads_are_none_of_its_memory(tmp_path: Path) -> None:
    file = tmp_path / "program"
    file.write_bytes(bytes(2**24))
    before = soak.resident(os.getpid())
    with file.open("rb") as opened, mmap.mmap(opened.fileno(), 0, mmap.MAP_PRIVATE) as pages:
        assert not any(pages[:: mmap.PAGESIZE])
        assert soak.resident(os.getpid()) < before + 4
    with mmap.mmap(-1, 2**24, mmap.MAP_PRIVATE) as pages:
        pages.write(b"1" * 2**24)
        assert soak.resident(os.getpid()) > before + 12


def test_a_soak_says_of_everything_whether_it_grew() -> None:
    output = subprocess.run(
        [sys.executable, str(ROOT / "benchmarks" / "soak.py"), "memory", "--minutes", "0.15"],
        stdout=subprocess.PIPE,
        timeout=110,
        text=True,
        check=False,
    ).stdout
    print(output)
    for who in ("back-end", "recorder", "controller"):
        assert f"{who}: memory: first " in output
        assert f"{who}: files: first " in output
    assert "shared memory: first " in output
    assert "allowed 2: flat" in output


def test_a_soak_drives_robots_until_its_steps_are_done() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "benchmarks" / "soak.py"), "endurance", "--steps", "1e5"],
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    # Whether it grows shows only in many more steps.
    assert "drives that needed an operator or failed: 0 of" in done.stdout
