# SPDX-License-Identifier: BSD-3-Clause
"""The videos of a LeRobotDataset, and the encoders that write them."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger.errors import InvalidArgument

from trifinger_data_sets import lerobot_layout as layout
from trifinger_data_sets.lerobot_layout import Place

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from trifinger_data_sets.episodes import Say

# The encoders in the order of preference, with their options. The first one that PyAV has is taken.
ENCODERS = {
    "libsvtav1": {"crf": "30", "preset": "10", "g": "2"},
    "libx264": {"crf": "23", "preset": "veryfast", "g": "2"},
    "mpeg4": {"g": "2", "q": "5"},
}
FASTEST = {"libsvtav1": 240}
"""The highest rate that an encoder takes [images/s]; the others take any."""
CODECS = {"libsvtav1": "av1", "libx264": "h264", "mpeg4": "mpeg4"}


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
        if self._bytes >= layout.VIDEO_SIZE * layout.MEGABYTE:
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
            path = self.place.path(self._folder, layout.VIDEO_PATH, video_key=self._key)
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


def choose_encoder(wanted: str | None, rate: int, say: Say) -> str:
    """The encoder that is wanted, or the first one that is there and fast enough."""
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
