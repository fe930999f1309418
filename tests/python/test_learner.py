# SPDX-License-Identifier: BSD-3-Clause
"""What a learner makes of experience, and algorithms of one's own in it."""

import importlib
import itertools
import json
import os
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import trifinger
from conftest import PATIENT, StartProgram
from trifinger.environments import Environment
from trifinger.errors import Error, InvalidArgument
from trifinger.niceness import NICENESS
from trifinger.training import Plan, Recipe, checkpoint
from trifinger.training.algorithm import Batch
from trifinger.training.experience import INTERVENTION, TERMINATED, TRUNCATED
from trifinger.training.learner import Learner, serve
from trifinger.training.on_robot import RobotTraining
from trifinger.training.run import Training

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/training.md"
SETTINGS = {"duration": 0.4, "random_actions": 10, "batch_size": 64}
ACTIONS = 20  # of an episode

OWN = """
import torch
from torch import nn

class Imitator:
    batches = []

    def __init__(self, observations, actions, recipe):
        self.policy = nn.Sequential(
            nn.Linear(observations, 32), nn.ReLU(), nn.Linear(32, actions), nn.Tanh()
        )
        self.optimizer = torch.optim.Adam(self.policy.parameters(), 1e-2)
        self.scale = torch.ones(())
        self.count = 0

    def update(self, batch):
        self.batches.append(batch)
        noise = 0.01 * self.scale * self.count * torch.randn(batch.observations.shape)
        loss = (self.policy(batch.observations + noise) - batch.actions).square().mean()
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        self.scale *= 0.9
        self.count += 1
        return {"loss": loss.item()}

    def actor(self):
        return self.policy

class Module(nn.Module, Imitator):
    def __init__(self, observations, actions, recipe):
        nn.Module.__init__(self)
        Imitator.__init__(self, observations, actions, recipe)

class WithoutUpdate:
    def actor(self): return None

class Larger(Imitator):
    def __init__(self, observations, actions, recipe):
        super().__init__(observations + 1, actions, recipe)

class Normed(Imitator):
    def actor(self): return nn.Sequential(self.policy, nn.LayerNorm(9))

class NoActor(Imitator):
    def actor(self): return None

class Needy(Imitator):
    def __init__(self): pass

class Failing(Imitator):
    def update(self, batch):
        return self.policy(batch.actions)

class Lost(Imitator):
    def update(self, batch):
        return {"loss": float("nan")}
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A module of a user in the current folder; imported only by what is tested."""
    (tmp_path / "my_own.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    yield lambda: sys.modules["my_own"]
    sys.modules.pop("my_own", None)


def plan_of(algorithm: str, *, is_shared: bool = False, **settings: Any) -> Plan:
    settings = SETTINGS | settings
    return Plan.of("reach", algorithm, is_shared=is_shared, settings=settings, episodes=20)


def experience_of(
    plan: Plan, episodes: int, *, session: int = 1, act: Callable[[np.ndarray], Any] | None = None
) -> np.ndarray:
    """What an actor tells of episodes in which `act` chooses the actions, or chance."""
    environment = Environment(**plan.environment)
    chance = np.random.default_rng(session)
    kind = [
        *((name, "i8") for name in ("session", "step", "seed", "episode", "actions", "flags")),
        *(("reward", "f8"), ("observation", "f4", 27), ("action", "f4", 9)),
        *(("achieved", "f4", 9), ("desired", "f4", 9)),
    ]
    elements = np.zeros((episodes, ACTIONS + 1), np.dtype(kind))
    elements["session"] = session
    for episode, told in enumerate(elements):
        told["episode"] = episode
        seen: Any
        seen, info = environment.reset(seed=session, options={"episode": episode})
        for i, element in enumerate(told):
            if i > 0:
                element["action"] = act(seen) if act else chance.uniform(-1, 1, 9)
                seen, element["reward"], _, _, info = environment.step(element["action"])
            element["actions"], element["step"] = i, 1000 * episode + 20 * i
            element["observation"] = seen
            element["achieved"], element["desired"] = info["achieved_goal"], info["desired_goal"]
        told["flags"][-1] = TRUNCATED
    return elements.ravel()


# An action that tells demonstrations from what chance did.
def shown(_: np.ndarray) -> np.ndarray:
    return np.full(9, 0.5)


def number_shown(batch: Any) -> int:
    return int((batch.actions == 0.5).all(dim=1).sum())


def weights(learner: Learner, tmp_path: Path) -> bytes:
    """All that is learned, as the next policy has it."""
    (tmp_path / "a.policy").write_bytes(learner.policy())
    policy = trifinger.Policy(tmp_path / "a.policy")
    seen = np.random.default_rng(5).uniform(-1, 1, (20, policy.num_inputs))
    return b"".join(np.asarray(policy(one)).tobytes() for one in seen)


def test_weights_that_are_not_finite_are_no_policy() -> None:
    learner = Learner(plan_of("ddpg"))
    with torch.no_grad():
        learner._model._model.actor.mu[0].weight.fill_(float("nan"))  # type: ignore[union-attr, index]
    with pytest.raises(Error, match="ddpg has no policy: ") as failed:
        learner.policy()
    assert not isinstance(failed.value, InvalidArgument)  # it may go on from its checkpoint


# ---- batches ----


@pytest.mark.parametrize("algorithm", ["td3", "sac"])
def test_algorithms_of_the_library_get_demonstrations(algorithm: str) -> None:
    plan = plan_of(algorithm, relabelled=0.0)
    learner = Learner(plan)
    learner.add(experience_of(plan, 5))
    demonstrations = experience_of(plan, 1, session=2, act=shown)
    demonstrations["flags"] |= INTERVENTION
    learner.add(demonstrations)
    learner.update(1)
    counts = [number_shown(learner._model.memory.sample(64)) for _ in range(20)]
    assert min(counts) >= 32
    assert np.mean(counts) == pytest.approx(32 + 32 / 6, abs=3)


@pytest.mark.parametrize("share", [0.5, 0.25, 1.0, 0.0])
def test_a_share_of_each_batch_is_demonstrations(own: Any, share: float) -> None:
    plan = plan_of("my_own:Imitator", demonstrations=share)
    learner = Learner(plan)
    learner.add(experience_of(plan, 5))
    learner.update(5)
    batches = own().Imitator.batches
    assert [number_shown(batch) for batch in batches] == 5 * [0]  # there are none yet
    help_of_a_person = experience_of(plan, 2, session=2, act=shown)
    help_of_a_person["flags"] |= INTERVENTION
    learner.add(help_of_a_person)
    # The rest is of all transitions: 100 without and 40 with help.
    learner.update(20)
    counts = [number_shown(batch) for batch in batches[5:]]
    assert min(counts) >= share * 64
    assert np.mean(counts) == pytest.approx(64 * (share + (1 - share) * 40 / 140), abs=4)


def test_experience_of_others_demonstrates_and_the_own_does_not(own: Any) -> None:
    plan = plan_of("my_own:Imitator")
    others, mine = experience_of(plan, 3, session=2, act=shown), experience_of(plan, 17)
    learner = Learner(plan, prior=len(others))
    learner.add(np.concatenate([others, mine]))
    learner.add(experience_of(plan, 1, session=3))
    learner.update(30)
    counts = [number_shown(batch) for batch in own().Imitator.batches]
    assert min(counts) >= 32
    assert np.mean(counts) == pytest.approx(32 + 32 * 60 / 420, abs=1.5)
    demonstrations = torch.cat([batch.actions[:32] for batch in own().Imitator.batches])
    assert (demonstrations == 0.5).all()
    for batch in own().Imitator.batches:
        assert batch.demonstrated.tolist() == 32 * [1] + 32 * [0]


@pytest.mark.parametrize("is_shared", [False, True])
def test_a_batch_has_the_transitions(own: Any, is_shared: bool) -> None:
    plan = plan_of("my_own:Imitator", is_shared=is_shared, reward_scale=2.0)
    elements = experience_of(plan, 1)
    elements["flags"][-1] = TERMINATED
    learner = Learner(plan)
    learner.add(elements)
    learner.update(40)
    rows = 3 if is_shared else 1
    assert learner.transitions == ACTIONS
    found = {}
    for batch in own().Imitator.batches:
        *parts, progress = batch
        assert all(part.dtype == torch.float32 for part in parts)
        assert batch.rewards.shape == batch.terminated.shape == batch.demonstrated.shape == (64,)
        assert progress == ACTIONS / learner.total
        for row in zip(*(part.numpy() for part in parts), strict=True):
            found[row[1].tobytes()] = row
    assert len(found) == rows * ACTIONS
    for before, after in itertools.pairwise(elements):
        distances = np.linalg.norm((after["achieved"] - after["desired"]).reshape(3, 3), axis=1)
        for i in range(rows):
            part = slice(i * 27 // rows, (i + 1) * 27 // rows)
            acted = after["action"].reshape(rows, -1)[i]
            seen, _, reward, then, terminated, demonstrated = found[acted.tobytes()]
            assert not demonstrated
            assert np.array_equal(seen, before["observation"][part])
            assert np.array_equal(then, after["observation"][part])
            expected = -distances[i] if is_shared else after["reward"]
            assert reward == pytest.approx(2 * expected, rel=1e-5)
            assert terminated == (after["flags"] == TERMINATED)


def test_the_newest_transitions_stay(own: Any) -> None:
    plan = plan_of("my_own:Imitator", buffer_size=30)
    learner = Learner(plan)
    learner.add(experience_of(plan, 3))
    learner.add(experience_of(plan, 2, session=2, act=shown))
    learner.update(5)
    assert [number_shown(batch) for batch in own().Imitator.batches] == 5 * [64]


@pytest.mark.usefixtures("own")
def test_demonstrations_are_imitated(tmp_path: Path) -> None:
    plan = plan_of("my_own:Imitator", demonstrations=1.0)
    chance = np.random.default_rng(0)
    matrix = chance.uniform(-0.3, 0.3, (9, 27))
    elements = experience_of(plan, 10, act=lambda seen: np.tanh(matrix @ seen))
    learner = Learner(plan, prior=len(elements))
    learner.add(elements)
    learner.update(400)
    assert learner.losses.keys() == {"train/loss"}
    (tmp_path / "a.policy").write_bytes(learner.policy())
    policy = trifinger.Policy(tmp_path / "a.policy")
    assert policy.metadata["task"] == "reach"
    fresh = experience_of(plan, 2, session=7, act=lambda seen: np.tanh(matrix @ seen))
    errors = [policy(a["observation"]) - b["action"] for a, b in itertools.pairwise(fresh)]
    of_episodes = np.delete(errors, ACTIONS, axis=0)  # between two episodes nobody acts
    assert np.abs(of_episodes).mean() < 0.05


# ---- checkpoints ----


@pytest.mark.usefixtures("own")
@pytest.mark.parametrize("algorithm", ["my_own:Imitator", "my_own:Module", "ddpg", "sac"])
def test_a_resumed_learner_goes_on_with_the_same_weights(tmp_path: Path, algorithm: str) -> None:
    def go_on(learner: Learner) -> None:
        np.random.seed(3)  # noqa: NPY002, that of Stable-Baselines3
        torch.manual_seed(3)
        learner.update(10)

    plan = plan_of(algorithm)
    elements = experience_of(plan, 5)
    first = Learner(plan)
    first.add(elements)
    first.update(10)
    kept = checkpoint.dump(first.state())
    now = weights(first, tmp_path)
    second = Learner(plan)
    second.add(elements)
    second.restore(checkpoint.load(kept))
    assert weights(second, tmp_path) == now
    go_on(first)
    go_on(second)
    assert weights(second, tmp_path) == weights(first, tmp_path) != now
    assert second.updates == 20
    assert second.losses == first.losses


@pytest.mark.usefixtures("own")
def test_a_checkpoint_of_another_algorithm_is_refused() -> None:
    state = Learner(plan_of("my_own:Imitator")).state()
    state = checkpoint.load(checkpoint.dump(state))
    for algorithm, said in (("my_own:Imitator", "size mismatch"), ("sac", "KeyError|parameters")):
        plan = plan_of(algorithm, is_shared=True)
        with pytest.raises(InvalidArgument, match="file 'learner' is of another") as refused:
            Learner(plan).restore(state)
        assert re.search(said, f"{refused.value} {refused.value.__cause__!r}")
        assert "\n" not in str(refused.value)
    state["model"]["parts"]["scale"] = torch.ones(2)
    with pytest.raises(InvalidArgument, match="file 'learner' is of another"):
        Learner(plan_of("my_own:Imitator")).restore(state)


# ---- a user's mistakes ----


@pytest.mark.usefixtures("own")
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("my_one:Imitator", "there is no module 'my_one' for the algorithm 'my_one:Imitator'"),
        ("my_own:Imitate", "'my_own:Imitate' has no functions update() and actor()"),
        ("my_own:WithoutUpdate", "'my_own:WithoutUpdate' has no functions update() and actor()"),
        ("my_own:Needy", "'my_own:Needy' cannot be used: TypeError: "),
        ("my_own:Larger", "actor() is from 28 to 9 numbers, must be from 27 to 9"),
        ("my_own:Normed", "the network has a LayerNorm; a policy can be made of Linear"),
        ("my_own:NoActor", "the network has a NoneType"),
    ],
)
def test_an_algorithm_that_cannot_be_used_is_named(name: str, said: str) -> None:
    with pytest.raises(InvalidArgument, match=re.escape(said)):
        Learner(plan_of(name))


@pytest.mark.usefixtures("own")
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("my_own:Failing", r"'my_own:Failing' failed at my_own.py:\d+: RuntimeError: mat1 and"),
        ("my_own:Lost", "the losses of 'my_own:Lost' are {'loss': nan}"),
    ],
)
def test_an_algorithm_that_fails_is_named(name: str, said: str) -> None:
    plan = plan_of(name)
    learner = Learner(plan)
    learner.add(experience_of(plan, 1))
    with pytest.raises(Error, match=said) as failed:
        learner.update(1)
    assert "\n" not in str(failed.value)
    assert not isinstance(failed.value, InvalidArgument)  # it may go on from its checkpoint


@pytest.mark.usefixtures("own")
def test_settings_that_fit_no_algorithm_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match=r"no algorithm 'sacc', only ddpg, .* MODULE:CLASS"):
        plan_of("sacc")
    with pytest.raises(InvalidArgument, match=r"demonstrations is 1\.5, must be 0 to 1"):
        plan_of("sac", demonstrations=1.5)
    with pytest.raises(InvalidArgument, match="relabelled are for pushes"):
        plan_of("my_own:Imitator", relabelled=0.2)
    with pytest.raises(InvalidArgument, match="symmetry, offsets and"):
        plan_of("ddpg", symmetry=True)
    with pytest.raises(InvalidArgument, match="only for a robot that runs: trifinger learn"):
        Training(plan_of("my_own:Imitator"), tmp_path / "f")
    assert not (tmp_path / "f").exists()


# ---- trust ----


def teach(connection: Connection, plan: Plan, elements: np.ndarray, told: list[Any]) -> None:
    """Does what a training does for a learner that has joined."""
    configuration = (ROOT / "config/trifinger_edu.yml").read_text()
    first: dict[str, Any] = {"plan": plan.to_json(), "configuration": configuration}
    first |= {
        "prior": 0,
        "published": -1,
        "state": None,
    }
    connection.send_bytes(checkpoint.dump(first))
    with connection:
        while not told or told[-1]["kind"] != "done":
            try:
                told.append(checkpoint.load(connection.recv_bytes()))
            except EOFError:
                return
            if told[-1]["kind"] == "more":
                answer = {"experience": elements, "is_whole": True}
                elements = np.zeros(0)
                connection.send_bytes(checkpoint.dump(answer))


@pytest.mark.parametrize("is_leader", [True, False])
def test_a_learner_lets_others_go_first(*, is_leader: bool) -> None:
    numbers = Path("/proc/self/autogroup")
    if not numbers.exists():
        pytest.skip("this kernel does not group processes by their sessions")
    code = f"""
import json, os, trifinger.niceness
def both():
    # A process that no session has been made for is in no group: the file is empty.
    return os.nice(0), open("{numbers}").read().split()[-1:]
before = both()
trifinger.niceness.be_nice()
print(json.dumps([before, both()]))
"""
    words = [sys.executable, "-c", code]
    done = subprocess.run(
        words, stdout=subprocess.PIPE, text=True, check=True, start_new_session=is_leader
    )
    (niceness, of_session), after = json.loads(done.stdout)
    # A session of somebody else stays as it is.
    is_its_own = is_leader and of_session
    expected = [str(NICENESS)] if is_its_own else of_session
    assert after == [min(niceness + NICENESS, 19), expected]


def test_a_learner_leaves_a_processor_to_others() -> None:
    given = sorted(os.sched_getaffinity(0))
    code = "import os, trifinger.niceness as n; n.be_nice(); print(sorted(os.sched_getaffinity(0)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == (given[1:] or given)


def serve_for(monkeypatch: pytest.MonkeyPatch, plan: Plan, said: str | None) -> list[Any]:
    """What a learner sends that is started with `--algorithm said`."""
    monkeypatch.setattr("trifinger.training.learner.be_nice", lambda: None)  # this one stays
    told: list[Any] = []
    here, there = Pipe()
    teacher = threading.Thread(target=teach, args=(there, plan, experience_of(plan, 2), told))
    teacher.start()
    try:
        with here:
            serve(here, said)
    finally:
        teacher.join()
    return told


@pytest.mark.parametrize("last", [0.0, 60.0])
def test_a_learner_that_is_behind_does_not_let_the_robot_wait(
    last: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("trifinger.training.learner.LAST", last)
    told = serve_for(monkeypatch, plan_of("ddpg", gradient_steps=5), None)
    assert told[-1]["kind"] == "done"
    newest = [one for one in told if one["kind"] == "policy"][-1]
    due = 5 * (newest["transitions"] - SETTINGS["random_actions"])
    assert (newest["updates"] == due) == (last > 0)


@pytest.mark.usefixtures("own")
def test_an_algorithm_that_only_a_file_names_is_not_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = plan_of("my_own:Imitator")
    (tmp_path / "plan.json").write_text(plan.to_json())
    for said in (None, "my_other:Imitator"):
        with pytest.raises(InvalidArgument, match=r"say --algorithm my_own|not of 'my_other"):
            Plan.of_folder(tmp_path, algorithm=said)
        with pytest.raises(InvalidArgument, match=r"say --algorithm my_own|not of 'my_other"):
            serve_for(monkeypatch, plan, said)
    assert "my_own" not in sys.modules
    assert Plan.of_folder(tmp_path, algorithm="my_own:Imitator") == plan
    told = serve_for(monkeypatch, plan, "my_own:Imitator")
    assert "my_own" in sys.modules
    assert [one["kind"] for one in told][-3:] == ["policy", "state", "done"]
    assert told[-3]["updates"] == 2 * ACTIONS - 10
    assert told[-3]["losses"].keys() == {"train/loss"}


# ---- the algorithm of the page ----


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The module `my_algorithm` of the page."""
    (program,) = (
        part
        for part in re.findall("```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
        if "class MyAlgorithm" in part
    )
    (tmp_path / "my_algorithm.py").write_text(program)
    monkeypatch.chdir(tmp_path)
    yield
    sys.modules.pop("my_algorithm", None)


@pytest.mark.usefixtures("page")
@pytest.mark.slow
def test_the_algorithm_of_the_page_finds_the_best_actions(monkeypatch: pytest.MonkeyPatch) -> None:
    """A point on a line is at 0 after one action, if that is the opposite of where it is."""
    monkeypatch.syspath_prepend(Path.cwd())
    own = importlib.import_module("my_algorithm")
    torch.set_num_threads(1)  # as the learner does
    torch.manual_seed(1)
    algorithm = own.MyAlgorithm(1, 1, Recipe(gamma=0.5, learning_rate=1e-3))
    for _ in range(400):
        seen, acted = 2 * torch.rand(64, 1) - 1, 2 * torch.rand(64, 1) - 1
        then = (seen + acted).clip(-1, 1)
        zeros = torch.zeros(64)
        algorithm.update(Batch(seen, acted, -(then[:, 0] ** 2), then, zeros, zeros, 0.0))
    places = torch.linspace(-0.9, 0.9, 19)[:, None]
    with torch.no_grad():
        assert (algorithm.actor()(places) + places).abs().mean() < 0.1


@pytest.mark.usefixtures("page")
@pytest.mark.slow
@pytest.mark.without_sanitizer  # nothing is learned in time
def test_the_algorithm_of_the_page_learns_on_a_robot(
    start_program: StartProgram, tmp_path: Path
) -> None:
    start_program("run", "trifinger_edu", "--name", "r", *PATIENT).wait_for("waits for a user")
    (tmp_path / "robot.yml").write_text(trifinger.observe("r").documents()["configuration.yml"])
    plan = Plan.of(
        "reach",
        "my_algorithm:MyAlgorithm",
        episodes=6,
        robot_config=str(tmp_path / "robot.yml"),
        settings=SETTINGS,
    )
    tally = RobotTraining(plan, tmp_path / "f", "r", judged=0).run()
    assert tally.restarts == {}
    assert tally.episodes == 6
    assert tally.updates > 50
    assert "my_algorithm" not in sys.modules  # only the learner runs it
    assert trifinger.Policy(tmp_path / "f/reach.policy").num_outputs == 9
    # Nobody who resumes it runs what only its folder names.
    command = [sys.executable, "-m", "trifinger.commands.learn", "--resume", "f", "--robot", "r"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "say --algorithm my_algorithm:MyAlgorithm" in done.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("own")
def test_a_training_whose_algorithm_cannot_be_used_ends_at_once(
    start_program: StartProgram, tmp_path: Path
) -> None:
    start_program("run", "trifinger_edu", "--name", "r", *PATIENT).wait_for("waits for a user")
    training = RobotTraining(plan_of("my_own:NoActor"), tmp_path / "f", "r", judged=0)
    with pytest.raises(InvalidArgument, match="'my_own:NoActor' cannot be used"):
        training.run()
    assert training.tally.restarts == {}
