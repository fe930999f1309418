# SPDX-License-Identifier: BSD-3-Clause
"""What this package raises, with the text of the C++ core.

What the operating system refuses is an OSError, as everywhere in Python.
"""

from __future__ import annotations

from collections.abc import Iterable

from trifinger.session_info import Fault


class Error(RuntimeError):
    """Base of everything that this package raises.

    The text is a sentence that names the thing, the value found and the value allowed, or the
    remedy.
    """


class InvalidArgument(Error, ValueError):
    """An argument has no meaning here: a wrong name, range, size or unit."""

    @classmethod
    def of_name(cls, kind: str, name: str, names: Iterable[str]) -> InvalidArgument:
        """The error of a `name` that is none of the `names` of a `kind`; suggests the nearest."""
        import difflib  # not for programs without mistakes

        known = sorted(names)
        meant = difflib.get_close_matches(name, known, 1, cutoff=0.75)
        hint = f"; did you mean '{meant[0]}'?" if meant else f"; there are {', '.join(known)}"
        return cls(f"there is no {kind} '{name}'{hint}")


class TimedOut(Error, TimeoutError):
    """A wait took longer than its timeout. What was waited for may still come."""


class RobotStopped(Error):
    """The session has ended: no further action is taken and no further element will come.

    Elements that are still in the history can be read on. `fault` says why it ended.
    """

    def __init__(self, text: str, fault: Fault | None = None) -> None:
        super().__init__(text)
        self.fault = fault


class HistoryLost(Error):
    """The element was overwritten by newer ones.

    `oldest` is the oldest step that can still be read.
    """

    def __init__(self, text: str, oldest: int = 0) -> None:
        super().__init__(text)
        self.oldest = oldest


class AcausalAction(Error):
    """An action was appended for a step whose observation had been read.

    On a real robot it would have come too late.
    """


class ActionMissing(Error):
    """A wait that only a further action could satisfy, and nobody else can append it."""


class SessionNotFound(Error):
    """Nobody offers a session of this name."""


class ControlHeld(Error):
    """Another process, handle or thread controls the robot."""


class RobotOwned(Error):
    """Another back-end owns the robot of this name."""


class IncompatibleSession(Error):
    """The session was made for another robot, with other fields, or by another version."""


class AlreadyRecorded(Error):
    """Another recorder writes a robot of this name into this folder."""


class NotInLog(Error):
    """Elements that were asked for are not in the log. read() gives those that are."""


class PolicyFileError(Error, ValueError):
    """The file is not what docs/policies.md says of it."""


class InheritedHandle(Error):
    """The handle was made before os.fork(); the child must connect on its own."""
