# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger job`: whatever a program does, its job ends and the robot is whole."""

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import PATIENT, Running, StartProgram
from job_place import (
    HIDDEN,
    INTERPRETER,
    NOBODY,
    PROGRAM,
    PYTHON,
    SEES_THE_PACKAGE,
    USER,
    Place,
    groups,
    needs_programs,
    place,
    processes_in,
)

pytestmark = needs_programs

MEMORY = Path("/dev", "shm")
DRIVE = """
import os, time, trifinger
robot = trifinger.connect(os.environ["TRIFINGER_ROBOT"])
hold = robot.new_action(position=robot.latest_observation().position)
for _ in range(100):
    t = robot.append_desired_action(hold)
    robot.get_observation(t)
"""


@pytest.fixture
def a_place(monkeypatch: pytest.MonkeyPatch) -> Iterator[Place]:
    for name in ("TRIFINGER_SESSION_DIR", "TRIFINGER_LOG_DIR"):
        monkeypatch.setenv(name, "")  # so that it is restored
    with place() as found:
        yield found


@pytest.fixture
def shared(a_place: Place, start_program: StartProgram) -> Place:
    """A place with a robot called "shared" that waits for its users."""
    robot = start_program("run", "sim", "--name", "shared", "--non-real-time", user=USER)
    robot.wait_for("waits for a user")
    return a_place


def python(text: str) -> tuple[str, ...]:
    if not SEES_THE_PACKAGE:
        pytest.skip(HIDDEN)
    return (*PYTHON, "-c", text)


def shell(text: str) -> tuple[str, ...]:
    return ("--", "sh", "-c", text)


def test_a_program_drives_the_robot_and_leaves_a_report(shared: Place) -> None:
    report = shared.run(*python(DRIVE + "robot.finish()\nprint('done')"), expect=0, test="joints")
    assert report["end"]["kind"] == "exited"
    assert report["driving"]["steps"] == 100
    assert report["driving"]["sessions"] == 1
    assert report["driving"]["faults"] == []
    for preparation in (report["before"], report["after"]):
        assert preparation["is_fit"]
        assert preparation["self_test"]["passes"]
        assert preparation["self_test"]["steps"] > 9 * 2000
        # The load is the weight that the model knows.
        for joint in preparation["self_test"]["joints"]:
            assert joint["load"] == pytest.approx(joint["weight"], abs=0.01)
    assert (shared.job / "output.txt").read_text() == "done\n"
    assert list((shared.job / "log").glob("*.mcap"))


LEARN = """
from trifinger.commands.learn import main
settings = ["--set", "duration=0.4", "--set", "random_actions=10"]
raise SystemExit(main(["reach", "--shared", "--robot", "shared", "--episodes", "4", *settings]))
"""


@pytest.mark.slow
def test_a_robot_learns_in_a_job(shared: Place) -> None:
    shared.run("--time", "10min", *python(LEARN), expect=0)
    folder = shared.job / "work/reach"
    tally = json.loads((folder / "tally.json").read_text())["tally"]
    assert tally["episodes"] == 4
    assert tally["updates"] > 0
    assert (folder / "reach.policy").exists()


def test_a_program_gets_its_folder_and_little_else(
    shared: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OF_THE_SUPERVISOR", "1")
    shared.run("--env", "ADDED=yes", *shell("env; pwd; cat; echo x > mine"), expect=0)
    output = (shared.job / "output.txt").read_text()
    assert "OF_THE_SUPERVISOR" not in output
    assert "ADDED=yes" in output
    assert "TRIFINGER_ROBOT=shared" in output
    assert output.endswith(f"{shared.job / 'work'}\n")
    assert (shared.job / "work/mine").exists()


HOSTILE = {
    "memory": (
        ("--memory", "200MB"),
        f"exec {INTERPRETER} -c 'x = [bytearray(10**7) for _ in range(10**6)]'",
        "memory",
    ),
    "many files": (
        ("--files", "20MB"),
        "i=0; while true; do i=$((i+1)); head -c 2000000 /dev/zero > f$i; done",
        "files",
    ),
    "empty files": (
        ("--file-count", "200"),
        "i=0; while true; do i=$((i+1)); : > f$i; done",
        "files",
    ),
    "a large file": (
        ("--file-size", "1MB"),
        "exec head -c 100000000 /dev/zero > f",
        "files",
    ),
    "a removed file": (
        ("--files", "20MB"),
        "exec 3> f; rm f; while true; do head -c 2000000 /dev/zero >&3; done",
        "files",
    ),
    "hidden files": ((), "mkdir -p a/b; : > a/b/f; chmod 0300 a; exec sleep 1000", "files"),
    "deep folders": ((), "for i in $(seq 300); do mkdir a; cd a; done; exec sleep 1000", "files"),
    "processors": (("--cpu-time", "1s"), "while true; do :; done & while true; do :; done", None),
    "no end": (("--time", "1s"), "exec sleep 1000", "time"),
    "ignores signals": (("--time", "1s"), "trap '' TERM HUP INT; while true; do :; done", "time"),
    "floods its output": (("--time", "1s", "--output-size", "10kB"), "exec yes", "time"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE)
def test_a_limit_ends_a_program_that_goes_too_far(shared: Place, name: str) -> None:
    options, script, limit = HOSTILE[name]
    if name == "memory":  # without the limit it would end by itself, but not soon
        options = (*options, "--time", "60s")
    report = shared.run(*options, *shell(script), expect=11)
    assert report["end"]["kind"] == "limit"
    assert report["end"]["limit"] == (limit or "cpu_time")
    assert report["after"]["is_fit"]
    assert (shared.job / "output.txt").stat().st_size < 100_000
    shared.run(*shell("true"), expect=0)


WITHOUT_LEADER = """
import ctypes, threading
def fill():
    x = [bytearray(10**7) for _ in range(10**6)]
threading.Thread(target=fill).start()
ctypes.CDLL(None).pthread_exit(None)  # Nothing of a process is shown whose first thread has ended.
"""
SEMAPHORES = """
import ctypes, os
libc = ctypes.CDLL(None)
os._exit(0 if any(libc.semget(0, 32000, 0o600) < 0 for _ in range(20)) else 1)
"""


def test_fault_79_memory_is_counted_or_refused(shared: Place) -> None:
    """What no process shows is refused; what was shown of too few threads is counted."""
    limits = ("--memory", "200MB", "--time", "60s")
    run = ("--", INTERPRETER, "-c")
    report = shared.run(*limits, *run, WITHOUT_LEADER, expect=11)
    assert report["end"]["limit"] == "memory"
    confined = report["confined_by"]
    assert confined["filters_calls"] or confined["counts_memory"]
    if confined["filters_calls"]:
        shared.run(*limits, *run, SEMAPHORES, expect=0)


@pytest.mark.slow
def test_a_fork_bomb_stays_small(shared: Place) -> None:
    script = "f() { f & f & sleep 1; }; while true; do f; done"
    words = shared.words("--processes", "40", "--time", "3s", *shell(script))
    done = subprocess.run(
        words, user=USER, group=USER, extra_groups=groups(), capture_output=True, text=True
    )
    # The kernel refuses more, of which the first shell may die, or a limit is seen first.
    assert done.returncode in (10, 11), done.stdout[-3000:]
    report = shared.report
    assert report["most_used"]["processes"] < 100
    assert report["after"]["is_fit"]
    assert not processes_in(shared.job / "work")


@pytest.mark.parametrize(
    ("script", "expect"),
    [
        ("(setsid setsid sleep 1000 &) ; sleep 0.1", 0),
        ("kill -9 -1; kill -9 $PPID; exit 3", 10),
        ("rm -rf ../../* ../../../kept; exit 0", 0),
        ("exec 0<&- 1>&- 2>&-; sleep 0.1", 0),
        ("exec /no/such/program", 10),
        ("kill -SEGV $$", 10),
    ],
)
def test_a_program_that_does_harm_harms_itself(shared: Place, script: str, expect: int) -> None:
    (shared.folder / "kept").write_text("kept")
    probe = shared.words(*shell("true"))
    subprocess.run(probe, user=USER, group=USER, extra_groups=groups(), check=True)
    if not shared.report["confined_by"]["read_only"] and "rm -rf" in script:
        pytest.skip("the kernel allows this user no namespaces, so its jobs can write anywhere")
    report = shared.run(*shell(script), expect=expect)
    assert report["after"]["is_fit"]
    assert (shared.folder / "kept").exists()


@pytest.mark.slow
def test_a_fault_is_cleared_after_the_job(a_place: Place, start_program: StartProgram) -> None:
    robot = start_program(
        "run",
        *("sim", "--name", "shared", *PATIENT, "--set", "backend.max_rejected_actions=10"),
        user=USER,
    )
    robot.wait_for("waits for a user")
    program = (
        DRIVE
        + "\nfor _ in range(1000):\n    robot.get_observation(robot.append_desired_action(bad))"
    )
    bad = "\nbad = robot.new_action(position=[0.0] * 9, position_kp=[1e9] * 9)"
    report = a_place.run(*python(program.replace("\nhold", bad + "\nhold")), expect=10)
    assert "RobotStopped" in (a_place.job / "output.txt").read_text()
    (fault,) = report["driving"]["faults"]
    assert "not fit to apply" in fault
    assert report["after"]["recovered"] == [fault]
    assert report["after"]["is_fit"]
    assert report["driving"]["rejected"] >= 10


@pytest.mark.slow
def test_leftovers_in_shared_memory_are_removed(shared: Place) -> None:
    program = """
import os, time
from multiprocessing import shared_memory, resource_tracker
block = shared_memory.SharedMemory(create=True, size=10**6)
resource_tracker.unregister(block._name, "shared_memory")
print(block.name, flush=True)
time.sleep(2)
os._exit(0)
"""
    report = shared.run(*python(program), expect=0)
    name = (shared.job / "output.txt").read_text().strip()
    assert report["leftovers"] == [str(MEMORY / name)]
    assert not (MEMORY / name).exists()


def started(place: Place, start_program: StartProgram, *options: str, **others: str) -> Running:
    words = place.words(*options, **others)
    running = start_program(*words[1:], program=words[:1], user=USER)
    running.wait_for("has begun")
    return running


@pytest.mark.slow
def test_control_that_is_held_ends_with_the_job(shared: Place, start_program: StartProgram) -> None:
    program = DRIVE + (
        "import signal; signal.signal(15, signal.SIG_IGN); print('has begun', flush=True)\n"
        "time.sleep(1000)"
    )
    assert started(shared, start_program, *python(program)).end()[0] == 128 + signal.SIGTERM
    report = shared.report
    assert report["driving"]["steps"] >= 100
    assert report["end"]["was_killed"]
    assert report["after"]["is_fit"]


def test_limits_hold_while_a_program_may_still_end_by_itself(
    shared: Place, start_program: StartProgram
) -> None:
    # It is asked to end when it has begun, uses too much then, and would go on if it could.
    hog = "import time; x = b'x' * 500_000_000; time.sleep(5)"
    script = (
        "trap ': > late' TERM; echo has begun; while [ ! -e late ]; do sleep 0.1; done; "
        f'{INTERPRETER} -c "{hog}"; : > survived'
    )
    running = started(shared, start_program, "--memory", "200MB", *shell(script), grace="60s")
    assert running.end()[0] == 128 + signal.SIGTERM
    end = shared.report["end"]
    assert end["kind"] == "interrupted"
    assert end["was_killed"]
    assert not (shared.job / "work/survived").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_turn_ends_with_a_report_and_a_robot_that_is_whole(
    shared: Place, start_program: StartProgram, number: signal.Signals
) -> None:
    running = started(shared, start_program, *shell("echo has begun; sleep 1000"))
    status, output = running.end(number)
    assert status == 128 + number, output
    report = shared.report
    assert report["end"]["kind"] == "interrupted"
    assert report["after"]["is_fit"]
    assert not processes_in(shared.job / "work")


def test_a_turn_is_interrupted_in_whatever_order_its_processes_get_the_signal(
    shared: Place, start_program: StartProgram
) -> None:
    running = started(shared, start_program, *shell("echo has begun; exec sleep 1000"))
    running.process.send_signal(signal.SIGSTOP)
    program = processes_in(shared.job / "work")
    for process in program:
        os.kill(process, signal.SIGTERM)
    while processes_in(shared.job / "work"):
        time.sleep(0.01)
    running.process.send_signal(signal.SIGTERM)
    running.process.send_signal(signal.SIGCONT)
    output, _ = running.process.communicate()
    assert running.process.returncode == 128 + signal.SIGTERM, output
    assert shared.report["end"]["kind"] == "interrupted"
    assert shared.report["after"]["is_fit"]


def test_a_second_signal_ends_at_once(shared: Place, start_program: StartProgram) -> None:
    # Nothing but the second signal ends it.
    script = "trap '' TERM; echo has begun; sleep 1000"
    running = started(shared, start_program, *shell(script), grace="1h")
    running.process.send_signal(signal.SIGTERM)
    running.wait_for("a second Ctrl-C ends at once")
    assert running.end(signal.SIGTERM)[0] == -signal.SIGTERM
    while processes_in(shared.job / "work"):
        pass
    shared.run(*shell("true"), expect=0)


def test_a_killed_turn_takes_its_program_with_it(
    shared: Place, start_program: StartProgram
) -> None:
    running = started(
        shared, start_program, *shell("(setsid sleep 1000 &) ; echo has begun; sleep 1000")
    )
    assert processes_in(shared.job / "work")
    running.end(signal.SIGKILL)
    while processes_in(shared.job / "work"):
        pass
    shared.run(*python(DRIVE), expect=0)


def test_two_turns_never_overlap(shared: Place, start_program: StartProgram) -> None:
    running = started(shared, start_program, *shell("echo has begun; sleep 1000"))
    words = shared.words(*shell("true"))
    second = subprocess.run(
        words, user=USER, group=USER, extra_groups=groups(), capture_output=True, text=True
    )
    assert second.returncode == 1
    assert "is in use" in second.stderr
    running.end()


def test_a_program_is_not_started_on_a_robot_that_is_not_fit(a_place: Place) -> None:
    report = a_place.run("--ready-timeout", "0.2s", *shell("echo started"), expect=12)
    assert report["end"]["kind"] == "not_started"
    assert "shared" in report["before"]["problem"]
    assert not (a_place.job / "output.txt").exists()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can run a job as somebody else")
def test_root_runs_a_program_as_its_user(shared: Place, start_program: StartProgram) -> None:
    robot = start_program(
        "run", "sim", "--name", "grouped", "--non-real-time", "--set", "backend.access=group",
        user=USER,
    )  # fmt: skip
    robot.wait_for("waits for a user")
    words = shared.words("--user", "nobody", *shell("id -un; touch /etc/x"), robot="grouped")
    done = subprocess.run(words, extra_groups=[USER], capture_output=True, text=True)
    assert done.returncode == 10, done.stdout + done.stderr
    assert (shared.job / "output.txt").read_text().startswith("nobody\n")
    for user in ([], ["--user", "root"]):
        words = shared.words(*user, *shell("true"), robot="grouped")
        refused = subprocess.run(words, extra_groups=[USER], capture_output=True, text=True)
        assert refused.returncode == 2
        assert "never runs as root" in refused.stderr


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can run a job as somebody else")
def test_root_makes_no_folder_that_its_user_could_exchange(a_place: Place) -> None:
    home = a_place.folder / "home"
    home.mkdir()
    os.chown(home, NOBODY, NOBODY)
    (home / "link").symlink_to("/etc")
    for output in (home / "job", home / "link" / "job"):
        words = a_place.words("--user", "nobody", *shell("true"))
        words[words.index("--output") + 1] = str(output)
        refused = subprocess.run(words, capture_output=True, text=True)
        assert refused.returncode == 2
        assert "root does not write there" in refused.stderr
        assert not output.exists()


def test_restore_makes_a_robot_fit(shared: Place) -> None:
    words = [str(PROGRAM), "restore", "shared", "--self-test", "hold"]
    done = subprocess.run(words, user=USER, group=USER, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "fit" in done.stdout
    shutil.rmtree(shared.folder / "jobs")
