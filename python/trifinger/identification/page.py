# SPDX-License-Identifier: BSD-3-Clause
"""Writes what was identified: a configuration, ranges for trainings, figures and a page."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from trifinger._trifinger import FreeRun
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.identification.fit import (
    DELAY,
    HELD_OUT,
    KINDS,
    LONG_PIECE,
    UNITS,
    Figure,
    Identification,
    free_runs,
)
from trifinger.identification.stiffness import advice, settings, stiffness
from trifinger.whole_file import whole_file

CONFIGURATION = "fitted.yml"
LATEST = 0.01  # torques and measurements of a simulation, each [s]
BASE = "robot.yml"
FIGURES = "identified.json"
RANGES = "vary.json"
PAGE = "identified.html"
_DRAWN = 3  # pieces of each joint
_WIDTH, _HEIGHT = 300, 110  # of a drawing [pixels]
_STYLE = """
body { font: 15px/1.5 sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; }
table { border-collapse: collapse; margin: 1em 0; }
td, th { border-bottom: 1px solid #ddd; padding: 0.15em 0.8em; text-align: right; }
td:first-child, th:first-child, td.text { text-align: left; }
svg { background: #fafafa; margin: 0.2em; }
.no { color: #999; }
"""
_COLOURS = {"measured": "#222", "before": "#d55e00", "after": "#0072b2"}


def save(result: Identification, folder: Path, base: str = "") -> dict[str, str | float]:
    """Writes all files into a folder, and returns the settings that trainings for it need.

    `base` is the name or the absolute path of the configuration that is extended; by default it is
    the one in the log, which is written, too.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if not base:
        _write(folder / BASE, result.motion.configuration)
    _write(folder / CONFIGURATION, configuration(result, base or BASE))
    _write(folder / RANGES, json.dumps(ranges(result), indent=2) + "\n")
    fitted = {one.name for one in result.figures if one.value != one.described}
    softer = stiffness(str(folder / CONFIGURATION), fitted & {"friction", "backlash"})
    training = settings(softer)
    figures = {
        "logs": result.motion.logs,
        "figures": [asdict(one) for one in result.figures],
        "train": training,
    }
    _write(folder / FIGURES, json.dumps(figures, indent=1) + "\n")
    _write(folder / PAGE, page(result, training))
    return training


def _write(path: Path, text: str) -> None:
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")


def configuration(result: Identification, base: str) -> str:
    """A configuration that extends that of the robot by what was fitted."""
    logs = ", ".join(result.motion.logs)
    lines = [
        f"# Written by 'trifinger identify' from {logs}.",
        "# Intervals are of 95 %. What is 'not told' is a guess that goes with the rest.",
        f"extends: {json.dumps(base)}",
        "",
        "driver: simulation",
        "",
        "identified:",
    ]
    for kind in KINDS:
        fitted = [one for one in result.figures if one.name == kind.name]
        if all(one.value == one.described for one in fitted):
            continue
        lines.append(f"  {kind.name}:{f'  # [{kind.unit}]' if kind.unit else ''}")
        values = result.values[kind.name]
        for one, value in zip(fitted, values, strict=True):
            told = f"{one.low:.4g} to {one.high:.4g}" if one.is_told else "not told"
            lines.append(f"    - {value:.6g}  # {one.joint}: {told}")
    delay, period = result.of(DELAY), result.motion.period
    late = [period * steps for steps in (result.torque_delay, result.measurement_delay)]
    if max(late) > LATEST:
        raise InvalidArgument(
            f"torques are {1e3 * late[0]:.4g} ms late and measurements {1e3 * late[1]:.4g} ms; a "
            f"simulation can be {1e3 * LATEST:g} ms late each way"
        )
    split = "" if result.splits_delay else "; the log does not split it"
    lines.append(f"  # Together {delay.low:.4g} to {delay.high:.4g} s{split}.")
    lines.append(f"  torque_delay: {late[0]:.6g}")
    lines.append(f"  measurement_delay: {late[1]:.6g}")
    return "\n".join(lines) + "\n"


def ranges(result: Identification) -> dict[str, list[float]]:
    """Ranges for `vary` that cover what is still not known of the fitted robot."""

    def widest(name: str) -> tuple[float, float]:
        """The largest half of an interval, as a share of its value, and as it is."""
        halves = [
            (one.high - one.value, (one.high - one.value) / one.value if one.value > 0 else 1.0)
            for one in result.told
            if one.name == name
        ]
        if not halves:
            return 0.0, 0.0
        return min(max(share for _, share in halves), 0.9), max(half for half, _ in halves)

    found = {}
    factors = {
        "rotor_inertia": "rotor_inertia",
        "joint_damping": "damping",
        "motor_gain": "torque_scale",
    }
    for name, figure in factors.items():
        share, _ = widest(figure)
        if share > 0:
            found[name] = [round(1 - share, 4), round(1 + share, 4)]
    for name, figure in {"joint_friction": "friction", "backlash": "backlash"}.items():
        _, half = widest(figure)
        if half > 0:
            found[name] = [0.0, round(half, 6)]
    return found


def page(result: Identification, training: Mapping[str, str | float]) -> str:
    """A page for a browser; `training` are the settings that trainings need."""
    after, before = result.after, result.before
    rows = "".join(
        f"<tr><td>{html.escape(joint)}</td><td>{1e6 * before.one_step[i]:.0f}</td>"
        f"<td>{1e6 * after.one_step[i]:.0f}</td><td>{1e3 * before.free_run[i]:.2f}</td>"
        f"<td>{1e3 * after.free_run[i]:.2f}</td></tr>"
        for i, joint in enumerate(result.motion.joints)
    )
    untold = [one for one in result.figures if not one.is_told]
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><title>What was identified</title><style>{_STYLE}</style>
<h1>What was identified</h1>
<p>From {html.escape(", ".join(result.motion.logs))}. The last {100 * HELD_OUT:.0f} % of the motion
were not fitted; errors and drawings are of them. After identification the error of a free run of
{LONG_PIECE:g} s is {result.ratio:.3f} of what it was.</p>
<h2>Errors</h2>
<table><tr><th>joint</th><th>one step before [&micro;rad]</th><th>after</th>
<th>free run of {LONG_PIECE:g} s before [mrad]</th><th>after</th></tr>{rows}</table>
<h2>Measured and simulated</h2>
<p>Free runs by the torques of the log:
{", ".join(f'<b style="color:{colour}">{name}</b>' for name, colour in _COLOURS.items())}.</p>
{_drawings(result)}
<h2>Figures</h2>
<table><tr><th>figure</th><th>joint</th><th>value</th><th>95 %</th><th>described</th></tr>
{"".join(map(_row, result.figures))}</table>
{f"<p>{advice(training)}</p>" if training else ""}
<h2>What the logs do not tell</h2>
<ul>{"".join(map(_hint, untold)) or "<li>nothing</li>"}</ul>
</html>
"""


def _row(one: Figure) -> str:
    told = "" if one.is_told else ' class="no"'
    unit = f" [{UNITS[one.name]}]" if UNITS[one.name] else ""
    return (
        f"<tr{told}><td>{one.name}{unit}</td><td class='text'>{html.escape(one.joint)}</td>"
        f"<td>{one.value:.4g}</td><td>{one.low:.4g} to {one.high:.4g}</td>"
        f"<td>{one.described:.4g}</td></tr>"
    )


def _hint(one: Figure) -> str:
    joint = f" of {html.escape(one.joint)}" if one.joint else ""
    return f"<li>{one.name}{joint}: {html.escape(one.shown_by)}</li>"


def _drawings(result: Identification) -> str:
    motion = result.motion
    robot = FreeRun.of_text(motion.configuration)
    first = round(len(motion) * (1 - HELD_OUT))
    measured, before = free_runs(robot, motion, robot.described, 0, first)
    delay = result.torque_delay + result.measurement_delay
    _, after = free_runs(robot, motion, result.values, delay, first)
    chosen = np.linspace(0, len(measured) - 1, min(_DRAWN, len(measured))).astype(int)
    parts = []
    for i, joint in enumerate(motion.joints):
        drawings = [
            _drawing({"measured": measured[k, :, i], "before": before[k, :, i],
                      "after": after[k, :, i]}) for k in chosen
        ]  # fmt: skip
        parts.append(f"<div>{html.escape(joint)} [rad]<br>{''.join(drawings)}</div>")
    return "".join(parts)


def _drawing(lines: dict[str, Array]) -> str:
    spread = lines["measured"]
    middle, half = np.mean(spread), max(float(np.ptp(spread)), 0.02)
    low, high = middle - half, middle + half

    def place(value: float) -> float:
        return float(np.clip(_HEIGHT * (high - value) / (high - low), -50, 200))

    drawn = []
    for name, values in lines.items():
        thin = np.asarray(values)[:: max(len(values) // 100, 1)]
        points = " ".join(
            f"{_WIDTH * k / max(len(thin) - 1, 1):.1f},{place(value):.1f}"
            for k, value in enumerate(thin)
        )
        drawn.append(f'<polyline fill="none" stroke="{_COLOURS[name]}" points="{points}"/>')
    labels = f'<text x="2" y="11" font-size="10">{high:.2f}</text>'
    labels += f'<text x="2" y="{_HEIGHT - 3}" font-size="10">{low:.2f}</text>'
    return f'<svg width="{_WIDTH}" height="{_HEIGHT}">{labels}{"".join(drawn)}</svg>'
