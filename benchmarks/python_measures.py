# SPDX-License-Identifier: BSD-3-Clause
"""The measures of the Python side. `./run bench` starts this once for each of them.

    python_measures.py MEASURE [--quick] < rows.json

The rows are the ones measured before. Prints JSON, one object per line: what the process may use of
the machine, its progress, its rows.
"""

import argparse
import contextlib
import ctypes
import itertools
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import live_view_measure
import log_view_measure
import numpy as np
import trifinger
from rows import Row
from trifinger.commands import program

sys.path.insert(0, str(Path(__file__).parents[1] / "packages" / "trifinger_compat"))
ORIGINAL_PLATFORM = 6100.0  # steps/s of the original's platform with its cube

# Options of a robot that outlives long breaks of its controller.
TIMEOUT = (
    *("--set", "backend.late_action.max_repeats=1000000"),
    *("--set", "backend.max_skipped_ticks=1000000"),
)


@dataclass(frozen=True)
class Effort:
    """How much to measure."""

    rounds: int
    windows: int
    window_time: float  # [s]
    rows: list[Row]  # rows measured before

    def reference(self, measure: str) -> Row:
        """Returns the row of that name."""
        return next(row for row in self.rows if row.measure == measure)


def report(**message: Any) -> None:
    """Reports a result to `./run bench`."""
    print(json.dumps(message), flush=True)


def in_rounds(rounds: int) -> Iterator[int]:
    """Works like `range`, and reports the progress."""
    for done in range(rounds):
        report(done=done, total=rounds)
        yield done


def control_loop(robot: Any, steps: int) -> float:
    """Returns the steps per second of the basic control loop with a policy that does nothing."""
    action = robot.new_action()
    t = robot.append_desired_action(action)
    begin = time.perf_counter()
    for _ in range(steps):
        robot.get_observation(t)
        t = robot.append_desired_action(action)
    return steps / (time.perf_counter() - begin)


@contextlib.contextmanager
def started(is_ready: Callable[[], bool], *words: str) -> Iterator[int]:
    """Runs `trifinger` in a process of its own. Yields its process id once it is ready."""
    with subprocess.Popen([program.path(), *words], stdout=subprocess.DEVNULL) as process:
        try:
            while not is_ready():
                if process.poll() is not None:
                    raise SystemExit(f"`trifinger {' '.join(words)}` ended with an error")
                time.sleep(0.01)
            yield process.pid
        finally:
            process.terminate()
            process.wait()


@contextlib.contextmanager
def back_end(robot: str, *options: str) -> Iterator[str]:
    """Runs a back-end in a process of its own. Yields its name."""
    name = f"benchmark-{os.getpid()}"

    def is_listed() -> bool:
        return name in (session.name for session in trifinger.list_sessions())

    with started(is_listed, "run", robot, "--name", name, *options):
        yield name


def recorder(name: str, folder: str, *options: str) -> contextlib.AbstractContextManager[int]:
    """Runs a recorder in a process of its own. Yields its process id once its file has begun."""
    before = set(Path(folder).glob("*.mcap"))

    def has_begun() -> bool:
        return set(Path(folder).glob("*.mcap")) != before

    return started(has_begun, "record", name, "-o", folder, *options)


def beside_cpp(measure: str, samples: list[float], unit: str, cpp: Row, **more: Any) -> Row:
    """Makes a row that is compared with its measure in C++, by the ratio of the two."""
    named: dict[str, Any] = {
        "reference": "the same from C++",
        "reference_value": cpp.value,
        "ratio": statistics.median(samples) / cpp.value,
    }
    return Row.of(measure, samples, unit, **named | more)


def loop_row(measure: str, samples: list[float], reach: float, reference: Row) -> Row:
    """Makes a row of the steps per second."""
    holds = statistics.median(samples) >= reach
    reach_text = f">= {reach / 1000:g} k steps/s"
    return beside_cpp(measure, samples, "steps/s", reference, reach=reach_text, holds=holds)


def inline_loop(effort: Effort) -> list[Row]:
    """Runs back-end and user in one thread."""
    with trifinger.fake() as robot:
        samples = [control_loop(robot, 200_000) for _ in in_rounds(effort.rounds)]
    reference = effort.reference("inline loop of the fake robot, C++")
    return [loop_row("inline loop of the fake robot, Python", samples, 700_000, reference)]


def compat(effort: Effort) -> list[Row]:
    """Moves the platform of the original stack, with a cube on its table."""
    from trifinger_simulation import TriFingerPlatform

    def steps_per_second(steps: int) -> float:
        platform = TriFingerPlatform()
        action = platform.Action(position=platform.spaces.robot_position.default)
        begin = time.perf_counter()
        for _ in range(steps):
            t = platform.append_desired_action(action)
            platform.get_robot_observation(t)
            platform.get_camera_observation(t)
        return steps / (time.perf_counter() - begin)

    samples = [steps_per_second(20_000) for _ in in_rounds(effort.rounds)]
    ratio = statistics.median(samples) / ORIGINAL_PLATFORM
    return [
        Row.of(
            "platform of the original stack with cube, Python",
            samples,
            "steps/s",
            reference="the original",
            reference_value=ORIGINAL_PLATFORM,
            ratio=ratio,
            reach=">= 5x",
            holds=ratio >= 5,
        )
    ]


def loop(effort: Effort) -> list[Row]:
    """Runs the back-end in a process of its own, on the same processor, which it inherits."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with back_end("fake", "--non-real-time") as name, trifinger.connect(name) as robot:
        samples = [control_loop(robot, 30_000) for _ in in_rounds(effort.rounds)]
    measure = "loop of the fake robot across processes, one CPU"
    return [loop_row(f"{measure}, Python", samples, 120_000, effort.reference(measure))]


def cpu_time(pid: int) -> float:
    """Returns the processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def lateness_window(robot: trifinger.Frontend, seconds: float) -> Callable[[], float]:
    """Returns what moves a robot for some seconds, and the 99th percentile of its lateness [us]."""
    action = robot.new_action(position=robot.latest_observation().position)
    actions = np.repeat(np.asarray(action), 50)
    robot.append_desired_action(action)

    def window() -> float:
        first = t = robot.current_time_index()
        while t < first + 1000 * seconds:
            t = robot.append_desired_actions(actions)
            robot.wait_until_time_index(t - 20)
        statuses = robot.get_statuses(first + 1, t - 20)
        return float(np.quantile(statuses["lateness"], 0.99)) * 1e-3

    return window


def recorder_rows(effort: Effort) -> list[Row]:
    """Measures a simulated robot with its object at 1 kHz, recorded by a separate process."""
    load: list[float] = []
    recorded: list[float] = []
    alone: list[float] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        # Nobody sends actions while a recorder starts or ends.
        back_end("sim", *TIMEOUT) as name,
        trifinger.connect(name) as robot,
    ):
        window = lateness_window(robot, effort.window_time)
        for _ in in_rounds(effort.windows):
            with recorder(name, folder) as pid:
                cpu_before, before = cpu_time(pid), time.perf_counter()
                recorded.append(window())
                load.append(100 * (cpu_time(pid) - cpu_before) / (time.perf_counter() - before))
            alone.append(window())
    ratio = statistics.median(a / b for a, b in zip(recorded, alone, strict=True))
    mean_load = statistics.mean(load)
    return [
        # The mean is used, because the system counts in hundredths of a second.
        Row(
            "recorder's CPU at 1 kHz, robot and object",
            mean_load,
            min(load),
            max(load),
            "%",
            reach="<= 3 % of one core",
            holds=mean_load <= 3.0,
        ),
        Row.of(
            "1 kHz: lateness while recorded, p99 of windows",
            recorded,
            "us",
            reference="not recorded",
            reference_value=statistics.median(alone),
            ratio=ratio,
            reach="<= 1.2x",
            holds=ratio <= 1.2,
        ),
    ]


def log(effort: Effort) -> list[Row]:
    """Reads a minute of a recorded robot into NumPy."""
    steps = 60_000
    with tempfile.TemporaryDirectory() as folder:
        simulation = trifinger.Simulation()
        with simulation.record(folder), simulation.connect() as robot:
            random = np.random.default_rng(1)
            action = robot.new_action(position=robot.latest_observation().position)
            for torque in random.uniform(-0.2, 0.2, (steps, 9)):
                action.torque = torque
                robot.wait_until_time_index(robot.append_desired_action(action))
            robot.finish()
        samples = []
        for _ in in_rounds(effort.rounds + 1):
            begin = time.perf_counter()
            rows = trifinger.Log(folder).session().read()
            samples.append(time.perf_counter() - begin)
            if len(rows.observations) != steps:
                raise SystemExit("steps are missing in the log")
    del samples[0]
    holds = statistics.median(samples) <= 0.15
    reference = effort.reference("log: 60 s at 1 kHz into arrays, C++")
    measure = "log: 60 s at 1 kHz into NumPy"
    return [beside_cpp(measure, samples, "s", reference, reach="<= 0.15 s", holds=holds)]


def data_set(effort: Effort) -> list[Row]:
    """Exports ten minutes of a robot with three cameras, and encodes as many images alone."""
    from trifinger.log.images import LoggedCameras
    from trifinger_data_sets import lerobot, lerobot_videos
    from trifinger_data_sets.episodes import find_episodes

    is_quick = effort.rounds == 1
    duration, episodes = (1, 2) if is_quick else (20, 30)  # the same session again and again
    rate = 10
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        simulation = trifinger.Simulation("sim_cameras", {"cameras.rate": rate})
        with simulation.record(folder / "logs"), simulation.connect() as robot:
            start = robot.latest_observation().position
            for i in range(1000 * duration):
                action = robot.new_action(position=start + 0.2 * np.sin(0.01 * i))
                robot.wait_until_time_index(robot.append_desired_action(action))
            robot.finish()
        log = trifinger.Log(folder / "logs")
        cameras = LoggedCameras(log.session())
        images = [[one[name] for name in cameras.names] for one in itertools.islice(cameras, 50)]
        encoder = next(lerobot_videos.encoders())
        report(done=0, total=2)
        begin = time.perf_counter()
        result = lerobot.write(find_episodes([log]) * episodes, folder / "set")
        exported = time.perf_counter() - begin
        report(done=1, total=2)
        begin = time.perf_counter()
        alone = folder / "alone"
        videos = [lerobot_videos.Videos(alone, name, rate, encoder) for name in cameras.names]
        for number in range(result.frames):
            for video, image in zip(videos, images[number % len(images)], strict=True):
                video.add(image)
        for video in videos:
            video.close()
        encoded = time.perf_counter() - begin
    ratio = exported / encoded
    return [
        Row.of(
            "LeRobotDataset of 10 minutes with three cameras at 10 Hz",
            [exported],
            "s",
            reference="encoding the films alone",
            reference_value=encoded,
            ratio=ratio,
            reach="<= 1.5x",
            holds=ratio <= 1.5,
            remark=f"{result.frames} rows; films by {encoder}",
        )
    ]


def log_view(effort: Effort) -> list[Row]:
    """Opens a log of an hour in the viewer."""
    is_quick = effort.rounds == 1
    return log_view_measure.measure(in_rounds(1 if is_quick else 5), is_quick)


def environment(effort: Effort) -> list[Row]:
    """Measures the actions per second of the single environment."""
    from trifinger.environments import Environment

    robot = Environment("reach")
    random = np.random.default_rng(1)
    actions = np.clip(np.cumsum(0.2 * random.normal(size=(100, 9)), axis=0), -1, 1)
    samples = []
    for episode in in_rounds(effort.rounds):
        robot.reset(seed=0, options={"episode": episode})
        begin = time.perf_counter()
        for action in actions.astype(np.float32):
            robot.step(action)
        samples.append(len(actions) / (time.perf_counter() - begin))
    reference = effort.reference("environment, reach at 50 Hz, C++")
    ratio = reference.value / statistics.median(samples)
    note = "the same from C++; the ratio is that of the times"
    more = {"reference": note, "ratio": ratio, "reach": "<= 1.3x", "holds": ratio <= 1.3}
    measure = "environment, reach at 50 Hz, Python"
    return [beside_cpp(measure, samples, "actions/s", reference, **more)]


def python_task(effort: Effort) -> list[Row]:
    """Steps 64 robots of the same task in Python and in C++, in turns."""
    from trifinger.environments import Options, VectorEnvironment
    from trifinger.tasks import Task, View

    class Reach(Task):
        options = Options(action="position", duration=2.0)
        goal_low = (-0.05, -0.05, 0.05) * 3
        goal_high = (0.05, 0.05, 0.15) * 3

        def achieve(self, view: View) -> np.ndarray:
            return view.tips.reshape(len(view.tips), 9)

        def reward(self, achieved: np.ndarray, desired: np.ndarray) -> np.ndarray:
            apart = np.linalg.norm((achieved - desired).reshape(-1, 3, 3), axis=2)
            return -apart.mean(axis=1)

        def is_success(self, achieved: np.ndarray, desired: np.ndarray) -> np.ndarray:
            apart = np.linalg.norm((achieved - desired).reshape(-1, 3, 3), axis=2)
            return (apart <= 0.02).all(axis=1)

    robots = {task: VectorEnvironment(task, 64) for task in (Reach(), "reach")}
    random = np.random.default_rng(1)
    walks = np.cumsum(0.2 * random.normal(size=(100, 64, 9)), axis=0)
    actions = np.clip(walks, -1, 1).astype(np.float32)
    speeds: dict[object, list[float]] = {task: [] for task in robots}
    for _ in in_rounds(effort.rounds):
        for task, vector in robots.items():
            vector.reset(seed=0)
            begin = time.perf_counter()
            for rows in actions:
                vector.step(rows)
            speeds[task].append(actions[..., 0].size / (time.perf_counter() - begin))
    mine, cpp = speeds.values()
    ratio = statistics.median(a / b for a, b in zip(mine, cpp, strict=True))
    return [
        Row.of(
            "own task in Python, 64 x reach at 50 Hz",
            mine,
            "actions/s",
            reference="the task in C++, in turns; median of the ratios",
            reference_value=statistics.median(cpp),
            ratio=ratio,
            reach=">= 0.7x",
            holds=ratio >= 0.7,
        )
    ]


def live_view(effort: Effort) -> list[Row]:
    """Shows a simulated robot with its object, which moves at 1 kHz, in three viewers."""
    rounds = -(-effort.windows // live_view_measure.WINDOWS)
    with back_end("sim", *TIMEOUT) as name:
        with trifinger.connect(name) as robot:
            window = lateness_window(robot, effort.window_time)
            lateness = live_view_measure.lateness_row(name, in_rounds(rounds), window)
        is_quick = effort.rounds == 1
        with moved(name):
            return [lateness, *live_view_measure.picture_rows(name, is_quick=is_quick)]


@contextlib.contextmanager
def moved(name: str) -> Iterator[None]:
    """Moves a robot to and fro, in a process of its own."""
    with subprocess.Popen([sys.executable, "-c", MOVE, name]) as process:
        try:
            yield
        finally:
            process.kill()


MOVE = """
import sys, numpy as np, trifinger
robot = trifinger.connect(sys.argv[1])
home = robot.latest_observation().position
t = 0
while True:
    actions = np.repeat(np.asarray(robot.new_action()), 50)
    actions["position"] = home + 0.2 * np.sin((t + np.arange(50))[:, None] / 200)
    t = robot.append_desired_actions(actions)
    robot.wait_until_time_index(t - 20)
"""

MEASURES: dict[str, Callable[[Effort], list[Row]]] = {
    "python_loop": loop,
    "python_inline_loop": inline_loop,
    "python_environment": environment,
    "python_task": python_task,
    "compat": compat,
    "python_log": log,
    "data_set": data_set,
    "log_view": log_view,
    "live_view": live_view,
    "recorder": recorder_rows,
}


def process_state() -> dict[str, Any]:
    """Reports what this process may use of the machine; harness.cpp does the same in C++."""
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return {
        "processors": status["Cpus_allowed_list"].strip(),
        "scheduler": os.sched_getscheduler(0),
        "priority": os.sched_getparam(0).sched_priority,
        "nice": os.getpriority(os.PRIO_PROCESS, 0),
        "locked": int(status["VmLck"].split()[0]),
    }


def main() -> int:
    """Runs one measure."""
    report(process=process_state())
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("measure", choices=MEASURES)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    # The process ends when its `./run bench` ends, and then ends whatever it has started.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    set_parent_death_signal = 1
    ctypes.CDLL(None).prctl(set_parent_death_signal, signal.SIGTERM)
    rows = [Row(**row) for row in json.load(sys.stdin)]
    effort = Effort(1, 1, 0.5, rows) if arguments.quick else Effort(15, 30, 2.0, rows)
    for row in MEASURES[arguments.measure](effort):
        report(row=row.json())
    return 0


if __name__ == "__main__":
    sys.exit(main())
