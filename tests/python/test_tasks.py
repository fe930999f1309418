# SPDX-License-Identifier: BSD-3-Clause
"""Tasks that are written in Python."""

import copy
import gc
import json
import pickle
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import trifinger
from conftest import StartChild, StartProgram
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from trifinger import policy_file
from trifinger.commands import evaluate, run_policy_of_python
from trifinger.environments import (
    Environment,
    Options,
    VectorEnvironment,
    policy_metadata,
)
from trifinger.tasks import Entry, Random, Start, Task, View

pytestmark = pytest.mark.bindings

CUBE = {"objects": [{"name": "cube", "type": "cube"}]}


class Middle(Task):
    name = "middle"
    options = Options(duration=0.4, action="position_change")
    goal_low = (-0.05, -0.05, 0.08)
    goal_high = (0.05, 0.05, 0.14)

    def achieve(self, view: View) -> Any:
        self.view = view
        return view.tips.mean(axis=1)


class Reach(Task):
    """The task "reach", once more."""

    name = "reach"
    options = Options.of("reach")
    has_goals_of_fingers = True
    goal_low = (-0.3, -0.3, 0.0) * 3
    goal_high = (0.3, 0.3, 0.5) * 3

    def achieve(self, view: View) -> Any:
        return view.tips.reshape(-1, 9)

    def reward(self, achieved: Any, desired: Any) -> Any:
        return -np.linalg.norm((achieved - desired).reshape(-1, 3, 3), axis=2).sum(axis=1) / 3


class Push(Task):
    """All that a task can say: it places the cube, draws again, changes goals, shows, ends."""

    name = "place"
    options = Options(duration=1.5, position_noise=1e-3, friction=(0.7, 1.2))
    config_overrides = CUBE
    object_name = "cube"
    goal_low = (-0.1, -0.1)
    goal_high = (0.1, 0.1)
    entries = (
        Entry("way", (-0.3, -0.3), (0.3, 0.3), "m"),
        Entry("speed", (-10.0,) * 9, (10.0,) * 9, "rad/s"),
    )
    last = 0.9  # when it ends [s]

    def prepare(self, num_robots: int) -> None:
        self.place = np.zeros((num_robots, 2))
        self.seen = np.zeros(num_robots, int)  # observations of an episode

    def draw_start(self, random: Random) -> Start:
        place = random.uniform((-0.1, -0.1), 0.1)
        while (is_far := np.linalg.norm(place, axis=1) > 0.1).any():
            place[is_far] = random[is_far].uniform((-0.1, -0.1), 0.1)
        self.place[random.robots] = place
        self.seen[random.robots] = 0
        turn = 0.1 * random.normal() + random.integer(0, 2)
        zero = np.zeros(len(random))
        return Start(
            object_position=np.column_stack([place, zero + 0.0325]),
            object_orientation=np.column_stack([np.cos(turn), zero, zero, np.sin(turn)]),
        )

    def achieve(self, view: View) -> Any:
        self.seen[view.robots] += 1
        return view.object_position[:, :2]

    def cost(self, view: View) -> Any:
        return 0.01 * np.abs(view.velocity).sum(axis=1) + 0.001 * self.seen[view.robots]

    def num_goals(self, time: Any) -> Any:
        return 1 + time // 0.5

    def has_ended(self, view: View) -> Any:
        return view.time > self.last

    def show(self, view: View) -> Any:
        return np.concatenate([view.goal - view.object_position[:, :2], view.velocity], axis=1)


def run(environment: Environment, seed: int) -> list[Any]:
    """Rewards and observations under random actions."""
    random = np.random.default_rng(seed)
    seen: list[Any] = [environment.reset(seed=seed)[0].copy()]
    over = False
    while not over:
        action = random.uniform(-1, 1, 9).astype(np.float32)
        observation, reward, terminated, truncated, _ = environment.step(action)
        seen += [observation.copy(), reward]
        over = terminated or truncated
    environment.close()
    return seen


def test_gymnasium_finds_nothing_wrong_with_it() -> None:
    check_env(Environment(Middle()), skip_render_check=True)


def test_episodes_of_a_seed_are_the_same_again() -> None:
    one, other = run(Environment(Middle()), 3), run(Environment(Middle()), 3)
    assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
    assert not np.array_equal(run(Environment(Middle()), 4)[0], one[0])


def test_what_it_sees_are_the_tips() -> None:
    task = Middle()
    environment = Environment(task)
    environment.reset(seed=1)
    kinematics = trifinger.Kinematics("trifinger_edu")
    position = environment.process.robot.latest_observation().position
    tips = np.asarray(kinematics.tip_positions(position)).reshape(1, 3, 3)
    assert task.view.tips == pytest.approx(tips, abs=1e-9)
    assert task.view.time == [0.0]
    assert task.view.robots == [0]


def test_the_same_task_in_python_does_what_that_in_cpp_does() -> None:
    own, known = VectorEnvironment(Reach(), 3), VectorEnvironment("reach", 3)
    own.reset(seed=5)
    known.reset(seed=5)
    random = np.random.default_rng(1)
    for step in range(1, own.episode_actions + 1):
        action = random.uniform(-1, 1, (3, 9)).astype(np.float32)
        # Starts and goals differ: those of the task in C++ are drawn in the space of joints. So
        # each is judged by the other, too.
        for environments in (own, known):
            _, reward, terminated, truncated, info = environments.step(action)
            for judge in (own, known):
                rewards = judge.compute_reward(info["achieved_goal"], info["desired_goal"])
                assert reward == pytest.approx(rewards, rel=1e-12)
            way = (info["achieved_goal"] - info["desired_goal"]).reshape(3, 3, 3)
            distance = np.linalg.norm(way, axis=2)
            assert info["distance"] == pytest.approx(distance, rel=1e-12)
            assert info["finger_rewards"] == pytest.approx(-distance, rel=1e-12)
            assert not terminated.any()
            assert (truncated == (step == own.episode_actions)).all()


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        (Middle, {}),
        (Reach, {"duration": 0.4, "per_finger": True, "mapping": "state_augmentation"}),
        (Push, {}),
        (Push, {"duration": 0.3, "observation": "dictionary"}),
    ],
    ids=["middle", "reach", "push", "short push"],
)
def test_many_simulations_are_single_ones_to_the_last_bit(
    kind: type[Task], options: dict[str, Any], mode: AutoresetMode
) -> None:
    count, ends = 5, 0
    vector = VectorEnvironment(kind(), count, num_threads=2, autoreset_mode=mode, **options)
    singles = [Environment(kind(), **options) for _ in range(count)]
    random = np.random.default_rng(2)
    # Episodes end at different times.
    first = random.uniform(-1, 1, (7, count, 9)).astype(np.float32)
    seen, info = vector.reset(seed=7)
    ones = [single.reset(seed=7 + i) for i, single in enumerate(singles)]
    for step in range(60):
        for i, (observation, alone) in enumerate(ones):
            rows = {"all": seen} if not isinstance(seen, dict) else seen
            own = {"all": observation} if not isinstance(observation, dict) else observation
            for name, row in rows.items():
                np.testing.assert_array_equal(row[i], own[name])
            for name in ("achieved_goal", "desired_goal", "distance", "is_success"):
                np.testing.assert_array_equal(info[name][i], alone[name])
        if step == 3:
            marks = np.arange(count) % 2 == 0
            seen, info = vector.reset(options={"reset_mask": marks})
            for i in np.flatnonzero(marks):
                ones[i] = singles[i].reset()
            continue
        actions = first[step % 7]
        seen, rewards, terminated, truncated, info = vector.step(actions)
        for i, single in enumerate(singles):
            if mode == AutoresetMode.NEXT_STEP and not single._is_running:
                ones[i] = single.reset()
                assert rewards[i] == 0.0
                continue
            observation, reward, ended, cut, alone = single.step(actions[i])
            assert (reward, ended, cut) == (rewards[i], terminated[i], truncated[i])
            ones[i] = (observation, alone)
            if (ended or cut) and mode == AutoresetMode.SAME_STEP:
                final = info["final_obs"][i]
                if not isinstance(final, dict):
                    np.testing.assert_array_equal(final, observation)
                assert info["final_info"]["distance"][i] == pytest.approx(alone["distance"], abs=0)
                ones[i] = single.reset()
            ends += ended or cut
        over = terminated | truncated
        if mode == AutoresetMode.DISABLED and over.any():
            seen, info = vector.reset(options={"reset_mask": over})
            for i in np.flatnonzero(over):
                ones[i] = singles[i].reset()
    assert ends >= count  # the marks at step 3 set episodes apart


def test_it_is_asked_once_for_all_robots() -> None:
    calls: list[tuple[str, int]] = []

    class Counted(Push):
        def __getattribute__(self, name: str) -> Any:
            value = super().__getattribute__(name)
            if name not in ("achieve", "reward", "is_success", "has_ended", "show", "draw_start"):
                return value

            def counted(*arguments: Any) -> Any:
                calls.append((name, len(getattr(arguments[0], "robots", arguments[0]))))
                return value(*arguments)

            return counted

    vector = VectorEnvironment(Counted(), 8)
    vector.reset(seed=1)
    calls.clear()
    vector.step(np.zeros((8, 9), np.float32))
    names = ("achieve", "reward", "is_success", "has_ended", "show")
    assert calls == [(name, 8) for name in names]
    calls.clear()
    vector.reset(options={"reset_mask": np.arange(8) < 3})
    assert calls == [("draw_start", 3), *((name, 3) for name in names)]


def test_it_can_place_an_object_change_its_goal_and_end_an_episode() -> None:
    task = Push()
    environment = Environment(task)
    _, info = environment.reset(seed=2)
    assert info["achieved_goal"] == pytest.approx(task.place[0], abs=1e-3)
    goals, terminated, steps = [info["desired_goal"].copy()], False, 0
    while not terminated:
        observation, _, terminated, truncated, info = environment.step(np.zeros(9, np.float32))
        assert not truncated
        goals.append(info["desired_goal"].copy())
        steps += 1
    assert steps == 46
    assert len(np.unique(goals, axis=0)) == 2
    way = info["desired_goal"] - info["achieved_goal"]
    assert environment.entries(observation)["way"] == pytest.approx(way, abs=1e-6)


def test_goal_conditioned_environments_take_it() -> None:
    environment = Environment(Middle(), observation="goal")
    observation, _ = environment.reset(seed=1)
    assert observation["desired_goal"].shape == (3,)
    rewards = environment.compute_reward(np.zeros((4, 3)), np.ones((4, 3)))
    assert rewards == pytest.approx(-np.sqrt(3) * np.ones(4))
    assert environment.compute_reward(np.zeros(3), np.ones(3)) == rewards[0]


def pickled(environment: Environment) -> Any:
    return pickle.loads(pickle.dumps(environment))  # noqa: S301 (what was pickled here)


@pytest.mark.parametrize("again", [copy.deepcopy, pickled])
def test_a_copy_of_an_environment_has_a_task_of_its_own(again: Any) -> None:
    task = Push()
    first = Environment(task)
    first.reset(seed=2)
    second = again(first)
    seen = [one.reset(seed=4)[0] for one in (first, second)]
    np.testing.assert_array_equal(*seen)
    assert task.seen[0] == 1  # observations of an episode: the copy counts its own
    first.close()
    second.close()


MODULE = """
from trifinger.environments import Options
from trifinger.tasks import Task

class Middle(Task):
    options = Options(duration=0.4, action="position_change")
    goal_low = (-0.05, -0.05, 0.08)
    goal_high = (0.05, 0.05, 0.14)

    def achieve(self, view):
        return view.tips.mean(axis=1)

number = 3
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The name of a module in the current folder."""
    (tmp_path / "middle_tasks.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    return "middle_tasks"


def test_a_name_of_module_and_class_is_taken_everywhere(module: str) -> None:
    name = f"{module}:Middle"
    assert Options.of(name).duration == 0.4
    expected = run(Environment(name), 3)
    made = gymnasium.make("TriFinger/Task-v0", task=name, duration=0.4)
    observation, _ = made.reset(seed=3)
    np.testing.assert_array_equal(observation, expected[0])
    many = gymnasium.make_vec("TriFinger/Task-v0", num_envs=2, task=name)
    np.testing.assert_array_equal(many.reset(seed=3)[0][0], expected[0])
    assert VectorEnvironment(name, 2).task == name
    for wrong, says in (
        ("middle_tusks:Middle", "there is no module 'middle_tusks'"),
        (f"{module}:Muddle", "has no class 'Muddle'"),
        (f"{module}:number", "has no class 'number'"),
        (":Middle", "there is no module ''"),
    ):
        with pytest.raises(trifinger.InvalidArgument, match=says):
            Environment(wrong)


class Mistaken(Middle):
    def achieve(self, view: View) -> Any:
        if view.time[0] > 0.1:
            raise LookupError("where is it?")
        return super().achieve(view)


class WrongSize(Middle):
    def achieve(self, view: View) -> Any:
        return [1.0]


class OneReward(Middle):
    def reward(self, achieved: Any, desired: Any) -> Any:
        return 1.0


class NoNumber(Middle):
    def reward(self, achieved: Any, desired: Any) -> Any:
        return np.where(np.arange(len(achieved)) == 1, np.nan, 0.0)


class Words(Middle):
    def draw_goal(self, random: Random) -> Any:
        return "there"


class NoGoal(Task):
    pass


def test_its_mistakes_are_errors_that_say_what_is_wrong() -> None:
    environment = Environment(Mistaken())
    environment.reset(seed=1)
    for _ in range(5):
        environment.step(np.zeros(9, np.float32))
    with pytest.raises(LookupError, match="where is it"):
        environment.step(np.zeros(9, np.float32))
    for kind, says in (
        (WrongSize, r"achieve\(\) of WrongSize\(\) has the shape \(1,\), must have \(2, 3\)"),
        (OneReward, r"reward\(\) .* has the shape \(\), must have \(2,\)"),
        (NoNumber, r"reward\(\) of NoNumber\(\) is nan in row 1, must be finite"),
        (Words, r"draw_goal\(\) of Words\(\) is 'there', must be an array of numbers"),
    ):
        with pytest.raises(trifinger.InvalidArgument, match=says):
            VectorEnvironment(kind(), 2).reset(seed=1)
    with pytest.raises(trifinger.InvalidArgument, match="have 0 numbers, must have 1 to 96"):
        Environment(NoGoal())
    with pytest.raises(trifinger.InvalidArgument, match="task is 3, must be the name"):
        VectorEnvironment(3, 2)  # type: ignore[arg-type]


def test_episodes_begin_again_after_a_mistake() -> None:
    task = Mistaken()
    vector = VectorEnvironment(task, 3, autoreset_mode=AutoresetMode.SAME_STEP)
    vector.reset(seed=1)
    actions = np.zeros((3, 9), np.float32)
    for _ in range(5):
        vector.step(actions)
    with pytest.raises(LookupError):
        vector.step(actions)
    vector.step(actions)
    assert (task.view.time == 0.0).all()
    observation, _ = vector.reset(seed=1)
    np.testing.assert_array_equal(observation[0], Environment(Middle()).reset(seed=1)[0])


def test_random_numbers_are_drawn_only_where_an_episode_or_a_goal_begins() -> None:
    class Keeps(Middle):
        def draw_start(self, random: Random) -> Start:
            self.random = random
            return Start()

    task = Keeps()
    Environment(task).reset(seed=1)
    with pytest.raises(trifinger.InvalidArgument, match="in draw_start"):
        task.random.normal()


class Fingers(Middle):
    has_goals_of_fingers = True
    goal_low: Any = (-0.3,) * 9
    goal_high: Any = (0.3,) * 9

    def achieve(self, view: View) -> Any:
        return view.tips.reshape(len(view.tips), 9)

    def reward(self, achieved: Any, desired: Any) -> Any:
        return np.zeros(len(achieved))

    def show(self, view: View) -> Any:
        return np.zeros((len(view.time), sum(len(entry.low) for entry in self.entries)))


@pytest.mark.parametrize(
    ("attributes", "says"),
    [
        ({"goal_low": (-1.0,) * 3, "goal_high": (1.0,) * 3}, "have 3 numbers, must have 9"),
        ({"entries": (Entry("way", (-1,), (1,)),)}, "'way' has 1 numbers, not 9"),
        ({"object_name": "cube", "config_overrides": CUBE}, "'object_position' has 3 numbers"),
        ({"goal_low": (0.0,) * 9, "goal_high": (0.0,) * 9}, "is from 0 to 0"),
        ({"goal_low": (1.0,) * 9}, "is from 1 to 0.3"),
        ({"goal_low": (np.nan,) * 9}, "is from nan to 0.3"),
        ({"goal_high": (np.inf,) * 9}, "is from -0.3 to inf"),
        ({"goal_high": (0.3,) * 8}, "9 numbers, goal_high has 8"),
        ({"entries": (Entry("way", (1,) * 9, (0,) * 9),)}, "number 0 of 'way' .* from 1 to 0"),
        ({"entries": (Entry("way", (), ()),)}, "'way' .* 0 lower and 0 upper bounds"),
        ({"entries": (Entry("way", (-1,) * 9, (1,) * 9),) * 2}, "two entries .* called 'way'"),
        ({"entries": (Entry("image_age", (-1,) * 9, (1,) * 9),)}, "called 'image_age', which no"),
        ({"entries": (Entry("", (-1,) * 9, (1,) * 9),)}, "called '', which no"),
    ],
)
def test_goals_and_entries_that_nothing_can_be_between_are_refused(
    attributes: dict[str, Any], says: str
) -> None:
    kind = type("Wrong", (Fingers,), attributes)
    for make in (Environment, lambda task: VectorEnvironment(task, 3)):
        with pytest.raises(trifinger.InvalidArgument, match=says):
            make(kind())


def test_entries_of_goals_of_fingers_need_not_be_for_fingers_in_a_dictionary() -> None:
    kind = type("Short", (Fingers,), {"entries": (Entry("way", (-1,), (1,)),)})
    observation, _ = Environment(kind(), observation="dictionary").reset(seed=1)
    assert isinstance(observation, dict)
    assert {name: len(row) for name, row in observation.items()} == {"way": 1, "tracking_error": 9}


@pytest.mark.parametrize(
    ("draw", "says"),
    [
        (lambda random: random.uniform([], []), "there are no bounds"),
        (lambda random: random.uniform(np.nan, 1), "from nan to 1"),
        (lambda random: random.uniform(-np.inf, 1), "from -inf to 1"),
        (lambda random: random.uniform((0, 1), (1, 0)), "from 1 to 0"),
        (lambda random: random.integer(5, 2), "no integer from 5 up to but not including 2"),
        (lambda random: random.integer(0, 0), "no integer from 0 up to but not including 0"),
    ],
)
def test_random_numbers_need_bounds_with_numbers_between_them(draw: Any, says: str) -> None:
    class Draws(Middle):
        def draw_start(self, random: Random) -> Start:
            draw(random)
            return Start()

    with pytest.raises(trifinger.InvalidArgument, match=says):
        Environment(Draws()).reset(seed=1)


def test_rewards_of_goals_are_those_of_the_task_in_every_environment() -> None:
    achieved, desired = np.zeros((4, 3)), np.ones((4, 3))
    for environment in (Environment(Middle()), VectorEnvironment(Middle(), 2)):
        rewards = environment._core.compute_reward(achieved, desired)
        assert rewards == pytest.approx(-np.sqrt(3) * np.ones(4))
        with pytest.raises(trifinger.InvalidArgument, match="4 achieved goals, but 2"):
            environment._core.compute_reward(achieved, desired[:2])


def test_an_object_serves_one_environment() -> None:
    task = Middle()
    environment = Environment(task)
    for make in (Environment, lambda task: VectorEnvironment(task, 2)):
        with pytest.raises(
            trifinger.InvalidArgument, match=r"this Middle\(\) serves another .*test_tasks:Middle'"
        ):
            make(task)
    with pytest.raises(trifinger.InvalidArgument, match="serves another environment"):
        gymnasium.make_vec(
            "TriFinger/Task-v0", num_envs=2, vectorization_mode="sync", task=Middle()
        )
    environment.close()
    Environment(copy.deepcopy(task))
    del environment
    gc.collect()
    Environment(task)


@pytest.mark.parametrize("place", [(0.02, 0.03, 0.0325), None])
def test_an_object_begins_where_the_configuration_says(place: Any) -> None:
    cube: dict[str, Any] = {"name": "cube", "type": "cube"}
    objects = {"objects": [cube | ({"position": place} if place else {})]}

    class Lies(Push):
        config_overrides = objects

        def draw_start(self, random: Random) -> Start:
            self.seen[random.robots] = 0
            return Start()

        def achieve(self, view: View) -> Any:
            self.position = view.object_position
            return super().achieve(view)

    one, many = Lies(), Lies()
    environment, vector = Environment(one), VectorEnvironment(many, 2)
    environment.reset(seed=1)
    vector.reset(seed=1)
    for task in (one, many):
        assert task.position[0] == pytest.approx(place or (0.0, 0.0, 0.0325), abs=1e-4)
    for _ in range(5):
        environment.step(np.zeros(9, np.float32))
    assert one.position[0, 2] == pytest.approx(0.0325, abs=1e-3)


@pytest.mark.parametrize(
    ("start", "says"),
    [
        (Start(position=[(0.0, 0.9, -1.7) * 3, (9.0,) * 9]), "joint 0 at 9 in row 1"),
        (Start(object_orientation=[(1, 0, 0, 0), (0, 0, 0, 0)]), "no pose of the object in row 1"),
    ],
)
def test_a_start_that_no_robot_can_have_is_refused(start: Start, says: str) -> None:
    class Starts(Push):
        def draw_start(self, random: Random) -> Start:
            return start

    vector = VectorEnvironment(Starts(), 2)
    with pytest.raises(trifinger.InvalidArgument, match=says):
        vector.reset(seed=1)


class Needs(Middle):
    def __init__(self, size: float) -> None:
        self.size = size


@pytest.mark.parametrize(
    ("task", "says"),
    [
        ("..evil:X", "there is no module '..evil'"),
        ("nopkg.sub:X", "there is no module 'nopkg.sub'"),
        ("os:system", "the module 'os' has no class 'system'"),
        ("this:X", "the module 'this' has no class 'X'"),
        (f"{__name__}:Needs", "__init__ needs arguments"),
        (type("A", (Middle,), {"goal_low": 0.1})(), "A.goal_low is 0.1, must be a list of numbers"),
        (type("A", (Middle,), {"goal_low": "abc"})(), "A.goal_low is 'abc', must be a list"),
        (type("A", (Middle,), {"name": 3})(), "A.name is 3, must be a text"),
        (type("A", (Middle,), {"goal_low": ("1",) * 3})(), "must be a list of numbers"),
        (type("A", (Middle,), {"num_fingers": 10**12})(), "must be 0 to 3"),
        (type("A", (Middle,), {"options": {}})(), "A.options is {}, must be Options"),
        (type("A", (Middle,), {"entries": [("a", [0], [1])]})(), "must be a list of Entry"),
        (type("A", (Middle,), {"entries": [Entry("a", 0, 1)]})(), "low is 0, must be a list"),  # type: ignore[arg-type]
    ],
)
def test_a_task_that_says_something_impossible_is_refused_with_a_sentence(
    task: Any, says: str
) -> None:
    with pytest.raises(trifinger.InvalidArgument, match=says):
        Environment(task)


def test_a_start_must_be_a_start_and_success_a_truth_value() -> None:
    class Nothing(Middle):
        def draw_start(self, random: Random) -> Any:
            return None

    class Distance(Middle):
        def is_success(self, achieved: Any, desired: Any) -> Any:
            return np.linalg.norm(achieved - desired, axis=1)

    class Counts(Middle):
        def is_success(self, achieved: Any, desired: Any) -> Any:
            return np.ones(len(achieved), int)

    for kind, says in ((Nothing, "must be a Start"), (Distance, "must be True or False")):
        with pytest.raises(trifinger.InvalidArgument, match=says):
            Environment(kind()).reset(seed=1)
    assert Environment(Counts()).reset(seed=1)[1]["is_success"] is True


def test_after_a_mistake_the_episode_has_ended_and_its_steps_count() -> None:
    environment = Environment(Mistaken())
    environment.reset(seed=1)
    for _ in range(5):
        environment.step(np.zeros(9, np.float32))
    before = environment.process.time_index
    with pytest.raises(LookupError):
        environment.step(np.zeros(9, np.float32))
    assert environment.process.time_index == before + environment.options.steps_per_action
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment.step(np.zeros(9, np.float32))
    observation, _ = environment.reset(seed=1)
    np.testing.assert_array_equal(observation, Environment(Middle()).reset(seed=1)[0])


def test_after_a_mistake_a_connected_robot_is_given_back() -> None:
    simulation = trifinger.Simulation("trifinger_edu", {"objects": []})
    environment = Environment(Mistaken(), connect=simulation.connect)
    environment.reset(seed=1)
    for _ in range(5):
        environment.step(np.zeros(9, np.float32))
    with pytest.raises(LookupError):
        environment.step(np.zeros(9, np.float32))
    with simulation.connect():
        pass


def test_a_reset_that_fails_leaves_no_episode() -> None:
    task = Mistaken()
    vector = VectorEnvironment(task, 3, autoreset_mode=AutoresetMode.DISABLED)
    vector.reset(seed=1)
    task.achieve = lambda view: 1 / 0 * view  # type: ignore[method-assign]
    with pytest.raises(ZeroDivisionError):
        vector.reset(options={"reset_mask": np.arange(3) == 1})
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"simulations \[1\]"):
        vector.step(np.zeros((3, 9), np.float32))
    del task.achieve
    vector.reset(options={"reset_mask": np.arange(3) == 1})
    vector.step(np.zeros((3, 9), np.float32))


def test_a_refused_second_stepper_changes_nothing() -> None:
    """While one thread steps, another is refused; the first one's episode goes on as if alone."""
    alone = Environment(Middle(), action="position_change")
    alone.reset(seed=1)
    expected = alone.step(np.full(9, 0.5, np.float32))[0]

    environment = Environment(Middle(), action="position_change")
    environment.reset(seed=1)
    refused: list[Exception] = []
    task = environment._own
    assert isinstance(task, Middle)
    # The task is asked while the turn of the first step lasts.
    achieve = task.achieve

    def steps_again(view: View) -> Any:
        task.achieve = achieve  # type: ignore[method-assign]
        try:
            environment.step(np.full(9, -0.5, np.float32))
        except trifinger.ControlHeld as error:
            refused.append(error)
        return achieve(view)

    task.achieve = steps_again  # type: ignore[method-assign]
    observation = environment.step(np.full(9, 0.5, np.float32))[0]
    assert len(refused) == 1
    np.testing.assert_array_equal(observation, expected)
    environment.step(np.zeros(9, np.float32))


FINGERS = """
import os
import signal
from trifinger.environments import Options
from trifinger.tasks import Task

class Fingers(Task):
    options = Options(duration=0.2, action="position_change", per_finger=True)
    has_goals_of_fingers = True
    goal_low = (-0.3, -0.3, 0.0) * 3
    goal_high = (0.3, 0.3, 0.5) * 3

    def achieve(self, view):
        return view.tips.reshape(len(view.tips), 9)

class Ended(Fingers):
    begun = 0

    def achieve(self, view):
        self.begun += int(view.time[0] == 0.0)
        if self.begun == 2 and view.time[0] > 0.0:
            os.kill(os.getpid(), signal.SIGTERM)
        return super().achieve(view)
"""


@pytest.fixture
def policy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Writes a policy that the fingers share, for a task of a module in the current folder."""
    (tmp_path / "finger_tasks.py").write_text(FINGERS)
    monkeypatch.chdir(tmp_path)

    def write(kind: str) -> str:
        name = f"finger_tasks:{kind}"
        policy_file.write(
            f"{kind}.policy",
            [(np.zeros((3, 12)), np.zeros(3), "identity")],
            metadata=policy_metadata(name, Options.of(name)),
        )
        monkeypatch.delitem(sys.modules, "finger_tasks")
        return name

    return write


def test_no_file_alone_decides_what_is_imported(
    policy: Any, start_fake: StartChild, capsys: pytest.CaptureFixture[str]
) -> None:
    start_fake("x")
    name = policy("Fingers")
    says = f"runs what is in the module 'finger_tasks': if you would run that, say --task {name}"
    for main in (evaluate.main, run_policy_of_python.main):
        assert main(["Fingers.policy"]) == 2
        assert says in capsys.readouterr().err
    assert run_policy_of_python.main(["Fingers.policy", "--task", "finger_tasks:Other"]) == 2
    assert f"is for the task '{name}', not for" in capsys.readouterr().err
    assert "finger_tasks" not in sys.modules
    assert evaluate.main(["Fingers.policy", "--task", name, "--episodes", "2"]) == 0


@pytest.mark.without_sanitizer  # it needs the program
def test_a_policy_that_fingers_share_runs_and_what_it_did_is_kept(
    policy: Any, start_program: StartProgram, capsys: pytest.CaptureFixture[str]
) -> None:
    start_program("run", "trifinger_edu", "--name", "p", "--non-real-time").wait_for(
        "waits for a user"
    )
    name = policy("Fingers")
    words = ["Fingers.policy", "--robot", "p", "--task", name, "--episodes", "2", "-o", "j"]
    assert run_policy_of_python.main(words) == 0
    assert [one["actions"] for one in json.loads(Path("j").read_text())] == [10, 10]
    assert run_policy_of_python.main([*words, "--scheduling", "require"]) == 2
    assert "keeps no real-time promise" in capsys.readouterr().err
    # SIGTERM in the second episode ends it like Ctrl-C.
    name = policy("Ended")
    words = ["Ended.policy", "--robot", "p", "--task", name, "--episodes", "3", "-o", "k"]
    assert run_policy_of_python.main(words) == 130
    assert [one["episode"] for one in json.loads(Path("k").read_text())] == [0]
    assert "1 of 1" in (said := capsys.readouterr().out) or "0 of 1" in said
    trifinger.connect("p").close()
