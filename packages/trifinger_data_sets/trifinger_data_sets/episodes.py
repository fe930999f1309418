# SPDX-License-Identifier: BSD-3-Clause
"""Episodes of logs: which steps of which session belong together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from trifinger._trifinger import Log, LoggedSession
from trifinger.errors import InvalidArgument
from trifinger.log.steps import step_range

from trifinger_data_sets.marks import ENDING, Mark, read_marks

# Is told in a sentence what is special about the logs.
Say = Callable[[str], None]


@dataclass(frozen=True)
class Episode:
    """The steps of a session from `first` to before `end`; all of them are in the log."""

    log: Path
    session: LoggedSession
    first: int
    end: int
    task: str
    mark: Mark | None = None
    """The mark that the episode comes from; None for an episode that is a session."""
    is_end: bool = True
    """False if a gap or the end of the log cut off the end of the episode."""
    losses: tuple[str, ...] = ()
    """What the logs of all episodes have lost, as sentences."""

    @property
    def terminated(self) -> bool:
        """True if nothing could follow the episode."""
        return self.is_end and self.mark is not None and self.mark.terminated

    def __str__(self) -> str:
        return (
            f"steps {self.first} to {self.end - 1} of '{self.session.name}' "
            f"(session {self.session.session_id}) in {self.log}"
        )


def losses_of(episodes: Iterable[Episode]) -> list[str]:
    """What the logs of episodes have lost, as sentences. Data sets have them."""
    return list(dict.fromkeys(loss for episode in episodes for loss in episode.losses))


def find_marks(logs: Iterable[Log]) -> list[Path]:
    """The files of marks in the folders of the logs."""
    folders = {file.parent for log in logs for file in log.files}
    return sorted(path for folder in folders for path in folder.glob(f"*{ENDING}"))


def find_episodes(
    logs: Sequence[Log],
    *,
    robot: str = "",
    task: str = "",
    marks: Sequence[Path] | None = None,
    begin: float | None = None,
    end: float | None = None,
    say: Say = print,
) -> list[Episode]:
    """The episodes in logs, in the order of the logs.

    Each session is an episode. With files of `marks` the marks are, and sessions without marks are
    left out. `task` is the sentence for episodes that have none. Only what was measured from
    `begin` to before `end` is taken, in seconds since the first step of the session in the log.
    Around a gap in a log, the steps before and after it become episodes of their own.

    Raises InvalidArgument if there are no episodes, or if the logs have robots of several names or
    types and `robot` is empty.
    """
    sessions = [(log, one) for log in logs for one in log.sessions if robot in ("", one.name)]
    if not sessions:
        names = sorted({one.name for log in logs for one in log.sessions})
        raise InvalidArgument(f"no session of '{robot}' is in the logs; they have {names}")
    kinds = sorted({(one.name, one.type) for _, one in sessions})
    if len({name for name, _ in kinds}) > 1 and not robot:
        names = sorted({name for name, _ in kinds})
        raise InvalidArgument(f"the logs have the robots {', '.join(names)}; choose one by --robot")
    if len({kind for _, kind in kinds}) > 1:
        types = ", ".join(sorted({kind for _, kind in kinds}))
        raise InvalidArgument(
            f"the sessions of '{robot or kinds[0][0]}' belong to robots of the types {types}; "
            "export the logs of each type alone"
        )
    by_session: dict[int, list[Mark]] | None = None
    if marks is not None:
        by_session = {}
        for path in marks:
            for mark in read_marks(path):
                by_session.setdefault(mark.session_id, []).append(mark)
    found: list[Episode] = []
    losses: list[str] = []
    for log, session in sessions:
        wanted = step_range(session, begin, end)
        found += _of_session(log, session, wanted, task, by_session, losses, say)
    if not found:
        what = "sessions" if marks is None else "marks"
        raise InvalidArgument(f"the {what} of the logs have no episodes in this part of them")
    return [replace(episode, losses=tuple(losses)) for episode in found]


def _of_session(
    log: Log,
    session: LoggedSession,
    wanted: tuple[int | None, int | None],
    task: str,
    marks: dict[int, list[Mark]] | None,
    losses: list[str],
    say: Say,
) -> Iterator[Episode]:
    there = session.range("applied_action")
    first = there[0] if wanted[0] is None else max(there[0], wanted[0])
    end = there[1] if wanted[1] is None else min(there[1], wanted[1])
    whole = Episode(log.files[0], session, first, end, task)
    episodes = [whole]
    if marks is not None:
        episodes = [
            replace(
                whole,
                first=max(first, mark.first),
                end=min(end, mark.end),
                task=mark.task or task,
                mark=mark,
                is_end=mark.end <= end,
            )
            for mark in sorted(marks.get(session.session_id, []), key=lambda mark: mark.first)
        ]
    gaps = session.gaps
    lost = [*_of_files(log), *_of_end(whole)]
    for gap in gaps:
        missing = replace(whole, first=gap.first, end=gap.last + 1)
        lost.append(f"{missing} are missing: {gap.reason}")
    for episode in episodes:
        if episode.mark is not None and episode.mark.end > there[1]:
            marked = replace(whole, first=episode.mark.first, end=episode.mark.end)
            lost.append(f"{marked} are an episode, but the log ends before step {there[1]}")
    for loss in lost:
        if loss not in losses:
            losses.append(loss)
            say(f"{loss}.")
    for episode in episodes:
        if episode.end <= episode.first:
            continue
        pieces = list(_without_gaps(episode, [(gap.first, gap.last + 1) for gap in gaps]))
        if len(pieces) != 1 or pieces[0] != episode:
            say(f"{episode}: steps are missing, so it becomes {len(pieces)} episodes.")
        yield from pieces


def _of_files(log: Log) -> Iterator[str]:
    if not log.is_finished:
        yield f"the end of {log.files[-1]} was not written: the recording was cut off or still runs"
    for damage in log.damage:
        yield (
            f"{damage.size} bytes of {damage.file} from byte {damage.offset} on are lost: "
            f"{damage.reason.removesuffix('.')}"
        )


def _of_end(whole: Episode) -> Iterator[str]:
    if whole.session.steps is None:
        yield (
            f"the end of '{whole.session.name}' (session {whole.session.session_id}) is not in "
            f"{whole.log}; the newest step is {whole.session.range('applied_action')[1] - 1}"
        )


def _without_gaps(episode: Episode, gaps: Sequence[tuple[int, int]]) -> Iterator[Episode]:
    begin = episode.first
    for gap, after in sorted(gaps):
        if after <= begin or gap >= episode.end:
            continue
        if gap > begin:
            yield replace(episode, first=begin, end=gap, is_end=False)
        begin = after
    if begin < episode.end:
        yield replace(episode, first=begin)
