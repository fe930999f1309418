# SPDX-License-Identifier: BSD-3-Clause
"""Gives every test its own folders. pytest's faulthandler_timeout ends tests that hang."""

import contextlib
import os
import secrets
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from hypothesis import settings
from trifinger import _trifinger

pytest_plugins = ["viewing"]  # a fixture

settings.register_profile("trifinger", deadline=None)  # machines may be busy
settings.load_profile("trifinger")

# A shell without job control ignores SIGINT in background processes, and everything that the tests
# start would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The build folder that contains the module under test.
BUILD = Path(_trifinger.__file__).parents[2]
PROGRAM = os.environ.get("TRIFINGER_PROGRAM", str(BUILD / "apps/trifinger"))

# Options of environments: everything that may differ from simulation to simulation.
ALL_THAT_VARIES = {
    "object_mass": (0.5, 2.0),
    "friction": (0.5, 1.5),
    "pair_friction": {"tip_object": (0.5, 1.5)},
    "contact_time": (1.0, 2.0),
    "rotor_inertia": (0.8, 1.2),
    "joint_damping": (0.5, 2.0),
    "joint_friction": (0.0, 0.01),
    "stop_margin": (0.9, 1.1),
    "tip_radius": (0.9, 1.1),
    "motor_gain": (0.9, 1.1),
    "torque_delay": (0, 3),
    "measurement_delay": (0, 3),
    "backlash": (0.0, 0.01),
    "velocity_noise": 0.01,
}

FAKE_BACKEND = """
import sys, trifinger
with trifinger.run_fake(sys.argv[1], **eval(sys.argv[2])):
    print("ready", flush=True)
    sys.stdin.read()
"""

# A robot from a file, with two motors, a joint without one and a ball.
ARM = """<mujoco model="arm">
  <compiler angle="radian"/>
  <option timestep="0.002"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" range="-2 2" damping="0.2" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02"/>
      <body name="lower" pos="0 0 -0.2">
        <joint name="elbow" axis="0 1 0" range="-2.5 2.5" damping="0.2" armature="0.01"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02"/>
        <site name="hand" pos="0 0 -0.2"/>
        <body name="flap" pos="0 0 -0.2">
          <joint name="flap" axis="1 0 0" damping="0.01" stiffness="0.5" armature="0.001"/>
          <geom type="box" size="0.01 0.02 0.005" pos="0 0.02 0"/>
        </body>
      </body>
    </body>
    <body name="ball" pos="0.5 0 1"><freejoint/><geom type="sphere" size="0.05"/></body>
  </worldbody>
  <actuator>
    <motor joint="elbow" gear="4" ctrllimited="true" ctrlrange="-2 2"/>
    <position joint="shoulder" kp="20" kv="1" forcerange="-9 9"/>
  </actuator>
</mujoco>
"""

ARM_CONFIGURATION = """name: arm
driver: simulation
robot:
  mjcf: arm.xml
  initial_position: {elbow: 0.3}
safety:
  every_joint: {safety_kd: 0.3, max_velocity: 3, braking: 4, default_kp: 20, default_kd: 1}
  shoulder: {soft_lower: -1.8, soft_upper: 1.8}
  elbow: {soft_lower: -2.2, soft_upper: 2.2, max_kp: 40}
"""


@pytest.fixture
def arm(tmp_path: Path) -> str:
    """The configuration of the robot ARM, a file."""
    (tmp_path / "arm.xml").write_text(ARM)
    (tmp_path / "arm.yml").write_text(ARM_CONFIGURATION)
    return str(tmp_path / "arm.yml")


def output_of(
    *command: str | Path,
    env: dict[str, str] | None = None,
    cwd: Path | None = None,
    succeeds: bool = True,
) -> str:
    """Runs a command, which succeeds or fails as expected, and returns what it said."""
    done = subprocess.run(
        command,
        cwd=cwd,
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert (done.returncode == 0) == succeeds, f"{command}\n{done.stdout}"
    return done.stdout


def patient(configuration: Path, period: float, folder: Path) -> Path:
    """The same robot, in real time, for a machine that may stall for as long as it likes."""
    path = folder / f"patient_{configuration.name}"
    path.write_text(f"extends: {configuration}\n{patient_backend(period)}")
    return path


def patient_backend(period: float) -> str:
    """The section of a configuration for a machine that may stall for as long as it likes."""
    return f"""backend:
  mode: real_time
  period: {period}
  history: 16384
  access: owner
  late_action: {{policy: repeat, max_repeats: 1000000}}
  max_skipped_ticks: 1000000
  max_late_steps: 1000000
  max_measurement_age: .inf
  max_rejected_actions: 10
  first_action_timeout: .inf
"""


def assert_steady(session: trifinger.LoggedSession) -> None:
    """No step of a session in real time is missing, and each keeps the phase of its period."""
    assert session.is_real_time
    assert session.gaps == []
    assert session.time_index.tolist() == list(range(len(session.time_index)))
    statuses = session.statuses
    # The last status says that the session has ended; it may have no tick of its own.
    ticks, skipped = statuses["tick"][:-1], statuses["skipped_ticks"][:-1]
    np.testing.assert_array_equal(np.diff(ticks), 1 + skipped[1:])
    # A step may be late by as much as the machine likes. Whatever its lateness, the deadlines of
    # the first half and of the second half of the session have one phase.
    period = round(session.period * 1e9)
    begins = statuses["time"][:-1] - statuses["lateness"][:-1] - ticks * period
    half = len(begins) // 2
    assert abs(begins[:half].min() - begins[half:].min()) < period


def free_port() -> int:
    """A port that nobody gets who asks for any, so it is still free when a program takes it."""
    lowest_of_any = int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split()[0])
    while True:
        port = lowest_of_any // 2 + secrets.randbelow(lowest_of_any // 2)
        # Another program may have this port; then the next one is tried.
        with socket.socket() as listener, contextlib.suppress(OSError):
            listener.bind(("127.0.0.1", port))
            return port


class Child:
    """A process that has printed "ready"; it ends when its input ends."""

    def __init__(self, *command: str) -> None:
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        line = self.read_line()
        if line != "ready":
            _, errors = self.process.communicate()
            raise AssertionError(f"{command[:3]} did not begin: {line}\n{errors}")

    @property
    def pid(self) -> int:
        return self.process.pid

    def read_line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().rstrip("\n")

    def write_line(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def kill(self) -> None:
        """Kills the process as `kill -9` does, and waits for its end."""
        self.process.kill()
        self.process.communicate()

    def finish(self) -> tuple[int, str]:
        """Ends its input, waits for the end and returns its exit status and what it said."""
        output, errors = self.process.communicate()
        return self.process.returncode, output + errors


class Running:
    """A running program, on request as another user. Its output is read by lines."""

    def __init__(
        self,
        *arguments: str,
        user: int | None = None,
        typed: bool = False,
        program: Sequence[str] = (PROGRAM,),
    ) -> None:
        self.process = subprocess.Popen(
            [*program, *arguments],
            stdin=subprocess.PIPE if typed else None,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            user=user,
            group=user,
            extra_groups=None if user is None else [],
        )

    def read_until(self, *texts: str) -> list[str]:
        """Reads until there was a line with each text, in any order; returns all that was read."""
        assert self.process.stdout is not None
        seen = []
        missing = set(texts)
        for line in self.process.stdout:
            seen.append(line)
            missing = {text for text in missing if text not in line}
            if not missing:
                return seen
        raise AssertionError(f"it ended without {missing}:\n{''.join(seen)}")

    def wait_for(self, text: str) -> str:
        """Reads up to the line that contains `text` and returns that line."""
        return self.read_until(text)[-1]

    def end(self, number: signal.Signals = signal.SIGTERM) -> tuple[int, str]:
        """Sends a signal, waits for the end, returns the exit status and the rest of the output."""
        self.process.send_signal(number)
        output, _ = self.process.communicate()
        return self.process.returncode, output


StartChild = Callable[..., Child]
StartProgram = Callable[..., Running]

EMULATED = "trifinger_edu_emulated"
# Machines of tests stall for longer than any robot's machine may.
PATIENT = [
    *("--set", "safety.plausibility.stuck_time=.inf"),
    *("--set", "safety.plausibility.max_position_rate=.inf"),
    *("--set", "safety.plausibility.max_velocity_error=.inf"),
    *("--set", "backend.late_action.policy=repeat"),
    *("--set", "backend.late_action.max_repeats=1000000"),
    *("--set", "backend.max_skipped_ticks=1000000"),
]
PATIENT_DCLAW = PATIENT[6:]
PATIENT_FAKE = ("--set", "max_repeats=1000000", "--set", "max_skipped=1000000")
PATIENT_BOARDS = [
    *PATIENT,
    *("--set", "boards.silent_after=3"),
    *("--set", "boards.receive_timeout=10"),
    *("--set", "boards.move_time=1"),
]


@pytest.fixture
def patient_arm(tmp_path: Path) -> Path:
    """The configuration of an arm of two joints from a file, which forgives being late."""
    arm = Path(__file__).parent / "examples" / "arm.yml"
    path = tmp_path / "patient_arm.yml"
    path.write_text(
        f"extends: {arm}\n"
        "backend:\n"
        "  {mode: real_time, period: 0.001, history: 16384, access: owner,\n"
        "   late_action: {policy: repeat, max_repeats: 1000000}, max_skipped_ticks: 1000000,\n"
        "   max_late_steps: 1000000, max_measurement_age: .inf, max_rejected_actions: 10,\n"
        "   first_action_timeout: .inf}\n"
    )
    return path


@pytest.fixture(autouse=True)
def session_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "sessions"
    folder.mkdir()
    monkeypatch.setenv("TRIFINGER_SESSION_DIR", str(folder))
    return folder


@pytest.fixture(autouse=True)
def log_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "logs"
    monkeypatch.setenv("TRIFINGER_LOG_DIR", str(folder))
    return folder


@pytest.fixture
def start_child() -> Iterator[StartChild]:
    """Starts processes that do not outlive the test."""
    children: list[Child] = []

    def start(*command: str) -> Child:
        children.append(Child(*command))
        return children[-1]

    yield start
    for child in children:
        if child.process.poll() is None:
            child.kill()


@pytest.fixture
def start_python(start_child: StartChild) -> StartChild:
    """Runs a Python program, given as text, in a process of its own."""

    def start(program: str, *arguments: str) -> Child:
        return start_child(sys.executable, "-c", program, *arguments)

    return start


@pytest.fixture
def start_fake(start_python: StartChild) -> StartChild:
    """Runs the back-end of a fake robot in a process of its own, with the options of run_fake()."""

    def start(name: str, **options: object) -> Child:
        return start_python(FAKE_BACKEND, name, repr(options))

    return start


@pytest.fixture
def start_foreign(start_child: StartChild) -> StartChild:
    """Runs a back-end with a robot that Python has never heard of."""

    def start(*arguments: str) -> Child:
        return start_child(str(BUILD / "tests/python/foreign_backend"), *arguments)

    return start


@pytest.fixture
def start_program() -> Iterator[StartProgram]:
    """Starts the program `trifinger`, or another one; it does not outlive the test."""
    started: list[Running] = []

    def start(*arguments: str, **options: Any) -> Running:
        started.append(Running(*arguments, **options))
        return started[-1]

    yield start
    for program in started:
        with program.process:  # closes what is left open, and waits
            program.process.kill()


@pytest.fixture(params=["simulated", "emulated"])
def start_robot(request: pytest.FixtureRequest, start_program: StartProgram) -> StartProgram:
    """Starts a robot with a cube in real time: a simulated one, or one on emulated motor boards.

    Nothing but its configuration tells the two apart. Its name and settings are the arguments, and
    what else `trifinger run` shall know. `in_haste`: a simulated one does not wait for real time.
    """

    def start(
        name: str, *settings: str, more: Sequence[str] = (), in_haste: bool = False
    ) -> Running:
        if request.param == "emulated":
            words = [EMULATED, "--name", name, *PATIENT_BOARDS, *settings]
            start_program("emulate", *words).wait_for("emulated boards are on")
        else:
            words = ["sim", "--name", name, *PATIENT, *settings]
            words += ["--non-real-time"] if in_haste else []
        robot = start_program("run", *words, *more)
        robot.wait_for("waits for a user")
        return robot

    return start


def diverging_state(simulation: trifinger.Simulation | None = None) -> bytes:
    """A saved state of "sim", or of `simulation`, whose cube has a speed beyond all measure."""
    simulation = simulation or trifinger.Simulation()
    position = np.array([0.05, 0.04, 0.0625])
    simulation.place_object("cube", position.tolist())
    state = bytearray(simulation.save())
    # The bytes of the pose give its place; after it come the speeds of nine joints and of the cube.
    place = state.index(position.tobytes())
    speed = np.ndarray((), np.float64, state, place + (7 + 9) * 8)
    speed[()] = 1e300
    return bytes(state)


@pytest.fixture
def robot() -> Iterator[trifinger.Frontend]:
    """A fake robot inside the test."""
    robot = trifinger.fake()
    yield robot
    robot.close()
