# SPDX-License-Identifier: BSD-3-Clause
"""Writes a LeRobotDataset, version 3.0, without the package LeRobot.

docs/data_sets.md says what its features mean. Rows and images pass through: the memory that
this takes does not grow with the length of the logs.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from trifinger import extras
from trifinger.errors import InvalidArgument
from trifinger.progress import Progress

from trifinger_data_sets import LEROBOT
from trifinger_data_sets.episodes import Episode, Say, losses_of
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
FILES_PER_CHUNK = 1000
DATA_SIZE = 100  # of a data file [MB]
VIDEO_SIZE = 200  # of a video file [MB]
EPISODES_SIZE = 8  # of the descriptions of episodes in a file, before they are compressed [MB]
GROUP_SIZE = 4  # of rows that become a row group of a data file, before they are compressed [MB]
WAITING = 10  # descriptions of episodes that become a table at once
MEGABYTE = 1 << 20
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
IMAGES = "observation.images."
DEFAULT_TASK = "Move the robot"

# The encoders in the order of preference, with their options. The first one that PyAV has is taken.
ENCODERS = {
    "libsvtav1": {"crf": "30", "preset": "10", "g": "2"},
    "libx264": {"crf": "23", "preset": "veryfast", "g": "2"},
    "mpeg4": {"g": "2", "q": "5"},
}
FASTEST = {"libsvtav1": 240}
"""The highest rate that an encoder takes [images/s]; the others take any."""
CODECS = {"libsvtav1": "av1", "libx264": "h264", "mpeg4": "mpeg4"}

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


@dataclass(frozen=True)
class Place:
    """Where a file is: `chunk` counts folders, `file` counts files in one."""

    number: int = 0

    @property
    def indices(self) -> dict[str, int]:
        """The numbers in its path."""
        chunk, file = divmod(self.number, FILES_PER_CHUNK)
        return {"chunk_index": chunk, "file_index": file}

    def path(self, folder: Path, pattern: str, **more: str) -> Path:
        """Its path; the folders are made."""
        path = folder / pattern.format(**self.indices, **more)
        path.parent.mkdir(parents=True, exist_ok=True)
        return path


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
        self._episodes = stack.enter_context(contextlib.closing(_Episodes(folder)))
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
        self._data = stack.enter_context(contextlib.closing(_Table(folder)))
        self._videos: dict[str, Videos] = {}
        if rows.cameras and images == "video":
            chosen = _encoder(encoder, rows.rate, say)
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
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": DATA_SIZE,
            "video_files_size_in_mb": VIDEO_SIZE,
            "fps": self._rows.rate,
            "splits": {"train": f"0:{count}"},
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH if has_videos else None,
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
        return _schema_of(self._features, [IMAGES + n for n in self._sizes if not self._videos])

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


def _arrow_type(feature: Feature) -> Any:
    import pyarrow as pa

    kind = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}[feature.dtype]
    if feature.shape == (1,):
        return kind
    if len(feature.shape) == 1:
        return pa.list_(kind, feature.shape[0])
    for _ in feature.shape:
        kind = pa.list_(kind)
    return kind


def _schema_of(features: Sequence[Feature], images: Sequence[str]) -> Any:
    """The columns of data files, with the description that the package `datasets` reads."""
    import pyarrow as pa

    columns = [pa.field(one.name, _arrow_type(one)) for one in features]
    picture = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    columns += [pa.field(name, picture) for name in images]
    described: dict[str, Any] = {}
    for one in features:
        value = {"dtype": one.dtype, "_type": "Value"}
        if one.shape == (1,):
            described[one.name] = value
        elif len(one.shape) == 1:
            described[one.name] = {
                "feature": value,
                "length": one.shape[0],
                "_type": "Sequence",
            }
        else:
            described[one.name] = {
                "shape": list(one.shape),
                "dtype": one.dtype,
                "_type": f"Array{len(one.shape)}D",
            }
    described |= {name: {"_type": "Image"} for name in images}
    note = json.dumps({"info": {"features": described}})
    return pa.schema(columns, metadata={"huggingface": note})


def _arrow_array(values: Array, feature: Feature) -> Any:
    import pyarrow as pa

    flat = pa.array(np.ascontiguousarray(values, np.dtype(feature.dtype)).ravel())
    if feature.shape == (1,):
        return flat
    if len(feature.shape) == 1:
        return pa.FixedSizeListArray.from_arrays(flat, feature.shape[0])
    for size in reversed(feature.shape):
        offsets = np.arange(0, len(flat) + 1, size, dtype=np.int32)
        flat = pa.ListArray.from_arrays(pa.array(offsets), flat)
    return flat


class _Episodes:
    """The files with a row for each episode.

    A file is written at once: its writer would keep something of each row group until its end, and
    the descriptions have a thousand columns.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._waiting: list[dict[str, Any]] = []
        self._tables: list[Any] = []
        self.place = Place()
        self.count = 0

    def add(self, row: dict[str, Any]) -> None:
        """Adds an episode."""
        self._waiting.append(row)
        self.count += 1
        if len(self._waiting) >= WAITING:
            self._pack()
        if sum(table.nbytes for table in self._tables) >= EPISODES_SIZE * MEGABYTE:
            self.close()

    def close(self) -> None:
        """Writes a file of the episodes that were added since the last one."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._pack()
        if self._tables:
            table = pa.concat_tables(self._tables)
            pq.write_table(
                table, self.place.path(self._folder, EPISODES_PATH), compression="snappy"
            )
            self.place = Place(self.place.number + 1)
            self._tables = []

    def _pack(self) -> None:
        import pyarrow as pa

        if self._waiting:
            schema = self._tables[0].schema if self._tables else None
            self._tables.append(pa.Table.from_pylist(self._waiting, schema))
            self._waiting = []


class _Table:
    """The data files; an episode is in one of them.

    Rows wait until they are a row group: short groups would be slow to read, and the writer keeps
    something of each until the end of the file.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._writer: Any = None
        self._waiting: list[Any] = []
        self._waiting_bytes = 0
        self._next = 0
        self.place = Place()

    def begin_episode(self) -> None:
        """Begins a new file if the last one is large enough."""
        if self._writer is not None and self._size() >= DATA_SIZE * MEGABYTE:
            self.close()

    def add(
        self,
        values: dict[str, Array],
        features: Sequence[Feature],
        files: dict[str, list[bytes]],
        schema: Any,
    ) -> None:
        """Adds rows; `files` are images, a file for each row."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        if self._writer is None:
            self.place = Place(self._next)
            self._next += 1
            self._path = self.place.path(self._folder, DATA_PATH)
            self._writer = pq.ParquetWriter(self._path, schema, compression="snappy")
        arrays = [_arrow_array(values[one.name], one) for one in features]
        arrays += [
            pa.array(
                [{"bytes": file, "path": None} for file in files[name]], schema.field(name).type
            )
            for name in schema.names[len(features) :]
        ]
        table = pa.Table.from_arrays(arrays, schema=schema)
        self._waiting.append(table)
        self._waiting_bytes += table.nbytes
        if self._waiting_bytes >= GROUP_SIZE * MEGABYTE:
            self._write()

    def close(self) -> None:
        """Ends the file."""
        if self._writer is not None:
            self._write()
            self._writer.close()
            self._writer = None

    def _write(self) -> None:
        import pyarrow as pa

        if self._waiting:
            self._writer.write_table(pa.concat_tables(self._waiting))
            self._waiting, self._waiting_bytes = [], 0

    def _size(self) -> int:
        return self._path.stat().st_size + self._waiting_bytes


class Videos:
    """The video files of a camera; an episode is in one of them."""

    def __init__(self, folder: Path, key: str, rate: int, encoder: str) -> None:
        self._folder = folder
        self._key = key
        self._rate = rate
        self.encoder = encoder
        self._container: Any = None
        self._next = 0
        self._images = 0
        self._bytes = 0
        self.place = Place()

    @property
    def duration(self) -> float:
        """Length of the file by now [s]."""
        return self._images / self._rate

    def begin_episode(self) -> float:
        """Begins a new file if the last one is large enough; returns its length by now [s]."""
        if self._bytes >= VIDEO_SIZE * MEGABYTE:
            self.close()
        if self._container is None:
            self._images = self._bytes = 0
            self.place = Place(self._next)
            self._next += 1
        return self.duration

    def add(self, image: NDArray[np.uint8]) -> None:
        """Adds an image of RGB."""
        import av

        if self._container is None:
            os.environ.setdefault("SVT_LOG", "1")  # says only what is wrong
            path = self.place.path(self._folder, VIDEO_PATH, video_key=self._key)
            self._container = av.open(str(path), "w")
            self._stream = self._container.add_stream(self.encoder, rate=self._rate)
            self._stream.height, self._stream.width = image.shape[:2]
            self._stream.pix_fmt = "yuv420p"
            self._stream.options = ENCODERS[self.encoder]
            with _unchanged_priorities():
                self._stream.codec_context.open()
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
        frame.pts = self._images
        frame.time_base = Fraction(1, self._rate)
        self._mux(self._stream.encode(frame))
        self._images += 1

    def close(self) -> None:
        """Ends the file."""
        if self._container is not None:
            self._mux(self._stream.encode())
            self._container.close()
            self._container = None

    def _mux(self, packets: Any) -> None:
        for packet in packets:
            self._bytes += packet.size
            self._container.mux(packet)


@contextlib.contextmanager
def _unchanged_priorities() -> Iterator[None]:
    """Takes the priority away that a library gives to this thread, and to those that it makes.

    SVT-AV1 takes the highest real-time priority if the user is root. A robot's loop beside it would
    wait for its threads, and all programs that this one starts would inherit the priority.
    """
    tasks = Path("/proc/self/task")
    before = {task.name for task in tasks.iterdir()}
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    yield
    os.sched_setscheduler(0, policy, parameters)
    for name in {task.name for task in tasks.iterdir()} - before:
        with contextlib.suppress(ProcessLookupError):  # it has ended
            os.sched_setscheduler(int(name), policy, parameters)


def encoders() -> Iterator[str]:
    """The encoders that PyAV has, the preferred ones first."""
    import av

    for name in ENCODERS:
        with contextlib.suppress(av.error.FFmpegError, ValueError):
            av.codec.Codec(name, "w")
            yield name


def _encoder(wanted: str | None, rate: int, say: Say) -> str:
    there = list(encoders())
    fast = [name for name in there if rate <= FASTEST.get(name, rate)]
    if wanted is not None:
        if wanted not in there:
            raise InvalidArgument.of_name("encoder", wanted, there)
        if wanted not in fast:
            raise InvalidArgument(
                f"{wanted} writes videos of up to {FASTEST[wanted]} images/s, not of {rate}: "
                "choose a lower rate, another encoder, or images instead of videos"
            )
        return wanted
    if not fast:
        raise InvalidArgument(
            f"PyAV has no encoder for videos of {rate} images/s; --images image writes PNG files"
        )
    best = next(iter(ENCODERS))
    if fast[0] != best:
        why = f"takes at most {FASTEST[best]} images/s" if best in there else "is not in PyAV"
        say(f"{best} {why}, so videos are written by {fast[0]}.")
    return fast[0]


def _png(image: NDArray[np.uint8]) -> bytes:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(image).save(file, format="PNG", compress_level=1)
    return file.getvalue()
