# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger learn`: a robot that learns by itself, whatever is killed meanwhile."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, StartProgram
from trifinger.commands.learn import command_of, parse
from trifinger.commands.program import path as program
from trifinger.environments import Options
from trifinger.training import Plan, checkpoint, on_robot
from trifinger.training.experience import INTERVENTION, LATE, Episodes, digest_of, of_logs
from trifinger.training.on_robot import LOGS, SPARE, RobotTraining, join
from trifinger.training.report import Tally

LEARN = [sys.executable, "-m", "trifinger.commands.learn"]
# Tests under sanitizers and on busy machines learn nothing in time.
pytestmark = [pytest.mark.slow, pytest.mark.without_sanitizer]


def plan_of(tmp_path: Path, robot: str, episodes: int, **settings: object) -> Plan:
    configuration = tmp_path / "robot.yml"
    configuration.write_text(trifinger.observe(robot).documents()["configuration.yml"])
    return Plan.of(
        "reach",
        "ddpg",
        is_shared=True,
        episodes=episodes,
        robot_config=str(configuration),
        settings={"duration": 0.4, "random_actions": 10} | settings,
    )


def start_robot(start_program: StartProgram) -> None:
    robot = start_program("run", "trifinger_edu", "--name", "r", *PATIENT)
    robot.wait_for("waits for a user")


def run_beside(training: RobotTraining, work: Callable[[], None], done: threading.Event) -> Tally:
    """Runs a training beside `work` in another thread, which ends when `done` is set."""
    worker = threading.Thread(target=work)
    worker.start()
    try:
        return training.run()
    finally:
        done.set()
        worker.join()


def experience_in(folder: Path) -> Iterator[np.ndarray]:
    options = Options.of("reach", duration=0.4, per_finger=True).to_json()
    yield from of_logs(folder / LOGS, digest_of({"task": "reach", "options": options}))
    for path in (folder / LOGS).glob(SPARE):
        yield checkpoint.load(path.read_bytes())


def elements_in(folder: Path) -> np.ndarray:
    """All that the logs of a training tell, each element once."""
    parts = list(experience_in(folder))
    if not parts:
        return np.zeros(0)
    elements = np.concatenate(parts)
    _, first = np.unique(elements[["session", "step"]], return_index=True)
    return elements[np.sort(first)]


def test_learns_from_everything_that_the_robot_does(
    start_program: StartProgram, tmp_path: Path
) -> None:
    start_robot(start_program)
    said: list[str] = []
    training = RobotTraining(plan_of(tmp_path, "r", 12), tmp_path / "f", "r", said.append, judged=2)
    tally = training.run()
    assert (tally.episodes, tally.actions) == (12, 240)
    assert tally.faults == tally.restarts == {}
    elements = elements_in(tmp_path / "f")
    # The judge uses another seed; its first element ends the last episode.
    assert set(elements["seed"]) == {1, 1_000_000}
    made = [*Episodes().add(elements)]
    made = [one for one in made if one.after["seed"] == 1]
    elements = elements[elements["seed"] == 1]
    on_time = np.count_nonzero((elements["actions"] > 0) & (elements["flags"] & LATE == 0))
    assert len(made) == on_time
    assert tally.updates == on_time - 10
    # Several policies acted, each after the one before it.
    acted = elements["policy"][elements["actions"] > 0]
    assert (np.diff(acted) >= 0).all()
    assert acted[0] == 0
    metadata = trifinger.Policy(training.policy_path).metadata
    assert metadata["number"] == str(tally.policies - 1)
    assert metadata["robot"] == str(tmp_path / "robot.yml")
    assert "2 new episodes" in said[-1]
    report = training.report().read_text()
    assert "| learning | episode 12 of 12, 240 actions, " in report
    assert (tmp_path / "f/tips.png").exists()


def test_goes_on_whatever_is_killed_and_loses_nothing(
    start_program: StartProgram, tmp_path: Path
) -> None:
    start_robot(start_program)
    kills = 500 if os.environ.get("TRIFINGER_SOAK") else 9
    plan = plan_of(tmp_path, "r", 1_000_000, buffer_size=10_000_000)
    training = RobotTraining(plan, tmp_path / "f", "r", judged=0)
    chance, done = np.random.default_rng(3), threading.Event()
    killed: list[str] = []

    def watch() -> subprocess.Popen[bytes]:
        words = ["view", "r", "--training", tmp_path / "f", "--port", "0", "--no-browser"]
        return subprocess.Popen([program(), *words], stdout=subprocess.DEVNULL)

    def kill() -> None:
        while not (training.policy_path.exists() and training.tally.episodes):
            if done.wait(0.1):
                return
        viewer = watch()
        while len(killed) < kills and not done.wait(chance.uniform(0.2, 2.0)):
            name = chance.choice(["actor", "learner", "recorder", "viewer"]) if killed else ""
            # The first two die at once: a session ends that nobody records.
            for one in (name,) if name else ("recorder", "actor"):
                process = viewer if one == "viewer" else training._processes.get(one)
                if process and process.poll() is None:
                    process.kill()
                    killed.append(one)
            if name == "viewer":
                viewer.wait()
                viewer = watch()
        viewer.kill()
        viewer.wait()
        # It still learns: a new policy acts in a whole episode.
        episodes, policies = training.tally.episodes, training.tally.policies
        while training.tally.episodes == episodes or training.tally.policies == policies:
            if done.wait(0.1):
                return
        training._events.put(("failed", KeyboardInterrupt()))  # as Ctrl-C would

    with pytest.raises(KeyboardInterrupt):
        run_beside(training, kill, done)
    assert len(killed) >= kills
    assert set(training.tally.restarts) <= {"actor", "learner", "recorder"}
    assert (
        0 < sum(training.tally.restarts.values()) <= len(killed)
    )  # one may end between look and kill
    elements = elements_in(tmp_path / "f")
    elements = np.sort(elements[elements["seed"] == 1], order=["episode", "actions"])
    # No element is missing: within an episode they follow one another, up to where it was cut off.
    numbers = np.unique(elements["episode"])
    assert numbers.tolist() == list(range(len(numbers)))
    # One that was killed at its very begin may begin again, in another session.
    for one in np.unique(elements[["session", "episode"]]):
        of_one = elements[elements[["session", "episode"]] == one]
        assert of_one["actions"].tolist() == list(range(len(of_one)))
    # The learner could see all of it but for what came after the end.
    seen, _ = training._book.since(0)
    assert len(elements) - len(seen) < 50
    keys = ["session", "step"]
    assert set(seen[keys].tolist()) <= set(elements[keys].tolist())


def test_waits_while_the_disk_is_full(
    start_program: StartProgram, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start_robot(start_program)
    said: list[str] = []
    training = RobotTraining(plan_of(tmp_path, "r", 8), tmp_path / "f", "r", said.append, judged=0)
    done = threading.Event()
    waited: list[bool] = []

    def fill() -> None:
        while training.tally.episodes < 2 and not done.wait(0.05):
            pass
        monkeypatch.setattr(on_robot, "ROOM", 1e18)
        while "actor" in training._processes and not done.wait(0.05):
            pass
        waited.append(training.tally.episodes < 8)
        monkeypatch.setattr(on_robot, "ROOM", 0)

    tally = run_beside(training, fill, done)
    assert waited == [True]
    assert "nearly full" in "".join(said)
    assert tally.restarts == {}
    assert set(elements_in(tmp_path / "f")["episode"]) == set(range(8))


def test_resumes_from_the_logs_and_begins_with_those_of_others(
    start_program: StartProgram, tmp_path: Path
) -> None:
    start_robot(start_program)
    plan = plan_of(tmp_path, "r", 6)
    words = [
        "reach",
        "--shared",
        "--robot",
        "r",
        "--episodes",
        "1000",
        "-o",
        tmp_path / "f",
    ]
    settings = ("duration=0.4", "random_actions=10")
    words += [word for setting in settings for word in ("--set", setting)]
    learn = subprocess.Popen([*LEARN, *words], stdout=subprocess.DEVNULL)
    tally = tmp_path / "f/tally.json"
    while not tally.exists() or len(elements_in(tmp_path / "f")) < 40:
        assert learn.poll() is None
        time.sleep(0.1)
    learn.kill()
    learn.wait()
    # Nobody moves the robot any more.
    while any(one.controller_pid for one in trifinger.list_sessions() if one.name == "r"):
        time.sleep(0.1)
    before = len(elements_in(tmp_path / "f"))
    again = subprocess.Popen([*LEARN, "--resume", tmp_path / "f"])
    while len(elements_in(tmp_path / "f")) <= before:
        assert again.poll() is None
        time.sleep(0.1)
    again.send_signal(signal.SIGINT)
    assert again.wait() == 130
    elements = elements_in(tmp_path / "f")
    known = json.loads((tmp_path / "f/tally.json").read_text())["tally"]
    assert known["episodes"] <= np.count_nonzero(elements["flags"] & 2) <= known["episodes"] + 1
    starts = elements["episode"][elements["actions"] == 0]
    assert (np.diff(starts.astype(int)) >= 1).all()  # no episode was done again
    acted = elements["policy"][(elements["actions"] > 0) & (elements["seed"] == 1)]
    assert (np.diff(acted) >= 0).all()  # no number was used twice, also not after the kill

    other = RobotTraining(plan, tmp_path / "g", "r", logs=[tmp_path / "f" / LOGS], judged=0)
    assert len(other._book.since(0)[0]) == len(elements)
    assert other.run().episodes == 6


def test_what_no_robot_learns_by_is_refused_before_it_moves(tmp_path: Path) -> None:
    plan = Plan.of("reach", "ddpg", settings={"relabelled": 0.5})

    def refusal(plan: Plan, *, is_judged: bool = False) -> str:
        with pytest.raises(trifinger.InvalidArgument) as refused:
            RobotTraining(plan, tmp_path / "f", "no such robot", is_judged=is_judged)
        return str(refused.value)

    from_states = dataclasses.replace(plan.recipe, reset_states="states.npz")
    assert "reset_states" in refusal(dataclasses.replace(plan, recipe=from_states))
    assert "ppo learns only" in refusal(Plan.of("reach", "ppo"))
    assert "relabelled" in refusal(plan, is_judged=True)
    assert "no such robot" in refusal(plan)


def test_a_learner_may_join_with_the_token_alone(
    start_program: StartProgram, tmp_path: Path
) -> None:
    start_robot(start_program)
    plan = plan_of(tmp_path, "r", 4)
    training = RobotTraining(plan, tmp_path / "f", "r", judged=0, listen="127.0.0.1:0")
    with pytest.raises(trifinger.InvalidArgument, match=r"another training runs in .*/f$"):
        RobotTraining(plan, tmp_path / "f", "r")
    false = tmp_path / "false"
    false.write_text("0" * 64)
    refused: list[str] = []

    def learn() -> None:
        try:
            join(training.address, false)
        except trifinger.Error as error:
            refused.append(str(error))
        join(training.address, tmp_path / "f/token")

    learner = threading.Thread(target=learn)
    learner.start()
    assert training.run().episodes == 4
    learner.join()
    assert "has another token" in refused[0]
    assert (tmp_path / "f/token").stat().st_mode & 0o77 == 0


def test_says_what_is_wrong(start_program: StartProgram, tmp_path: Path) -> None:
    start_robot(start_program)

    def refused(*words: object) -> str:
        done = subprocess.run(
            [*LEARN, *map(str, words)], capture_output=True, text=True, check=False
        )
        assert done.returncode != 0
        assert "Traceback" not in done.stderr
        return done.stderr.splitlines()[-1]

    assert "either a task, --resume or --join" in refused()
    assert "--join and --token belong together" in refused("--join", "here:1")
    assert "no HOST:PORT" in refused("--join", "here", "--token", tmp_path / "t")
    assert "there is no training in" in refused("--resume", tmp_path)
    folder = ("--robot", "r", "-o", tmp_path / "f")
    assert "there is no task 'reech'" in refused("reech", *folder)
    assert not (tmp_path / "f").exists()
    assert "a task in Python" in refused("my_tasks:Middle", *folder)
    assert "nobody can join at" in refused("reach", *folder, "--listen", "127.0.0.1:99999")
    assert "no experience of this task" in refused("reach", *folder, "--from", tmp_path)
    (tmp_path / "g").mkdir()
    simulated = Plan.of("reach", "ddpg")
    (tmp_path / "g/plan.json").write_text(simulated.to_json())
    assert "has a training; --resume" in refused("reach", "--robot", "r", "-o", tmp_path / "g")
    assert "a training in simulation" in refused("--resume", tmp_path / "g", "--robot", "r")


def test_says_how_to_go_on() -> None:
    begun = ["reach", "--algorithm", "my:Own", "--care", "", "--takeover", "--judge", "keys"]
    assert command_of(parse(begun), Path("a folder"), "r") == (
        "trifinger learn --resume 'a folder' --robot r --algorithm my:Own --care '' --takeover "
        "--judge keys"
    )
    assert command_of(parse(["reach"]), Path("f"), "r") == "trifinger learn --resume f --robot r"


@pytest.mark.parametrize("option", ["--care=", "--from=logs", "--judge=keys", "--takeover"])
def test_what_is_said_at_the_robot_is_not_for_who_joins(
    option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        parse(["--join", "here:1", "--token", "t", option])
    assert "--join takes --token and --algorithm alone" in capsys.readouterr().err


def test_lets_warm_motors_rest(
    start_program: StartProgram, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(on_robot, "REST_BELOW", 0.9999)
    monkeypatch.setattr(on_robot, "REST", 1.0)
    monkeypatch.setattr(on_robot, "LOOK", 0.1)
    start_robot(start_program)
    said: list[str] = []
    training = RobotTraining(plan_of(tmp_path, "r", 3), tmp_path / "f", "r", said.append, judged=0)
    tally = training.run()
    assert tally.episodes == 3
    assert tally.rests >= 2
    assert tally.time_lost >= 2 * 1.0  # it does rest
    assert tally.restarts == {}
    assert "the motors are warm: thermal margin" in "".join(said)


def test_takes_care_of_the_robot_after_a_fault(start_program: StartProgram, tmp_path: Path) -> None:
    late = ("--set", "backend.late_action.max_repeats=1000")
    robot = start_program("run", "trifinger_edu", "--name", "r", *PATIENT, *late)
    robot.wait_for("waits for a user")
    care = ["sh", "-c", f"echo cared >> {tmp_path / 'care.txt'}"]
    training = RobotTraining(
        plan_of(tmp_path, "r", 6), tmp_path / "f", "r", judged=0, care=care, options=["--takeover"]
    )
    stopped = threading.Event()

    def stop() -> None:
        """Stops the actor for longer than the robot waits for an action."""
        while training.tally.episodes < 1:
            if stopped.wait(0.05):
                return
        actor = training._processes["actor"]
        actor.send_signal(signal.SIGSTOP)
        while not any(one.fault for one in trifinger.list_sessions() if one.name == "r"):
            if stopped.wait(0.05):
                break
        actor.send_signal(signal.SIGCONT)

    tally = run_beside(training, stop, stopped)
    assert 4 <= tally.episodes < 6  # the fault has cut one off
    assert set(tally.faults) == {"the action was not there in time"}
    assert tally.cares == tally.recoveries == sum(tally.faults.values()) > 0
    assert (tmp_path / "care.txt").read_text() == tally.cares * "cared\n"
    assert tally.time_lost > 0


def test_ends_if_nobody_brings_the_object_back(
    start_program: StartProgram, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = ("--set", "objects.0.position=[0.0, 0.17, 0.0325]")
    robot = start_program("run", "sim", "--name", "r", *PATIENT, *place)
    robot.wait_for("waits for a user")
    configuration = tmp_path / "robot.yml"
    configuration.write_text(trifinger.observe("r").documents()["configuration.yml"])
    plan = Plan.of(
        "push",
        "ddpg",
        episodes=100,
        robot_config=str(configuration),
        settings={"duration": 0.4, "random_actions": 10},
    )
    with pytest.raises(trifinger.Error, match=r"17 cm from the middle, out of reach; --care names"):
        RobotTraining(plan, tmp_path / "f", "r").run()
    monkeypatch.setattr(on_robot, "MOST_CARES", 2)
    care = ["sh", "-c", f'echo "$@" >> {tmp_path / "care.txt"}', "care"]
    with pytest.raises(trifinger.Error, match="needs care again and again"):
        RobotTraining(plan, tmp_path / "f", "r", care=care, care_of_object=["held"]).run()
    assert (tmp_path / "care.txt").read_text() == 2 * "held\n"


def test_a_push_begins_with_demonstrations(start_program: StartProgram, tmp_path: Path) -> None:
    robot = start_program("run", "sim", "--name", "r", *PATIENT)
    robot.wait_for("waits for a user")
    script = Path(__file__).parents[2] / "evaluation/push_demonstrations.py"
    words = [sys.executable, script, "r", tmp_path / "demonstrations", "--count", "1"]
    assert subprocess.run(words, check=False).returncode == 0
    # Few steps: a busy machine takes them all in the time that a learner has after the episode.
    plan = Plan.of("push", "rlpd", episodes=1, settings={"gradient_steps": 2})
    logs = [tmp_path / "demonstrations"]
    training = RobotTraining(plan, tmp_path / "f", "r", logs=logs, judged=0)
    tally = training.run()
    assert tally.episodes == 1
    shown, _ = training._book.since(0, most=training._prior)
    assert np.count_nonzero(shown["flags"] & INTERVENTION) >= 100
    lived, _ = training._book.since(0)
    on_time = (lived["actions"] > 0) & (lived["flags"] & LATE == 0)
    assert tally.updates == 2 * np.count_nonzero(on_time)
    # The action that was the same as the person's, not what the policy would have done.
    assert np.abs(shown["action"]).max() > 0.5
