# SPDX-License-Identifier: BSD-3-Clause
"""Recorders and jobs by their files, and by the locks that say which of them live."""

import fcntl
import json
import os
import re
import shutil
import struct
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from datetime import datetime
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from trifinger.session_info import session_folder

from trifinger_metrics.robots import Add, Guard

FLOCK = "@hhqqi4x"  # struct flock: type, whence, start, length, process
JOB, JOB_BYTE = "trifinger-job", 3  # ipc::Lock::kJob
LOG = re.compile(r"([\w+-]+)_\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d_\d{3,}\.mcap")
RECORDER = re.compile(r"\.([\w-]+)\.recorder")
LOCK = re.compile(r"trifinger\.([\w-]+)\.lock")
LONGEST = 1_000_000  # report of a job [bytes]
ENDS = ("exited", "signal", "limit", "interrupted", "not_started")  # of a job


def default_log_folder() -> Path:
    """The folder where recorders write by default."""
    state = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state")
    return Path(os.environ.get("TRIFINGER_LOG_DIR") or state / "trifinger")


def is_locked(path: Path, byte: int = 0) -> bool:
    """True if a process holds a lock of this byte of a file; raises OSError."""
    file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
    with os.fdopen(file, "rb", buffering=0):
        query = struct.pack(FLOCK, fcntl.F_WRLCK, os.SEEK_SET, byte, 1, 0)
        answer = fcntl.fcntl(file, fcntl.F_OFD_GETLK, query)
    return bool(struct.unpack(FLOCK, answer)[0] != fcntl.F_UNLCK)


def open_locks() -> list[tuple[Path, Path, bool]]:
    """Lock files of recorders and robots that processes of this user have open.

    With each, the folder in /proc of its process, and whether that runs a job.
    """
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            # Much quicker than by paths: there may be thousands.
            files = os.listdir(f"{process}/fd")  # noqa: PTH208
            links = [os.readlink(f"{process}/fd/{one}") for one in files]  # noqa: PTH115
            locks = [Path(one) for one in links if one.endswith((".recorder", ".lock"))]
            is_job = bool(locks) and (process / "comm").read_text().strip() == JOB
        except OSError:
            continue  # of another user, or it has just ended
        found += [(lock, process, is_job) for lock in locks]
    return found


def start_of(process: Path) -> int:
    """When a process was started, in seconds since 1970; raises OSError."""
    ticks = int((process / "stat").read_text().rpartition(")")[2].split()[19])
    age = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    return round(time.time() - age)


@lru_cache(maxsize=10_000)
def read_report(path: Path, _changed: int) -> tuple[str, tuple[float, str, int, float]]:
    """Robot; end [s], how its job ended, exit code, duration [s]; raises OSError, ValueError."""
    try:
        if not path.is_file() or path.stat().st_size > LONGEST:
            raise ValueError("it is no file, or too long")
        report: Any = json.loads(path.read_bytes())
        begin, end = (datetime.fromisoformat(report[key]) for key in ("begin", "end_time"))
        kind = report["end"]["kind"] if report["end"]["kind"] in ENDS else "other"
        duration = (end - begin).total_seconds()
        return str(report["robot"]), (end.timestamp(), kind, int(report["exit_code"]), duration)
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no report of a job: {error!r}") from None


class Files:
    """The recordings and jobs of `names`, or of all robots.

    `logs` are folders with logs; those of recorders of this user are found. `jobs` are folders with
    folders of jobs; that of the newest job of this user is found.
    """

    def __init__(self, names: Sequence[str], logs: Iterable[Path], jobs: Iterable[Path]) -> None:
        self._names = names
        self._logs = {folder.absolute() for folder in logs}
        self._unfinished: set[Path] = set()
        self._jobs = list(jobs)
        self._newest_jobs: dict[str, Path] = {}
        self._starts: dict[str, float] = {}

    def _is_wanted(self, robot: str) -> bool:
        return not self._names or robot in self._names

    def read(self, add: Add, guard: Guard) -> None:
        """Reads all files."""
        runners: dict[str, Path] = {}  # processes of jobs, by robot
        for path, process, is_job in open_locks():
            recorded, run = RECORDER.fullmatch(path.name), LOCK.fullmatch(path.name)
            if recorded and not is_job:
                self._unfinished.add(path.parent)
            elif recorded:  # a job has a log of its own, and says itself if it is not complete
                self._newest_jobs[recorded[1]] = path.parents[1] / "job.json"
            elif run and is_job:
                runners[run[1]] = process
        for folder in sorted(self._logs | self._unfinished):
            guard("recording", partial(self._add_logs, add, folder))
        for path in session_folder().glob("trifinger.*.lock"):
            robot = path.name.split(".")[1]
            if self._is_wanted(robot):
                guard("job", partial(self._add_running, add, path, robot, runners.get(robot)))
        self._add_reports(add, guard)

    def _add_logs(self, add: Add, folder: Path) -> None:
        self._unfinished.discard(folder)
        place, disk = str(folder), shutil.disk_usage(folder)
        add("log_folder_free_bytes", disk.free, place)
        add("log_folder_size_bytes", disk.total, place)
        logs: dict[str, list[os.stat_result]] = defaultdict(list)
        for path in folder.iterdir():
            recorder, log = RECORDER.fullmatch(path.name), LOG.fullmatch(path.name)
            if recorder and self._is_wanted(recorder[1]):
                self._unfinished.add(folder)
                add("recorder_up", is_locked(path), recorder[1], place)
            for robot in filter(self._is_wanted, log[1].split("+") if log else ()):
                logs[robot].append(path.stat())
        for robot, found in logs.items():
            last = max(one.st_mtime for one in found)
            add("recording_files", len(found), robot, place)
            add("recording_bytes", sum(one.st_size for one in found), robot, place)
            add("recording_write_timestamp_seconds", last, robot, place)

    def _add_running(self, add: Add, lock: Path, robot: str, runner: Path | None) -> None:
        is_running = is_locked(lock, JOB_BYTE)
        add("job_running", is_running, robot)
        start = self._starts.pop(robot, time.time())  # of one of another user: the first scrape
        if is_running:
            self._starts[robot] = start_of(runner) if runner else start
            add("job_start_timestamp_seconds", self._starts[robot], robot)

    def _add_reports(self, add: Add, guard: Guard) -> None:
        found: dict[str, list[tuple[float, str, int, float]]] = defaultdict(list)

        def read(path: Path) -> None:
            robot, report = read_report(path, path.stat().st_mtime_ns)
            found[robot].append(report)

        paths = {path for folder in self._jobs for path in folder.glob("*/job.json")}
        for path in sorted(paths | set(self._newest_jobs.values())):
            guard("job", partial(read, path))
        for robot in filter(self._is_wanted, found):
            ends = Counter(kind for _, kind, *_ in found[robot])
            for kind in (*ENDS, "other"):
                add("job_reports", ends[kind], robot, kind)
            end, kind, code, duration = max(found[robot])
            add("last_job", {}, robot, kind)
            add("last_job_exit_code", code, robot)
            add("last_job_duration_seconds", duration, robot)
            add("last_job_end_timestamp_seconds", end, robot)
