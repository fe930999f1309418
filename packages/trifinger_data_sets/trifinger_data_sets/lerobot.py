# SPDX-License-Identifier: BSD-3-Clause
"""Writes a LeRobotDataset, version 3.0, without the package LeRobot.

docs/data_sets.md says what its features mean. Rows and images pass through: the memory that
this takes does not grow with the length of the logs.
"""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from trifinger import extras
from trifinger.errors import InvalidArgument
from trifinger.progress import Progress

from trifinger_data_sets import LEROBOT, lerobot_layout as layout
from trifinger_data_sets.episodes import Episode, Say, losses_of
from trifinger_data_sets.lerobot_tables import DataTable, EpisodeTable, schema_of
from trifinger_data_sets.lerobot_videos import CODECS, ENCODERS, Videos, choose_encoder
from trifinger_data_sets.output import whole_folder
from trifinger_data_sets.rows import (
    IMAGE_AGE,
    Block,
    Choice,
    Feature,
    Pictures,
    Rows,
)
from trifinger_data_sets.statistics import Brightness, Columns, Statistics, sampled, thinned

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger.arrays import Array

VERSION = "v3.0"
IMAGES = "observation.images."
DEFAULT_TASK = "Move the robot"

COMMON = (
    Feature("timestamp", "float32", (1,), unit="s"),
    Feature("frame_index", "int64", (1,)),
    Feature("episode_index", "int64", (1,)),
    Feature("index", "int64", (1,)),
    Feature("task_index", "int64", (1,)),
)
"""Features that every data set has, after its own."""
REWARDS = (
    Feature("next.reward", "float32", (1,)),
    Feature("next.done", "bool", (1,)),
    Feature("next.success", "bool", (1,)),
)
"""Features of data sets whose marks say how episodes went."""


@dataclass(frozen=True, kw_only=True)
class Result:
    """What was written."""

    episodes: int
    frames: int
    rate: int

    def __str__(self) -> str:
        return f"{self.episodes} episodes, {self.frames} rows at {self.rate} Hz"


def write(
    episodes: Sequence[Episode],
    folder: Path,
    *,
    choice: Choice | None = None,
    images: Literal["video", "image"] = "video",
    encoder: str | None = None,
    force: bool = False,
    say: Say = print,
) -> Result:
    """Writes a data set of episodes into `folder`, which appears when it is whole.

    `images` says whether images become videos or a PNG in each row. `encoder` is one of `ENCODERS`;
    None takes the first that is there. Raises InvalidArgument; Error if a package is missing.
    """
    extras.require(*LEROBOT)
    if folder.exists() and not force:
        raise InvalidArgument(f"{folder} is there already; --force replaces it")
    rows = Rows(episodes, choice or Choice(), say)
    usable = rows.usable(episodes)
    with whole_folder(folder, force=force) as part, contextlib.ExitStack() as stack:
        writer = _Writer(part, rows, usable, images, encoder, say, stack)
        with Progress(folder.name) as progress:
            total = sum(rows.count(episode) for episode in usable)
            for episode in usable:
                writer.add(episode, lambda done: progress.update(done / total))
        result = writer.finish()
        if losses := losses_of(episodes):
            writer.write_json("losses.json", losses)
        return result


class _Writer:
    def __init__(
        self,
        folder: Path,
        rows: Rows,
        episodes: Sequence[Episode],
        images: str,
        encoder: str | None,
        say: Say,
        stack: contextlib.ExitStack,
    ) -> None:
        self._folder = folder
        self._rows = rows
        self._images = images
        self._has_marks = any(episode.mark is not None for episode in episodes)
        self._features = [*rows.features, *(REWARDS if self._has_marks else ()), *COMMON]
        if rows.cameras:
            ages = Feature(IMAGE_AGE, "float32", (len(rows.cameras),), rows.cameras, "s")
            self._features.insert(len(rows.features), ages)
        self._robot_type = episodes[0].session.type
        self._sizes: dict[str, tuple[int, int]] = {}
        self._tasks: dict[str, int] = {}
        self._episodes = stack.enter_context(contextlib.closing(EpisodeTable(folder)))
        self._frames = 0
        self._spill = folder / "spill"
        self._spill.mkdir()
        self._columns = {
            one.name: Columns(self._spill / f"{i}", one.shape, one.dtype)
            for i, one in enumerate(self._features)
        }
        for columns in self._columns.values():
            stack.callback(columns.close)
        self._brightness = {name: Brightness() for name in rows.cameras}
        self._data = stack.enter_context(contextlib.closing(DataTable(folder)))
        self._videos: dict[str, Videos] = {}
        if rows.cameras and images == "video":
            chosen = choose_encoder(encoder, rows.rate, say)
            self._videos = {
                name: stack.enter_context(
                    contextlib.closing(Videos(folder, IMAGES + name, rows.rate, chosen))
                )
                for name in rows.cameras
            }

    def add(self, episode: Episode, show: Any) -> None:
        rows = self._rows
        number = self._episodes.count
        task = episode.task or DEFAULT_TASK
        task_index = self._tasks.setdefault(task, len(self._tasks))
        count = rows.count(episode)
        pictures = rows.pictures(episode) if rows.cameras else None
        brightness = {name: Brightness() for name in rows.cameras}
        looked_at = set(sampled(count).tolist())
        first = self._frames
        self._data.begin_episode()
        begun = {name: video.begin_episode() for name, video in self._videos.items()}
        judged = _judged(episode, rows.steps(episode)) if self._has_marks else {}
        done = 0
        for block in rows.blocks(episode):
            frame = np.arange(done, done + len(block), dtype=np.int64)
            values = dict(block.values)
            values |= {
                # In double precision, so that rounding to single is the only deviation.
                "timestamp": frame / rows.rate,
                "frame_index": frame,
                "episode_index": np.full(len(block), number),
                "index": first + frame,
                "task_index": np.full(len(block), task_index),
            }
            values |= {name: part[frame] for name, part in judged.items()}
            if pictures is not None:
                values[IMAGE_AGE] = pictures.ages(block.steps, rows.period)
            shaped = {
                one.name: np.asarray(values[one.name]).reshape(len(block), *one.shape)
                for one in self._features
            }
            for name, columns in self._columns.items():
                columns.add(shaped[name])
            files: dict[str, list[bytes]] = {}
            if pictures is not None:
                files = self._add_images(
                    pictures, block, done, looked_at, brightness, lambda n: show(first + n)
                )
            self._data.add(shaped, self._features, files, self._schema)
            done += len(block)
            show(first + done)
        self._frames += done
        self._describe(episode, number, task, first, begun, brightness)

    def _add_images(
        self,
        pictures: Pictures,
        block: Block,
        done: int,
        looked_at: set[int],
        brightness: dict[str, Brightness],
        show: Any,
    ) -> dict[str, list[bytes]]:
        files: dict[str, list[bytes]] = {}
        wanted = {name: pictures.rows(name, block.steps) for name in pictures.names}
        last: dict[str, tuple[int, NDArray[np.uint8]]] = {}
        for i in range(len(block)):
            for name in pictures.names:
                row = int(wanted[name][i])
                if name not in last or last[name][0] != row:
                    last[name] = (row, pictures.image(name, row))
                image = last[name][1]
                size = self._sizes.setdefault(name, image.shape[:2])
                if image.shape[:2] != size:
                    raise InvalidArgument(
                        f"the images of {name} have {image.shape[1]} x {image.shape[0]} pixels, "
                        f"those before had {size[1]} x {size[0]}; export them as two data sets"
                    )
                if done + i in looked_at:
                    brightness[name].add(thinned(image))
                if name in self._videos:
                    self._videos[name].add(image)
                else:
                    files.setdefault(IMAGES + name, []).append(_png(image))
            show(done + i + 1)
        return files

    def _describe(
        self,
        episode: Episode,
        number: int,
        task: str,
        first: int,
        begun: dict[str, float],
        brightness: dict[str, Brightness],
    ) -> None:
        chunk = self._data.place.indices
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [task],
            "length": self._frames - first,
            "data/chunk_index": chunk["chunk_index"],
            "data/file_index": chunk["file_index"],
            "dataset_from_index": first,
            "dataset_to_index": self._frames,
        }
        for name, video in self._videos.items():
            start = f"videos/{IMAGES}{name}/"
            row |= {start + key: value for key, value in video.place.indices.items()}
            row[start + "from_timestamp"] = begun[name]
            row[start + "to_timestamp"] = video.duration
        statistics = {
            name: columns.statistics(first, self._frames) for name, columns in self._columns.items()
        }
        for name, counted in brightness.items():
            statistics[IMAGES + name] = counted.statistics()
            self._brightness[name].merge(counted)
        for name, numbers in statistics.items():
            row |= {f"stats/{name}/{key}": value for key, value in numbers.items()}
        place = self._episodes.place.indices
        row |= {f"meta/episodes/{key}": value for key, value in place.items()}
        # Where the episode comes from, which LeRobot does not need.
        row |= {
            "source/log": episode.log.name,
            "source/session_id": str(episode.session.session_id),
            "source/first_step": episode.first,
            "source/end_step": episode.end,
        }
        self._episodes.add(row)

    def finish(self) -> Result:
        import pandas as pd

        self._data.close()
        for video in self._videos.values():
            video.close()
        statistics: dict[str, Statistics] = {
            name: columns.statistics() for name, columns in self._columns.items()
        }
        for name, counted in self._brightness.items():
            statistics[IMAGES + name] = counted.statistics()
        for columns in self._columns.values():
            columns.close()
        self._spill.rmdir()
        self._episodes.close()
        tasks = pd.DataFrame(
            {"task_index": list(self._tasks.values())},
            index=pd.Index(list(self._tasks), name="task"),
        )
        tasks.to_parquet(self._folder / "meta/tasks.parquet")
        self.write_json("stats.json", statistics)
        self.write_json("info.json", self._info())
        return Result(episodes=self._episodes.count, frames=self._frames, rate=self._rows.rate)

    def _info(self) -> dict[str, Any]:
        has_videos = bool(self._videos)
        count = self._episodes.count
        return {
            "codebase_version": VERSION,
            "robot_type": self._robot_type,
            "total_episodes": count,
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            "chunks_size": layout.FILES_PER_CHUNK,
            "data_files_size_in_mb": layout.DATA_SIZE,
            "video_files_size_in_mb": layout.VIDEO_SIZE,
            "fps": self._rows.rate,
            "splits": {"train": f"0:{count}"},
            "data_path": layout.DATA_PATH,
            "video_path": layout.VIDEO_PATH if has_videos else None,
            "features": self._described_features(),
        }

    def _described_features(self) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for one in self._features:
            names = list(one.names) if one.names and len(one.shape) == 1 else None
            found[one.name] = {"dtype": one.dtype, "shape": list(one.shape), "names": names}
            if one.unit:
                found[one.name]["info"] = {"unit": one.unit, "numbers": list(one.names)}
        for name in self._rows.cameras:
            height, width = self._sizes[name]
            video = self._videos.get(name)
            feature: dict[str, Any] = {
                "dtype": "image" if video is None else "video",
                "shape": [height, width, 3],
                "names": ["height", "width", "channels"],
            }
            if video is not None:
                feature["info"] = {
                    "video.height": height,
                    "video.width": width,
                    "video.codec": CODECS[video.encoder],
                    "video.pix_fmt": "yuv420p",
                    "video.fps": self._rows.rate,
                    "video.channels": 3,
                    "is_depth_map": False,
                    "has_audio": False,
                    **{f"video.{key}": value for key, value in ENCODERS[video.encoder].items()},
                }
            found[IMAGES + name] = feature
        return found

    @property
    def _schema(self) -> Any:
        return schema_of(self._features, [IMAGES + n for n in self._sizes if not self._videos])

    def write_json(self, name: str, value: Any) -> None:
        """Writes a file of the folder `meta`."""
        path = self._folder / "meta" / name
        path.write_text(json.dumps(value, indent=4) + "\n", encoding="utf-8")


def _judged(episode: Episode, steps: NDArray[np.int64]) -> dict[str, Array]:
    """What followed each row of an episode: the sum of its rewards, and whether it ended well.

    The reward of an action belongs to the row at or before the step from which it was chosen.
    """
    mark = episode.mark
    found: dict[str, Array] = {
        "next.reward": np.zeros(len(steps)),
        "next.done": np.zeros(len(steps), bool),
        "next.success": np.zeros(len(steps), bool),
    }
    if mark is not None and mark.decisions is not None:
        chosen_at = mark.decisions.steps[:-1]
        rows = np.searchsorted(steps, chosen_at, side="right") - 1
        is_inside = (rows >= 0) & (chosen_at < episode.end)
        np.add.at(found["next.reward"], rows[is_inside], mark.decisions.rewards[is_inside])
    if episode.is_end:
        found["next.done"][-1] = True
        found["next.success"][-1] = bool(mark is not None and mark.success)
    return found


def _png(image: NDArray[np.uint8]) -> bytes:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(image).save(file, format="PNG", compress_level=1)
    return file.getvalue()
