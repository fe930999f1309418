# SPDX-License-Identifier: BSD-3-Clause
"""Reads a LeRobotDataset v3.0 as its format is described, without any code of the writer."""

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow.parquet as pq
from PIL import Image

TOLERANCE = 1e-4  # of times [s]
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
ALWAYS = ("timestamp", "frame_index", "episode_index", "index", "task_index")


@dataclass
class Frames:
    """The images of a video file, in their order, with their times [s]."""

    times: list[float]
    images: list[Any]


def decoded(path: Path) -> Frames:
    times, images = [], []
    with av.open(str(path)) as container:
        for frame in container.decode(video=0):
            times.append(float(frame.pts * frame.time_base))
            images.append(frame.to_ndarray(format="rgb24"))
    return Frames(times, images)


class Reader:
    """All rows of a data set, in their global order."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.info = json.loads((folder / "meta/info.json").read_text())
        self.stats = json.loads((folder / "meta/stats.json").read_text())
        assert self.info["codebase_version"] == "v3.0"
        self.fps = self.info["fps"]
        assert isinstance(self.fps, int)
        self.features = self.info["features"]
        self.data_files = sorted(folder.glob("data/*/*.parquet"))
        self.columns: dict[str, list[Any]] = {}
        self.file_of_row: list[Path] = []
        for file in self.data_files:
            table = pq.read_table(file)
            for name in table.column_names:
                self.columns.setdefault(name, []).extend(table.column(name).to_pylist())
            self.file_of_row += [file] * len(table)
        self.episodes: list[dict[str, Any]] = []
        for file in sorted(folder.glob("meta/episodes/*/*.parquet")):
            self.episodes += pq.read_table(file).to_pylist()
        tasks = pq.read_table(folder / "meta/tasks.parquet").to_pydict()
        self.tasks = dict(zip(tasks["task_index"], tasks["task"], strict=True))
        self.videos: dict[Path, Frames] = {}

    def column(self, name: str) -> Any:
        return np.array(self.columns[name])

    def is_seen(self, name: str) -> bool:
        return self.features[name]["dtype"] in ("video", "image")

    def video(self, key: str, episode: dict[str, Any]) -> tuple[Path, Frames]:
        path = self.folder / self.info["video_path"].format(
            video_key=key,
            chunk_index=episode[f"videos/{key}/chunk_index"],
            file_index=episode[f"videos/{key}/file_index"],
        )
        if path not in self.videos:
            self.videos[path] = decoded(path)
        return path, self.videos[path]

    def image(self, key: str, row: int) -> Any:
        """The image of a row, found by its time as the format says."""
        if self.features[key]["dtype"] == "image":
            return np.asarray(Image.open(io.BytesIO(self.columns[key][row]["bytes"])))
        episode = self.episodes[self.columns["episode_index"][row]]
        _, frames = self.video(key, episode)
        wanted = episode[f"videos/{key}/from_timestamp"] + self.columns["timestamp"][row]
        nearest = int(np.argmin(np.abs(np.array(frames.times) - wanted)))
        assert abs(frames.times[nearest] - wanted) < TOLERANCE
        return frames.images[nearest]

    def check(self) -> None:
        """Holds everything to the description of the format that holds for any data set."""
        rows = len(self.columns["index"])
        assert self.info["total_frames"] == rows
        assert self.info["total_episodes"] == len(self.episodes)
        assert self.info["total_tasks"] == len(self.tasks)
        assert self.info["splits"] == {"train": f"0:{len(self.episodes)}"}
        assert self.info["chunks_size"] == 1000
        assert set(ALWAYS) <= set(self.features)
        assert all("/" not in name for name in self.features)
        stored = {name for name, one in self.features.items() if one["dtype"] != "video"}
        assert set(self.columns) == stored
        np.testing.assert_array_equal(self.columns["index"], np.arange(rows))
        self._check_shapes()
        begin = 0
        for number, episode in enumerate(self.episodes):
            assert episode["episode_index"] == number
            first, end = episode["dataset_from_index"], episode["dataset_to_index"]
            assert (first, end - first) == (begin, episode["length"])
            assert episode["length"] > 0
            begin = end
            here = slice(first, end)
            assert set(self.columns["episode_index"][here]) == {number}
            np.testing.assert_array_equal(
                self.columns["frame_index"][here], np.arange(episode["length"])
            )
            np.testing.assert_allclose(
                self.columns["timestamp"][here],
                np.arange(episode["length"]) / self.fps,
                atol=TOLERANCE,
                rtol=0,
            )
            path = self.folder / self.info["data_path"].format(
                chunk_index=episode["data/chunk_index"], file_index=episode["data/file_index"]
            )
            assert set(self.file_of_row[here]) == {path}
            tasks = {self.tasks[index] for index in self.columns["task_index"][here]}
            assert tasks == set(episode["tasks"])
            self._check_videos(episode)
            for name in stored - {n for n in stored if self.is_seen(n)}:
                found = {
                    key: episode[f"stats/{name}/{key}"]
                    for key in (*QUANTILES, "min", "max", "mean", "std", "count")
                }
                self._check_stats(name, found, self.columns[name][here])
        assert begin == rows
        for name in self.features:
            if not self.is_seen(name):
                self._check_stats(name, self.stats[name], self.columns[name])
            else:
                for key in ("min", "max", "mean", "std", *QUANTILES):
                    numbers = np.array(self.stats[name][key])
                    assert numbers.shape == (3, 1, 1)
                    assert (numbers >= 0).all()
                    assert (numbers <= 1).all()

    def _check_shapes(self) -> None:
        for name, values in self.columns.items():
            if not self.is_seen(name):
                shape = self.features[name]["shape"]
                inner = [] if shape == [1] else shape
                assert np.array(values).shape == (len(values), *inner), name
                names = self.features[name]["names"]
                assert names is None or len(names) == shape[-1]

    def _check_videos(self, episode: dict[str, Any]) -> None:
        for key in self.features:
            if self.features[key]["dtype"] != "video":
                continue
            path, frames = self.video(key, episode)
            begin = episode[f"videos/{key}/from_timestamp"]
            end = episode[f"videos/{key}/to_timestamp"]
            assert abs(end - begin - episode["length"] / self.fps) < TOLERANCE
            assert end <= len(frames.images) / self.fps + TOLERANCE, path
            height, width, _ = self.features[key]["shape"]
            assert all(image.shape == (height, width, 3) for image in frames.images)

    @staticmethod
    def _check_stats(name: str, stats: dict[str, Any], values: list[Any]) -> None:
        numbers = np.array(values, np.float64)
        if numbers.ndim == 1:
            numbers = numbers[:, None]
        expected = {
            "min": numbers.min(axis=0),
            "max": numbers.max(axis=0),
            "mean": numbers.mean(axis=0),
            "std": numbers.std(axis=0),
            "count": [len(numbers)],
        }
        for key, share in QUANTILES.items():
            expected[key] = np.quantile(numbers, share, axis=0)
        for key, value in expected.items():
            np.testing.assert_allclose(
                stats[key], value, rtol=1e-5, atol=1e-6, err_msg=f"{name} {key}"
            )
