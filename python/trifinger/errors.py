# SPDX-License-Identifier: BSD-3-Clause
"""Errors that this package raises, with the texts of the C++ core.

If the operating system refuses something, that is an OSError, as everywhere in Python.
"""

from collections.abc import Iterable
from typing import Self

from trifinger.session_info import Fault
from trifinger.text import printable_lines


class Error(RuntimeError):
    """Base of everything that this package raises.

    The text is a sentence. It names the thing, the value found, and the value allowed or the
    remedy. What others wrote is in it as it may be printed, and shortened.
    """

    def __init__(self, text: object = "") -> None:
        super().__init__(printable_lines(str(text)))


class InvalidArgument(Error, ValueError):
    """An argument has no meaning here: a wrong name, range, size or unit."""

    @classmethod
    def of_name(cls, kind: str, name: str, names: Iterable[str]) -> Self:
        """The error for a `name` that is not in the `names` of a `kind`; suggests the nearest."""
        import difflib  # imported only when there is a mistake: it takes time

        known = sorted(names)
        meant = difflib.get_close_matches(name, known, 1, cutoff=0.75)
        hint = f"; did you mean '{meant[0]}'?" if meant else f"; there are {', '.join(known)}"
        return cls(f"there is no {kind} '{name}'{hint}")


class TimedOut(Error, TimeoutError):
    """A wait took longer than its timeout. The element or action may still come."""


class RobotStopped(Error):
    """The session has ended: no further action is taken and no further element will come.

    Elements that are still in the history can still be read. `fault` says why the session ended.
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


class CameraLost(Error):
    """There is no good image of a camera: unplugged, late, lost or damaged."""


class AcausalAction(Error):
    """An action was appended for a step whose observation had already been read.

    On a real robot such an action would come too late.
    """


class ActionMissing(Error):
    """The wait could end only with another action, and nobody else can append one."""


class SessionNotFound(Error):
    """There is no session of this name."""


class ControlHeld(Error):
    """Another process, handle or thread controls the robot."""


class RobotOwned(Error):
    """Another back-end owns the robot of this name."""


class IncompatibleSession(Error):
    """The session belongs to another robot, has other fields, or is of another version."""


class AlreadyRecorded(Error):
    """Another recorder already records a robot of this name into this folder."""


class NotInLog(Error):
    """Some requested elements are not in the log. read() returns only those that are."""


class PolicyFileError(Error, ValueError):
    """The file does not have the format that docs/policies.md describes."""


class InheritedHandle(Error):
    """The handle was made before os.fork(); the child must connect on its own."""
