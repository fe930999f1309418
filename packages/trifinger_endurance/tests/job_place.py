# SPDX-License-Identifier: BSD-3-Clause
"""A place for the tests of `trifinger job`, in which root's tests run everything as nobody."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from conftest import BUILD

PROGRAM = BUILD / "apps/trifinger-job"
NOBODY = 65534
# A job never runs as root, so root's tests run robots and jobs as nobody.
USER = NOBODY if os.geteuid() == 0 else None
# The interpreter of the tests may lie where only root can start it; Debian's lies elsewhere.
INTERPRETER = sys.executable if USER is None else "/usr/bin/python3"
# The package under test need not be installed.
PACKAGES = f"PYTHONPATH={os.pathsep.join(path for path in sys.path if Path(path).is_dir())}"
PYTHON = ("--env", PACKAGES, "--", INTERPRETER)
# A job has a /tmp and a /var/tmp of its own, so it cannot import the package of a clone there.
SEES_THE_PACKAGE = BUILD.parts[1] != "tmp" and BUILD.parts[1:3] != ("var", "tmp")
HIDDEN = "this clone lies in /tmp or /var/tmp, of which a job sees nothing"


def may_be_used() -> bool:
    """Whether the user of the tests can start the programs under test."""
    words = ["env", PACKAGES, INTERPRETER, "-c", "import trifinger"]
    try:
        done = subprocess.run(words, user=USER, group=USER, capture_output=True)
        help_ = subprocess.run([PROGRAM, "--help"], user=USER, group=USER, capture_output=True)
    except PermissionError:
        return False
    return done.returncode == 0 and help_.returncode == 0


needs_programs = pytest.mark.skipif(
    not PROGRAM.exists() or not may_be_used(),
    reason="nobody may not start the programs under test",
)


class Place:
    """A folder that the user of the tests may use, and jobs in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.number = 0

    def words(
        self, *options: str, robot: str = "shared", test: str = "hold", grace: str = "1s"
    ) -> list[str]:
        """The command of a job; its folder is `self.job`."""
        self.number += 1
        words = ["run", "--robot", robot, "--self-test", test, "--grace", grace]
        return [str(PROGRAM), *words, "--output", str(self.job), *options]

    @property
    def job(self) -> Path:
        return self.folder / "jobs" / str(self.number)

    @property
    def report(self) -> dict[str, Any]:
        return dict(json.loads((self.job / "job.json").read_text()))

    def run(self, *options: str, expect: int, **others: str) -> dict[str, Any]:
        """Runs a job to its end and returns its report."""
        words = self.words(*options, **others)
        done = subprocess.run(
            words, user=USER, group=USER, extra_groups=groups(), capture_output=True, text=True
        )
        assert done.returncode == expect, done.stdout[-3000:] + done.stderr
        report = self.report
        assert report["exit_code"] == expect
        assert not processes_in(self.job / "work")
        return report


def groups() -> Sequence[int] | None:
    return None if USER is None else []


@contextmanager
def place() -> Iterator[Place]:
    """Makes the place, and names its folders in the environment of the tests."""
    folder = Path(tempfile.mkdtemp(prefix="trifinger_job_"))
    try:
        folder.chmod(0o755)
        for name in ("sessions", "logs", "jobs"):
            (folder / name).mkdir()
            (folder / name).chmod(0o1777)
        os.environ["TRIFINGER_SESSION_DIR"] = str(folder / "sessions")
        os.environ["TRIFINGER_LOG_DIR"] = str(folder / "logs")
        yield Place(folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def processes_in(folder: Path) -> list[int]:
    """The processes whose working folder is in `folder`."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if (process / "cwd").readlink().is_relative_to(folder):
                found.append(int(process.name))
        except OSError:  # it has ended, or belongs to somebody else
            continue
    return found
