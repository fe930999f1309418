# SPDX-License-Identifier: BSD-3-Clause
"""All settings of a training: how a policy learns, and for how long."""

import ast
import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

# This import comes first because its error says what to install.
from trifinger._trifinger import task_names
from trifinger.environments import Options
from trifinger.errors import InvalidArgument
from trifinger.own_class import name_of_file

LIBRARY = ("ddpg", "td3", "sac")  # algorithms of Stable-Baselines3
ON_POLICY = "ppo"  # of rsl_rl; it learns in simulations only
# The others: each is a trifinger.training.algorithm.Algorithm, and here by name.
CLASSES = {"rlpd": "trifinger.training.rlpd:Rlpd"}

SHOWN = ("symmetric_view", "object_offsets")  # to PPO, in tasks with a cube
PLAN = "plan.json"  # the file in the folder of a training
TALLY = "tally.json"  # what has happened, beside it, if the training is one on a robot


@dataclasses.dataclass(frozen=True, kw_only=True)
class OfCube:
    """What PPO needs for a task with a cube."""

    episodes: int
    duration: float = 6.0
    """Length of an episode [s]."""
    position_change: float = 0.03
    """In place of 0.1 rad: a cube that is held is dropped by large changes."""
    initial_noise: float = 0.3
    shown: tuple[str, ...] = (*SHOWN, "symmetric_object")
    """What is observed that is not by default."""


OF_CUBES: Mapping[str, OfCube] = {
    "push": OfCube(episodes=60_000, position_change=0.06, initial_noise=0.6, shown=SHOWN),
    "lift": OfCube(episodes=15_000),
    "lift_pose": OfCube(episodes=15_000, shown=(*SHOWN, "keypoints")),
    "move_cube_on_trajectory": OfCube(episodes=3000, duration=60.0),
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Recipe:
    """Settings of how a policy learns."""

    algorithm: str = "ddpg"
    """ON_POLICY, one of LIBRARY or of CLASSES, or MODULE:CLASS of your own."""
    is_shared: bool = False
    """Whether the fingers share one policy."""
    num_envs: int = 1
    """Number of robots that learn at once; a single one uses the interface of real robots."""
    physics_step: float = 0.001
    """Time step of many robots while they learn [s]; evaluations have steps of 1 ms."""
    reset_states: str = ""
    """File of `ResetStates`, or a log: a share of the episodes of many robots begins in a state of
    it. The folder of the training keeps these states."""
    reset_share: float = 0.5
    """That share; evaluations always begin where the task does."""
    asymmetric: bool = False
    """Whether the critic of PPO also sees what only simulations know: the true pose of the object,
    its velocities, and what varies from robot to robot (Pinto et al. 2018)."""
    gamma: float = 0.9
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-4
    """Learning rate at the end; it falls linearly from `learning_rate`."""
    device: str = "cpu"
    """Where networks of PPO learn: "cpu", "cuda" or, with "auto", "cuda" where there is one. The
    same plan gives the same policy on the same device."""
    batch_size: int = 128
    gradient_steps: int = 1
    """Gradient steps after each action of all robots; PPO does not use this."""
    layers: tuple[int, ...] = (256, 256)
    noise: float = 0.2
    final_noise: float = 0.02
    """Standard deviation of noise on actions of DDPG and TD3 at the end; it falls linearly from
    `noise`."""
    noise_color: float = 0.0
    """Colour of that noise on a connected robot: 0 is white, 1 is pink, 2 is nearly red. Slow noise
    is gentle to motors and explores further."""
    reward_scale: float = 10.0
    """Factor on the reward of the task. Rewards of `approach` and `kernel` are added to the
    product."""
    relabelled: float = 0.0
    """Share of the goals that are replaced: those of a reach by positions that were reached, and
    batches are then put together finger by finger; those of a push, on a connected robot, as
    trifinger.training.pushes says."""
    symmetry: bool = False
    """Whether transitions of a push are turned by thirds of a circle, and their cube by quarters;
    on a connected robot."""
    offsets: bool = False
    """Whether networks also get the offsets from the tips and the goal of a push to the object, on
    a connected robot. They follow from the observation, but 2 cm are little among its numbers."""
    approach: float = 0.0
    """Reward for a tip that comes nearer to where it could push the object to its goal [1/m]. An
    object that comes nearer to its goal gets twice as much."""
    kernel: float = 0.0
    """Reward of each action for an object at its goal; at 2 cm it is 0.43 of that, at 5 cm 0.07."""
    action_cost: float = 0.0
    """What PPO takes off the reward for each action: times the sum of its squares."""
    random_actions: int = 100
    """Random actions of each robot before it learns; PPO does not use this. A connected robot acts
    by its first policy instead."""
    demonstrations: float = 0.5
    """Share of each batch that is drawn from demonstrations, once there are any; the rest is drawn
    from all transitions. PPO and reaches that are `relabelled` do not use this."""
    imitation: float = 0.0
    """Weight in RLPD of the squared distance to demonstrated actions, against values of about 1; it
    falls linearly to 0 at the end."""
    buffer_size: int = 1_000_000
    """Largest number of transitions that are stored."""
    rollout: int = 100
    """Actions of each robot between two updates of PPO."""
    epochs: int = 10
    """How often an update of PPO goes through the actions of a rollout."""
    initial_noise: float = 1.0
    """Standard deviation of actions of PPO at the start; PPO learns the later ones."""
    entropy: float = 0.0
    """Weight of the entropy of actions in the loss of PPO: more keeps them noisy for longer."""

    @classmethod
    def of(
        cls,
        task: str,
        algorithm: str,
        *,
        is_shared: bool = False,
        has_fingers: bool = True,
    ) -> Self:
        """A recipe that is known to learn the task, or else a starting point for experiments.

        Only a robot that `has_fingers` can share experience or a policy between them.
        """
        reaches_with_fingers = has_fingers and task in ("reach", "finger_reach")
        known = (*LIBRARY, ON_POLICY, *CLASSES)
        if algorithm not in known and ":" not in algorithm:
            raise InvalidArgument(
                f"there is no algorithm '{algorithm}', only {', '.join(known)} and MODULE:CLASS"
            )
        common: dict[str, Any] = {"algorithm": algorithm, "is_shared": is_shared}
        if algorithm == ON_POLICY:
            common |= {"learning_rate": 3e-4, "final_learning_rate": 3e-5}
            if reaches_with_fingers:
                return cls(**common, num_envs=16, batch_size=160)
            if task.startswith("dclaw_"):
                common |= {"gamma": 0.98, "reward_scale": 1.0, "initial_noise": 0.6}
                return cls(**common, num_envs=64, rollout=40, batch_size=512)
            common |= {"gamma": 0.99, "reward_scale": 1.0, "entropy": 5e-4}
            noise = OF_CUBES[task].initial_noise if task in OF_CUBES else 0.6
            common |= {"initial_noise": noise}
            if ":" not in task and task != "reach":
                common |= {"physics_step": 0.005, "approach": 20.0, "kernel": 0.25}
                scale = 0.0 if task in OF_CUBES else 1.0
                common |= {"action_cost": 0.002, "reward_scale": scale}
            return cls(**common, num_envs=128, rollout=64, batch_size=1024, epochs=4)
        if task == "push" and algorithm == "rlpd":
            common |= {"gamma": 0.95, "learning_rate": 3e-4, "gradient_steps": 12, "approach": 40.0}
            common |= {"relabelled": 0.5, "symmetry": True, "offsets": True, "random_actions": 0}
            common |= {"imitation": 0.1}
            return cls(**common, layers=(128, 128), noise=0.4, final_noise=0.1, noise_color=0.5)
        if algorithm not in LIBRARY:
            gamma = 0.9 if reaches_with_fingers else 0.98
            return cls(**common, gamma=gamma, batch_size=256, learning_rate=3e-4)
        if reaches_with_fingers and is_shared:
            return cls(**common, batch_size=80, final_learning_rate=2e-5, relabelled=0.2)
        if reaches_with_fingers:
            return cls(**common, batch_size=64, relabelled=0.8)
        return cls(**common, num_envs=8, gamma=0.98, batch_size=256, learning_rate=3e-4)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """All settings of a training; the same plan gives the same policy."""

    task: str
    recipe: Recipe
    options: Options
    episodes: int = 700
    """Number of episodes of all robots together, if each has its full length."""
    seed: int = 1
    robot_config: str | None = None
    """Configuration of the robot; None: that of the robot that the task is usually for."""
    evaluation_interval: int = 50
    """Episodes between two evaluations."""
    checkpoint_interval: int = 25
    """Episodes between two checkpoints."""

    @classmethod
    def of(
        cls,
        task: str,
        algorithm: str,
        *,
        is_shared: bool = False,
        settings: Mapping[str, Any] | None = None,
        **more: Any,
    ) -> Self:
        """The plan of Recipe.of(); `settings` are other values for fields of Recipe and Options.

        `more` are fields of the plan itself, as in `episodes=100`.
        """
        settings = dict(settings or {})
        algorithm = str(settings.pop("algorithm", algorithm))
        recipe = Recipe.of(
            task, algorithm, is_shared=is_shared, has_fingers="frames" not in settings
        )
        usual = vars(recipe) | vars(Options.of(task))
        for name in sorted(settings):
            if name not in usual:
                raise InvalidArgument.of_name("setting", name, usual)
            _check_type(name, settings[name], usual[name])
        changes = {name: settings.pop(name) for name in vars(recipe) if name in settings}
        recipe = dataclasses.replace(recipe, **changes)
        if recipe.is_shared or (recipe.relabelled > 0 and task != "push"):
            settings = {"per_finger": True} | settings
        if task in OF_CUBES and algorithm == ON_POLICY:
            of_cube = OF_CUBES[task]
            changes = {"duration": of_cube.duration, "position_change": of_cube.position_change}
            changes |= dict.fromkeys(of_cube.shown, True)
            if settings.get("keypoints"):
                changes.pop("symmetric_object", None)  # Both say how the cube lies.
            settings = changes | settings
            more = {"episodes": of_cube.episodes} | more
        if (task, algorithm) == ("push", "rlpd"):
            slow = {"steps_per_action": 100, "duration": 10.0}
            settings = slow | {"action": "relative_position", "position_change": 0.15} | settings
        if task.startswith("dclaw_") and algorithm == ON_POLICY:
            more = {"episodes": 20_000, "evaluation_interval": 1000} | more
        # --resume may be said elsewhere.
        if recipe.reset_states:
            whole = str(Path(recipe.reset_states).resolve())
            recipe = dataclasses.replace(recipe, reset_states=whole)
        robot = more.get("robot_config")
        if robot is not None and Path(robot).is_file():
            more["robot_config"] = str(Path(robot).resolve())
        # There are about a hundred evaluations at most, so that they take little of the time.
        episodes = more.get("episodes", 700)
        more.setdefault("evaluation_interval", max(50, episodes // 100))
        more.setdefault("checkpoint_interval", max(25, episodes // 100))
        plan = cls(task=task, recipe=recipe, options=Options.of(task, **settings), **more)
        reaches = task in ("reach", "finger_reach")
        if recipe.is_shared and task in task_names() and not reaches:
            raise InvalidArgument(
                f"fingers share a policy of a reach (per_finger), not of '{task}'"
            )
        if (recipe.approach > 0 or recipe.kernel > 0) and (recipe.is_shared or reaches):
            raise InvalidArgument("approach and kernel are for tasks with an object")
        if recipe.device not in ("cpu", "cuda", "auto"):
            raise InvalidArgument(f"device is {recipe.device!r}, must be 'cpu', 'cuda' or 'auto'")
        for name in ("num_envs", "rollout", "batch_size", "epochs"):
            if vars(recipe)[name] < 1:
                raise InvalidArgument(f"{name} is {vars(recipe)[name]}, must be at least 1")
        if recipe.reset_states and recipe.num_envs == 1:
            raise InvalidArgument("reset_states are for many robots: num_envs of 2 or more")
        if not 0.0 <= recipe.reset_share <= 1.0:
            raise InvalidArgument(f"reset_share is {recipe.reset_share}, must be 0 to 1")
        if not 0.0 < recipe.initial_noise <= 1.0:
            raise InvalidArgument(
                f"initial_noise is {recipe.initial_noise}, must be above 0, at most 1"
            )
        is_library = algorithm in LIBRARY
        of_pushes = recipe.symmetry or recipe.offsets or (recipe.relabelled > 0 and not is_library)
        if of_pushes and (is_library or task != "push" or plan.options.frames):
            raise InvalidArgument(
                "symmetry, offsets and, but for ddpg, td3 and sac, relabelled are for pushes of a "
                "TriFinger by rlpd or an algorithm of your own"
            )
        chosen = plan.options
        shown = (chosen.symmetric_view, chosen.symmetric_object, chosen.object_offsets)
        if of_pushes and any((*shown, chosen.keypoints)):
            raise InvalidArgument(
                "symmetry, offsets and relabelled do not go with symmetric_view, "
                "symmetric_object, object_offsets and keypoints, which show other entries"
            )
        if not 0.0 <= recipe.demonstrations <= 1.0:
            raise InvalidArgument(f"demonstrations is {recipe.demonstrations}, must be 0 to 1")
        if plan.episodes < 1:
            raise InvalidArgument(f"episodes is {plan.episodes}, must be at least 1")
        return plan

    @property
    def environment(self) -> dict[str, Any]:
        """The arguments that all environments of the training have in common."""
        return {"task": self.task, "options": self.options, "config": self.robot_config}

    @property
    def name(self) -> str:
        """The name of the task, without the module of one in Python: for files and folders."""
        return name_of(self.task)

    def to_json(self) -> str:
        """The plan as JSON, as the folder of a run holds it."""
        return json.dumps(dataclasses.asdict(self), indent=2)

    @classmethod
    def of_folder(cls, folder: Path, task: str | None = None, algorithm: str | None = None) -> Self:
        """The plan of the training in a folder; what is MODULE:CLASS must be named here, too."""
        if not (folder / PLAN).is_file():
            raise InvalidArgument(f"there is no training in {folder}")
        plan = cls.from_json((folder / PLAN).read_text())
        plan.require_said(folder, task, algorithm)
        return plan

    def require_said(self, file: Path, task: str | None, algorithm: str | None) -> None:
        """Raises InvalidArgument if a file has this plan that the user did not say.

        What is MODULE:CLASS must be said, because it runs; the others may be left out.
        """
        for kind, named, said in (
            ("task", self.task, task),
            ("algorithm", self.recipe.algorithm, algorithm),
        ):
            if name_of_file(kind, named, said, file) != named:
                raise InvalidArgument(f"{file} has a training of '{named}', not of '{said}'")

    @classmethod
    def from_json(cls, text: str) -> Self:
        """The plan from the text that to_json() returned."""
        fields = json.loads(text)
        recipe = fields.pop("recipe")
        recipe["layers"] = tuple(recipe["layers"])
        options = Options.from_json(json.dumps(fields.pop("options")))
        return cls(recipe=Recipe(**recipe), options=options, **fields)


def name_of(task: str) -> str:
    """The name of a task without its module: "Middle" of "my_tasks:Middle"."""
    return task.rpartition(":")[2]


def parse_setting(word: str) -> tuple[str, Any]:
    """Key and value of KEY=VALUE; the value is a literal of Python or else a word."""
    name, equals, text = word.partition("=")
    if not equals:
        raise InvalidArgument(f"'{word}' is no KEY=VALUE")
    try:
        return name, ast.literal_eval(text)
    except (SyntaxError, ValueError):
        return name, text


def _check_type(name: str, value: Any, usual: Any) -> None:
    kinds = (int, float) if type(usual) is float else (type(usual),)
    if type(value) not in kinds:
        raise InvalidArgument(f"{name} is {value!r}, must be like {usual!r}")
