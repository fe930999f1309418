# SPDX-License-Identifier: BSD-3-Clause
"""Writes a data set of Minari, in HDF5 and without loss.

Episodes that an environment has made (`RecordEpisodes`) have its observations, actions and rewards,
and Minari recovers the environment. Other episodes have what the robot measured and what it was
asked for, and rewards of 0. docs/data_sets.md has the details. An episode passes through in parts,
so its length does not matter.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from trifinger import extras
from trifinger.errors import InvalidArgument
from trifinger.whole_file import whole_file

from trifinger_data_sets import MINARI
from trifinger_data_sets.episodes import Episode, Say, losses_of
from trifinger_data_sets.marks import Decisions, environment_of
from trifinger_data_sets.output import whole_folder
from trifinger_data_sets.rows import (
    ACTION,
    ENVIRONMENT,
    HIGH_RATE,
    STATE,
    STEP,
    Choice,
    Pictures,
    Rows,
)

if TYPE_CHECKING:
    from gymnasium import spaces
    from trifinger._trifinger import LoggedSession
    from trifinger.arrays import Array

ROOT = "MINARI_DATASETS_PATH"  # the variable that says where Minari looks for data sets
IDENTIFIER = re.compile(r"(?:([-_\w]+(?:/[-_\w]+)*)/)?([-_\w]+)-v(\d+)", re.ASCII)
NAMESPACE = "namespace_metadata.json"
DATA = "main_data.hdf5"
MEGABYTE = 1e6
CONFIGURATION = "configuration.yml"  # documents of a session
MODEL = "model.xml"


@dataclass(frozen=True, kw_only=True)
class About:
    """What people should know of a data set. None is left out."""

    author: str | None = None
    author_email: str | None = None
    algorithm_name: str | None = None
    code_permalink: str | None = None
    description: str | None = None


@dataclass(frozen=True, kw_only=True)
class Result:
    """What was written."""

    path: Path
    episodes: int
    steps: int
    environment: str = ""
    """The task, if an environment has made the episodes."""

    def __str__(self) -> str:
        who = f" of the environment '{self.environment}'" if self.environment else ""
        return f"{self.episodes} episodes{who}, {self.steps} actions"


@dataclass(frozen=True)
class _Source:
    observation_space: spaces.Space[Any]
    action_space: spaces.Space[Any]
    spec: str | None = None
    task: str = ""
    rows: Rows | None = None
    origin: dict[str, Any] | None = None


def root() -> Path:
    """The folder in which Minari looks for data sets."""
    return Path(os.environ.get(ROOT) or Path.home() / ".minari" / "datasets")


def write(
    episodes: Sequence[Episode],
    identifier: str,
    *,
    choice: Choice | None = None,
    observation: Literal["environment", "flat", "dictionary"] | None = None,
    high_rate: bool = False,
    about: About | None = None,
    force: bool = False,
    say: Say = print,
) -> Result:
    """Writes the data set `identifier`, such as "trifinger/reach-v0", where Minari looks for it.

    `observation` says what an observation is: that of the environment that has made the episodes,
    or one vector of what the robot measured, or a dictionary, which also has images. None takes
    the first one that is possible; images need the dictionary. `high_rate` also keeps all steps
    between the rows, in the infos, whatever `choice` says. Raises InvalidArgument; Error if a
    package is missing.
    """
    extras.require(*MINARI)
    match = IDENTIFIER.fullmatch(identifier)
    if match is None:
        raise InvalidArgument(
            f"'{identifier}' names no data set of Minari; expected is (NAMESPACE/)NAME-vNUMBER, "
            "such as trifinger/reach-v0"
        )
    folder = root() / identifier
    if folder.exists() and not force:
        raise InvalidArgument(f"{folder} is there already; --force replaces it")
    choice = replace(choice or Choice(), high_rate=high_rate)
    source = _source(episodes, choice, observation, say)
    usable = _with_actions(episodes, source, say)
    with whole_folder(folder, force=force) as part:
        (part / "data").mkdir()
        steps = _write_episodes(part / "data" / DATA, usable, source)
        size = (part / "data" / DATA).stat().st_size / MEGABYTE
        metadata = _metadata(identifier, source, about or About())
        metadata |= {
            "total_episodes": len(usable),
            "total_steps": steps,
            "dataset_size": round(size, 1),
        }
        if losses := losses_of(episodes):
            metadata["losses"] = losses
        text = json.dumps(metadata, indent=2)
        (part / "data" / "metadata.json").write_text(text + "\n", encoding="utf-8")
        _make_namespaces(match.group(1))
    return Result(path=folder, episodes=len(usable), steps=steps, environment=source.task)


def _source(
    episodes: Sequence[Episode], choice: Choice, observation: str | None, say: Say
) -> _Source:
    made = [_decisions(episode) for episode in episodes]
    environments = {one.environment for one in made if one is not None}
    is_one = len(environments) == 1 and all(one is not None for one in made)
    if observation == "environment" or (observation is None and is_one):
        if not is_one:
            raise InvalidArgument(
                "not all episodes were made by the same environment; --observation flat takes what "
                "the robot measured"
            )
        if choice.high_rate:
            raise InvalidArgument(
                "what an environment saw has no steps between its observations; --observation flat "
                "takes what the robot measured, which has"
            )
        return _environment_source(made[0], episodes[0].session)
    if any(made):
        say("the episodes have what the robot measured, not what an environment saw.")
    say("no environment has judged, so all rewards are 0.")
    return _robot_source(episodes, choice, observation, say)


def _decisions(episode: Episode) -> Decisions | None:
    # An environment's episode is whole or not: part of it has other ends.
    mark = episode.mark
    if mark is None or (episode.first, episode.end) != (mark.first, mark.end):
        return None
    return mark.decisions


def _environment_source(decisions: Decisions | None, session: LoggedSession) -> _Source:
    import gymnasium
    from gymnasium.envs.registration import EnvSpec, WrapperSpec

    from trifinger_data_sets.recorded_environment import make

    if decisions is None:
        raise InvalidArgument("no environment has made the episodes")
    arguments = environment_of(decisions)
    wrappers = tuple(WrapperSpec(**one) for one in arguments.pop("wrappers", ()))
    origin = {name: arguments[name] for name in ("config", "config_overrides")}
    files = _files(arguments, session)
    if files:
        config = Path(origin["config"]).name
        arguments |= {"config": config, "config_overrides": {}, "files": files}
    spec = EnvSpec(
        id=f"TriFinger/{_camel(arguments['task'])}-v0",
        entry_point=f"{make.__module__}:{make.__name__}",
        kwargs=arguments,
        additional_wrappers=wrappers,
    )
    # The environment is made as everybody will make it who recovers it.
    with contextlib.closing(gymnasium.make(EnvSpec.from_json(spec.to_json()))) as environment:
        return _Source(
            environment.observation_space,
            environment.action_space,
            spec.to_json(),
            arguments["task"],
            origin=origin if files else None,
        )


def _files(arguments: dict[str, Any], session: LoggedSession) -> dict[str, str]:
    # A robot of the user's own file: its configuration and its model travel in the data set. Takes
    # out of the arguments what is for them alone.
    from trifinger_data_sets.recorded_environment import is_path

    documents = session.documents
    limits = arguments.pop("limits", {})
    text = documents.get(CONFIGURATION)
    if not is_path(arguments["config"]) or text is None:
        return {}
    name = Path(arguments["config"]).name
    if not limits:
        return {name: text}
    # A robot on hardware has no model in its log.
    model = documents.get(MODEL)
    return {name: _with_model(text, limits), MODEL: model} if model is not None else {}


def _with_model(configuration: str, limits: dict[str, dict[str, float]]) -> str:
    # The model of a session needs no other file and has the objects of the configuration in it. It
    # has no limits.
    lines = []
    section = ""
    for line in configuration.splitlines():
        if not line.startswith(" "):
            section = line.partition(":")[0]
        if section in ("objects", "safety"):
            continue
        if section == "robot" and re.match(r"  (mjcf|urdf|mesh_folder): ", line):
            continue
        lines.append(line)
        if line == "robot:":
            lines.append(f"  mjcf: {MODEL}")
    lines.append("safety:")
    for joint, values in limits.items():
        lines.append(f"  {json.dumps(joint)}:")
        names = [name.partition(".") for name in values]
        lines += [f"    {key}: {_number(values[key])}" for key, dot, _ in names if not dot]
        inner = [(key, rest) for key, dot, rest in names if dot]
        for group in dict.fromkeys(key for key, _ in inner):
            lines.append(f"    {group}:")
            lines += [
                f"      {rest}: {_number(values[f'{key}.{rest}'])}"
                for key, rest in inner
                if key == group
            ]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return repr(value).replace("inf", ".inf")


def _camel(task: str) -> str:
    return "".join(word.capitalize() for word in task.split("_"))


def _robot_source(
    episodes: Sequence[Episode], choice: Choice, observation: str | None, say: Say
) -> _Source:
    from gymnasium import spaces

    rows = Rows(episodes, choice, say)
    if observation is None:
        observation = "dictionary" if rows.cameras else "flat"
    if observation == "flat" and rows.cameras:
        if choice.cameras:
            raise InvalidArgument("images need --observation dictionary")
        rows = Rows(episodes, replace(choice, cameras=()), say)
    sizes = {one.name: one.shape[0] for one in rows.features}

    def box(size: int) -> spaces.Box:
        return spaces.Box(-np.inf, np.inf, (size,), np.float32)

    vectors = {name: sizes[name] for name in (STATE, ENVIRONMENT) if name in sizes}
    space: spaces.Space[Any] = box(sum(vectors.values()))
    if observation == "dictionary":
        parts: dict[str, spaces.Space[Any]] = {
            _key(name): box(size) for name, size in vectors.items()
        }
        for name in rows.cameras:
            height, width = rows.image_size(name)
            parts[name] = spaces.Box(0, 255, (height, width, 3), np.uint8)
        space = spaces.Dict(parts)
    return _Source(space, box(sizes[ACTION]), rows=rows)


def _key(feature: str) -> str:
    return feature.removeprefix("observation.")


def _with_actions(episodes: Sequence[Episode], source: _Source, say: Say) -> list[Episode]:
    if source.rows is None:
        return list(episodes)
    usable = []
    for episode in source.rows.usable(episodes):
        # The last row has no observation after it.
        if source.rows.count(episode) >= 2:
            usable.append(episode)
        else:
            say(f"{episode} is left out: it is too short for an action")
    if not usable:
        raise InvalidArgument("no episode has an action")
    return usable


def _write_episodes(path: Path, episodes: Sequence[Episode], source: _Source) -> int:
    import h5py

    total = 0
    with h5py.File(path, "w", track_order=True) as file:
        for number, episode in enumerate(episodes):
            group = file.create_group(f"episode_{number}")
            if source.rows is None:
                steps = _add_decisions(group, episode)
            else:
                steps = _add_rows(group, episode, source)
            terminations = np.zeros(steps, bool)
            terminations[-1] = episode.terminated
            truncations = np.zeros(steps, bool)
            truncations[-1] = not episode.terminated
            group.create_dataset("terminations", data=terminations)
            group.create_dataset("truncations", data=truncations)
            group.attrs["id"] = number
            group.attrs["total_steps"] = steps
            group.attrs["task"] = episode.task
            group.attrs["log"] = episode.log.name
            group.attrs["session_id"] = str(episode.session.session_id)
            total += steps
    return total


def _add_decisions(group: Any, episode: Episode) -> int:
    decisions = episode.mark.decisions if episode.mark is not None else None
    if decisions is None:
        raise InvalidArgument(f"{episode} was not made by an environment")
    group.create_dataset("observations", data=decisions.observations)
    group.create_dataset("actions", data=decisions.actions)
    group.create_dataset("rewards", data=decisions.rewards)
    infos = group.create_group("infos")
    infos.create_dataset("step", data=decisions.steps)
    group.attrs["seed"] = decisions.seed
    group.attrs["options/episode"] = decisions.episode
    return len(decisions.actions)


def _add_rows(group: Any, episode: Episode, source: _Source) -> int:
    rows = source.rows
    assert rows is not None  # noqa: S101  (_write_episodes has looked)
    is_dictionary = hasattr(source.observation_space, "spaces")
    steps = rows.count(episode) - 1
    pictures = rows.pictures(episode) if rows.cameras else None
    series: dict[str, Any] = {}

    def put(name: str, begin: int, values: Array, length: int) -> None:
        values = values[: length - begin]
        if name not in series:
            shape = (length, *values.shape[1:])
            series[name] = group.create_dataset(name, shape, values.dtype, chunks=True)
        series[name][begin : begin + len(values)] = values

    between = [one.name for one in rows.features if one.name.startswith(tuple(HIGH_RATE.values()))]
    begin = 0
    for block in rows.blocks(episode):
        vectors = {
            _key(name): block.values[name] for name in (STATE, ENVIRONMENT) if name in block.values
        }
        if is_dictionary:
            for name, values in vectors.items():
                put(f"observations/{name}", begin, values, steps + 1)
        else:
            put("observations", begin, np.concatenate(list(vectors.values()), axis=1), steps + 1)
        put("actions", begin, block.values[ACTION], steps)
        for name in (STEP, *between):
            put(f"infos/{name}", begin, block.values[name], steps + 1)
        if pictures is not None:
            for i, images in enumerate(_images(pictures, block.steps)):
                for name, image in images.items():
                    put(f"observations/{name}", begin + i, image[None], steps + 1)
        begin += len(block)
    group.create_dataset("rewards", data=np.zeros(steps))
    return steps


def _images(pictures: Pictures, steps: Array) -> Iterator[dict[str, Array]]:
    wanted = {name: pictures.rows(name, steps) for name in pictures.names}
    for i in range(len(steps)):
        yield {name: pictures.image(name, int(rows[i])) for name, rows in wanted.items()}


def _metadata(identifier: str, source: _Source, about: About) -> dict[str, Any]:
    import minari
    from minari.serialization import serialize_space

    metadata: dict[str, Any] = {
        "dataset_id": identifier,
        "data_format": "hdf5",
        "jpeg_encoding": False,
        "observation_space": serialize_space(source.observation_space),
        "action_space": serialize_space(source.action_space),
        "minari_version": minari.__version__,
    }
    if source.spec is not None:
        metadata["env_spec"] = source.spec
    if source.origin is not None:
        metadata["recorded_with"] = source.origin
    if source.rows is not None:
        metadata["rate"] = source.rows.rate
        metadata["names"] = {
            _key(one.name): list(one.names) for one in source.rows.features if one.names
        }
    for name, value in vars(about).items():
        if value is not None:
            metadata[name] = [value] if name.startswith("author") else value
    return metadata


def _make_namespaces(namespace: str | None) -> None:
    folder = root()
    for part in (namespace or "").split("/"):
        if part:
            folder /= part
            folder.mkdir(parents=True, exist_ok=True)
            with (
                contextlib.suppress(FileExistsError),
                whole_file(folder / NAMESPACE, replace=False) as part_file,
            ):
                part_file.write_text("{}")
