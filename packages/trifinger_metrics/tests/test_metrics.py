# SPDX-License-Identifier: BSD-3-Clause
"""What `trifinger metrics` says of robots, recorders and jobs, and what it says of itself."""

import json
import math
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import EMULATED, PATIENT_BOARDS, PROGRAM, StartChild, StartProgram
from prometheus_client import CollectorRegistry
from prometheus_client.openmetrics import exposition
from prometheus_client.openmetrics.parser import text_string_to_metric_families
from trifinger_metrics import robots
from trifinger_metrics.collector import Collector, families

ROOT = Path(__file__).parents[3]
COMMAND = (
    sys.executable,
    "-c",
    "import sys; from trifinger_metrics.commands.metrics import main; sys.exit(main())",
)
FOR_PROMETHEUS = ROOT / "packages/trifinger_metrics/trifinger_metrics/for_prometheus"
ALERTS = FOR_PROMETHEUS / "trifinger_alerts.yml"
OPEN_METRICS = "application/openmetrics-text; version=1.0.0"
PATIENT = {"real_time": True, "max_action_repeats": 10**6, "max_skipped_ticks": 10**6}

needs_promtool = pytest.mark.skipif(
    shutil.which("promtool") is None, reason="promtool is missing: Debian's package prometheus"
)


class Scrape:
    """A scrape in the format OpenMetrics, as the parser of Prometheus's library reads it."""

    def __init__(self, text: str) -> None:
        families = text_string_to_metric_families(text)
        samples = [sample for family in families for sample in family.samples]
        self.samples = {(one.name, frozenset(one.labels.items())): one.value for one in samples}
        assert len(self.samples) == len(samples)

    def __call__(self, name: str, **labels: str) -> float:
        """The value of a sample, which must be there."""
        return self.samples[f"trifinger_{name}", frozenset(labels.items())]

    def labels(self, name: str) -> list[dict[str, str]]:
        """The labels of all samples of this name."""
        return [dict(labels) for found, labels in self.samples if found == f"trifinger_{name}"]


class Exporter:
    """A collector in this process, and what it has reported."""

    def __init__(self, *names: str, **folders: list[Path]) -> None:
        self.said: list[str] = []
        self.registry = CollectorRegistry()
        self.registry.register(Collector(names, report=self.said.append, **folders))

    def scrape(self) -> Scrape:
        return Scrape(exposition.generate_latest(self.registry).decode())


def drive(name: str, steps: int, **fields: object) -> trifinger.Frontend:
    """Appends actions, and returns when the last one was applied."""
    robot = trifinger.connect(name)
    action = robot.new_action(**fields)  # type: ignore[arg-type]
    for _ in range(steps):
        t = robot.append_desired_action(action)
    robot.get_status(t)
    return robot


def status_of(name: str) -> dict[str, Any]:
    """What `trifinger status NAME --json` says."""
    words = [PROGRAM, "status", name, "--json"]
    return dict(json.loads(subprocess.run(words, capture_output=True, check=True).stdout))


def fetch(url: str, accept: str = OPEN_METRICS) -> str:
    request = urllib.request.Request(url, headers={"Accept": accept})  # noqa: S310 (our server)
    with urllib.request.urlopen(request) as answer:  # noqa: S310
        return str(answer.read().decode())


# ---- robots ----


def test_a_session_has_the_values_that_status_has() -> None:
    options = PATIENT | {"max_action_repeats": 3, "period": 0.002}
    with trifinger.run_fake("left", **options):  # type: ignore[arg-type]
        robot = drive("left", 50)
        with pytest.raises(trifinger.RobotStopped):  # it is late: a fault after three repeats
            robot.get_observation(1000)
        scrape = Exporter().scrape()
        status = status_of("left")
        timing = robot.timing()
    loop = status["loop"]
    assert timing is not None
    assert scrape("steps_total", robot="left") == status["steps"]
    assert scrape("period_seconds", robot="left") == status["period"]
    assert scrape("up", robot="left") == status["is_alive"]
    assert scrape("lateness_max_seconds", robot="left") == loop["lateness_max"]
    for cause, count in loop["late"].items():
        assert scrape("late_steps_total", robot="left", cause=cause) == count
    for flag, key in (("action_repeated", "repeats"), ("acausal", "acausal")):
        assert scrape("flagged_steps_total", robot="left", flag=flag) == loop[key]
    assert loop["repeats"] == 3
    assert scrape("skipped_periods_total", robot="left") == loop["skipped"]
    assert scrape("fault_active", robot="left") == status["fault"]["needs_recovery"]
    assert scrape("last_fault_info", robot="left", code=status["fault"]["code"]) == 1
    (session,) = scrape.labels("session_info")
    assert session["session"] == str(status["session_id"])
    assert (session["type"], session["mode"]) == ("fake", "real_time")

    # Each bucket has the steps below its bound, and p99 is where status has it.
    edges, counts = robots.EDGES, np.array(timing.lateness().counts())
    buckets = {
        float(labels["le"]): scrape("lateness_seconds_bucket", robot="left", le=labels["le"])
        for labels in scrape.labels("lateness_seconds_bucket")
    }
    for bound, count in buckets.items():
        assert count == counts[edges < bound * (1 - 1e-9)].sum()
    assert buckets[math.inf] == scrape("lateness_seconds_count", robot="left") == timing.steps()
    below = [bound for bound, count in buckets.items() if count < 0.99 * timing.steps()]
    assert max(below, default=0.0) <= loop["lateness_p99"] * (1 + 1 / 8)
    widest = timing.steps() * timing.lateness().max() * (1 + 1 / 8)
    assert 0 < scrape("lateness_seconds_sum", robot="left") <= widest


def test_joints_have_margins_and_limits(start_program: StartProgram) -> None:
    start_program("run", "sim", "--name", "left", "--non-real-time").wait_for("waits for a user")
    exporter = Exporter()
    exporter.scrape()
    robot = drive("left", 100, torque=[0.0, 0.0, 0.0, 0.0, 1e3, 0.0, 0.0, 0.0, 0.0])
    scrape = exporter.scrape()
    applied = robot.get_applied_actions(*robot.range("applied_action"))
    assert scrape("steps_total", robot="left") == status_of("left")["steps"] == len(applied) == 100
    for joint, margin in enumerate(applied[-1]["thermal_margin"]):
        assert scrape("thermal_margin_ratio", robot="left", joint=str(joint)) == margin
    clipped = (applied["reasons"] & np.uint64(trifinger.Reason.TORQUE_CLIPPED)).any(axis=1).sum()
    assert clipped > 0
    limited = scrape("limited_steps_total", robot="left", reason="torque_clipped")
    assert limited == clipped
    assert (
        exporter.scrape()("limited_steps_total", robot="left", reason="torque_clipped") == clipped
    )
    assert scrape("limited_steps_total", robot="left", reason="stuck") == 0
    assert {"companion": "object", "robot": "left"} in scrape.labels("companion_elements_total")
    assert exporter.said == []


def test_a_fault_is_counted_once_and_known_after_it_was_cleared() -> None:
    exporter = Exporter()
    with trifinger.run_fake("left", action_fault_after=5):
        assert exporter.scrape()("faults_total", robot="left", code="driver") == 0
        with pytest.raises(trifinger.RobotStopped):
            drive("left", 10)
        for _ in range(2):
            scrape = exporter.scrape()
            assert scrape("fault_active", robot="left") == 1
            assert scrape("faults_total", robot="left", code="driver") == 1
            assert scrape("phase", robot="left", trifinger_phase="ended") == 1
        trifinger.recover("left")
        scrape = exporter.scrape()
        assert scrape("fault_active", robot="left") == 0
        assert scrape("faults_total", robot="left", code="driver") == 1
        assert scrape("last_fault_info", robot="left", code="driver") == 1


def test_a_killed_back_end_stays_visible_with_its_fault(start_fake: StartChild) -> None:
    backend = start_fake("left")
    robot = drive("left", 20)
    exporter = Exporter()
    assert exporter.scrape()("up", robot="left") == 1
    backend.kill()
    for each in (exporter, Exporter(), Exporter("left")):  # also of one that starts later
        scrape = each.scrape()
        assert scrape("up", robot="left") == 0
        assert scrape("steps_total", robot="left") == 20
        assert scrape("last_fault_info", robot="left", code="backend_died") == 1
        assert each.said == []
    robot.close()


def test_a_robot_that_was_stopped_is_down_only_where_it_is_named() -> None:
    all_robots, named = Exporter(), Exporter("left", "left")
    with trifinger.run_fake("left"), trifinger.run_fake("right"):
        assert len(all_robots.scrape().labels("up")) == 2
        assert named.scrape().labels("up") == [{"robot": "left"}]
    assert all_robots.scrape().labels("up") == []
    assert named.scrape()("up", robot="left") == 0


def test_counts_go_on_from_session_to_session() -> None:
    exporter = Exporter()
    with trifinger.run_fake("left", **PATIENT):  # type: ignore[arg-type]
        counts = []
        for steps in (30, 50):  # by the second scrape, the second session has passed the first one
            robot = drive("left", steps)
            # Until finish(), the last action is repeated. The timing record follows a step.
            robot.wait_until_time_index(robot.current_time_index() + 2)
            scrape = exporter.scrape()
            names = ("steps_total", "lateness_seconds_count")
            counts.append([scrape(name, robot="left") for name in names])
            robot.finish()
    assert all(count >= 30 for count in counts[0])
    assert all(late - early >= 50 for early, late in zip(*counts, strict=True))


def test_steps_that_were_overwritten_before_a_scrape_are_counted_as_unread() -> None:
    exporter = Exporter()
    with trifinger.run_fake("left", history=64):
        exporter.scrape()
        robot = drive("left", 10)
        assert exporter.scrape()("unread_steps_total", robot="left") == 0
        for _ in range(1000):
            t = robot.append_desired_action(robot.new_action())
        robot.get_status(t)
        scrape = exporter.scrape()
        assert 1000 - 64 <= scrape("unread_steps_total", robot="left") < 1000
        assert exporter.said == []


def test_actions_that_wait_are_counted() -> None:
    with trifinger.run_fake("left", **PATIENT, period=0.02):  # type: ignore[arg-type]
        exporter = Exporter()
        assert exporter.scrape()("waiting_actions", robot="left") == 0
        robot = trifinger.connect("left")
        count = 100
        for _ in range(count):
            t = robot.append_desired_action(robot.new_action())
        before = robot.range("desired_action")[1]
        waiting = exporter.scrape()("waiting_actions", robot="left")
        after = robot.range("desired_action")[1]
        assert count - after - 1 <= waiting <= count - before  # one may just be taken
        assert exporter.scrape()("controlled", robot="left") == 1
        robot.get_status(t)
        assert exporter.scrape()("waiting_actions", robot="left") == 0
        assert exporter.said == []


def test_names_and_places_are_those_of_the_core() -> None:
    faults = (ROOT / "src/core/fault.cpp").read_text().partition("kFaults{")[2].partition("}")[0]
    assert tuple(re.findall(r'"(\w+)"', faults)) == robots.FAULTS
    locks = (ROOT / "src/ipc/file_lock.hpp").read_text()
    assert "kOwner = 0," in locks
    assert "kJob = 3," in locks
    ends = (ROOT / "packages/trifinger_endurance/shared_robot/job_report.cpp").read_text()
    kinds = ends.partition("name_of(JobEnd::Kind kind)")[2].partition("}\n\n")[0]
    from trifinger_metrics.files import ENDS

    assert set(re.findall(r'return "(\w+)"', kinds)) == set(ENDS)


@pytest.mark.slow
def test_a_robot_on_motor_boards_has_running_hours(start_program: StartProgram) -> None:
    options = [EMULATED, "--name", "left", *PATIENT_BOARDS]
    start_program("emulate", *options).wait_for("emulated boards are on")
    start_program("run", *options).wait_for("waits for a user")
    wear = trifinger.observe("left.wear")
    wear.wait_until_time_index(0)
    first = wear.get_observation(0)
    scrape = Exporter().scrape()
    last = wear.latest_observation()
    for metric, field in robots.WEAR.items():
        for joint in range(len(first[field])):
            value = scrape(f"{metric}_total", robot="left", joint=str(joint))
            assert first[field][joint] <= value <= last[field][joint]
    assert scrape("joint_powered_seconds_total", robot="left", joint="0") > 0


@pytest.mark.slow
def test_cameras_have_rates_and_dropped_images(start_program: StartProgram) -> None:
    start_program("run", "sim_cameras", "--name", "left", "--non-real-time").wait_for(
        "waits for a user"
    )
    robot = drive("left", 300, position=trifinger.observe("left").latest_observation().position)
    element = robot.companion("cameras").latest_observation()
    scrape = Exporter().scrape()
    cameras = {labels["camera"] for labels in scrape.labels("camera_images_total")}
    assert cameras == {"camera60", "camera180", "camera300"}
    for camera in cameras:
        count = scrape("camera_images_total", robot="left", camera=camera)
        assert count == element[camera]["number"] + 1 > 0
        assert scrape("camera_up", robot="left", camera=camera) == 1
        assert scrape("camera_dropped_images_total", robot="left", camera=camera) == 0


# ---- what cannot be read ----


def test_what_cannot_be_read_is_counted_and_said_once(session_folder: Path, tmp_path: Path) -> None:
    (session_folder / "trifinger.broken.state").write_bytes(b"no session" * 1000)
    (session_folder / "trifinger.folder.state").mkdir()
    job = tmp_path / "jobs" / "one" / "job.json"
    job.parent.mkdir(parents=True)
    job.write_text('{"robot": "left"}')
    (tmp_path / "jobs" / "two").mkdir()
    os.mkfifo(tmp_path / "jobs" / "two" / "job.json")  # who opens it waits
    (tmp_path / "file").touch()
    exporter = Exporter(jobs=[tmp_path / "jobs"], logs=[tmp_path / "none", tmp_path / "file"])
    with trifinger.run_fake("left"):
        robot = drive("left", 5)
        exporter.scrape()
        scrape = exporter.scrape()
        robot.close()
    assert scrape("steps_total", robot="left") == 5
    assert scrape("read_errors_total", source="session") == 4
    assert scrape("read_errors_total", source="job") == 4
    assert scrape("read_errors_total", source="recording") == 2
    assert len(exporter.said) == 5
    assert "broken" in exporter.said[0]
    assert f"{job} is no report of a job: KeyError" in "".join(exporter.said)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can be two users")
def test_a_robot_of_another_user_does_not_hide_the_others(
    session_folder: Path, tmp_path: Path
) -> None:
    for folder in (*tmp_path.parents, tmp_path, session_folder):
        if not folder.stat().st_mode & 1:
            folder.chmod(0o711)
    session_folder.chmod(0o777)
    with trifinger.run_fake("left"):
        # The interpreter of the tests may lie where only root can start it, so a fork is enough.
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            os.setresuid(65534, 65534, 65534)
            exporter = Exporter()
            count = int(exporter.scrape()("read_errors_total", source="session"))
            os.write(writer, f"{count} {exporter.said}".encode())
            os._exit(0)
        os.close(writer)
        os.waitpid(child, 0)
        said = os.read(reader, 10_000).decode()
        os.close(reader)
    assert said.startswith("1 ")
    assert "which belongs to user root" in said


# ---- recorders and jobs ----


def test_a_recorder_works_ends_or_dies(start_program: StartProgram, tmp_path: Path) -> None:
    folder = tmp_path / "logs of left"
    here = {"robot": "left", "folder": str(folder)}
    with trifinger.run_fake("left"):
        exporter = Exporter()
        recorder = start_program("record", "left", "-o", str(folder))
        drive("left", 100).finish()
        recorder.wait_for("left")  # its events come after its lock
        while not list(folder.glob("*.mcap")):
            os.sched_yield()
        scrape = exporter.scrape()
        assert scrape("recorder_up", **here) == 1
        assert scrape("recording_files", **here) == 1
        size = shutil.disk_usage(folder).total
        assert scrape("log_folder_size_bytes", folder=str(folder)) == size
        recorder.end(signal.SIGKILL)
        assert exporter.scrape()("recorder_up", **here) == 0

        recorder = start_program("record", "left", "-o", str(folder))
        recorder.wait_for("left")
        assert exporter.scrape()("recorder_up", **here) == 1
        recorder.end()
    scrape = Exporter(logs=[folder]).scrape()
    assert here not in scrape.labels("recorder_up")
    files = list(folder.glob("*.mcap"))
    assert scrape("recording_files", **here) == len(files)
    assert scrape("recording_bytes", **here) == sum(file.stat().st_size for file in files)
    newest = max(file.stat().st_mtime for file in files)
    assert scrape("recording_write_timestamp_seconds", **here) == pytest.approx(newest)
    assert here not in Exporter("right", logs=[folder]).scrape().labels("recording_files")


JOB = """
import fcntl, os, struct, sys
from pathlib import Path
Path("/proc/self/comm").write_text("trifinger-job")
for path, byte in ((sys.argv[1], 3), (sys.argv[2], 0)):
    file = os.open(path, os.O_RDWR | os.O_CREAT)
    fcntl.fcntl(file, fcntl.F_OFD_SETLK, struct.pack("@hhqqi4x", fcntl.F_WRLCK, 0, byte, 1, 0))
print("ready", flush=True)
sys.stdin.read()
"""


def report_of(robot: str, kind: str, code: int, end: str) -> str:
    report = {"robot": robot, "begin": "2026-11-24T09:00:00Z", "end_time": end}
    return json.dumps(report | {"exit_code": code, "end": {"kind": kind}})


def test_a_job_runs_and_its_end_is_known(
    start_python: StartChild, session_folder: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "jobs" / "newest"
    (folder / "log").mkdir(parents=True)
    exporter = Exporter()
    with trifinger.run_fake("left"):
        assert exporter.scrape()("job_running", robot="left") == 0
        lock = session_folder / "trifinger.left.lock"
        job = start_python(JOB, str(lock), str(folder / "log" / ".left.recorder"))
        scrape = exporter.scrape()
        assert scrape("job_running", robot="left") == 1
        started = Path(f"/proc/{job.pid}").stat().st_mtime
        assert abs(scrape("job_start_timestamp_seconds", robot="left") - started) < 60
        # A job looks after its own. Other tests may record on this machine.
        mine = {"robot": "left", "folder": str(folder / "log")}
        assert mine not in scrape.labels("recorder_up")
        job.finish()
        assert exporter.scrape()("job_running", robot="left") == 0
    (folder / "job.json").write_text(report_of("left", "limit", 11, "2026-11-24T09:05:00Z"))
    scrape = exporter.scrape()
    assert scrape("last_job_exit_code", robot="left") == 11
    assert scrape("last_job_duration_seconds", robot="left") == 300
    assert scrape("last_job_info", robot="left", end="limit") == 1
    (tmp_path / "jobs" / "older").mkdir()
    older = tmp_path / "jobs" / "older" / "job.json"
    older.write_text(report_of("left", "exited", 0, "2026-11-24T09:01:00Z"))
    scrape = Exporter(jobs=[tmp_path / "jobs"]).scrape()
    assert scrape("job_reports", robot="left", end="exited") == 1
    assert scrape("job_reports", robot="left", end="limit") == 1
    assert scrape("last_job_exit_code", robot="left") == 11
    assert scrape("last_job_end_timestamp_seconds", robot="left") == 1795511100


# ---- the command ----


@pytest.fixture
def served(start_fake: StartChild, start_program: StartProgram) -> Iterator[str]:
    """The address at which a command serves a fake robot that has made some steps."""
    start_fake("left", **PATIENT)
    robot = drive("left", 20)
    serving = start_program("--port", "0", program=COMMAND)
    yield serving.wait_for("Serves http://").split()[1]
    robot.close()


def test_both_formats_are_served(served: str) -> None:
    scrape = Scrape(fetch(served))
    assert scrape("steps_total", robot="left") >= 20
    plain = fetch(served, "text/plain")
    assert "# EOF" not in plain
    assert 'trifinger_up{robot="left"} 1.0' in plain


@needs_promtool
def test_prometheus_finds_no_fault_with_the_metrics(served: str) -> None:
    words = ["promtool", "check", "metrics"]
    text = fetch(served, "text/plain")
    done = subprocess.run(words, input=text, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_in_order(start_program: StartProgram, number: signal.Signals) -> None:
    serving = start_program("--port", "0", program=COMMAND)
    url = serving.wait_for("Serves http://").split()[1]
    fetch(url)
    assert serving.end(number) == (0, "")


def refused(*words: str) -> tuple[int, str]:
    done = subprocess.run([*COMMAND, *words], capture_output=True, text=True, check=False)
    assert done.stdout == ""
    return done.returncode, done.stderr


def test_an_unknown_name_is_said_at_once(start_fake: StartChild) -> None:
    start_fake("left")
    code, said = refused("lift")
    assert code == 1
    assert re.fullmatch(r"trifinger metrics: there is no robot 'lift'.*'left' is meant.*\n", said)


def test_a_port_that_is_in_use_is_said_in_a_sentence() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = str(other.getsockname()[1])
        why = f"cannot listen at 127.0.0.1, port {port}: Address already in use"
        how = "--port and --host choose another"
        assert refused("--port", port) == (1, f"trifinger metrics: {why}; {how}\n")
    code, said = refused("--port", "70000")
    assert (code, said.count("\n")) == (1, 1)
    assert "0 to 65535" in said


def test_the_files_for_prometheus_are_written(tmp_path: Path) -> None:
    done = subprocess.run([*COMMAND, "--write-files", str(tmp_path / "new")], check=False)
    assert done.returncode == 0
    for name in ("trifinger_alerts.yml", "trifinger_dashboard.json"):
        assert (tmp_path / "new" / name).read_text() == (FOR_PROMETHEUS / name).read_text()
    (tmp_path / "file").touch()
    code, said = refused("--write-files", str(tmp_path / "file"))
    assert (code, said.count("\n")) == (1, 1)


# ---- dashboard and alerts ----


def exported() -> set[str]:
    """The names of all samples."""
    ends = {"counter": ["_total"], "info": ["_info"], "histogram": ["_bucket", "_sum", "_count"]}
    made = families().values()
    return {family.name + end for family in made for end in ends.get(family.type, [""])}


def metrics_in(expression: str) -> set[str]:
    """The metrics that an expression names."""
    bare = re.sub(r'"[^"]*"|\$\w+|\[[^]]*\]', "", expression)
    bare = re.sub(r"\{[^}]*\}|\b(by|on|group_left|ignoring) *\([^)]*\)", " ", bare)
    words = set(re.findall(r"[a-z_][a-z0-9_]+(?! *\()\b", bare))
    return words - {"and", "or", "unless", "sum", "min", "max"}


def expressions() -> Iterator[str]:
    yield from re.findall(
        r"^ +expr: (?:>-\n)?((?:.|\n)*?)\n +(?:for|labels):", ALERTS.read_text(), re.M
    )
    dashboard = json.loads((FOR_PROMETHEUS / "trifinger_dashboard.json").read_text())
    for panel in dashboard["panels"]:
        yield from (target["expr"] for target in panel.get("targets", ()))
    for variable in dashboard["templating"]["list"]:
        if variable["type"] == "query":
            yield variable["query"]["query"].partition("(")[2].partition(",")[0]


def test_dashboard_and_alerts_name_only_what_is_exported() -> None:
    text = 'sum by (le) (rate(one_total{label="text"}[5m])) / two > 1 and on (label) three'
    assert metrics_in(text) == {"one_total", "two", "three"}
    found = [metrics_in(expression) for expression in expressions()]
    assert len(found) > 40
    assert all(found)
    assert set().union(*found) - exported() == {"up"}  # Prometheus's own
    # What users look for is on the dashboard.
    shown = set().union(*found)
    assert {"trifinger_waiting_actions", "trifinger_thermal_margin_ratio"} <= shown
    assert {"trifinger_joint_powered_seconds_total", "trifinger_log_folder_free_bytes"} <= shown


@needs_promtool
def test_prometheus_takes_every_expression(tmp_path: Path) -> None:
    """Those of the dashboard as rules, because promtool checks no dashboards."""
    rules = [
        {"record": f"panel:{i}", "expr": re.sub(r"\$__rate_interval", "1m", expression)}
        for i, expression in enumerate(expressions())
    ]
    file = tmp_path / "rules.yml"
    file.write_text(json.dumps({"groups": [{"name": "panels", "rules": rules}]}))  # JSON is YAML
    for path in (file, ALERTS):
        words = ["promtool", "check", "rules", str(path)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "SUCCESS" in done.stdout


HERE = 'instance="pc", robot="left"'
FIRING = {
    "TrifingerMachineDown": {'up{job="trifinger", instance="pc"}': "0x60"},
    "TrifingerRobotDown": {f"trifinger_up{{{HERE}}}": "0x60"},
    "TrifingerFault": {
        f"trifinger_up{{{HERE}}}": "1x60",
        f"trifinger_fault_active{{{HERE}}}": "1x60",
    },
    "TrifingerLate": {
        f'trifinger_late_steps_total{{{HERE}, cause="user"}}': "0+600x60",
        f"trifinger_steps_total{{{HERE}}}": "0+60000x60",
    },
    "TrifingerHot": {
        f'trifinger_thermal_margin_ratio{{{HERE}, joint="0"}}': "0.1x60",
        f'trifinger_phase{{{HERE}, trifinger_phase="running"}}': "1x60",
    },
    "TrifingerDiskFilling": {
        'trifinger_log_folder_free_bytes{instance="pc", folder="/logs"}': "100000-1000x60",
        'trifinger_log_folder_size_bytes{instance="pc", folder="/logs"}': "200000x60",
    },
    "TrifingerRecorderDead": {f'trifinger_recorder_up{{{HERE}, folder="/logs"}}': "0x60"},
    "TrifingerRecorderSilent": {
        f'trifinger_recorder_up{{{HERE}, folder="/logs"}}': "1x60",
        f'trifinger_recording_write_timestamp_seconds{{{HERE}, folder="/logs"}}': "0x60",
        f"trifinger_steps_total{{{HERE}}}": "0+60000x60",
    },
    "TrifingerCameraLost": {
        f'trifinger_camera_up{{{HERE}, camera="camera60"}}': "0x60",
        f'trifinger_phase{{{HERE}, trifinger_phase="running"}}': "1x60",
    },
    "TrifingerJobStuck": {
        f"trifinger_job_running{{{HERE}}}": "1x90",
        f"trifinger_job_start_timestamp_seconds{{{HERE}}}": "0x90",
    },
    "TrifingerNotFit": {f"trifinger_last_job_exit_code{{{HERE}}}": "13x60"},
    "TrifingerUnreadable": {'trifinger_read_errors_total{instance="pc", source="job"}': "0+4x60"},
}


@needs_promtool
@pytest.mark.parametrize("name", FIRING)
def test_an_alert_fires_when_it_should_and_no_other_does(name: str, tmp_path: Path) -> None:
    minutes = 75
    labels = {"alertname": name}
    query = "count by (alertname) (ALERTS{alertstate='firing'})"
    series = [{"series": one, "values": values} for one, values in FIRING[name].items()]
    fires = {"expr": query, "eval_time": f"{minutes if 'Job' in name else 30}m"}
    fires["exp_samples"] = [{"labels": f'{{alertname="{labels["alertname"]}"}}', "value": 1}]  # type: ignore[assignment]
    test = {"interval": "1m", "input_series": series, "promql_expr_test": [fires]}
    file = tmp_path / "test.yml"
    file.write_text(json.dumps({"rule_files": [str(ALERTS)], "tests": [test]}))
    words = ["promtool", "test", "rules", str(file)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@needs_promtool
def test_a_good_robot_raises_no_alert(tmp_path: Path) -> None:
    assert set(FIRING) == set(re.findall(r"alert: (\w+)", ALERTS.read_text()))
    good = {
        'up{job="trifinger", instance="pc"}': "1x60",
        f"trifinger_up{{{HERE}}}": "1x60",
        f"trifinger_fault_active{{{HERE}}}": "0x60",
        f"trifinger_steps_total{{{HERE}}}": "0+60000x60",
        f'trifinger_late_steps_total{{{HERE}, cause="user"}}': "0x60",
        f'trifinger_thermal_margin_ratio{{{HERE}, joint="0"}}': "0.9x60",
        f'trifinger_phase{{{HERE}, trifinger_phase="running"}}': "1x60",
        'trifinger_log_folder_free_bytes{instance="pc", folder="/logs"}': "100000x60",
        'trifinger_log_folder_size_bytes{instance="pc", folder="/logs"}': "200000x60",
        f'trifinger_recorder_up{{{HERE}, folder="/logs"}}': "1x60",
        f'trifinger_recording_write_timestamp_seconds{{{HERE}, folder="/logs"}}': "0+60x60",
        f"trifinger_job_running{{{HERE}}}": "1x60",
        f"trifinger_job_start_timestamp_seconds{{{HERE}}}": "0+60x60",
        f"trifinger_last_job_exit_code{{{HERE}}}": "0x60",
        'trifinger_read_errors_total{instance="pc", source="job"}': "0x60",
    }
    series = [{"series": one, "values": values} for one, values in good.items()]
    none = {"expr": "ALERTS", "eval_time": "50m", "exp_samples": []}
    test = {"interval": "1m", "input_series": series, "promql_expr_test": [none]}
    file = tmp_path / "test.yml"
    file.write_text(json.dumps({"rule_files": [str(ALERTS)], "tests": [test]}))
    words = ["promtool", "test", "rules", str(file)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_dashboard_can_be_imported() -> None:
    dashboard = json.loads((FOR_PROMETHEUS / "trifinger_dashboard.json").read_text())
    ids = [panel["id"] for panel in dashboard["panels"]]
    assert len(ids) == len(set(ids))
    variables = {variable["name"] for variable in dashboard["templating"]["list"]}
    assert variables == {"datasource", "instance", "robot"}
    used = set(re.findall(r"\$\{?(\w+)", json.dumps(dashboard))) - {"__all", "__rate_interval"}
    assert used == variables
    places = [panel["gridPos"] for panel in dashboard["panels"]]
    for one in places:
        assert one["x"] + one["w"] <= 24
        overlapping = [
            other
            for other in places
            if other is not one
            and one["x"] < other["x"] + other["w"]
            and other["x"] < one["x"] + one["w"]
            and one["y"] < other["y"] + other["h"]
            and other["y"] < one["y"] + one["h"]
        ]
        assert overlapping == []
