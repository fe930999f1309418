# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger benchmark`: its tables can be repeated, and are what single episodes come to."""

import csv
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from trifinger import benchmark, policy_file
from trifinger.arrays import Array
from trifinger.commands.benchmark import TASKS, main
from trifinger.environments import Environment, Options, policy_metadata
from trifinger.errors import InvalidArgument
from trifinger.evaluation import interval_of_rate
from trifinger_simulation.tasks import move_cube

PAGE = Path(__file__).parents[2] / "docs/benchmark.md"
OWN = """\
import numpy as np


class Still:
    options = {"action": "position_change", "steps_per_action": 50}

    def reset(self, observation, environment):
        self.begin, self.task = observation["joint_position"], environment.task

    def act(self, observation):
        assert self.task == "reach"
        assert np.abs(observation["joint_position"] - self.begin).max() < 0.1
        return np.zeros(9)


class Wrong:
    options = {"duration": 1.0}

    def reset(self, observation, environment): ...

    def act(self, observation): ...


class Short(Still):
    def act(self, observation):
        return [0.0, 1.0]


def middle(observation):
    if "object_age" in observation:
        assert np.linalg.norm(observation["goal"][:2]) < 0.14
        assert observation["object_is_sure"]
    return 0 * observation["joint_position"]


text = "no controller"
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with controllers and a policy for each of two tasks."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(OWN)
    (shown,) = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    (tmp_path / "my_controllers.py").write_text(shown)
    for module in ("own", "my_controllers"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    write_policy(tmp_path / "reach.policy", "reach", Options.of("reach", friction=(0.5, 1.0)))
    write_policy(tmp_path / "push.policy", "push", Options.of("push", duration=1.0))
    return tmp_path


def write_policy(path: Path, task: str, options: Options, **metadata: str) -> None:
    environment = Environment(task, options=options)
    (inputs,), (outputs,) = environment.observation_space.shape, environment.action_space.shape
    weights = np.random.default_rng(1).normal(size=(outputs, inputs)) / inputs
    layers = [(weights, np.zeros(outputs), "tanh")]
    policy_file.write(path, layers, metadata=policy_metadata(task, options) | metadata)


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """What the command says is wrong."""
    assert main(words) == 2
    output = capsys.readouterr()
    assert output.out == ""
    return output.err


@pytest.mark.usefixtures("folder")
def test_a_table_is_equal_when_it_is_repeated(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["reach", "push", "--policy", "reach.policy", "--policy", "push.policy"]
    words += ["--controller", "random", "--episodes", "2", "-o"]
    assert main([*words, "one"]) == 0
    table = capsys.readouterr().out
    assert main([*words, "two", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    for ending in ("md", "csv", "json"):
        one, two = (Path(name, f"benchmark.{ending}") for name in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()
    assert Path("one/benchmark.md").read_text() == table
    assert json.loads(Path("one/benchmark.json").read_text()) == report
    assert [(row["task"], row["actor"]) for row in report["rows"]] == [
        *(("reach", "reach.policy"), ("reach", "random")),
        *(("push", "push.policy"), ("push", "random")),
    ]
    rows = list(csv.DictReader(Path("one/benchmark.csv").read_text().splitlines()))
    assert [float(row["distance_median"]) for row in rows] == [
        row["figures"]["distance_median"] for row in report["rows"]
    ]
    push = report["rows"][2]
    # The benchmark's own robots and duration, whatever the training's were.
    assert (push["options"]["duration"], push["robot"]) == (15.0, "trifinger_edu")
    assert report["rows"][0]["options"]["friction"] == [1.0, 1.0]
    assert len(push["sha256"]) == 64
    assert push["first_seed"] == 5_000_000_000


def test_figures_are_what_single_episodes_come_to() -> None:
    """The challenge's own cost, from where the cube is in an environment of one robot."""
    count, options = 2, Options.of("push")
    figures = benchmark.judge("push", benchmark.controller("random"), episodes=count).figures
    costs, distances, successes = [], [], 0
    environment = Environment("push", options=options)
    for seed in range(benchmark.SEED, benchmark.SEED + count):
        random = np.random.default_rng(seed)
        _, info = environment.reset(seed=seed)
        goal, cost, has_ended = move_cube.Pose(info["desired_goal"]), [], False
        while not has_ended:
            step = environment.step(random.uniform(-1, 1, 9))
            info, has_ended = step[4], step[2] or step[3]
            cost.append(move_cube.evaluate_state(goal, move_cube.Pose(info["achieved_goal"]), 1))
        cost += [cost[-1]] * (750 - len(cost))
        costs.append(np.mean(cost))
        distances.append(np.linalg.norm(info["achieved_goal"] - info["desired_goal"]))
        successes += distances[-1] <= 0.02
    assert figures["cost"] == pytest.approx(np.mean(costs), rel=1e-5)
    assert figures["cost_deviation"] == pytest.approx(np.std(costs), rel=1e-5)
    assert figures["cost_sum"] == pytest.approx(15_000 * np.mean(costs), rel=1e-5)
    assert figures["distance_median"] == pytest.approx(np.median(distances), rel=1e-5)
    assert figures["successes"] == successes


def test_the_interval_of_a_rate_is_wilsons() -> None:
    stats = pytest.importorskip("scipy.stats")
    for good in range(21):
        wanted = stats.binomtest(good, 20).proportion_ci(method="wilson")
        assert interval_of_rate(good, 20) == pytest.approx(tuple(wanted), abs=1e-4)


def test_dclaws_scores_are_means_over_the_actions() -> None:
    figures = benchmark.judge("dclaw_turn_random", benchmark.controller("zero"), episodes=1).figures
    environment = Environment("dclaw_turn_random")
    environment.reset(seed=benchmark.SEED)
    infos = [environment.step(np.zeros(9, np.float32))[4] for _ in range(40)]
    for name in ("points", "joints_near_limit", "fast_joints", "high_currents"):
        assert figures[name] == pytest.approx(np.mean([info[name] for info in infos]), rel=1e-5)
    assert "cost" not in figures


def test_what_ended_early_costs_what_it_cost_last() -> None:
    rewards = np.array([[-1.0, -2.0, -3.0], [-4.0, np.nan, np.nan]])
    held: Array = benchmark._held(rewards, 4)
    np.testing.assert_array_equal(held, [[-1, -2, -3, -3], [-4] * 4])


@pytest.mark.usefixtures("folder")
def test_controllers_of_ones_own_act(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--controller", "own:middle", "--controller", "zero", "--episodes", "2", "--json"]
    assert main(["reach", "--controller", "own:Still", *words]) == 0
    still, middle, zero = json.loads(capsys.readouterr().out)["rows"]
    assert still["options"]["steps_per_action"] == 50
    assert still["figures"]["distance_median"] != zero["figures"]["distance_median"]
    # A function that answers with zeros does what the controller does that does nothing.
    assert middle["figures"] == zero["figures"]
    assert main(["push", *words]) == 0
    middle, zero = json.loads(capsys.readouterr().out)["rows"]
    assert middle["figures"] == zero["figures"]
    assert main(["push", "--controller", "my_controllers:Hold", "--episodes", "1"]) == 0
    assert "push ['joint_position', 'joint_velocity', 'tip_position'" in capsys.readouterr().out


@pytest.mark.usefixtures("folder")
def test_the_condition_of_the_robots_makes_a_difference() -> None:
    act = benchmark.controller("random")
    rows = [
        benchmark.judge("reach", act, episodes=2, condition=condition)
        for condition in ("as documented", "as built")
    ]
    assert rows[0].figures != rows[1].figures
    assert "; trifinger_edu, as built; seeds from 5,000,000,000." in benchmark.table(rows[1:])
    assert rows[1].options["condition"] == rows[1].condition == "as built"


def test_a_policy_of_something_else_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sentence = said(capsys, "push", "--policy", "reach.policy")
    assert "reach.policy is for the task 'reach', which is not among push" in sentence
    with pytest.raises(InvalidArgument, match="for the task 'reach', not for 'push'"):
        benchmark.judge("push", benchmark.policy(folder / "reach.policy"))
    write_policy(folder / "pro.policy", "reach", Options.of("reach"), robot="trifinger_pro")
    sentence = said(capsys, "--policy", "pro.policy", "--episodes", "1")
    assert (
        "is for the robot 'trifinger_pro', the benchmark 'reach' is on 'trifinger_edu'" in sentence
    )
    assert "--robot-config trifinger_pro" in sentence
    assert (
        main(["--policy", "pro.policy", "--episodes", "1", "--robot-config", "trifinger_pro"]) == 0
    )
    capsys.readouterr()
    goal = Options.of("reach", observation="goal")
    policy_file.write(
        "goal.policy",
        [(np.ones((9, 9)), np.zeros(9), "tanh")],
        metadata=policy_metadata("reach", goal),
    )
    assert 'is for observation="goal"' in said(capsys, "--policy", "goal.policy")
    policy_file.write("none.policy", [(np.ones((9, 9)), np.zeros(9), "tanh")])
    assert "does not say its task" in said(capsys, "--policy", "none.policy")
    metadata = policy_metadata("reach", Options.of("reach"))
    policy_file.write("small.policy", [(np.ones((9, 9)), np.zeros(9), "tanh")], metadata=metadata)
    assert "turns 9 numbers into 9, the task 'reach' needs" in said(
        capsys, "--policy", "small.policy"
    )


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("pusj", "there is no benchmark 'pusj'; did you mean 'push'?"),
        ("push --episodes 0", "--episodes is 0, must be at least 1"),
        ("--controller zero", "a task is needed: reach, push, "),
        ("reach push --policy push.policy", "nothing acts in 'reach'"),
        ("push --controller twice", "--controller twice must be zero, random, or MODULE:CLASS"),
        ("push --controller nowhere:Mine", "there is no module 'nowhere'"),
        ("push --controller own:text", "must be a class with reset(observation, environment)"),
        ("push --controller own:Wrong", "there is no option of a controller 'duration'"),
        ("push --controller own:Short --episodes 1", "'own:Short' acts by array([0., 1.])"),
        ("push --condition broken", "invalid choice: 'broken'"),
    ],
)
def test_what_is_wrong_is_said(
    capsys: pytest.CaptureFixture[str], words: str, sentence: str
) -> None:
    if "invalid choice" in sentence:
        with pytest.raises(SystemExit):
            main(words.split())
        assert sentence in capsys.readouterr().err
    else:
        assert sentence in said(capsys, *words.split())


def test_without_words_it_lists_the_tasks(capsys: pytest.CaptureFixture[str]) -> None:
    assert set(TASKS) == set(benchmark.BENCHMARKS)
    assert main([]) == 0
    assert "move_cube_on_trajectory     20 episodes of 120 s\n" in capsys.readouterr().out
    assert "a task is needed" in said(capsys, "--json")
