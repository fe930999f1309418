# SPDX-License-Identifier: BSD-3-Clause
"""Records what a hand does with a robot that floats.

    with trifinger.guide("sim") as guide:
        recording = teach(guide, until=input)      # ends when somebody presses Enter
    recording.motion().save("wave.motion")

`until` is any function that returns when the recording shall end. In simulation it can be the hand
itself: a script that pulls at the tips.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from trifinger.errors import Error, InvalidArgument, RobotStopped
from trifinger.session_info import SessionInfo

if TYPE_CHECKING:
    from trifinger._trifinger import Frontend, Guide

    from trifinger_view.motion import Motion

LONGEST = 1800.0
"""Longest recording [s]; a motion holds no more."""
INTERVAL = 0.05
"""Time from one look at the series to the next [s]; the history holds a multiple of this."""


@dataclass(frozen=True)
class Recording:
    """The positions of all joints in each step of a recording.

    Steps whose measurement is not a number are left out.
    """

    session: SessionInfo
    """The session in which it was recorded."""
    configuration: str
    """The configuration of the robot, as text."""
    joints: tuple[str, ...]
    """Names of the joints."""
    first_step: int
    """Step at which the recording begins."""
    times: npt.NDArray[np.float64]
    """(n,), from the first step on [s]."""
    positions: npt.NDArray[np.float64]
    """(n, num_joints) [rad], of slides [m]."""

    @property
    def duration(self) -> float:
        """Time from the first to the last step [s]."""
        return float(self.times[-1]) if len(self.times) else 0.0

    def motion(self) -> Motion:
        """The motion for this robot, which can be saved, changed and played.

        Raises:
            InvalidArgument: if fewer than two steps were recorded
        """
        from trifinger_view.motion import JointFacts, Motion

        facts = JointFacts.of_configuration(self.configuration, self.session.type, self.joints)
        origin = (
            f"taught by hand: robot '{self.session.name}', session {self.session.session_id}, "
            f"from step {self.first_step}"
        )
        return Motion(
            times=self.times,
            positions=self.positions,
            joints=facts.joints,
            robot=facts.robot,
            tips=self.tips(),
            configuration=self.configuration,
            history=(origin,),
        )

    def tips(self) -> npt.NDArray[np.float64] | None:
        """The positions of the tips in the world frame, (n, num_fingers, 3) [m].

        None for a robot from a file.
        """
        from trifinger_view.motion import JointFacts

        facts = JointFacts.of_configuration(self.configuration, self.session.type, self.joints)
        return facts.tips(self.positions)


class Teaching:
    """One recording, which can be read while it grows and after any end of it."""

    def __init__(self, guide: Guide) -> None:
        self._guide = guide
        self._robot: Frontend = guide.frontend
        self._session = self._robot.session_info()
        self._configuration = self._robot.documents().get("configuration.yml", "")
        self._positions: list[npt.NDArray[np.float64]] = []
        self._first = self._next = -1

    @property
    def duration(self) -> float:
        """Length of what is recorded so far [s]."""
        return max(self._next - 1 - self._first, 0) * self._session.period

    def recording(self) -> Recording:
        """Returns what is recorded so far."""
        width = self._guide.num_joints
        positions = np.concatenate([np.empty((0, width)), *self._positions])
        steps = np.flatnonzero(np.isfinite(positions).all(axis=1))
        return Recording(
            session=self._session,
            configuration=self._configuration,
            joints=self._guide.joint_names,
            first_step=self._first,
            times=steps.astype(np.float64) * self._session.period,
            positions=positions[steps],
        )

    def run(
        self,
        until: Callable[[], object] | None = None,
        *,
        duration: float | None = None,
        watch: Callable[[float], None] | None = None,
    ) -> Recording:
        """Lets the robot float and records it; then the robot holds, however the recording ends.

        `until` is called in a thread of its own. The recording ends when it returns, or after
        `duration` [s], or after LONGEST. `watch` gets the length so far [s], several times a
        second.

        Raises:
            InvalidArgument: if neither `until` nor `duration` is given, if `duration` is too long,
                or if it has been run
            RobotStopped: if the session ends meanwhile; what came before is in `recording()`
        """
        if until is None and duration is None:
            raise InvalidArgument("nothing ends the recording: give `until` or `duration`")
        if duration is not None and not 0 < duration <= LONGEST:
            raise InvalidArgument(
                f"the duration is {duration:g} s, must be above 0 and at most {LONGEST:g} s"
            )
        if self._first >= 0:
            raise InvalidArgument("this recording has ended; begin another one")
        end = _End(until)
        self._first = self._next = max(self._guide.state().step, 0)
        steps = round((LONGEST if duration is None else duration) / self._session.period)
        last = self._first + max(steps, 1)
        try:
            self._guide.float_freely()
            end.start()
            while not end.wait(INTERVAL):
                self._read(last)
                if watch:
                    watch(self.duration)
                if self._next > last:
                    break
                self._guide.check()
            self._read(last)
        except RobotStopped:
            self._read_what_is_left()
            raise
        finally:
            # A robot that has stopped cannot hold; whatever else came up is what the caller hears.
            with suppress(Error):
                self._guide.hold()
        end.check()
        return self.recording()

    def _read(self, last: int) -> None:
        """Reads all steps that are there, up to the step `last`."""
        self._take(min(self._robot.current_time_index(), last) + 1)

    def _read_what_is_left(self) -> None:
        with suppress(Error):
            self._take(self._robot.range("observation")[1])

    def _take(self, end: int) -> None:
        if end > self._next:
            observations = self._robot.get_observations(self._next, end)
            self._positions.append(observations["position"].reshape(end - self._next, -1).copy())
            self._next = end


def teach(
    guide: Guide,
    until: Callable[[], object] | None = None,
    *,
    duration: float | None = None,
    watch: Callable[[float], None] | None = None,
) -> Recording:
    """Lets the robot float, records what a hand does with it, and lets it hold again.

    `until` is called in a thread of its own, such as `input`. The recording ends when it returns,
    or after `duration` [s]. `watch` gets the length so far [s]. `Teaching` keeps what was recorded
    before an error.

    Raises:
        InvalidArgument: if neither `until` nor `duration` is given
        RobotStopped: if the session ends meanwhile
    """
    return Teaching(guide).run(until, duration=duration, watch=watch)


class _End:
    """Waits for the end of a function in a thread that keeps nobody from leaving."""

    def __init__(self, until: Callable[[], object] | None) -> None:
        self._until = until
        self._has_ended = threading.Event()
        self._error: BaseException | None = None

    def start(self) -> None:
        if self._until:
            threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        try:
            if self._until:
                self._until()
        except BaseException as error:  # raised where somebody can catch it
            self._error = error
        self._has_ended.set()

    def wait(self, timeout: float) -> bool:
        return self._has_ended.wait(timeout)

    def check(self) -> None:
        if self._error:
            raise self._error
