# SPDX-License-Identifier: BSD-3-Clause
"""Steps: commands that print one line each and leave their whole output in build/logs.

      build                                  ok      12.3 s

On a terminal, a step that runs shows its progress. If it fails, the end of its output follows.
"""

import contextlib
import itertools
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import ClassVar

ROOT = Path(__file__).resolve().parents[2]
LOGS = ROOT / "build" / "logs"

Command = Sequence[str]

# What ninja and ctest print before each target and test.
PROGRESS = re.compile(r"^\[ *\d+/\d+\]|^ *\d+/\d+(?= Test)", re.MULTILINE)
SANITIZER = re.compile(r"runtime error: |ERROR: AddressSanitizer|WARNING: ThreadSanitizer")
# The lines of pytest, GoogleTest, ctest, compilers and clang-tidy that name what failed.
REASON = re.compile(
    r"^FAILED |^ERROR [a-z]|^\[  FAILED  \] [^ ]+\."
    r"|^\s+\d+ - .*\((Failed|Timeout|SEGFAULT|Subprocess aborted)\)|: (error|fatal error): "
)
# The first line of what is printed when a process ends at once, or a watchdog ends it.
CRASH = re.compile(r"^Fatal Python error: |^Timeout \(\d|ERROR: AddressSanitizer")


class StepFailed(Exception):
    """A step failed that others need. Its line is printed already."""


class NotRun(Exception):
    """A step or stage cannot run on this machine; the sentence says why."""


def duration(seconds: float) -> str:
    """Returns a duration for people."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    return f"{int(seconds) // 60} min {int(seconds) % 60:02} s"


@contextlib.contextmanager
def _sigterm_later() -> Iterator[None]:
    """Lets a SIGTERM wait, so that it meets a command that is known and can be ended."""
    came = False

    def note(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        nonlocal came
        came = True

    handler = signal.signal(signal.SIGTERM, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, handler)
        if came:
            signal.raise_signal(signal.SIGTERM)


class Step:
    """A command that runs."""

    def __init__(
        self,
        group: str,
        label: str,
        command: Command,
        variables: Mapping[str, str],
        *,
        beside: bool,
    ) -> None:
        """Starts the command, with `variables` added to the environment."""
        LOGS.mkdir(parents=True, exist_ok=True)
        self.group = group
        self.label = label
        self.log = LOGS / f"{group}-{re.sub('[^A-Za-z0-9+-]', '-', label)}.log"
        self._begin = time.time()
        with self.log.open("wb") as output:
            self._process = subprocess.Popen(
                command,
                cwd=ROOT,
                env={**os.environ, **variables},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                # Ctrl-C reaches our process group, but not what runs beside it: `stop` ends that.
                process_group=0 if beside else None,
            )
        self._beside = beside

    def end(self) -> None:
        """Waits for the command and prints the step's line."""
        if sys.stdout.isatty():
            while self._runs():
                self._show_progress()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(1)
            print("\r\x1b[K", end="")
        self._process.wait()
        # A step beside others has ended earlier; the last thing that it did was to write.
        end = self.log.stat().st_mtime if self._beside else time.time()
        verdict = "ok    " if self.succeeded else "FAILED"
        print(f"  {self.label:38} {verdict}  {duration(end - self._begin)}", flush=True)

    def wait(self) -> None:
        """Waits until the command ends by itself, unless it runs beside others."""
        if not self._beside:
            self._process.wait()

    def stop(self) -> None:
        """Ends the command with all its processes; without effect if it has ended."""
        if self._runs():
            if self._beside:
                os.killpg(self._process.pid, signal.SIGTERM)
            else:
                self._process.terminate()
            self._process.wait()

    @property
    def succeeded(self) -> bool:
        """Says whether the command has ended with status 0."""
        return self._process.returncode == 0

    @property
    def output(self) -> str:
        """What the command has written so far."""
        return self.log.read_text(errors="replace")

    def last_line(self, pattern: str = "") -> str:
        """Returns the last line of the output that contains `pattern`; empty if there is none."""
        lines = (line for line in reversed(self.output.splitlines()) if re.search(pattern, line))
        return next(lines, "")

    def _runs(self) -> bool:
        return self._process.poll() is None

    def _show_progress(self) -> None:
        with self.log.open("rb") as log:
            log.seek(max(0, self.log.stat().st_size - 2000))
            end = log.read().decode(errors="replace")
        progress = ["", *PROGRESS.findall(end)][-1].strip()
        passed = duration(time.time() - self._begin)
        print(f"\r  {self.label:38} {progress:12} {passed} ", end="", flush=True)


class Steps:
    """The steps of one group, such as a build; each group knows what failed in all of them."""

    failures: ClassVar[list[str]] = []
    """A line for each step that failed, followed by lines of its output that name reasons."""
    running: ClassVar[list[Step]] = []

    def __init__(self, group: str) -> None:
        """Names the group; the logs of its steps begin with it."""
        self.group = group

    def begin(self, label: str, command: Command, **variables: str) -> Step:
        """Starts a step that runs beside others; `end` waits for it."""
        return self._start(label, command, variables, beside=True)

    def end(self, step: Step) -> None:
        """Waits for the step, prints its line and, if it failed, the end of its output."""
        step.end()
        Steps.running.remove(step)
        if not step.succeeded:
            self._report(step)

    def run(self, label: str, command: Command, **variables: str) -> Step:
        """Runs a step that others need and returns it.

        Raises:
            StepFailed: if the command failed
        """
        step = self.check(label, command, **variables)
        if not step.succeeded:
            raise StepFailed
        return step

    def check(self, label: str, command: Command, **variables: str) -> Step:
        """Runs a step and returns it, also if it failed."""
        step = self._start(label, command, variables, beside=False)
        self.end(step)
        return step

    @staticmethod
    def wait() -> None:
        """Waits until the step that runs ends by itself."""
        for step in Steps.running:
            step.wait()

    @staticmethod
    def stop() -> None:
        """Ends all steps that still run."""
        for step in Steps.running:
            step.stop()

    def _start(
        self, label: str, command: Command, variables: Mapping[str, str], *, beside: bool
    ) -> Step:
        with _sigterm_later():
            step = Step(self.group, label, command, variables, beside=beside)
            Steps.running.append(step)
        return step

    def _report(self, step: Step) -> None:
        lines = step.output.splitlines()
        # The report of a sanitizer may begin before the last lines.
        shown = [line for line in lines if SANITIZER.search(line)][:5] + lines[-80:]
        log = step.log.relative_to(ROOT)
        for line in [*shown, f"the whole output: {log}"]:
            print(f"    | {line}")
        Steps.failures.append(f"{step.group}, {step.label}: {log}")
        reasons = sorted({line.strip()[:200] for line in lines if REASON.search(line)})
        Steps.failures.extend(f"  {reason}" for reason in reasons[:10])
        from_crash = itertools.dropwhile(lambda line: not CRASH.search(line), lines)
        Steps.failures.extend(f"  | {line[:200]}" for line in itertools.islice(from_crash, 30))
