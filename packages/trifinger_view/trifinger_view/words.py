# SPDX-License-Identifier: BSD-3-Clause
"""The state of a session in words."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from trifinger._trifinger import TimingRecord
from trifinger.session_info import SessionInfo

from trifinger_view.frame import Frame

PHASES = {
    "preparing": "prepares",
    "holding": "holds its pose and waits for a controller",
    "running": "runs",
    "ended": "has ended",
}


@dataclass(frozen=True)
class Line:
    """A line of the state."""

    label: str
    text: str
    level: str = ""
    """ "good", "warning", "bad", or empty for a plain line."""


def missing(name: str) -> list[Line]:
    """What to say while there is no robot."""
    what = f"no robot '{name}' runs" if name else "no robot runs"
    return [
        Line("state", f"{what}; this page shows it as soon as it does"),
        Line("start one", f"trifinger run {name or 'sim'}"),
    ]


def lines_of(
    info: SessionInfo,
    frame: Frame | None,
    timing: TimingRecord | None,
    reasons: Mapping[str, Sequence[int]],
) -> list[Line]:
    """The state of a running session, or of one that has ended.

    `reasons` are why joints did not get what was asked for: numbers of joints by reason.
    """
    is_fault = info.fault is not None and info.fault.needs_recovery
    lines = []
    was_stopped = info.fault is not None and info.fault.code == "stopped"
    if not info.backend_is_alive and was_stopped:
        lines.append(Line("state", "the robot was stopped, and its back-end has ended"))
    elif not info.backend_is_alive:
        lines.append(Line("state", "the back-end is gone", "bad"))
        lines.append(
            Line(
                "remedy",
                f"trifinger log rescue {info.name} keeps the last seconds; then start the "
                "back-end again",
            )
        )
    else:
        level = "bad" if is_fault else "good" if info.phase == "running" else ""
        lines.append(Line("state", PHASES.get(info.phase, info.phase), level))
    if info.fault is not None:
        lines.append(Line("fault" if is_fault else "end", info.fault_text, "bad" * is_fault))
    if is_fault and info.backend_is_alive:
        lines.append(Line("remedy", f"trifinger recover {info.name}"))
    if frame is not None and frame.time_index >= 0:
        lines.append(Line("step", f"{frame.time_index} ({frame.time:.1f} s)"))
    if info.controller_pid is not None:
        lines.append(Line("controller", f"process {info.controller_pid}"))
    if timing is not None:
        lines.append(Line("timing", str(timing), "warning" if timing.late_steps() else ""))
    lines += [Line("real time", warning, "warning") for warning in info.realtime_warnings]
    for reason, joints in reasons.items():
        which = ", ".join(map(str, joints))
        lines.append(Line("safety", f"joint{'s' * (len(joints) > 1)} {which}: {reason}", "warning"))
    return lines


def lines_of_training(folder: Path | None) -> list[Line]:
    """How a training on the robot goes, by the files in its folder: `trifinger learn`."""
    if folder is None:
        return []
    try:
        rows = json.loads((folder / "tally.json").read_text())["rows"]
    except (OSError, ValueError, KeyError) as error:
        return [Line("learning", f"{folder} has no training on a robot: {error}", "warning")]
    return [
        Line(name, text, "warning" * (name == "faults" and text != "none"))
        for name, text in rows.items()
    ]


def facts_of(info: SessionInfo) -> str:
    """Facts about a session that do not change, for a headline."""
    mode = "real time" if info.is_real_time else "time waits for the controller"
    return f"{info.type} · {_rate(info.period)} · {mode}"


def _rate(period: float) -> str:
    rate = 1.0 / period
    return f"{rate / 1000:g} kHz" if rate >= 1000 else f"{rate:.4g} Hz"
