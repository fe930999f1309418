# SPDX-License-Identifier: BSD-3-Clause
"""Episodes of reaching, in a pickle. `trifinger.Simulation.record` keeps more."""

import pickle
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from trifinger.whole_file import whole_file


@dataclass
class EpisodeData:
    """One episode: its goals, and what followed."""

    joint_goal: Any
    tip_goal: Any
    joint_positions: list[Any] = field(default_factory=list)
    tip_positions: list[Any] = field(default_factory=list)
    timestamps: list[Any] = field(default_factory=list)

    def append(self, joint_pos: Any, tip_pos: Any, timestamp: Any) -> None:
        """Adds a step."""
        self.joint_positions.append(joint_pos)
        self.tip_positions.append(tip_pos)
        self.timestamps.append(timestamp)


class DataLogger:
    """Keeps episodes. The one that goes on counts only when the next one begins."""

    def __init__(self) -> None:
        self.episodes: list[dict[str, Any]] = []
        self._current: EpisodeData | None = None

    def new_episode(self, joint_goal: Any, tip_goal: Any) -> None:
        """Ends the episode that goes on, and begins another one."""
        if self._current is not None:
            self.episodes.append(asdict(self._current))
        self._current = EpisodeData(joint_goal, tip_goal)

    def append(self, joint_pos: Any, tip_pos: Any, timestamp: Any) -> None:
        """Adds a step to the episode; RuntimeError before the first one."""
        if self._current is None:
            raise RuntimeError("call new_episode() before append()")
        self._current.append(joint_pos, tip_pos, timestamp)

    def store(self, filename: str | Path) -> None:
        """Writes the whole episodes: a list of dicts."""
        with whole_file(filename) as part, part.open("wb") as file:
            pickle.dump(self.episodes, file)
