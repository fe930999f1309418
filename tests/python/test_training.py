# SPDX-License-Identifier: BSD-3-Clause
"""Trainings: that they learn, that a kill changes nothing, and what Stable-Baselines3 is shown."""

import contextlib
import io
import json
import multiprocessing
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import av
import killed_training
import numpy as np
import pytest
import torch
import trifinger
from conftest import PROGRAM, output_of
from gymnasium.vector import AutoresetMode
from link_into_venv import write_scripts
from stable_baselines3 import DDPG
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from trifinger import evaluation, policy_file
from trifinger._trifinger import task_names
from trifinger.commands import evaluate, train
from trifinger.environments import Environment, Options, VectorEnvironment
from trifinger.errors import InvalidArgument
from trifinger.stable_baselines import Rows
from trifinger.training import CHECKPOINT, CURVE, PLAN, Plan, Training, checkpoint
from trifinger.training.ddpg import QuickDDPG
from trifinger.training.model import MODELS
from trifinger.training.replay import FingerReplayBuffer

ROOT = Path(__file__).parents[2]

# The shortest training that has all parts of a long one.
SHORT = {"duration": 0.2, "batch_size": 20, "layers": (16, 16), "random_actions": 15}


def short_plan(algorithm="ddpg", **more):
    more = {"is_shared": True, "episodes": 6, "evaluation_interval": 2} | more
    settings = SHORT | more.pop("settings", {})
    return Plan.of("reach", algorithm, settings=settings, checkpoint_interval=1, **more)


def trained(plan, folder):
    training = Training(plan, folder)
    training.run()
    training.close()
    return training


@pytest.fixture(scope="module", autouse=True)
def _one_processor():
    """One processor for each worker: threads on all of them would wait for other tests."""
    before = os.sched_getaffinity(0)
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    os.sched_setaffinity(0, {sorted(before)[worker % len(before)]})
    yield
    os.sched_setaffinity(0, before)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The folder of a training that nobody has killed."""
    return trained(short_plan(), tmp_path_factory.mktemp("undisturbed")).folder


@pytest.mark.slow
def test_a_short_training_comes_within_4_cm(tmp_path):
    training = Training(Plan.of("reach", "ddpg", is_shared=True, episodes=20), tmp_path)
    assert training.run().median < 0.04
    policy = trifinger.Policy(training.policy_path)
    perfect = evaluation.evaluate(policy, "reach")
    assert perfect.summary().median < 0.04
    as_built = evaluation.evaluate(policy, "reach", condition="as built")
    assert not np.array_equal(as_built.distances, perfect.distances)
    assert as_built.summary().median < 0.05
    with pytest.raises(InvalidArgument, match="condition"):
        evaluation.evaluate(policy, "reach", condition="broken")


@pytest.mark.slow
def test_a_training_has_figures(undisturbed, tmp_path):
    shutil.copytree(undisturbed, tmp_path, dirs_exist_ok=True)
    Training.resume(tmp_path).save_figures()
    for figure in ("curve.png", "tips.png", "film.mp4"):
        assert (tmp_path / figure).stat().st_size > 1000
    assert list((tmp_path / "tensorboard").iterdir())


@pytest.mark.parametrize("algorithm", [*MODELS, "ppo"])
@pytest.mark.parametrize("is_shared", [False, True])
def test_every_algorithm_ends_in_a_file_of_its_policy(algorithm, is_shared, tmp_path):
    settings = {"num_envs": 2, "rollout": 10}
    plan = short_plan(algorithm, is_shared=is_shared, settings=settings)
    training = trained(plan, tmp_path)
    policy = trifinger.Policy(training.policy_path)
    observations = np.random.default_rng(1).uniform(-1, 1, (20, policy.num_inputs))
    observations = observations.astype(np.float32)
    np.testing.assert_allclose(
        evaluation.act_of(policy)(observations), training.act(observations), atol=1e-6
    )
    assert policy.metadata["task"] == "reach"
    assert Options.from_json(policy.metadata["options"]) == plan.options
    assert training.curve[0][0] == 0
    assert training.curve[-1][0] == training.episodes == plan.episodes


# ---- kills ----

# Each process begins as a copy of one that has imported these modules.
PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload(["torch._dynamo", "tensorboard", "trifinger.training"])


def run_until_killed(folder, plan, module, name, count):
    words = (folder, plan.to_json(), module, name, count)
    process = PROCESSES.Process(target=killed_training.run, args=words)
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL


def assert_same_training(folder, other):
    assert (folder / CURVE).read_text() == (other / CURVE).read_text()
    assert (folder / "reach.policy").read_bytes() == (other / "reach.policy").read_bytes()


STEP = ("trifinger.environments", "Environment.step")
TRAIN = ("trifinger.training.ddpg", "QuickDDPG.train")


@pytest.mark.slow
@pytest.mark.parametrize(("place", "count"), [(STEP, 5), (STEP, 17), (STEP, 40), (TRAIN, 23)])
def test_fault_65_a_killed_training_ends_as_if_it_had_not_been(place, count, undisturbed, tmp_path):
    run_until_killed(tmp_path, short_plan(), *place, count)
    training = Training.resume(tmp_path)
    training.run()
    assert_same_training(tmp_path, undisturbed)


@pytest.mark.slow
def test_fault_65_a_training_may_be_killed_again_and_again(undisturbed, tmp_path):
    for _ in range(3):
        run_until_killed(tmp_path, short_plan(), *STEP, 15)
    Training.resume(tmp_path).run()
    assert_same_training(tmp_path, undisturbed)


@pytest.mark.slow
def test_fault_65_a_killed_training_of_many_robots_goes_on_with_what_it_knows(tmp_path):
    # Updates come at the ends of episodes, so the kill loses no episode.
    settings = {"num_envs": 2, "rollout": 10}
    plan = short_plan("ppo", is_shared=False, episodes=12, settings=settings)
    undisturbed = trained(plan, tmp_path / "undisturbed").folder
    killed = tmp_path / "killed"
    run_until_killed(killed, plan, "rsl_rl.algorithms.ppo", "PPO.update", 4)
    Training.resume(killed).run()
    assert_same_training(killed, undisturbed)


# Kills while a checkpoint is written: before its bytes are safe on disk, and before it gets its
# name.
@pytest.mark.parametrize("place", [("os", "fsync"), ("pathlib", "Path.replace")])
@pytest.mark.parametrize("count", [2, 7])
def test_fault_66_a_training_killed_while_it_writes_keeps_what_it_had(
    place, count, undisturbed, tmp_path
):
    run_until_killed(tmp_path, short_plan(), *place, count)
    Training.resume(tmp_path).run()
    assert_same_training(tmp_path, undisturbed)


def test_a_checkpoint_is_the_old_or_the_new_one(tmp_path):
    training = Training(short_plan(episodes=2), tmp_path)
    training.run()
    whole = (tmp_path / CHECKPOINT).read_bytes()
    (tmp_path / f"{CHECKPOINT}.partial").write_bytes(whole[: len(whole) // 2])
    assert Training.resume(tmp_path).run() == training.curve[-1][1]


# ---- untrusted checkpoints ----


class Touching:
    """Makes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def files_that_run(path):
    """Files that would make `path` if a reader believed what they say."""
    yield pickle.dumps(Touching(path))
    yield pickle.dumps({"model": Touching(path)})
    for write in (np.savez, np.savez_compressed):
        file = io.BytesIO()
        write(file, **{"0": np.array(Touching(path), object), "state.json": np.zeros(1, object)})
        yield file.getvalue()
    file = io.BytesIO()
    torch.save({"model": Touching(path)}, file)
    yield file.getvalue()


def test_fault_83_an_untrusted_checkpoint_runs_nothing(undisturbed, tmp_path):
    shutil.copytree(undisturbed, tmp_path / "run")
    ran = tmp_path / "ran"
    for content in files_that_run(ran):
        (tmp_path / "run" / CHECKPOINT).write_bytes(content)
        with pytest.raises(
            InvalidArgument, match=r"is no checkpoint of this training.*begins anew"
        ):
            Training.resume(tmp_path / "run")
        assert not ran.exists()


def test_fault_83_a_changed_checkpoint_is_refused_or_read(undisturbed):
    content = (undisturbed / CHECKPOINT).read_bytes()
    plan = Plan.of_folder(undisturbed)
    random = np.random.default_rng(1)
    state = checkpoint.load(content)
    assert state["curve"]
    assert plan.recipe.algorithm == "ddpg"
    for _ in range(200):
        changed = bytearray(content)
        if random.random() < 0.3:
            del changed[random.integers(len(changed)) :]
        for place in random.integers(len(changed), size=4):
            changed[place] = random.integers(256)
        with contextlib.suppress(ValueError, LookupError):
            checkpoint.load(bytes(changed))


def test_a_checkpoint_keeps_every_kind_of_value():
    values = {
        "numbers": [1, -(2**100), 0.1, float("inf"), True, None, "é", np.float32(0.5).item()],
        "nested": (1, [2, (3, {"four": 4, 5: "five"})]),
        "arrays": [np.eye(2, 3, dtype=kind) for kind in (bool, int, np.float32)],
        "tensor": torch.arange(3.0),
        "scalar": torch.tensor(2.5),
        "empty": np.zeros((0, 3)),
    }
    found = checkpoint.load(checkpoint.dump(values))
    assert found.keys() == values.keys()
    assert found["numbers"] == values["numbers"]
    assert found["nested"] == values["nested"]
    for one, other in zip(found["arrays"], values["arrays"], strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    assert torch.equal(found["tensor"], values["tensor"])
    assert torch.equal(found["scalar"], values["scalar"])
    assert found["empty"].shape == (0, 3)


def test_other_seeds_are_other_trainings(undisturbed, tmp_path):
    trained(short_plan(seed=2), tmp_path)
    assert (tmp_path / CURVE).read_text() != (undisturbed / CURVE).read_text()


# ---- what Stable-Baselines3 sees ----


def vector(num_envs=2, **options):
    return VectorEnvironment(
        "reach",
        num_envs,
        options=Options.of("reach", per_finger=True, duration=0.1, **options),
        autoreset_mode=AutoresetMode.SAME_STEP,
    )


def test_a_shared_policy_sees_a_row_for_each_finger():
    rows, whole = Rows(vector(), is_per_finger=True, is_shared=True), vector()
    first = rows.begin(3, [0, 0])
    seen, _ = whole.reset(seed=3)
    assert rows.num_envs == 6
    np.testing.assert_array_equal(first, seen.reshape(6, 9))
    rng = np.random.default_rng(0)
    ends = 0
    while ends < 3:
        actions = rng.uniform(-1, 1, (6, 3)).astype(np.float32)
        mine, rewards, dones, infos = rows.step(actions)
        seen, _, _, truncated, info = whole.step(actions.reshape(2, 9))
        np.testing.assert_array_equal(mine, seen.reshape(6, 9))
        np.testing.assert_array_equal(dones, np.repeat(truncated, 3))
        # In a reach, all episodes end together, and fingers get their negative distances.
        ended = truncated.all()
        distances = (info["final_info"] if ended else info)["distance"]
        np.testing.assert_allclose(rewards, -distances.ravel(), rtol=1e-6)
        assert all(("terminal_observation" in one) == ended for one in infos)
        if ended:
            last = np.stack([one["terminal_observation"] for one in infos])
            np.testing.assert_array_equal(last, np.stack(info["final_obs"]).reshape(6, 9))
            assert all(one["TimeLimit.truncated"] for one in infos)
        ends += ended


@pytest.mark.parametrize(
    ("options", "size"),
    [({}, 9), ({"mapping": "state_augmentation"}, 12), ({"action": "position_change"}, 12)],
)
@pytest.mark.parametrize("is_shared", [False, True])
def test_a_batch_put_together_finger_by_finger_has_the_rewards_of_its_parts(
    is_shared, options, size
):
    rows = Rows(vector(**options), is_per_finger=True, is_shared=is_shared, reward_scale=10.0)
    low, high = np.array([-0.3, -0.3, 0.0]), np.array([0.3, 0.3, 0.5])
    buffer = FingerReplayBuffer(
        100,
        rows.observation_space,
        rows.action_space,
        n_envs=rows.num_envs,
        relabelled=0.0,
        reward_scale=10.0,
        goal_low=low,
        goal_high=high,
    )
    rng = np.random.default_rng(0)
    seen = rows.begin(3, [0, 0])
    parts = {}
    for _ in range(30):
        actions = rng.uniform(-1, 1, (rows.num_envs, rows.action_space.shape[0]))
        following, rewards, dones, infos = rows.step(actions.astype(np.float32))
        for row, info in enumerate(infos):
            fingers = seen[row].reshape(-1, size)
            middle, half = (high + low) / 2, (high - low) / 2
            goals = fingers[:, -3:] * half + middle
            distance = np.linalg.norm(goals - info["achieved_goal"].reshape(-1, 3), axis=1)
            assert rewards[row] == pytest.approx(-10.0 * distance.mean(), rel=1e-5)
            parts |= {
                finger.tobytes(): -10.0 * one for finger, one in zip(fingers, distance, strict=True)
            }
        last = [
            info.get("terminal_observation", row)
            for info, row in zip(infos, following, strict=True)
        ]
        buffer.add(seen, np.stack(last), actions, rewards, dones, infos)
        seen = following
    batch = buffer.sample(64)
    for row, reward in zip(batch.observations.numpy(), batch.rewards.numpy(), strict=True):
        expected = np.mean([parts[finger.tobytes()] for finger in row.reshape(-1, size)])
        assert reward == pytest.approx(expected, rel=1e-4)
    assert not batch.dones.any()  # episodes ended only because their time was over
    buffer._relabelled = 1.0
    batch = buffer.sample(64)
    fingers = batch.observations.numpy().reshape(-1, size)
    goals = {tuple(goal) for goal in buffer._achieved.reshape(-1, 3)}
    assert all(tuple(finger[-3:]) in goals for finger in fingers)
    np.testing.assert_array_equal(
        fingers[:, -3:], batch.next_observations.numpy().reshape(-1, size)[:, -3:]
    )


@pytest.mark.parametrize("task", ["push", "lift", "lift_pose", "move_cube_on_trajectory", "throw"])
def test_coming_nearer_is_rewarded_by_as_much(task):
    def make(**more):
        options = Options.of(task, duration=0.2, **more)
        return VectorEnvironment(task, 2, options=options, autoreset_mode=AutoresetMode.SAME_STEP)

    def away_of(tips, place, goal):
        offset = goal[:3] - place[: min(3, len(goal))]
        aside = np.hypot(*offset[:2])
        behind = [*(place[:2] - min(0.045, aside) * offset[:2] / aside), place[2]]
        reach = min(np.linalg.norm(tip - behind) for tip in tips.reshape(3, 3))
        return reach + 2 * np.linalg.norm(offset)

    def away(seen):
        names = ("tip_position", "object_position", "goal")
        rows = zip(*(np.asarray(seen[name], float) for name in names), strict=True)
        return np.array([away_of(*row) for row in rows])

    plain = Rows(make(), reward_scale=2.0)
    drawn = Rows(make(), reward_scale=2.0, approach=3.0, gamma=0.9)
    shown = make(observation="dictionary")
    for rows in (plain, drawn):
        rows.begin(5, [0, 0])
    before = away(shown.reset(seed=5)[0])
    rng = np.random.default_rng(0)
    ends = 0
    while ends < 2:
        actions = rng.uniform(-1, 1, (2, 9)).astype(np.float32)
        extra = drawn.step(actions)[1] - plain.step(actions)[1]
        seen, _, _, ended, info = shown.step(actions)
        after = away(seen)
        reached = after
        if ended.all():
            reached = away({key: np.stack([one[key] for one in info["final_obs"]]) for key in seen})
            ends += 1
        np.testing.assert_allclose(extra, 3.0 * (before - 0.9 * reached), atol=1e-4)
        before = after


def test_nothing_is_near_where_nothing_follows(monkeypatch):
    options = Options.of("push", duration=0.2)
    world = VectorEnvironment("push", 1, options=options, autoreset_mode=AutoresetMode.SAME_STEP)
    rows = Rows(world, approach=3.0, gamma=0.9)
    rows.begin(5, [0])
    potential = rows._potentials.copy()
    core = world.step

    def end(actions):
        seen, rewards, terminated, truncated, info = core(actions)
        last = np.full(1, None, object)
        last[0] = seen[0]
        info |= {"final_obs": last, "final_info": info}
        return seen, np.zeros_like(rewards), ~terminated, truncated, info

    monkeypatch.setattr(world, "step", end)
    assert rows.step(np.zeros((1, 9)))[1] == pytest.approx(-potential, rel=1e-5)


def test_an_activation_that_serves_twice_is_written_twice(tmp_path):
    for activation in (torch.nn.ELU(), torch.nn.ReLU(), torch.nn.Tanh()):
        linear = [torch.nn.Linear(*sizes) for sizes in ((3, 8), (8, 8), (8, 2))]
        network = torch.nn.Sequential(linear[0], activation, linear[1], activation, linear[2])
        policy = policy_file.write(tmp_path / "p.policy", policy_file.layers_of(network))
        seen = np.random.default_rng(1).normal(size=3).astype(np.float32)
        with torch.no_grad():
            np.testing.assert_allclose(policy(seen), network(torch.from_numpy(seen)), atol=1e-6)


def test_a_critic_may_see_what_is_hidden(tmp_path):
    settings = {"num_envs": 4, "rollout": 20, "duration": 0.2, "object_mass": (0.5, 2.0)}
    hidden = VectorEnvironment("push", 1).hidden
    size = sum(numbers.shape[1] for numbers in hidden.values())
    for asymmetric in (False, True):
        plan = Plan.of("push", "ppo", episodes=8, settings=settings | {"asymmetric": asymmetric})
        model = trained(plan, tmp_path / str(asymmetric))._model
        seen = model._seen["seen"].shape[1]
        assert model._actor.obs_dim == seen
        assert model._critic.obs_dim == seen + (size if asymmetric else 0)
    other = model._seen.clone()
    other["hidden"] += 0.1
    with torch.no_grad():
        assert not torch.equal(model._critic(other), model._critic(model._seen))
        assert torch.equal(model._actor(other), model._actor(model._seen))


def test_noise_of_actions_goes_on_learning_at_its_bounds(tmp_path):
    plan = Plan.of(
        "reach", "ppo", episodes=16, settings=SHORT | {"initial_noise": 1.0, "rollout": 10}
    )
    parameter = trained(plan, tmp_path)._model._actor.distribution.log_std_param
    assert (parameter <= 0.0).all()
    assert parameter.grad is not None
    assert (parameter.grad != 0.0).all()


def test_nearness_is_worth_what_it_says():
    rows = Rows(VectorEnvironment("push", 2, autoreset_mode=AutoresetMode.SAME_STEP), kernel=0.5)
    observations = rows.begin(1, [0, 0])
    goal = rows.entries(observations)["goal"]
    places, low, high = rows.flat["object_position"]
    for distance, worth in ((0.0, 1.0), (0.02, 0.43), (0.05, 0.07), (0.2, 0.0)):
        aside = np.add(goal, [distance, 0, 0])
        observations[:, places] = 2 * (aside - low) / (high - low) - 1
        np.testing.assert_allclose(rows._potential(observations)[1], worth, atol=0.01)


def test_a_goal_that_changes_is_no_gain_and_turns_all_that_is_seen():
    many = VectorEnvironment(
        "move_cube_on_trajectory",
        3,
        steps_per_action=500,
        symmetric_view=True,
        autoreset_mode=AutoresetMode.SAME_STEP,
    )
    rows = Rows(many, reward_scale=0.0, approach=20.0)
    goal = rows.entries(rows.begin(2, [0, 0, 0]))["goal"]
    changes = 0
    for _ in range(110):  # s / 2; the first goal is for 30 s, the others for 10
        step = rows.move(np.zeros((3, 9), np.float32))
        assert not step.ended.any()
        seen = rows.entries(step.observations)
        changes += (np.abs(seen["goal"] - goal).max(axis=1) > 1e-3).sum()
        goal = seen["goal"]
        assert np.abs(step.rewards).max() < 0.3
        place = many.hidden["true_object_position"]
        np.testing.assert_allclose(place, seen["object_position"], atol=1e-3)
    assert changes >= 3 * 3


def test_a_recipe_brings_its_episodes_unless_others_are_asked_for():
    plan = Plan.of("push", "ppo")
    assert (plan.episodes, plan.options.duration, plan.evaluation_interval) == (60000, 6.0, 600)
    plan = Plan.of("push", "ppo", episodes=10, settings={"duration": 1.0})
    assert (plan.episodes, plan.options.duration) == (10, 1.0)
    assert Plan.of("throw", "ppo").options.duration == Options.of("throw").duration


def test_gradient_steps_are_those_of_the_library(tmp_path, monkeypatch):
    parameters = []
    for index, model in enumerate((QuickDDPG, DDPG)):
        monkeypatch.setitem(MODELS, "ddpg", model)
        training = trained(short_plan(), tmp_path / str(index))
        policy = training._model._model.policy
        assert all(np.isfinite(one.detach().numpy()).all() for one in policy.parameters())
        parameters.append([one.detach().numpy() for one in policy.parameters()])
        assert training._model._model._n_updates > 40
    for mine, others in zip(*parameters, strict=True):
        np.testing.assert_allclose(mine, others, atol=1e-4)


def test_an_evaluation_is_what_single_environments_come_to():
    options = Options.of("reach", duration=0.2)
    target = np.linspace(-0.5, 0.5, 9, dtype=np.float32)
    evaluator = evaluation.Evaluator("reach", options, episodes=3, seed=5)
    result = evaluator(lambda seen: np.tile(target, (len(seen), 1)))
    for index in range(3):
        environment = Environment("reach", options=options)
        environment.reset(seed=5 + index)
        has_ended = False
        while not has_ended:
            _, _, _, has_ended, info = environment.step(target)
        np.testing.assert_array_equal(result.distances[index], info["distance"])
        offset = info["achieved_goal"] - info["desired_goal"]
        np.testing.assert_array_equal(result.paths[index, -1], offset)
        assert result.successes[index] == info["is_success"]


@pytest.mark.parametrize("steps_per_action", [10, 20, 50])
def test_a_film_lasts_as_long_as_its_episodes(steps_per_action, tmp_path):
    path = tmp_path / "film.mp4"
    environment = Environment(
        "reach", duration=0.2, steps_per_action=steps_per_action, render_mode="rgb_array"
    )
    evaluation.save_policy_film(lambda seen: np.zeros((len(seen), 9)), environment, path)
    with av.open(str(path)) as film:
        (stream,) = film.streams.video
        assert 15 <= stream.average_rate <= 30
        assert stream.frames / stream.average_rate == pytest.approx(5 * 0.2)


# Examples of the pages of docs, made shorter.
@pytest.mark.parametrize(
    ("page", "word", "changes"),
    [
        ("training", "Training(", {"episodes=700": "episodes=2, settings={'duration': 0.2}"}),
        (
            "environments",
            "Rows",
            {"Rows(robots))": "Rows(robots), n_steps=100)", ".learn(100_000)": ".learn(100)"},
        ),
    ],
)
def test_the_programs_of_the_pages_run(page, word, changes, tmp_path, monkeypatch):
    text = (ROOT / f"docs/{page}.md").read_text()
    (program,) = (part for part in re.findall("```python\n(.*?)```", text, re.S) if word in part)
    for long, short in changes.items():
        assert long in program
        program = program.replace(long, short)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SB3_LOGDIR", str(tmp_path))
    exec(program, {})  # noqa: S102, our own page
    assert page != "training" or (tmp_path / "run/film.mp4").exists()


# ---- a user's mistakes ----


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["reach", "--set", "gama=1"], "no setting 'gama'; did you mean 'gamma'?"),
        (["reach", "--set", "durration=1"], "no setting 'durration'; did you mean 'duration'?"),
        (
            ["reach", "--set", "colour=1"],
            "no setting 'colour'; there are action, action_cost, algorithm, appr",
        ),
        (["reach", "--set", "gamma"], "KEY=VALUE"),
        (["reach", "--set", "gamma='high'"], "gamma"),
        (["reach", "--episodes", "0"], "episodes"),
        (["jump"], "jump"),
        (["push", "--shared"], "fingers share a policy of a reach (per_finger), not of 'push'"),
        (["reach", "--set", "approach=1.0"], "object"),
        (["--resume", "nowhere"], "nowhere"),
        (["push", "--algorithm", "td3"], "'push' is learned by ppo, as far as is known"),
        (["push", "--set", "algorithm=td3"], "'push' is learned by ppo, as far as is known"),
        (["throw"], "nothing learns 'throw', as far as is known"),
        (["lift"], "'lift' is not learned from scratch, as far as is known"),
        (["push", "--untried", "--set", "action_cost='x'"], "action_cost"),
    ],
)
def test_a_mistake_is_named(words, said, capsys, tmp_path, monkeypatch):
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    assert train.main(words) == 2
    assert said in capsys.readouterr().err
    assert not list(folder.iterdir())


def test_what_is_offered_is_what_has_learned():
    chosen = train.algorithm_of
    assert chosen("push", None) == chosen("throw", None) == chosen("reach", "ppo") == "ppo"
    assert chosen("reach", None) == chosen("my_tasks:Middle", None) == "ddpg"
    # The page says the same, of each pair that was trained with all seeds.
    said = {}
    for line in (ROOT / "docs/results/training.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[0] in task_names() and cells[4].count(",") == 2:
            task, algorithm = cells[0], cells[1].removesuffix(", shared")
            said[task, algorithm] = said.get((task, algorithm), False) or cells[-1] == "yes"
    learned = {pair for pair, learns in said.items() if learns}
    assert learned == {(task, each) for task, known in train.LEARNED.items() for each in known}


@pytest.mark.parametrize("words", [["--episodes", "9"], ["--shared"], ["--set", "gamma=0.5"]])
def test_a_training_goes_on_as_it_was_begun(words, undisturbed, capsys):
    with pytest.raises(SystemExit):
        train.main(["--resume", str(undisturbed), *words])
    assert "no other options" in capsys.readouterr().err


@pytest.mark.slow
def test_an_interrupted_training_goes_on_from_the_command_line(tmp_path, capsys, monkeypatch):
    folder = tmp_path / "run"
    settings = [f"--set={name}={value}" for name, value in SHORT.items()]

    def interrupt(training):
        if len(training.curve) == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(Training, "save_curve", interrupt)
        words = ["reach", "--shared", "--episodes", "100", "-o", str(folder), *settings]
        assert train.main(words) == 130
    assert f"--resume {folder} goes on" in capsys.readouterr().err
    assert train.main(["--resume", str(folder)]) == 0
    assert "episode 100 of 100: " in capsys.readouterr().err


def test_tensorboard_has_every_evaluation(undisturbed):
    board = EventAccumulator(str(undisturbed / "tensorboard"))
    board.Reload()
    lines = (undisturbed / CURVE).read_text().splitlines()[1:]
    medians = [float(line.split(",")[2]) for line in lines]
    told = [event.value for event in board.Scalars("evaluation/median")]
    np.testing.assert_allclose(told, medians, rtol=1e-5)


@pytest.mark.slow
def test_lines_say_how_a_training_goes_and_a_file_has_no_bar(tmp_path, capsys):
    folder = tmp_path / "run"
    settings = [f"--set={name}={value}" for name, value in SHORT.items()]
    words = ["reach", "--shared", "--episodes", "4", "-o", str(folder), *settings]
    assert train.main(words) == 0
    done = capsys.readouterr()
    assert "episode 4 of 4: " in done.err
    first, *_ = done.err.splitlines()
    assert first == (
        f"reach by ddpg: 4 episodes of 1 robot, seed 1; {folder / PLAN} has all settings."
    )
    assert "{" not in done.err
    plan = (folder / PLAN).read_text()
    for name in ("steps_per_action", "position_noise", "object_delay", "friction", "learning_rate"):
        assert f'"{name}": ' in plan
    assert "\r" not in done.err
    assert f"{folder}/reach.policy written." in done.out
    assert {file.name for file in folder.iterdir()} == {
        *(CHECKPOINT, CURVE, PLAN, "reach.policy", "tensorboard"),
        *("curve.png", "film.mp4", "tips.png"),
    }


@pytest.mark.slow
@pytest.mark.parametrize("task", ["push", "dclaw_turn_fixed"])
def test_the_recipes_of_the_pages_train(task, tmp_path):
    settings = SHORT | {"num_envs": 2, "rollout": 10}
    words = [task, "--algorithm", "ppo", "--episodes", "2", "-o", str(tmp_path / "run")]
    assert train.main([*words, *(f"--set={name}={value}" for name, value in settings.items())]) == 0
    assert trifinger.Policy(tmp_path / f"run/{task}.policy").metadata["task"] == task


OWN_TASK = """
from trifinger.environments import Options
from trifinger.tasks import Task

class Middle(Task):
    options = Options(action="position_change")
    goal_low = (-0.05, -0.05, 0.08)
    goal_high = (0.05, 0.05, 0.14)

    def achieve(self, view):
        return view.tips.mean(axis=1)
"""


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["ddpg", "ppo"])
def test_a_task_of_ones_own_is_trained_evaluated_and_run(
    algorithm, tmp_path, monkeypatch, capsys, start_program
):
    (tmp_path / "my_tasks.py").write_text(OWN_TASK)
    monkeypatch.chdir(tmp_path)
    settings = SHORT | {"num_envs": 2} | ({"rollout": 10} if algorithm == "ppo" else {})
    words = ["my_tasks:Middle", "--algorithm", algorithm, "--episodes", "2"]
    assert train.main([*words, *(f"--set={name}={value}" for name, value in settings.items())]) == 0
    policy = str(tmp_path / "Middle/Middle.policy")
    assert trifinger.Policy(policy).metadata["task"] == "my_tasks:Middle"
    capsys.readouterr()
    assert evaluate.main([policy, "--episodes", "3", "--json"]) == 2
    assert "say --task my_tasks:Middle" in capsys.readouterr().err
    said = ["--task", "my_tasks:Middle"]
    assert evaluate.main([policy, *said, "--episodes", "3", "--json"]) == 0
    assert 0 < json.loads(capsys.readouterr().out)["median"] < 0.5
    if algorithm == "ppo":
        return
    assert train.main(["--resume", "Middle"]) == 2
    assert "say --task my_tasks:Middle" in capsys.readouterr().err
    assert train.main(["--resume", "Middle", *said]) == 0

    # The program in C++ hands the policy to that of the Python package.
    scripts = tmp_path / "bin"
    scripts.mkdir()
    write_scripts(scripts)
    start_program("run", "trifinger_edu", "--name", "p", "--non-real-time").wait_for(
        "waits for a user"
    )
    program = Path(PROGRAM).parent / "trifinger-run-policy"
    words = [program, policy, "--robot", "p", "--episodes", "2", "--seed", "3", "-o", "j"]

    def run(path, *more):
        return subprocess.run(
            [*words, *more],
            capture_output=True,
            text=True,
            check=False,
            env=os.environ | {"PATH": path},
        )

    done = run(f"{scripts}:/usr/bin")
    assert done.returncode == 2
    assert "say --task my_tasks:Middle" in done.stderr
    done = run(f"{scripts}:/usr/bin", *said)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "of 2 episodes ended at their goal." in done.stdout
    reports = json.loads(Path("j").read_text())
    assert [(one["episode"], one["actions"], one["repeated_steps"]) for one in reports] == [
        (0, 10, 0),
        (1, 10, 0),
    ]
    done = run("/usr/bin")
    assert done.returncode == 2
    assert "is part of the Python package" in done.stderr


@pytest.mark.slow
def test_a_robot_of_ones_own_is_trained_and_evaluated(arm, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["reach", "--robot-config", arm, "--episodes", "2", "-o", "out"]
    settings = SHORT | {"frames": ("hand",)}
    assert train.main([*words, *(f"--set={name}={value}" for name, value in settings.items())]) == 0
    policy = trifinger.Policy("out/reach.policy")
    assert policy.metadata["robot"] == arm
    assert policy.num_outputs == 2
    assert Path("out/film.mp4").stat().st_size > 0
    capsys.readouterr()
    assert evaluate.main(["out/reach.policy", "--episodes", "3", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["episodes"] == 3


def test_a_folder_keeps_the_training_that_it_has(undisturbed, capsys):
    assert train.main(["reach", "-o", str(undisturbed)]) == 2
    assert "--resume" in capsys.readouterr().err
    with pytest.raises(InvalidArgument, match="another plan"):
        Training(short_plan(seed=9), undisturbed)


@pytest.mark.parametrize("module", ["environments", "evaluation", "stable_baselines", "training"])
def test_modules_say_what_to_install(module):
    program = f"import sys; sys.modules['gymnasium'] = None; import trifinger.{module}"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.stderr.splitlines()[-1].endswith(": gymnasium is missing: ./run setup")


@pytest.mark.parametrize("missing", ["stable_baselines3", "torch", "gymnasium"])
def test_says_what_to_install(missing):
    program = f"""
import sys
sys.modules["{missing}"] = None
from trifinger.commands import train
sys.exit(train.main(["reach"]))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr == f"trifinger train: {missing} is missing: ./run setup\n"


def test_evaluate_says_how_near_a_policy_comes(undisturbed, capsys):
    policy = str(undisturbed / "reach.policy")
    assert evaluate.main([policy, "--episodes", "4", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["episodes"] == 4
    assert summary["lower_quartile"] <= summary["median"] <= summary["upper_quartile"]
    assert evaluate.main([policy, "--episodes", "4"]) == 0
    assert f"{100 * summary['median']:.2f} cm" in capsys.readouterr().out
    assert evaluate.main([policy, "--task", "finger_reach", "--json"]) == 0
    assert evaluate.main([policy, "--episodes", "0"]) == 2


@pytest.mark.slow
def test_the_commands_of_the_readme_train_evaluate_and_run(tmp_path, monkeypatch, start_program):
    monkeypatch.chdir(tmp_path)
    settings = [f"--set={name}={value}" for name, value in SHORT.items()]
    assert train.main(["reach", "--shared", "--episodes", "2", *settings]) == 0
    assert evaluate.main(["reach/reach.policy", "--episodes", "1"]) == 0
    robot = start_program("run", "trifinger_edu", "--name", "edu", "--non-real-time")
    robot.wait_for("waits for a user")
    words = ["reach/reach.policy", "--robot", "edu", "--episodes", "1"]
    assert "of 1 episodes ended" in output_of(PROGRAM, "run-policy", *words)


def test_a_plan_is_what_was_written(tmp_path):
    plan = short_plan(settings={"friction": (0.5, 1.0)})
    assert Plan.from_json(plan.to_json()) == plan
    Training(plan, tmp_path).close()
    assert Plan.from_json((tmp_path / PLAN).read_text()) == plan
