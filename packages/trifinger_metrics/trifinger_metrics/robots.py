# SPDX-License-Identifier: BSD-3-Clause
"""Robots by their sessions in shared memory, read as an observer."""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable
from contextlib import closing
from functools import partial

import numpy as np
import trifinger
from prometheus_client.utils import floatToGoString

Add = Callable[..., None]
"""Adds a sample: its metric, its value, which is {} for an info, and its labels."""
Guard = Callable[[str, Callable[[], None]], None]
"""Reads something of a source; counts it if it raises."""
FAULTS = (
    *("first_action_late", "action_late", "backend_late", "actions_rejected", "memory_damaged"),
    *("driver", "driver_hangs", "backend_died", "measurement_stale", "machine_suspended"),
)
FLAGS = ("action_repeated", "acausal", "action_rejected")
REASONS = {(reason.name or "").lower(): np.uint64(reason) for reason in trifinger.Reason}
IMAGE_IS_GOOD = 1  # Frame::State
SILENCE = 2.0  # a loop that waits gives a sign of life every 50 ms [s]
EDGES = np.array(trifinger.LatenessHistogram.edges())
MIDDLES = np.append((EDGES[:-1] + EDGES[1:]) / 2, EDGES[-1])
# Powers of two from 4 us to 17 ms, then 134 ms and 1 s: each is the edge of a bin.
BOUNDS = [2.0**power / 1e9 for power in (*range(12, 25), 27, 30)]
ENDS = np.searchsorted(EDGES, np.array(BOUNDS) * (1 - 1e-9))
WEAR = {
    "joint_powered_seconds": "powered_time",
    "joint_revolutions": "revolutions",
    "joint_work_joules": "work",
    "joint_index_slips": "index_slips",
}


class Robot:
    """What is kept of a robot from one scrape to the next.

    Counts that begin anew with each session go on from the last session's, so that none is lost
    where the new session has passed the old one by the next scrape.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._session = 0
        self._next_step = -1  # that was not read yet, -1 for a new session
        self._counts: dict[Hashable, float] = {}  # of this session
        self._before: Counter[Hashable] = Counter()  # of those before
        self._seen: Counter[tuple[str, ...]] = Counter()  # by metric and labels
        self._last_fault = (0, "")

    def read(self, add_sample: Add, companions: Iterable[str], guard: Guard) -> None:
        """Reads the robot and its companions; raises Error if that is not possible at all."""

        def add(metric: str, value: object, *labels: str, **sums: float) -> None:
            add_sample(metric, value, self._name, *labels, **sums)

        with closing(trifinger.observe(self._name)) as session:
            info = session.session_info()
            if info.session_id != self._session:
                self._before.update(self._counts)  # adds
                self._counts.clear()
                self._session, self._next_step = info.session_id, -1
            self._add_session(add, info)
            guard("session", partial(self._add_timing, add, session))
            guard("session", partial(self._add_steps, add, session))
            for name in companions:
                guard("session", partial(self._add_companion, add, session, name))

    def _total(self, key: Hashable, count: float) -> float:
        self._counts[key] = count
        return self._before[key] + count

    def _add_session(self, add: Add, info: trifinger.SessionInfo) -> None:
        fault = info.fault if info.fault and info.fault.needs_recovery else None
        if fault and self._last_fault[0] != info.session_id:
            self._last_fault = (info.session_id, fault.code)
            self._seen["faults", fault.code] += 1
        mode = "real_time" if info.is_real_time else "non_real_time"
        add("session", {}, str(info.session_id), info.type, mode)
        phases = ("preparing", "holding", "running", "ended")
        add("phase", {phase: phase == info.phase for phase in phases})
        add("up", info.backend_is_alive and info.since_heartbeat <= SILENCE)
        add("heartbeat_age_seconds", info.since_heartbeat)
        add("period_seconds", info.period)
        add("fault_active", fault is not None)
        add("controlled", info.controller_pid is not None)
        add("steps", self._total("steps", info.steps))
        if info.backend_is_alive and info.phase != "ended":
            add("waiting_actions", info.waiting_actions)
        for code in FAULTS:
            add("faults", self._seen["faults", code], code)
        if self._last_fault[1]:
            add("last_fault", {}, self._last_fault[1])

    def _add_timing(self, add: Add, session: trifinger.Frontend) -> None:
        timing = session.timing()
        if timing is None:
            return
        counts = np.array(timing.lateness().counts())
        sums = [float(counts[:end].sum()) for end in (*ENDS, None)]
        bounds = [*map(floatToGoString, BOUNDS), "+Inf"]
        buckets = [(one, self._total(one, n)) for one, n in zip(bounds, sums, strict=True)]
        total = self._total("lateness", float(counts @ MIDDLES))
        add("lateness_seconds", buckets, sum_value=total)
        add("lateness_max_seconds", timing.lateness().max())
        for cause in ("user", "scheduler", "driver"):
            add("late_steps", self._total(cause, timing.late_steps(cause)), cause)

    def _add_steps(self, add: Add, session: trifinger.Frontend) -> None:
        has_joints = "reasons" in (session.applied_action_dtype.names or ())
        first, end = session.range("applied_action")
        self._count_steps(session, first, min(end, session.range("status")[1]), has_joints)
        for flag in FLAGS:
            add("flagged_steps", self._seen["flagged_steps", flag], flag)
        for name in ("skipped_periods", "unread_steps"):
            add(name, self._seen[name,])
        for reason in REASONS if has_joints else ():
            add("limited_steps", self._seen["limited_steps", reason], reason)
        if first == end:
            return
        status = session.get_status(session.range("status")[1] - 1, timeout=0)
        for name in ("discarded_actions", "lost_frames"):
            add(name, self._total(name, int(status[name])))
        if has_joints:
            margins = session.get_applied_action(end - 1, timeout=0).thermal_margin
            for joint, margin in enumerate(margins):
                add("thermal_margin_ratio", float(margin), str(joint))

    def _count_steps(self, session: trifinger.Frontend, first: int, end: int, joints: bool) -> None:
        # The oldest steps of a full history may be overwritten while they are read.
        begin = first + (end - first) // 4 if first > 0 else first
        if self._next_step >= 0:
            self._seen["unread_steps",] += max(0, begin - self._next_step)
            begin = max(begin, self._next_step)
        self._next_step = end
        if begin >= end:
            return
        try:
            statuses = session.get_statuses(begin, end, timeout=0)
            actions = session.get_applied_actions(begin, end, timeout=0) if joints else None
        except trifinger.HistoryLost:  # a simulation without deadlines is faster than this
            self._seen["unread_steps",] += end - begin
            return
        for flag in FLAGS:
            bit = trifinger.Status[flag.upper()]
            self._seen["flagged_steps", flag] += int(np.count_nonzero(statuses["flags"] & bit))
        self._seen["skipped_periods",] += int(statuses["skipped_ticks"].sum())
        if actions is not None:
            reasons = np.bitwise_or.reduce(actions["reasons"], axis=1)
            for name, reason in REASONS.items():
                self._seen["limited_steps", name] += int(np.count_nonzero(reasons & reason))

    def _add_companion(self, add: Add, session: trifinger.Frontend, name: str) -> None:
        with closing(session.companion(name)) as companion:
            first, end = companion.range("observation")
            add("companion_elements", self._total(("companion", name), end), name)
            if first == end or name not in ("cameras", "wear"):
                return
            element = companion.get_observation(end - 1, timeout=0)
        for metric, field in WEAR.items() if name == "wear" else ():
            for joint, value in enumerate(element[field]):
                add(metric, float(value), str(joint))
        for camera in (element.dtype.names or ()) if name == "cameras" else ():
            if "missed" in (element.dtype[camera].names or ()):
                image = element[camera]
                add("camera_images", int(image["number"]) + 1, camera)
                add("camera_dropped_images", int(image["missed"]), camera)
                add("camera_up", int(image["state"]) == IMAGE_IS_GOOD, camera)
