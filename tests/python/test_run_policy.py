# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger run-policy`: a policy acts on a robot exactly as in its environment."""

import json
import re
import signal
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import trifinger
from conftest import BUILD, PATIENT, StartChild, StartProgram
from lerobot_reader import Reader
from trifinger import policy_file
from trifinger.environments import Environment, Options, policy_metadata
from trifinger_data_sets.commands.export import main as export
from trifinger_data_sets.marks import read_marks
from trifinger_data_sets.recorded_environment import RecordEpisodes

PROGRAM = BUILD / "apps/trifinger-run-policy"


def write_policy(
    path: Path, task: str, options: Options, sharing: int = 1, **metadata: str
) -> trifinger.Policy:
    """A policy of random weights; one that the fingers share has a third of the numbers."""
    environment = Environment(task, options=options)
    inputs = environment.observation_space.shape[0] // sharing
    outputs = environment.action_space.shape[0] // sharing
    rng = np.random.default_rng(3)
    layers = [
        (rng.normal(size=(16, inputs)), rng.normal(size=16), "relu"),
        (0.2 * rng.normal(size=(outputs, 16)), np.zeros(outputs), "tanh"),
    ]
    return policy_file.write(path, layers, metadata=policy_metadata(task, options) | metadata)


def run(*words: object, robot: str = "p") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [PROGRAM, *map(str, words), "--robot", robot], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("task", "robot", "settings", "options", "sharing", "precision"),
    [
        ("reach", "trifinger_edu", [], {}, 1, "double"),
        ("reach", "trifinger_edu", [], {}, 1, "single"),
        ("reach", "trifinger_edu", [], {"per_finger": True, "position_kp": 4.0}, 3, "double"),
        (
            "reach",
            "trifinger_edu",
            [],
            {"mapping": "state_augmentation", "action": "torque"},
            1,
            "double",
        ),
        ("finger_reach", "trifinger_edu", ["robot.arrangement=finger"], {}, 1, "double"),
        ("push", "sim", [], {"duration": 1.0, "position_noise": 1e-3}, 1, "double"),
    ],
    ids=["joint", "single precision", "shared", "augmented", "finger", "push"],
)
def test_does_what_the_environment_does_to_the_last_bit(
    start_program: StartProgram, tmp_path: Path, task, robot, settings, options, sharing, precision
) -> None:
    chosen = Options.of(task, **options)
    write_policy(tmp_path / "p.policy", task, chosen, sharing)
    policy = trifinger.Policy(tmp_path / "p.policy", precision=precision)
    words = [word for setting in settings for word in ("--set", setting)]
    start_program("run", robot, "--name", "p", "--non-real-time", *words).wait_for(
        "waits for a user"
    )
    overrides = dict(setting.split("=") for setting in settings)
    environment = Environment(
        task,
        options=chosen,
        connect=lambda: trifinger.connect("p"),
        config_overrides=overrides,
    )
    observation, _ = environment.reset(seed=2, options={"episode": 5})
    total, ended = 0.0, False
    while not ended:
        parts = np.split(observation.astype(float), sharing)
        action = np.concatenate([policy(part) for part in parts])
        observation, reward, terminated, truncated, info = environment.step(action)
        total += reward
        ended = terminated or truncated
    environment.close()

    words = ["--episodes", 1, "--first", 5, "--seed", 2, "--precision", precision]
    done = run(tmp_path / "p.policy", *words, "-o", tmp_path / "j")
    assert done.returncode == 0, done.stdout + done.stderr
    (report,) = json.loads((tmp_path / "j").read_text())
    assert report["total_reward"] == total
    assert report["distance"][: np.size(info["distance"])] == np.ravel(info["distance"]).tolist()
    assert report["repeated_steps"] == 0


@pytest.mark.slow
def test_goes_through_episodes_in_real_time(start_program: StartProgram, tmp_path: Path) -> None:
    write_policy(tmp_path / "p.policy", "reach", Options.of("reach", duration=0.5))
    start_program("run", "trifinger_edu", "--name", "p", *PATIENT).wait_for("waits for a user")
    done = run(tmp_path / "p.policy", "--episodes", 2, "--scheduling", "off")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "episode    1:   25 actions" in done.stdout
    assert "of 2 episodes ended at their goal." in done.stdout


def session_in(logs: Path) -> trifinger.LoggedSession:
    """The robot's session that had a user; in others it waits for one."""
    (session,) = (one for one in trifinger.Log(logs).sessions if one.range("applied_action")[1] > 0)
    return session


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_a_log_tells_all_that_a_learner_needs(
    start_program: StartProgram, tmp_path: Path, noise: float
) -> None:
    options = Options.of("reach", duration=0.4, action="torque")
    metadata = {"exploration_noise": str(noise), "exploration_color": "1", "number": "17"}
    policy = write_policy(tmp_path / "p.policy", "reach", options, **metadata)
    words = ("--non-real-time", "--record", tmp_path / "logs")
    robot = start_program("run", "trifinger_edu", "--name", "p", *words)
    robot.wait_for("waits for a user")
    words = ("--episodes", 6, "--seed", 7, "--explore", "--approach-every", 3, "--json")
    done = run(tmp_path / "p.policy", *words)
    assert done.returncode == 0, done.stdout + done.stderr
    robot.end()

    session = session_in(tmp_path / "logs")
    told = session.companion("experience").observations
    assert len(told) == 6 * 21
    assert (np.diff(told["step"]) > 0).all()
    reports = [json.loads(line) for line in done.stdout.splitlines()]
    assert (told["session"] == session.session_id).all()
    differences = []
    for report in reports:
        episode = told[told["episode"] == report["episode"]]
        assert (episode["seed"] == 7).all()
        assert episode["actions"].tolist() == list(range(21))
        assert episode["policy"].tolist() == [-1] + [17] * 20
        assert (np.diff(episode["step"]) == options.steps_per_action).all()
        assert episode["reward"][1:].sum() == pytest.approx(report["total_reward"], abs=1e-12)
        assert (episode["flags"] & 2 > 0).tolist() == [False] * 20 + [True]
        # Each action is that of the policy in the state before, but for the noise.
        seen = episode["observation"][:-1, : policy.num_inputs].astype(float)
        chosen = np.array([policy(one) for one in seen])
        differences.append(episode["action"][1:, :9] - chosen)
        offsets = (episode["achieved"] - episode["desired"])[-1, :9].reshape(3, 3)
        distances = np.linalg.norm(offsets, axis=1)
        np.testing.assert_allclose(distances, report["distance"][:3], rtol=1e-4, atol=1e-6)
    deviation = np.std(differences)
    assert deviation == pytest.approx(noise, rel=0.3, abs=1e-6)
    # The numbers from which the desired actions were made.
    acted = told[told["actions"] > 0]
    torque = np.array([session.get_desired_action(int(step)).torque for step in acted["step"]])
    scale = np.abs(torque).max() / np.abs(acted["action"]).max()
    np.testing.assert_allclose(torque, scale * acted["action"][:, :9], rtol=1e-5, atol=1e-6)
    # The robot goes to every third start; the other episodes begin where the one before ended.
    starts = told["step"][told["actions"] == 0]
    ends = told["step"][told["actions"] == 20]
    pauses = starts[1:] - ends[:-1]
    assert pauses.tolist() == [20, 20, 2000, 20, 20]


def test_another_policy_takes_over(start_program: StartProgram, tmp_path: Path) -> None:
    options = Options.of("reach", duration=0.4)
    path = tmp_path / "p.policy"
    write_policy(path, "reach", options)
    record = ("--non-real-time", "--record", tmp_path / "logs")
    robot = start_program("run", "trifinger_edu", "--name", "p", *record)
    robot.wait_for("waits for a user")
    words = [path, "--robot", "p", "--episodes", 1_000_000, "-o", tmp_path / "j"]
    actor = subprocess.Popen([PROGRAM, *map(str, words)], stdout=subprocess.PIPE, text=True)
    assert actor.stdout is not None
    while "episode" not in actor.stdout.readline():
        pass
    for count in range(1, 4):
        write_policy(tmp_path / "new.policy", "reach", options)
        (tmp_path / "new.policy").rename(path)
        while f"policy {count}\n" not in actor.stdout.readline():
            pass
    actor.send_signal(signal.SIGINT)
    actor.communicate()
    acting = [report["policy"] for report in json.loads((tmp_path / "j").read_text())]
    assert acting == sorted(acting)
    assert set(acting) == {0, 1, 2, 3}
    robot.end()
    told = session_in(tmp_path / "logs").companion("experience").observations
    told = told["policy"][told["actions"] > 0]
    assert (np.diff(told) >= 0).all()
    assert set(told) == {0, 1, 2, 3}


def test_marks_the_episodes_that_an_environment_marks(
    start_program: StartProgram, tmp_path: Path
) -> None:
    options = Options.of("reach", duration=0.4)
    policy = write_policy(tmp_path / "p.policy", "reach", options)
    logs = tmp_path / "logs"
    robot = start_program(
        "run", "trifinger_edu", "--name", "p", "--non-real-time", "--record", logs
    )
    robot.wait_for("waits for a user")
    environment = RecordEpisodes(
        Environment("reach", options=options, connect=lambda: trifinger.connect("p")),
        tmp_path / "environment",
        sentence="Reach the goals",
    )
    for episode in range(3):
        observation, _ = environment.reset(seed=1, options={"episode": episode})
        ended = False
        while not ended:
            observation, _, terminated, truncated, _ = environment.step(policy(observation))
            ended = terminated or truncated
    environment.close()
    (expected,) = (tmp_path / "environment").iterdir()

    path = logs / "reach.episodes.jsonl"
    words = [tmp_path / "p.policy", "--seed", 1, "--marks", path, "--task", "Reach the goals"]
    for first, count in ((0, 2), (2, 1)):  # the second run goes on at the end of the file
        done = run(*words, "--first", first, "--episodes", count)
        assert done.returncode == 0, done.stdout + done.stderr
    robot.end()
    marks = read_marks(path)

    # The environment begins a session for each episode, the program for each call.
    begin = [0, marks[0].end, 0]
    assert [
        replace(one, session_id=0, first=one.first - t, end=one.end - t)
        for one, t in zip(marks, begin, strict=True)
    ] == [replace(one, session_id=0, decisions=None) for one in read_marks(expected)]
    sessions = {one.session_id: one for one in trifinger.Log(logs).sessions}
    assert marks[0].session_id == marks[1].session_id != marks[2].session_id
    for mark in marks:
        assert mark.session_id in sessions
        assert mark.end - mark.first == 20 * 20  # actions, and steps of each
        assert mark.end <= sessions[mark.session_id].range("observation")[1]
    assert export(["lerobot", str(logs), "--episodes", "marks", "-o", str(tmp_path / "set")]) == 0
    reader = Reader(tmp_path / "set")
    reader.check()
    found = [(one["source/first_step"], one["source/end_step"]) for one in reader.episodes]
    assert found == [(mark.first, mark.end) for mark in marks]
    assert list(reader.tasks.values()) == ["Reach the goals"]


def test_marks_that_no_export_would_find_or_that_cannot_be_written_are_refused(
    start_program: StartProgram, tmp_path: Path
) -> None:
    write_policy(tmp_path / "p.policy", "reach", Options.of("reach", duration=0.1))
    start_program("run", "trifinger_edu", "--name", "p", "--non-real-time").wait_for(
        "waits for a user"
    )
    (tmp_path / "file").touch()
    for words, text in [
        (["--marks", tmp_path / "marks"], "must end in .episodes.jsonl"),
        (["--marks", tmp_path / "file/a.episodes.jsonl"], "cannot make the folder"),
        (["--task", "Reach"], "--marks"),
    ]:
        done = run(tmp_path / "p.policy", *words)
        assert done.returncode != 0
        assert text in done.stderr + done.stdout
    # The robot goes on, and the error comes at the end.
    full = tmp_path / "full.episodes.jsonl"
    full.symlink_to("/dev/full")
    done = run(tmp_path / "p.policy", "--episodes", 2, "--marks", full)
    assert done.returncode != 0
    assert "episode    1:" in done.stdout
    assert f"cannot write the marks of episodes to {full}" in done.stderr


def warnings_of(done: subprocess.CompletedProcess[str]) -> list[str]:
    assert done.returncode == 0, done.stdout + done.stderr
    return [line.strip() for line in done.stderr.splitlines() if line.startswith("  ")]


@pytest.mark.parametrize(("task", "robot"), [("reach", "trifinger_edu"), ("push", "sim")])
def test_warns_of_another_scene_than_that_of_the_training(
    start_program: StartProgram, tmp_path: Path, task, robot
) -> None:
    options = Options.of(task, duration=0.1)
    path = tmp_path / "p.policy"
    write_policy(path, task, options)
    words = (path, "--episodes", 1, "--scheduling", "off")
    same = start_program("run", robot, "--name", "p", "--non-real-time")
    same.wait_for("waits for a user")
    done = run(*words)
    assert (warnings_of(done), done.stderr) == ([], "")
    same.end()

    changes = {
        "fingers.height": "0.3",
        "backend.period": "0.002",
        "contact.floor_friction": "0.8",
        "objects": '[{"name": "cube", "type": "cube", "mass": 0.2}]',
        "simulation.seed": "7",
    }
    settings = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    other = start_program("run", robot, "--name", "p", "--non-real-time", *settings)
    other.wait_for("waits for a user")
    done = run(*words)
    cube = "box of 0.065 x 0.065 x 0.065 m and"
    before = f"{cube} 0.094 kg" if task == "push" else "none"
    assert "'p' is not what" in done.stderr
    assert warnings_of(done) == [
        "backend.period: 0.002 here, 0.001 in the training",
        "contact.floor_friction: 0.8 here, 0.5 in the training",
        "fingers.height: 0.3 here, 0.283 in the training",
        f"object 'cube': {cube} 0.2 kg here, {before} in the training",
    ]

    # Earlier versions wrote files without the configuration.
    policy = trifinger.Policy(path)
    old = {name: text for name, text in policy.metadata.items() if name != "configuration"}
    assert set(policy.metadata) - set(old) == {"configuration"}
    sizes = (policy.num_outputs, policy.num_inputs)
    policy_file.write(path, [(np.zeros(sizes), np.zeros(sizes[0]), "tanh")], metadata=old)
    assert run(*words).stderr == ""


def test_says_what_is_wrong(start_program: StartProgram, tmp_path: Path) -> None:
    start_program("run", "trifinger_edu", "--name", "p").wait_for("waits for a user")
    layers = [(np.zeros((9, 27)), np.zeros(9), "tanh")]
    policy_file.write(tmp_path / "none.policy", layers)
    options = Options.of("reach")
    wide = [(np.zeros((9, 20)), np.zeros(9), "tanh")]
    policy_file.write(tmp_path / "w.policy", wide, metadata=policy_metadata("reach", options))
    push = Options.of("push")
    policy_file.write(tmp_path / "push.policy", layers, metadata=policy_metadata("push", push))
    strange = policy_metadata("reach", options) | {"options": '{"rate": 50}'}
    policy_file.write(tmp_path / "strange.policy", layers, metadata=strange)
    pro = policy_metadata("reach", options, "trifinger_pro")
    policy_file.write(tmp_path / "pro.policy", layers, metadata=pro)
    for name, text in [
        ("nothing.policy", "nothing.policy"),
        ("pro.policy", "was trained for a trifinger_pro, which this robot is not"),
        ("none.policy", "does not say its 'task'"),
        ("w.policy", "20 inputs and 9 outputs; the environment has 27"),
        ("push.policy", "needs an object called 'cube'"),
        ("strange.policy", "there is no option 'rate'"),
    ]:
        done = run(tmp_path / name)
        assert done.returncode != 0
        assert text in done.stderr
    assert "nobody" in run(tmp_path / "w.policy", robot="nobody").stderr


PERSON = """
import sys, trifinger
with trifinger.connect(sys.argv[1]) as robot:
    hold = robot.new_action(position=robot.latest_observation().position)
    robot.append_desired_action(hold)
    print("ready", flush=True)
    while True:
        robot.append_desired_action(hold)
"""


@pytest.fixture
def start_actor(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Lets the policy in `tmp_path` act until it is told to stop, or until the test ends."""
    actors: list[subprocess.Popen[str]] = []

    def start(*words: str) -> subprocess.Popen[str]:
        command = [PROGRAM, tmp_path / "p.policy", "--robot", "p", "--json", *words]
        with (tmp_path / "errors").open("w") as errors:
            pipe = subprocess.PIPE
            actors.append(
                subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=errors, text=True)
            )
        return actors[-1]

    yield start
    for actor in actors:
        if actor.poll() is None:
            actor.kill()
            actor.communicate()


def next_report(actor: subprocess.Popen[str]) -> dict[str, Any]:
    assert actor.stdout is not None
    return dict(json.loads(actor.stdout.readline()))


@pytest.mark.parametrize("mapping", ["approximation", "state_augmentation"])
def test_a_person_takes_over_and_lets_go(
    start_program: StartProgram,
    start_python: StartChild,
    start_actor: Callable[..., subprocess.Popen[str]],
    tmp_path: Path,
    mapping: Literal["approximation", "state_augmentation"],
) -> None:
    options = Options.of("reach", duration=0.4, mapping=mapping)
    write_policy(tmp_path / "p.policy", "reach", options)
    robot = start_program(
        "run", "trifinger_edu", "--name", "p", *PATIENT, "--record", tmp_path / "logs"
    )
    robot.wait_for("waits for a user")
    actor = start_actor("--takeover", "--episodes", "1000000", "--approach-every", "1000000")
    next_report(actor)
    # A finger with gains of its own, one with torque and position, and one with torque alone.
    with trifinger.connect("p-takeover") as person:
        position = person.latest_observation().position.copy()
        actions = np.repeat(np.array([person.new_action(position=position)]), 1500)
        actions["position"] += 0.1 * np.sin(np.arange(1500) / 100)[:, None]
        actions["position_kp"][:, :3], actions["position_kd"][:, :3] = 5.0, 0.05
        actions["torque"][:, 3:6] = 0.05
        actions["torque"][:, 6:], actions["position"][:, 6:] = 0.02, np.nan
        person.append_desired_actions(actions)
        person.finish()
    while next_report(actor)["interventions"] > 0:
        pass
    # One who is killed lets go, too.
    child = start_python(PERSON, "p-takeover")
    while next_report(actor)["interventions"] < 20:
        pass
    child.kill()
    while next_report(actor)["interventions"] > 0:
        pass
    actor.send_signal(signal.SIGINT)
    actor.communicate()
    assert actor.returncode == 130, (tmp_path / "errors").read_text()
    robot.end()

    session = session_in(tmp_path / "logs")
    told = session.companion("experience").observations
    told = told[told["actions"] > 0]
    is_persons = told["flags"] & 16 > 0
    assert (np.diff(is_persons.astype(int)) != 0).sum() == 4  # two persons take over and let go
    assert (told["policy"] == np.where(is_persons, -1, 0)).all()
    asked, seen = session.desired_actions, session.observations
    kp, kd = (session.applied_actions[f"position_{gain}"][told["step"][0]] for gain in ("kp", "kd"))

    # What numbers mean positions: as the policy's actions say.
    its = told[~is_persons]
    numbers, target = its["action"][:, :9].astype(float), asked["position"][its["step"]]
    middle, half = np.zeros(9), np.zeros(9)
    for i in range(9):
        half[i], middle[i] = np.polyfit(numbers[:, i], target[:, i], 1)
    checked = 0
    for before, element, after in zip(told, told[1:], told[2:], strict=False):
        flags = before["flags"] | element["flags"] | after["flags"]
        if element["flags"] & 16 == 0 or flags & 8:
            continue
        first = element["step"] - (19 if mapping == "approximation" else 0)
        equal = []
        for t in range(first, first + 20):
            known = first - 1 if mapping == "approximation" else 0
            y = seen[max(known, t - 2)]  # what was known when this action was chosen
            one = asked[t]
            own = [
                np.where(np.isnan(one[f"position_{n}"]), g, one[f"position_{n}"])
                for n, g in (("kp", kp), ("kd", kd))
            ]
            pd = own[0] * (one["position"] - y["position"]) - own[1] * y["velocity"]
            torque = one["torque"] + np.where(np.isnan(one["position"]), 0.0, pd)
            equal.append(y["position"] + (torque + kd * y["velocity"]) / kp)
        expected = np.clip((np.mean(equal, axis=0) - middle) / half, -1.0, 1.0)
        np.testing.assert_allclose(element["action"][:9], expected, atol=1e-4)
        checked += 1
    assert checked > 0


def test_standard_input_judges(
    start_program: StartProgram,
    start_actor: Callable[..., subprocess.Popen[str]],
    tmp_path: Path,
) -> None:
    write_policy(tmp_path / "p.policy", "reach", Options.of("reach", duration=2.0))
    robot = start_program(
        "run", "trifinger_edu", "--name", "p", *PATIENT, "--record", tmp_path / "logs"
    )
    robot.wait_for("waits for a user")
    actor = start_actor("--judge", "--episodes", "1000000", "--approach-every", "1000000")
    assert actor.stdin is not None
    next_report(actor)
    watcher = trifinger.observe("p")
    for verdict in ("success", "failure"):
        # A verdict between two episodes is of none, so it is said in the midst of one.
        while True:
            watcher.wait_until_time_index(watcher.current_time_index() + 500)
            actor.stdin.write(f"{verdict}\n")
            actor.stdin.flush()
            report = next_report(actor)
            if report["is_terminated"]:
                break
        assert report["is_success"] == (verdict == "success")
        assert report["total_reward"] == (1.0 if verdict == "success" else 0.0)
    actor.stdin.write("nonsense\n")
    actor.stdin.close()
    for _ in range(2):  # Nobody judges any more.
        report = next_report(actor)
    assert (report["is_terminated"], report["actions"], report["total_reward"]) == (False, 100, 0.0)
    actor.stdin = None
    actor.send_signal(signal.SIGINT)
    actor.communicate()
    assert 'not "nonsense"' in (tmp_path / "errors").read_text()
    robot.end()
    told = session_in(tmp_path / "logs").companion("experience").observations
    assert (told["flags"] & 32 > 0).all()
    assert set(told["reward"]) == {0.0, 1.0}
    ends = told["flags"] & 1 > 0
    assert (told["flags"][ends] & 4 > 0).tolist() == (told["reward"][ends] == 1.0).tolist()


def test_ends_if_the_robot_needs_care(start_program: StartProgram, tmp_path: Path) -> None:
    write_policy(tmp_path / "p.policy", "push", Options.of("push", duration=0.2))
    for place, episodes, exit_code in ((0.25, 1, 6), (0.0, 2, 0)):
        cube = f'[{{"name": "cube", "type": "cube", "position": [{place}, 0, 0.0325]}}]'
        words = ("run", "sim", "--name", "p", "--non-real-time", "--set", f"objects={cube}")
        robot = start_program(*words)
        robot.wait_for("waits for a user")
        done = run(tmp_path / "p.policy", "--episodes", 2, "--end-out-of-reach", "--json")
        assert done.returncode == exit_code, done.stderr
        assert len(done.stdout.splitlines()) == episodes
        said = re.search(r"the cube lies (\d+) cm from the middle, out of reach", done.stderr)
        assert (int(said[1]) > 15) if said else exit_code == 0
        robot.end()
    start_program("run", "sim", "--name", "p", "--non-real-time").wait_for("waits for a user")
    done = run(tmp_path / "p.policy", "--episodes", 2, "--rest-below", 1.0)
    assert done.returncode == 5, done.stderr
    assert "the motors are warm: thermal margin 0.9" in done.stderr
