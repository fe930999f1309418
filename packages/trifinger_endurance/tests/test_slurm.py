# SPDX-License-Identifier: BSD-3-Clause
"""Slurm as the queue of a shared robot, set up as docs/shared_robot.md says, in private folders."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from conftest import StartProgram, free_port
from job_place import (
    HIDDEN,
    PACKAGES,
    PROGRAM,
    SEES_THE_PACKAGE,
    Place,
    groups,
    needs_programs,
    place,
    processes_in,
)

NOBODY = 65534
SBIN = Path("/usr/sbin")
DAEMONS = [SBIN / name for name in ("munged", "slurmctld", "slurmd")]
PAGE = Path(__file__).parents[3] / "docs/shared_robot.md"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.geteuid() != 0, reason="only root can start jobs of other users"),
    pytest.mark.skipif(
        not all(daemon.exists() for daemon in DAEMONS),
        reason="slurm-wlm and munge are not installed",
    ),
    needs_programs,
    pytest.mark.skipif(not SEES_THE_PACKAGE, reason=HIDDEN),
]

DRIVE = """
import os, trifinger
robot = trifinger.connect(os.environ["TRIFINGER_ROBOT"])
hold = robot.new_action(position=robot.latest_observation().position)
for _ in range(100):
    robot.get_observation(robot.append_desired_action(hold))
robot.finish()
"""


def file_of_page(name: str) -> str:
    """A file that the page shows in full: the block of code after the line that names it."""
    found = re.search(
        rf"^`{re.escape(name)}`:\n\n```[a-z]+[^\n]*\n(.*?)^```$", PAGE.read_text(), re.M | re.S
    )
    assert found, f"{PAGE} does not show {name}"
    return found[1]


class Queue:
    """A Slurm of one node, whose daemons end with the test."""

    def __init__(self, a_place: Place) -> None:
        self.folder = a_place.folder / "slurm"
        for name in ("state", "spool"):
            (self.folder / name).mkdir(parents=True)
        self.started: list[subprocess.Popen[bytes]] = []
        self.write_files(a_place)
        os.environ["SLURM_CONF"] = str(self.folder / "slurm.conf")

    def write_files(self, a_place: Place) -> None:
        """The files of the page, in other folders and on a machine that has another name."""
        host = socket.gethostname().split(".")[0]
        changes = {
            "SlurmctldHost": f"{host}(127.0.0.1)",
            "SlurmUser": "root",
            "AuthInfo": f"socket={self.folder}/munge.socket",
            "StateSaveLocation": f"{self.folder}/state",
            "SlurmdSpoolDir": f"{self.folder}/spool",
            "SlurmctldPidFile": f"{self.folder}/slurmctld.pid",
            "SlurmdPidFile": f"{self.folder}/slurmd.pid",
            "SlurmctldLogFile": f"{self.folder}/slurmctld.log",
            "SlurmdLogFile": f"{self.folder}/slurmd.log",
            "JobCompLoc": f"{self.folder}/completed",
            "Epilog": f"{self.folder}/epilog",
            # Where the test runs there may be no cgroups to write to.
            "ProctrackType": "proctrack/linuxproc",
            "TaskPlugin": "task/none",
        }
        lines = []
        for line in file_of_page("/etc/slurm/slurm.conf").splitlines():
            key = line.partition("=")[0]
            lines.append(f"{key}={changes.pop(key)}" if key in changes else line)
        assert set(changes) <= {"AuthInfo", "SlurmdPidFile", "SlurmctldPidFile"}
        lines += [f"{key}={value}" for key, value in changes.items()]
        lines += [f"SlurmctldPort={free_port()}", f"SlurmdPort={free_port()}"]
        text = "\n".join(lines).replace("robot-pc", host) + "\n"
        text = re.sub(r" RealMemory=\d+", "", re.sub(r" CPUs=\d+", " CPUs=1", text))
        text = re.sub(r"^(DefMemPerNode|MaxMemPerNode)=.*\n", "", text, flags=re.M)
        text = text.replace("CR_Core_Memory", "CR_Core")
        (self.folder / "slurm.conf").write_text(text)
        (self.folder / "gres.conf").write_text(file_of_page("/etc/slurm/gres.conf"))
        (self.folder / "cgroup.conf").write_text("CgroupPlugin=cgroup/v1\n")
        epilog = file_of_page("/etc/slurm/epilog").replace(
            "runuser -u trifinger -- trifinger job",
            f"exec setpriv --reuid={NOBODY} --regid={NOBODY} --clear-groups"
            f" env TRIFINGER_SESSION_DIR={a_place.folder}/sessions {PROGRAM}",
        )
        (self.folder / "epilog").write_text(epilog)
        (self.folder / "epilog").chmod(0o755)
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o600)

    def start(self) -> None:
        host = socket.gethostname().split(".")[0]
        files = {"key-file": "key", "pid-file": "pid", "log-file": "log", "seed-file": "seed"}
        munge = [f"--{name}={self.folder}/munge.{end}" for name, end in files.items()]
        munge += [f"--socket={self.folder}/munge.socket", "--force", "--foreground"]
        config = ["-f", str(self.folder / "slurm.conf")]
        self.start_daemon("munged", *munge)
        while not (self.folder / "munge.socket").exists():
            self.look()
        self.start_daemon("slurmctld", "-D", *config)
        self.start_daemon("slurmd", "-D", "-N", host, *config)
        while "idle" not in self.tell("sinfo", "--noheader", "--format=%T"):
            self.look()

    def start_daemon(self, name: str, *words: str) -> None:
        with (self.folder / f"{name}.out").open("wb") as output:
            self.started.append(
                subprocess.Popen([SBIN / name, *words], stdout=output, stderr=output)
            )

    def look(self) -> None:
        """Waits a moment; fails if a daemon has ended."""
        time.sleep(0.1)
        for daemon in self.started:
            assert daemon.poll() is None, "".join(
                f"{log.name}:\n{log.read_text()[-2000:]}" for log in self.folder.glob("*.out")
            )

    def tell(self, *words: str) -> str:
        return subprocess.run(words, capture_output=True, text=True).stdout

    def wait_until_empty(self) -> None:
        """Waits for the end of all jobs. A busy controller may not answer, which says nothing."""
        while True:
            asked = subprocess.run(["squeue", "--noheader"], capture_output=True, text=True)
            if asked.returncode == 0 and not asked.stdout:
                return
            self.look()

    def submit(self, script: Path, *words: str) -> str:
        command = ["sbatch", "--parsable", "--uid=nobody", f"--chdir={script.parent}"]
        done = subprocess.run([*command, script, *words], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def end(self) -> None:
        for daemon in reversed(self.started):
            daemon.terminate()
            try:
                daemon.wait(20)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()


@pytest.fixture
def a_place(monkeypatch: pytest.MonkeyPatch) -> Iterator[Place]:
    for name in ("TRIFINGER_SESSION_DIR", "TRIFINGER_LOG_DIR", "SLURM_CONF"):
        monkeypatch.setenv(name, "")  # so that it is restored
    with place() as found:
        yield found


@pytest.fixture
def queue(a_place: Place) -> Iterator[Queue]:
    queue = Queue(a_place)
    try:
        queue.start()
        yield queue
    finally:
        queue.end()


@pytest.fixture
def script(a_place: Place, start_program: StartProgram) -> Path:
    """The job of the page, for the program that its arguments name; its robot runs."""
    robot = start_program("run", "sim", "--name", "robot-1", "--non-real-time", user=NOBODY)
    robot.wait_for("waits for a user")
    script = a_place.folder / "jobs" / "job.sh"
    text = file_of_page("my_job.sh")
    own = f"{PROGRAM} run --self-test hold --grace 1s --time 10min --env {PACKAGES}"
    assert "trifinger job run" in text
    text = text.replace("trifinger job run", own).replace("python3 my_experiment.py", '"$@"')
    script.write_text(text)
    script.chmod(0o755)
    return script


def report_of(job: str, jobs: Path) -> dict[str, Any]:
    """What a job has written."""
    return dict(json.loads((jobs / f"job-{job}/job.json").read_text()))


def test_three_jobs_share_a_robot_and_one_of_them_is_hostile(queue: Queue, script: Path) -> None:
    jobs = script.parent
    drive = ["/usr/bin/python3", "-c", DRIVE]
    hostile = "(setsid setsid sleep 1000 &); trap '' TERM; kill -9 $PPID; while true; do :; done"
    # The time of the others also counts while Python starts, on a busy machine.
    limited = script.with_name("limited.sh")
    limited.write_text(script.read_text().replace("--time 10min", "--time 4s"))
    limited.chmod(0o755)
    ids = [
        queue.submit(script, *drive),
        queue.submit(limited, "sh", "-c", hostile),
        queue.submit(script, *drive),
    ]
    queue.wait_until_empty()

    reports = [report_of(number, jobs) for number in ids]
    assert [report["exit_code"] for report in reports] == [0, 11, 0]
    assert [report["driving"]["steps"] for report in reports] == [100, 0, 100]
    assert all(report["after"]["is_fit"] for report in reports)
    assert not processes_in(jobs)

    # Slurm says the same, and that no two of them ran at once.
    told = queue.tell("sacct", "--completion", "-f", str(queue.folder / "completed"))
    assert re.findall(r"COMPLETED|FAILED", told) == ["COMPLETED", "FAILED", "COMPLETED"], told
    times = []
    for number in ids:
        shown = queue.tell("scontrol", "show", "job", number)
        found = re.search(r"StartTime=(\S+) EndTime=(\S+)", shown)
        assert found
        times.append(found.groups())
        assert "gres:robot" in shown, shown
    for (_, end), (begin, _) in pairwise(times):
        assert end <= begin
    # A node whose epilog has failed would be drained.
    assert "idle" in queue.tell("sinfo", "--noheader", "--format=%T")

    restored = subprocess.run(
        [str(PROGRAM), "restore", "robot-1", "--self-test", "hold"],
        user=NOBODY,
        group=NOBODY,
        extra_groups=groups(),
        capture_output=True,
        text=True,
    )
    assert restored.returncode == 0, restored.stdout
    shutil.rmtree(jobs)


def test_a_job_that_is_given_up_brings_the_robot_back(queue: Queue, script: Path) -> None:
    jobs = script.parent
    job = queue.submit(script, "sleep", "1000")
    while not processes_in(jobs / f"job-{job}/work"):
        queue.look()
    queue.tell("scancel", job)
    queue.wait_until_empty()
    report = report_of(job, jobs)
    assert report["exit_code"] == 128 + signal.SIGTERM
    assert report["after"]["is_fit"]
    assert not processes_in(jobs)
    told = queue.tell("sacct", "--completion", "-f", str(queue.folder / "completed"))
    assert "CANCELLED" in told
    shutil.rmtree(jobs)
