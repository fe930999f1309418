# SPDX-License-Identifier: BSD-3-Clause
"""Runs the examples, in both languages: `./run examples [NAME ...]`.

A NAME is the start of the name of an example: 05, or 05_own_robot. Some examples need robots that
already run: they get simulated ones. That of the first example is stopped after some steps.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import trifinger
from trifinger.commands import program

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
CONTROL_LOOP = "01_basic_control_loop"
TWO_ROBOTS = "16_two_robots"
STEPS = 2000  # steps of the control loop before its robot is stopped


def commands(name: str, programs: Path) -> Iterator[tuple[str, list[str]]]:
    """Yields language and command of each version of an example."""
    yield "C++", [str(programs / name)]
    yield "Python", [sys.executable, str(EXAMPLES / f"{name}.py")]


@contextmanager
def simulated_robot(robot: str, *options: str) -> Iterator[None]:
    """Runs a robot with these options of `trifinger run`."""
    words = [program.path(), "run", robot, *options]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        try:
            if not any("waits for a user" in line for line in process.stdout or ()):
                raise trifinger.Error(f"{' '.join(words)} ended at once")
            yield
        finally:
            process.terminate()
            process.communicate()


def run_control_loop(command: Sequence[str]) -> tuple[int, str]:
    """Runs the control loop on a robot that is stopped after some steps.

    The robot waits for actions, so that a busy machine does no harm.
    """
    with (
        simulated_robot("sim", "--non-real-time"),
        subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as process,
    ):
        try:
            with trifinger.observe("sim") as robot:
                robot.wait_until_time_index(STEPS)
        except trifinger.RobotStopped:  # the example has failed, and its output says why
            pass
        subprocess.run([program.path(), "stop", "sim"], check=True, stdout=subprocess.DEVNULL)
        output, _ = process.communicate()
    return process.returncode, output


def run_two_robots(command: Sequence[str]) -> tuple[int, str]:
    """Runs the example with two robots in real time."""
    with ExitStack() as robots:
        for robot in ("sim", str(EXAMPLES / "arm.yml")):
            robots.enter_context(simulated_robot(robot))
        return run_alone(command)


def run_alone(command: Sequence[str]) -> tuple[int, str]:
    """Runs an example that needs no other program."""
    done = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    return done.returncode, done.stdout


def main(words: Sequence[str]) -> int:
    """Runs the examples in `words`, or all; returns 0 if all of them succeed."""
    programs = Path(words[0])
    names = sorted(path.stem for path in EXAMPLES.glob("*.py"))
    chosen = [name for name in names if name.startswith(tuple(words[1:] or ("",)))]
    if not chosen:
        print(f"./run examples: there are {', '.join(names)}", file=sys.stderr)
        return 2
    os.environ["PATH"] = f"{programs}:{os.environ['PATH']}"  # 05 in Python starts the C++ program
    failed = []
    # Robots of the examples must not meet other robots on this machine.
    with tempfile.TemporaryDirectory() as folder:
        os.environ["TRIFINGER_SESSION_DIR"] = folder
        for name in chosen:
            for language, command in commands(name, programs):
                print(f"{name}, {language}", flush=True)
                began = time.monotonic()
                run = {CONTROL_LOOP: run_control_loop, TWO_ROBOTS: run_two_robots}
                status, output = run.get(name, run_alone)(command)
                print("".join(f"    {line}\n" for line in output.splitlines()), end="")
                if status != 0:
                    failed.append(f"{name}, {language}")
                    print(f"  FAILED with exit status {status}", end="")
                print(f"  {time.monotonic() - began:.1f} s", flush=True)
    print(f"{2 * len(chosen) - len(failed)} examples succeeded", end="")
    print(f"; these failed: {'; '.join(failed)}" if failed else "")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
