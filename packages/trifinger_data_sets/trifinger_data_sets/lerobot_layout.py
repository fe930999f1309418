# SPDX-License-Identifier: BSD-3-Clause
"""Where the files of a LeRobotDataset are, and how large they become."""

from dataclasses import dataclass
from pathlib import Path

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
