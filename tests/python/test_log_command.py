# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger log` as its users see it: what it prints, what it writes, and its exit codes."""

import base64
import gzip
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import plotly.offline
import pytest
import trifinger
from conftest import PATIENT_FAKE, PROGRAM, StartProgram
from link_into_venv import write_scripts
from test_log import Written, write_log
from trifinger.log.plot import curves, panels, plot
from trifinger.log.plot.matplotlib_figure import draw

COMMANDS = ("info", "check", "recover", "cut", "plot", "export")
STEPS = 600


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_log(tmp_path_factory.mktemp("log"), "trifinger", STEPS, 200, 249)


@pytest.fixture(scope="module")
def odd(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_log(tmp_path_factory.mktemp("odd"), "odd", STEPS)


@pytest.fixture
def damaged(written: Written, tmp_path: Path) -> Path:
    path = tmp_path / "damaged.mcap"
    content = bytearray(written.path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    return path


@pytest.fixture
def python_programs(tmp_path: Path) -> dict[str, str]:
    """An environment in which the programs of the Python package are on the PATH."""
    folder = tmp_path / "bin"
    folder.mkdir()
    write_scripts(folder)
    return {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"}


def run(*arguments: str | Path, expect: int = 0, environment: dict[str, str] | None = None) -> str:
    """Runs `trifinger log` to its end and returns all that it printed."""
    result = subprocess.run(
        [PROGRAM, "log", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    assert result.returncode == expect, result.stdout + result.stderr
    return result.stdout + result.stderr


# ---- usage ----


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(
    command: str, python_programs: dict[str, str]
) -> None:
    text = run(command, "--help", environment=python_programs)
    assert re.search(rf"Examples?:\n(  .*\n)*  trifinger log {command}\b", text)


def test_the_help_lists_every_command() -> None:
    text = run("--help")
    assert all(re.search(rf"^  {command} ", text, re.MULTILINE) for command in COMMANDS)


def test_a_misspelt_command_is_recognised() -> None:
    assert "did you mean 'info'?" in run("inof", expect=2)


@pytest.mark.parametrize("command", ["info", "check", "recover"])
def test_wrong_files_are_named(command: str, tmp_path: Path) -> None:
    assert "nothing.mcap: No such file" in run(command, tmp_path / "nothing.mcap", expect=1)
    (tmp_path / "text.mcap").write_text("hello, I am no log")
    assert "text.mcap is no MCAP file" in run(command, tmp_path / "text.mcap", expect=1)
    run(command, expect=2)


# ---- info ----


def test_info_tells_what_happened(written: Written) -> None:
    text = run("info", written.path)
    for expected in (
        "robot  trifinger, real-time at 1000 Hz",
        "550 (0 to 599), 0.599 s, 1000 Hz",
        "object      60 elements, 100 Hz",
        "action_late: the action for the last step came too late",
        "steps 200 to 249 of 'robot': the disk was full",
        "configuration.yml",
        "recorder: the disk is nearly full",
    ):
        assert expected in text


def test_info_tells_programs_the_same(written: Written) -> None:
    info = json.loads(run("info", "--json", written.path))
    assert info["is_log"]
    assert info["is_finished"]
    assert info["lost_bytes"] == 0
    assert info["size"] == written.path.stat().st_size
    (session,) = info["sessions"]
    assert (session["name"], session["steps"], session["duration"]) == ("robot", 550, 0.599)
    assert session["gaps"] == [{"first": 200, "last": 249, "reason": "the disk was full"}]
    assert session["fault"]["code"] == "action_late"
    statuses = written.log.session().statuses
    for key, percent in (("lateness_p50", 50), ("lateness_p99", 99)):
        expected = sorted(statuses["lateness"])[len(statuses) * percent // 100] * 1e-9
        assert session["loop"][key] == pytest.approx(expected, rel=0.035)
    assert session["loop"]["lateness_max"] == pytest.approx(statuses["lateness"].max() * 1e-9)
    assert session["loop"]["repeats"] == int(
        (statuses["flags"] & trifinger.Status.ACTION_REPEATED.value != 0).sum()
    )
    assert info["events"][0]["text"] == "the disk is nearly full"


def test_info_names_what_is_damaged(damaged: Path) -> None:
    text = run("info", damaged)
    assert re.search(r"lost +\d", text)
    assert re.search(r"damage +bytes \d+ to \d+: .*checksum", text)
    assert "lost with damaged bytes" in text


def test_info_knows_other_mcap_files(tmp_path: Path) -> None:
    writer_module = pytest.importorskip("mcap.writer")
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = writer_module.Writer(file)
        writer.start(profile="x", library="another")
        schema = writer.register_schema("Pose", "jsonschema", b"{}")
        channel = writer.register_channel("/pose", "json", schema)
        for t in range(5):
            writer.add_message(channel, t * 10**9, b"{}", t * 10**9)
        writer.finish()
    text = run("info", path)
    assert "/pose  Pose  5" in text
    assert "no log of robots" in text
    info = json.loads(run("info", path, "--json"))
    assert info["topics"] == [{"topic": "/pose", "type": "Pose", "messages": 5}]
    assert not info["is_log"]
    assert info["duration"] == 4.0
    assert "whole" in run("check", path)


# ---- check, recover, cut ----


def test_check_tells_whole_from_damaged(written: Written, damaged: Path) -> None:
    assert "whole" in run("check", written.path)
    text = run("check", written.path, damaged, expect=1)
    assert "whole" in text
    assert "damaged" in text
    assert "trifinger log recover" in text


def test_fault_24_recover_says_by_its_exit_code_what_is_lost(
    written: Written, damaged: Path, tmp_path: Path
) -> None:
    whole = tmp_path / "whole.mcap"
    assert "nothing is lost" in run("recover", written.path, "-o", whole)
    assert "could not be used" in run("recover", damaged, expect=3)
    recovered = damaged.with_name("damaged.recovered.mcap")
    run("check", recovered)
    assert len(trifinger.Log(recovered).session().gaps) == 2
    assert "File exists" in run("recover", damaged, "-o", recovered, expect=1)


def test_cut_takes_steps_and_seconds(written: Written, tmp_path: Path) -> None:
    by_step, by_time = tmp_path / "step.mcap", tmp_path / "time.mcap"
    assert "steps 100 to 149" in run(
        "cut", written.path, "--first", "100", "--last", "150", "-o", by_step
    )
    run("cut", written.path, "--from", "0.1", "--to", "0.15", "-o", by_time)
    whole = written.log.session()
    for path in (by_step, by_time):
        part = trifinger.Log(path).session()
        assert part.time_index.tolist() == list(range(100, 150))
        assert part.observations.tobytes() == whole.get_observations(100, 150).tobytes()
        assert part.documents == whole.documents
    assert "--first" in run("cut", written.path, "--first", "1", "--from", "1", "-o", "x", expect=2)
    assert "nothing is left" in run("cut", written.path, "--first", "9999", "-o", "x", expect=2)


# ---- plot and export ----


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "suffix"), [("trifinger", "png"), ("trifinger", "svg"), ("odd", "svg")]
)
def test_plot_draws_every_robot(
    robot: str,
    suffix: str,
    written: Written,
    odd: Written,
    tmp_path: Path,
    python_programs: dict[str, str],
) -> None:
    pytest.importorskip("matplotlib")
    log = {"trifinger": written, "odd": odd}[robot]
    picture = tmp_path / f"picture.{suffix}"
    run("plot", log.path, "-o", picture, environment=python_programs)
    content = picture.read_bytes()
    if suffix == "png":
        assert content.startswith(b"\x89PNG")
        return
    assert "<svg" in content.decode()


class Page:
    """What a page made by `trifinger log plot` holds."""

    def __init__(self, text: str) -> None:
        bundle = plotly.offline.get_plotlyjs()
        assert bundle in text
        self.text = text.replace(bundle, "")
        numbers = re.search(r'id="numbers">([^<]*)<', text)
        index = re.search(r'id="index">([^<]*)<', text)
        assert numbers
        assert index
        self.numbers = gzip.decompress(base64.b64decode(numbers[1]))
        self.lines = json.loads(index[1])["lines"]

    def line(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times, smallest and largest numbers."""
        _, times, low, high, count = self.lines[i]
        return (
            np.frombuffer(self.numbers, "<f8", count, times),
            np.frombuffer(self.numbers, "<f4", count, low),
            np.frombuffer(self.numbers, "<f4", count, high),
        )


def envelope(rows: np.ndarray, bins: int = 10) -> curves.Envelope:
    """The envelope of rows of numbers, as many in each bin."""
    made = curves.Envelope(bins)
    made.add(np.arange(bins), np.arange(bins) * (len(rows) // bins), rows)
    return made


@pytest.mark.parametrize("unit", ["rad", "Nm", "m", "N", "", "lm"])
@pytest.mark.parametrize("size", [0.0, 1e-15, 1e-6, 1e-3, 1.0, 1e6])
@pytest.mark.parametrize("middle", [0.0, 1e-12, -0.3, 1.0, 1e5])
def test_an_axis_shows_all_numbers_and_no_noise(unit: str, size: float, middle: float) -> None:
    rows = middle + size * np.random.default_rng(1).uniform(-1, 1, (50, 3))
    low, high = panels.Panel("x", unit, envelope(rows)).limits()
    assert low < rows.min()
    assert high > rows.max()
    assert high - low >= panels.LEAST.get(unit, 0.0) * (1 - 1e-9)
    assert high - low >= panels.LEAST_SHARE * np.abs(rows).max() * (1 - 1e-9)
    span = max(np.ptp(rows), panels.LEAST.get(unit, 1.0), 2e-3 * np.abs(rows).max())
    assert high - low < 1.2 * span  # and not much else
    assert (low + high) / 2 == pytest.approx((rows.min() + rows.max()) / 2, abs=1e-9 * (1 + span))


def test_a_panel_is_left_out_if_one_number_says_it_all() -> None:
    rows = np.full((100, 3), np.nan)
    rows[:, 1:] = 1.0
    one = envelope(rows)
    rows[57, 2] = 1.001  # a peak of a single step
    other = envelope(rows)
    zeros = envelope(np.zeros((100, 3)))
    nothing = envelope(np.full((100, 3), np.nan))
    assert panels.Panel("x", "", one).still() == 1.0
    assert panels.Panel("x", "", other).still() is None
    assert panels.Panel("x", "", one, desired=nothing, applied=one).still() == 1.0
    assert panels.Panel("x", "", one, desired=zeros).still() is None
    assert panels.Panel("x", "Nm", zeros, zeros, zeros).still() == 0.0
    assert panels.Panel("x", "Nm", zeros, zeros, one).still() is None


def test_a_plot_names_what_never_happened(tmp_path: Path) -> None:
    with trifinger.simulate(record=str(tmp_path / "log")) as robot:
        robot.append_desired_actions(np.repeat(robot.new_action(), 40))
        robot.wait_until_time_index(39)
    log = trifinger.Log(tmp_path / "log")
    contents = panels.contents_of(log, log.session(), None, None)
    drawn = [panel.name for _, panel in contents.rows]
    assert {"position", "velocity", "object: cube.position"} <= set(drawn)
    assert contents.still["tip_force"] == 0.0
    assert not set(contents.still) & set(drawn)
    assert "tip_force (always 0)" in contents.left_out
    assert "problems (there were none)" in contents.left_out
    plot(log, tmp_path / "page.html")
    assert contents.left_out in Page((tmp_path / "page.html").read_text()).text
    texts = [text.get_text() for text in draw(log, log.session(), None, None).axes[0].texts]
    assert " ".join(texts).count(contents.left_out) == 1


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["trifinger", "odd"])
def test_a_page_needs_nothing_but_itself_and_has_every_step(
    robot: str, written: Written, odd: Written, tmp_path: Path, python_programs: dict[str, str]
) -> None:
    log = {"trifinger": written, "odd": odd}[robot]
    run("plot", log.path, "-o", tmp_path / "page.html", environment=python_programs)
    page = Page((tmp_path / "page.html").read_text())
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", page.text)
    assert "The page holds every step" in page.text
    if robot != "trifinger":
        return
    assert "the disk is nearly full" in page.text
    assert "period: 0.001 s" in page.text
    session = log.log.session()
    whole = session.observations["position"].astype("<f4")
    steps = session.time_index
    found = [line for line in map(page.line, range(len(page.lines))) if len(line[0]) == STEPS]
    for joint in range(9):
        assert any(
            np.array_equal(low[steps], whole[:, joint], equal_nan=True)
            and np.array_equal(high[steps], whole[:, joint], equal_nan=True)
            for _, low, high in found
        )
    # What is missing is drawn as a gap.
    times, low, _ = found[0]
    assert np.isnan(low[200:250]).all()
    assert (np.diff(times) > 0).all()


@pytest.mark.slow
def test_a_page_of_a_long_log_keeps_every_peak(
    written: Written, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("trifinger.log.plot.page.MAX_STRETCHES", 50)
    plot(written.log, tmp_path / "page.html")
    page = Page((tmp_path / "page.html").read_text())
    assert "50 stretches of up to 12 steps" in page.text
    session = written.log.session()
    lines = list(map(page.line, range(len(page.lines))))
    assert max(len(times) for times, _, _ in lines) == 50
    for joint in range(9):
        position = session.observations["position"][:, joint].astype("<f4")
        parts = np.split(position, np.flatnonzero(np.diff(session.time_index // 12)) + 1)
        bounds = np.array([[np.nanmin(part), np.nanmax(part)] for part in parts])
        assert any(
            np.array_equal(low[np.isfinite(low)], bounds[:, 0])
            and np.array_equal(high[np.isfinite(high)], bounds[:, 1])
            for _, low, high in lines
        )


def test_a_page_says_what_it_needs(written: Written, tmp_path: Path) -> None:
    text = (
        "import sys\nsys.modules['plotly'] = None\nfrom trifinger.commands.plot import main\n"
        f"sys.exit(main([{str(written.path)!r}, '-o', 'a.html']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 1
    assert done.stderr == "trifinger log plot: plotly is missing: ./run setup\n"
    assert not (tmp_path / "a.html").exists()


def test_lateness_is_the_same_number_in_every_command(
    start_program: StartProgram, tmp_path: Path
) -> None:
    folder = tmp_path / "recorded"
    words = ("--name", "late", "--record", str(folder))
    robot = start_program("run", "fake", *words, *PATIENT_FAKE)
    robot.wait_for("waits for a user")
    with trifinger.connect("late") as user:
        t = user.append_desired_action(user.new_action())
        user.get_observation(t + 100)
        # Ticks that are left out are lateness, too.
        backend = user.session_info().backend_pid
        os.kill(backend, signal.SIGSTOP)
        time.sleep(0.02)
        os.kill(backend, signal.SIGCONT)
        user.get_observation(t + 200)
        user.finish()
        kept = user.timing()
    assert kept is not None
    expected = str(kept.lateness())
    robot.wait_for(f"lateness {expected}")
    assert robot.end()[0] == 0

    log = trifinger.Log(folder)
    session = log.session("late")
    assert session.statuses["skipped_ticks"].any()
    logged = session.timing()
    assert (str(logged), str(logged and logged.lateness())) == (str(kept), expected)
    assert f"lateness    {expected}" in run("info", folder)
    loop = json.loads(run("info", "--json", folder))["sessions"][0]["loop"]
    assert loop["lateness_max"] == kept.lateness().max()
    assert loop["lateness_p99"] == kept.lateness().quantile(0.99)
    plot(log, tmp_path / "page.html", "late")
    assert f"lateness {expected}" in Page((tmp_path / "page.html").read_text()).text
    assert f"lateness {expected}" in panels.title_of(curves.read(session))[1]
    each = trifinger.lateness_of(session.get_statuses(*session.range("status")), session.period)
    assert len(each) == kept.steps()
    assert each.max() == pytest.approx(kept.lateness().max(), abs=1e-12)


def test_plot_refuses_what_it_cannot_draw(
    written: Written, tmp_path: Path, python_programs: dict[str, str]
) -> None:
    text = run("plot", written.path, "-o", "a.jpg", expect=2, environment=python_programs)
    assert "must end in .png" in text
    text = run("plot", written.path, "--robot", "sim", expect=2, environment=python_programs)
    assert "it has 'robot'" in text
    text = run("plot", tmp_path / "nothing.mcap", expect=1, environment=python_programs)
    assert "nothing.mcap" in text


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_export_writes_the_newest_session_into_a_file(
    kind: str, written: Written, tmp_path: Path, python_programs: dict[str, str]
) -> None:
    pandas = pytest.importorskip("pandas")
    path = tmp_path / f"run.{kind}"
    text = run("export", written.path, "-o", path, environment=python_programs)
    assert f"{path} written." in text
    assert list(tmp_path.glob("*run*")) == [path]
    table = {"csv": pandas.read_csv, "parquet": pandas.read_parquet}[kind](path)
    assert len(table) == STEPS - 50
    text = run(
        *(
            "export",
            written.path,
            "-o",
            path,
            "--format",
            {"csv": "parquet", "parquet": "csv"}[kind],
        ),
        expect=2,
        environment=python_programs,
    )
    assert f"ends in .{kind}" in text


@pytest.mark.parametrize("format_", ["csv", "parquet"])
def test_export_writes_a_table_per_robot_and_companion(
    format_: str, written: Written, tmp_path: Path, python_programs: dict[str, str]
) -> None:
    pandas = pytest.importorskip("pandas")
    run(
        *("export", written.path, "--format", format_, "-o", tmp_path, "--to", "0.3"),
        environment=python_programs,
    )
    read = {"csv": pandas.read_csv, "parquet": pandas.read_parquet}[format_]
    robot = read(tmp_path / f"log.robot.{format_}")
    assert robot["time_index"].tolist() == [*range(200), *range(250, 300)]
    assert len(read(tmp_path / f"log.robot.object.{format_}")) == 30


def test_export_copies_a_log(
    written: Written, tmp_path: Path, python_programs: dict[str, str]
) -> None:
    copy = tmp_path / "copy.mcap"
    environment = {**python_programs, "PATH": f"{Path(PROGRAM).parent}:{python_programs['PATH']}"}
    run("export", written.path, "--format", "mcap", "-o", copy, environment=environment)
    assert len(trifinger.Log(copy).session().observations) == STEPS - 50
