# SPDX-License-Identifier: BSD-3-Clause
"""A student that sees what a robot sees, and learns what a teacher would do who sees more.

DAgger (Ross, Gordon and Bagnell 2011): the student acts, the teacher says at each step what it
would have done, and the student learns from all that was said so far. So it also learns the way
back from its own mistakes. Both see the same robots: a simulation for each moves alike.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

# This import comes first because its error says what to install.
from trifinger.environments import Options, VectorEnvironment, policy_metadata

# isort: split
import numpy as np
import torch
from gymnasium.spaces import flatdim
from gymnasium.vector import AutoresetMode
from torch import nn

from trifinger import policy_file
from trifinger._trifinger import Policy
from trifinger.arrays import Array
from trifinger.environments.options import require
from trifinger.errors import Error, InvalidArgument
from trifinger.evaluation import act_of, rows_of
from trifinger.whole_file import whole_file

FINGER = 3  # joints of a finger
PLACE_UNIT = 0.1  # of where a student says that the object is [m]
# What a student may have another of than its teacher: what is seen, not what is done.
SIGHT = (
    *("observation", "symmetric_view", "symmetric_object", "object_offsets", "keypoints"),
    *(
        "position_noise",
        "velocity_noise",
        "object_poses",
        "object_period",
        "object_delay",
        "object_position_noise",
    ),
    *("object_orientation_noise", "object_loss", "camera_rate", "camera_delay", "camera_size"),
    "camera_varies",
)
# What a student cannot change, because the teacher's actions would mean something else.
ACTIONS = ("action", "position_change", "steps_per_action", "leash", "per_finger", "frames")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Lessons:
    """How a student is taught."""

    episodes: int = 600
    """Number of episodes of all robots together."""
    rounds: int = 10
    """The teacher acts in the first of them, the student in the others."""
    num_envs: int = 20
    """Number of robots that move at once."""
    every: int = 2
    """One of so many actions is learned from: observations that follow each other are alike."""
    epochs: int = 20
    """How often the layers learn from all that was seen, after each round."""
    looks: int = 2
    """The same for the convolutions, which take a hundred times as long. The layers then learn from
    what these find."""
    layers: tuple[int, ...] = (512, 256, 128)
    batch_size: int = 256
    learning_rate: float = 1e-3
    """It falls to zero along half a cosine, over all rounds."""
    noise: float = 0.1
    """Standard deviation of noise on actions while lessons are given."""
    place: float = 3000.0
    """Weight of where the object is [1/m²]: a part of what sees images learns to say it, for the
    layers behind."""
    seed: int = 1

    def __post_init__(self) -> None:
        for name in ("episodes", "rounds", "num_envs", "every", "epochs", "looks", "batch_size"):
            require(getattr(self, name) >= 1, name, getattr(self, name), "at least 1")
        require(
            self.episodes >= self.rounds * self.num_envs,
            "episodes",
            self.episodes,
            f"at least {self.rounds * self.num_envs}: one for each robot in each round",
        )


Watch = Callable[[int, float], None]
"""Called after each round with its number, and how far the student's actions are from those of its
teacher while it acts itself: the root mean square of numbers from -1 to 1. The first round has what
a student has learned that has not acted yet: infinity."""


def distill(
    teacher: Policy,
    path: Path,
    *,
    options: Options,
    lessons: Lessons | None = None,
    watch: Watch | None = None,
) -> Policy:
    """Writes the file of a student of `teacher`, as ONNX, and returns its policy.

    `options` are those of the student; the teacher's file says its task, options and robot. Raises
    InvalidArgument if options differ that mean other actions.
    """
    lessons = lessons or Lessons()
    require(path.suffix == ".onnx", "path", str(path), "the name of a file that ends in .onnx")
    torch.set_num_threads(1)
    torch.manual_seed(lessons.seed)
    with closing(_Robots(teacher, options, lessons)) as robots:
        seen = robots.layout
        student = Student(seen, robots.num_actions, lessons.layers)
        examples = _Examples(seen, robots.num_actions, robots.num_examples)
        optimizer = torch.optim.AdamW(student.parameters(), lessons.learning_rate)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, lessons.rounds)
        for number in range(lessons.rounds):
            deviation = robots.act(student if number else None, examples)
            if number == 0:
                student.scale(examples.entries)
            _learn(student, examples, optimizer, lessons)
            schedule.step()
            if watch is not None:
                watch(number + 1, deviation)
        metadata = policy_metadata(robots.task, options, robots.config)
    student.export(path, metadata)
    return Policy(path)


def options_of_student(teacher: Policy, **changes: Any) -> Options:
    """The options of a teacher with some changes, for a student.

    What images cannot show is off then: symmetric_view, symmetric_object, object_offsets and
    keypoints. Raises InvalidArgument if the teacher's file does not say its options, or for unknown
    names.
    """
    if "options" not in teacher.metadata:
        raise InvalidArgument("the teacher's file does not say its 'options'")
    if changes.get("observation") == "images":
        unseen = ("symmetric_view", "symmetric_object", "object_offsets", "keypoints")
        changes = dict.fromkeys(unseen, False) | changes
    return Options.from_json(teacher.metadata["options"]).changed(**changes)


@dataclasses.dataclass(frozen=True)
class Layout:
    """The parts of an observation, in the order of gymnasium.spaces.flatten."""

    names: Sequence[str]
    shapes: Sequence[tuple[int, ...]]

    @classmethod
    def of(cls, space: Any) -> Layout:
        """That of the observations of one robot."""
        parts = getattr(space, "spaces", {"": space})
        return cls([*parts], [part.shape for part in parts.values()])

    @property
    def sizes(self) -> list[int]:
        """Count of the numbers of each part."""
        return [math.prod(shape) for shape in self.shapes]

    @property
    def images(self) -> list[int]:
        """Which of the parts are images."""
        return [index for index, shape in enumerate(self.shapes) if len(shape) == 3]

    @property
    def entries(self) -> list[int]:
        """Which of the parts are not."""
        return [index for index, shape in enumerate(self.shapes) if len(shape) != 3]

    def split(self, observations: Any) -> tuple[Array, Array]:
        """Entries (N x numbers), and images (N x height x width x channels of all cameras)."""
        parts = observations if isinstance(observations, dict) else {"": observations}
        entries = [parts[self.names[index]] for index in self.entries]
        images = [parts[self.names[index]] for index in self.images]
        seen = np.concatenate(images, axis=3) if images else np.zeros((len(entries[0]), 0), "u1")
        return np.concatenate(entries, axis=1), seen


class Student(nn.Module):
    """Layers of the entries of an observation, and of what convolutions find in its images."""

    mean: torch.Tensor
    deviation: torch.Tensor
    eyes: nn.Module
    look: nn.Module
    place: nn.Module

    def __init__(self, layout: Layout, acted: int, layers: Sequence[int]) -> None:
        super().__init__()
        self.layout = layout
        count = sum(layout.sizes[index] for index in layout.entries)
        self.register_buffer("mean", torch.zeros(count))
        self.register_buffer("deviation", torch.ones(count))
        found = 0
        if layout.images:
            height, width, _ = layout.shapes[layout.images[0]]
            channels = 3 * len(layout.images)
            self.eyes = nn.Sequential(
                *(nn.Conv2d(channels, 16, 5, 2, 2), nn.ReLU()),
                *(nn.Conv2d(16, 32, 3, 2, 1), nn.ReLU()),
                *(nn.Conv2d(32, 64, 3, 2, 1), nn.ReLU()),
                *(nn.Conv2d(64, 64, 3, 2, 1), nn.ReLU()),
                nn.Flatten(),
            )
            flat = self.eyes(torch.zeros(1, channels, height, width)).shape[1]
            self.look = nn.Sequential(nn.Linear(flat, layers[0]), nn.ReLU())
            self.place = nn.Linear(layers[0], 3)
            found = layers[0] + 3
        sizes = [count + found, *layers]
        hidden: list[nn.Module] = []
        for size, after in pairwise(sizes):
            hidden += [nn.Linear(size, after), nn.ELU()]
        self.layers = nn.Sequential(*hidden, nn.Linear(sizes[-1], acted), nn.Tanh())

    def scale(self, entries: torch.Tensor) -> None:
        """Makes these entries have mean 0 and deviation 1 for the layers."""
        self.mean.copy_(entries.mean(0))
        # What never changes must not be magnified when it does.
        deviation = entries.std(0)
        self.deviation.copy_(torch.where(deviation < 1e-4, 1.0, deviation))

    def see(self, images: torch.Tensor) -> torch.Tensor:
        """What is found in images (N x channels x height x width), of numbers from 0 to 255.

        The last three numbers are where the object is [0.1 m].
        """
        if not self.layout.images:
            return images.reshape(len(images), 0)
        found = self.look(self.eyes(images / 255.0 - 0.5))
        return torch.cat([found, self.place(found)], 1)

    def act(self, entries: torch.Tensor, found: torch.Tensor) -> torch.Tensor:
        """Actions for entries, and what was found in images."""
        numbers = ((entries - self.mean) / self.deviation).clamp(-10.0, 10.0)
        seen = torch.cat([numbers, found], 1) if self.layout.images else numbers
        actions: torch.Tensor = self.layers(seen)
        return actions

    def forward(self, vectors: torch.Tensor) -> torch.Tensor:
        """Actions for whole observations, each as one vector."""
        parts = torch.split(vectors, self.layout.sizes, dim=1)
        entries = torch.cat([parts[index] for index in self.layout.entries], 1)
        if not self.layout.images:
            return self.act(entries, torch.zeros(1, 0))
        images = [
            parts[index].reshape(-1, *self.layout.shapes[index]).permute(0, 3, 1, 2)
            for index in self.layout.images
        ]
        return self.act(entries, self.see(torch.cat(images, 1)))

    def export(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Writes the file of ONNX that computes an action for an observation."""
        with warnings.catch_warnings(), whole_file(path) as part:
            warnings.simplefilter("ignore")  # it says that there is a newer exporter
            torch.onnx.export(
                self.eval(),
                (torch.zeros(1, sum(self.layout.sizes)),),
                part,
                input_names=["observation"],
                output_names=["action"],
                opset_version=17,
                dynamo=False,
            )
            part.write_bytes(policy_file.with_metadata(part.read_bytes(), metadata))


class _Examples:
    # What the student saw, what the teacher would have done, and where the object was.
    def __init__(self, layout: Layout, acted: int, room: int) -> None:
        count = sum(layout.sizes[index] for index in layout.entries)
        self.count = 0
        self._entries = torch.zeros(room, count)
        shapes = [layout.shapes[index] for index in layout.images]
        height, width = shapes[0][:2] if shapes else (0, 0)
        self._images = torch.zeros(room, 3 * len(shapes), height, width, dtype=torch.uint8)
        self._actions = torch.zeros(room, acted)
        self._places = torch.zeros(room, 3)

    @property
    def entries(self) -> torch.Tensor:
        return self._entries[: self.count]

    def add(self, entries: Array, images: Array, actions: Array, places: Array) -> None:
        rows = slice(self.count, self.count + len(entries))
        self._entries[rows] = torch.from_numpy(entries)
        if images.size:
            self._images[rows] = torch.from_numpy(images).permute(0, 3, 1, 2)
        self._actions[rows] = torch.from_numpy(actions)
        self._places[rows] = torch.from_numpy(places)
        self.count += len(entries)

    def batches(self, size: int, *others: torch.Tensor) -> Iterator[tuple[torch.Tensor, ...]]:
        """Entries, wanted actions and the rows of `others`, in a new order."""
        for rows in torch.randperm(self.count).split(size):
            yield tuple(one[rows].float() for one in (self._entries, self._actions, *others))

    def looks(self, size: int) -> Iterator[tuple[torch.Tensor, ...]]:
        """The same with images, and where the object was."""
        return self.batches(size, self._images, self._places)

    def found(self, student: Student) -> torch.Tensor:
        """What a student finds in all images."""
        with torch.no_grad():
            images = self._images[: self.count].split(512)
            return torch.cat([student.see(part.float()) for part in images])


def _learn(
    student: Student, examples: _Examples, optimizer: torch.optim.Optimizer, lessons: Lessons
) -> None:
    def improve(loss: torch.Tensor) -> None:
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()

    for _ in range(lessons.looks if student.layout.images else 0):
        for entries, wanted, images, places in examples.looks(lessons.batch_size):
            found = student.see(images)
            aside = (PLACE_UNIT * found[:, -3:] - places).square().mean()
            done = student.act(entries, found)
            improve((done - wanted).square().mean() + lessons.place * aside)
    found = examples.found(student)
    for _ in range(lessons.epochs):
        for entries, wanted, seen in examples.batches(lessons.batch_size, found):
            improve((student.act(entries, seen) - wanted).square().mean())
    if not all(one.isfinite().all() for one in student.parameters()):
        raise Error("the student has learned nothing: its weights are not finite")


class _Robots:
    # Has each robot twice: as the teacher sees it, and as the student does.
    def __init__(self, teacher: Policy, options: Options, lessons: Lessons) -> None:
        seeing = options_of_student(teacher)
        self.task = teacher.metadata.get("task", "")
        require(":" not in self.task, "task", self.task, "one in C++: two simulations move alike")
        self.config = teacher.metadata.get("robot")
        for name in ACTIONS:
            if getattr(options, name) != getattr(seeing, name):
                raise InvalidArgument(
                    f"{name} is {getattr(options, name)!r}, must be that of the teacher, "
                    f"{getattr(seeing, name)!r}: its actions mean something else"
                )
        sight = {name: getattr(seeing, name) for name in SIGHT}
        self._lessons, self._round = lessons, 0
        self._random = np.random.default_rng(lessons.seed)
        self._teacher, self._student = (
            VectorEnvironment(
                self.task,
                lessons.num_envs,
                options=one,
                config=self.config,
                num_threads=1,
                physics_step=0.005,
                autoreset_mode=AutoresetMode.SAME_STEP,
            )
            for one in (options.changed(**sight), options)
        )
        seen, acted = self._teacher.single_observation_space, self._teacher.single_action_space
        if rows_of(teacher, self.task, seen, acted) != 1:
            raise InvalidArgument("a policy that the fingers share cannot be a teacher")
        self._says = act_of(teacher)
        self.layout = Layout.of(self._student.single_observation_space)
        self.num_actions = flatdim(acted)

    @property
    def num_examples(self) -> int:
        """The most that all rounds give."""
        actions = -(-self._teacher.episode_actions // self._lessons.every)
        return actions * self._episodes * self._lessons.num_envs * self._lessons.rounds

    # Episodes of each robot in a round.
    @property
    def _episodes(self) -> int:
        return self._lessons.episodes // (self._lessons.num_envs * self._lessons.rounds)

    def act(self, student: Student | None, examples: _Examples) -> float:
        """Acts as the student does, or the teacher, and returns how far it is from the teacher."""
        squares: list[float] = []
        for _ in range(self._episodes):
            first = self._lessons.seed * 1_000_000 + self._round * self._lessons.num_envs
            self._round += 1
            seen, _ = self._teacher.reset(seed=first)
            shown, _ = self._student.reset(seed=first)
            has_ended = np.zeros(self._lessons.num_envs, bool)
            for number in range(self._teacher.episode_actions):
                going = ~has_ended
                entries, images = self.layout.split(shown)
                wanted = self._turned(np.clip(self._says(np.asarray(seen)), -1.0, 1.0))
                if number % self._lessons.every == 0:
                    parts = (entries, images, wanted, self._places())
                    examples.add(*(one[going] for one in parts))
                actions = wanted
                if student is not None:
                    actions = self._by(student, entries, images)
                    squares.append(float(np.square(actions - wanted)[going].mean()))
                noise = self._random.normal(0.0, self._lessons.noise, actions.shape)
                actions = np.clip(actions + noise, -1.0, 1.0).astype(np.float32)
                seen, _, terminated, truncated, _ = self._teacher.step(self._turned(actions, -1))
                shown, *_ = self._student.step(actions)
                ended = terminated | truncated
                has_ended |= ended
                self._require_alike(~has_ended)
                if has_ended.all():
                    break
        return math.sqrt(np.mean(squares)) if squares else math.inf

    def close(self) -> None:
        self._teacher.close()
        self._student.close()

    # What the teacher sees must be what happens to the student.
    def _require_alike(self, which: Array) -> None:
        for index in map(int, np.flatnonzero(which)):
            one, other = (
                each._core.configuration(index) for each in (self._teacher, self._student)
            )
            if one != other:
                raise Error(f"robot {index} of the teacher has moved otherwise than its student's")

    @staticmethod
    def _by(student: Student, entries: Array, images: Array) -> Array:
        with torch.inference_mode():
            numbers = torch.from_numpy(np.moveaxis(images, -1, 1) if images.size else images)
            found = student.see(numbers.float())
            actions: Array = student.act(torch.from_numpy(entries), found).numpy()
        return actions

    # Where the objects are; zeros if the task has none.
    def _places(self) -> Array:
        nowhere = np.zeros((self._lessons.num_envs, 3), np.float32)
        return self._student.hidden.get("true_object_position", nowhere)

    # Actions in the order of the student's joints, of the teacher's, or with -1 the reverse.
    def _turned(self, actions: Array, sign: int = 1) -> Array:
        turned = np.empty_like(actions)
        for index, row in enumerate(actions):
            first = self._teacher._core.first_finger(index)
            first -= self._student._core.first_finger(index)
            turned[index] = np.roll(row, sign * FINGER * first)
        return turned
