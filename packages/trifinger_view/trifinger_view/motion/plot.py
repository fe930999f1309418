# SPDX-License-Identifier: BSD-3-Clause
"""A figure of a motion: positions, speeds and torques beside their limits, and paths of the
tips.
"""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger import extras
from trifinger.errors import InvalidArgument
from trifinger.whole_file import whole_file

from trifinger_view.motion.facts import is_trifinger
from trifinger_view.motion.limits import UNITS, Samples, allowed_speeds

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from trifinger_view.motion.facts import JointFacts
    from trifinger_view.motion.motion import Motion

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
MAX_POINTS = 4000  # of a curve; a picture cannot show more


def plot(motion: Motion, path: str | os.PathLike[str], facts: JointFacts | None = None) -> None:
    """Draws the motion into a .png, .svg or .pdf file; replaces a file that is there.

    With `facts`, by default those of the configuration in the motion, the figure has limits,
    torques and tips as well. Raises InvalidArgument for another kind of file, Error if Matplotlib
    is missing.
    """
    target = Path(path)
    if target.suffix not in (".png", ".svg", ".pdf"):
        raise InvalidArgument(f"{target} does not end in .png, .svg or .pdf")
    extras.require("plot", "matplotlib")
    figure_type = importlib.import_module("matplotlib.figure").Figure
    if facts is None and motion.configuration:
        facts = motion.facts()
    figure = _draw(motion, facts, figure_type)
    with whole_file(target) as part:
        figure.savefig(part, dpi=110)


def _draw(motion: Motion, facts: JointFacts | None, figure_type: Any) -> Any:
    samples = Samples.of(motion)
    torques = tips = speeds = None
    if facts is not None:
        speeds = allowed_speeds(facts, samples)
        motor = facts.torques(samples.positions, samples.velocities, samples.accelerations)
        torques = None if motor is None else motor + facts.safety_kd * samples.velocities
        tips = facts.tips(samples.positions)
    fingers = len(motion.joints) // 3 if len(motion.joints) % 3 == 0 else 1
    each = len(motion.joints) // fingers
    units = sorted(set(facts.units)) if facts is not None else ["rad"]
    units = ["rad", "m"] if len(units) > 1 or "rad or m" in units else units
    rows = [
        f"{what} [{' or '.join(UNITS[unit][what] for unit in units)}]"
        for what in ("position", "speed", "torque")[: 2 + (torques is not None)]
    ]
    rows += ["tip [m]"] * (tips is not None)
    figure = figure_type(figsize=(4.3 * fingers + 1.2, 2.2 * len(rows) + 0.8), layout="constrained")
    figure.suptitle(f"{motion.robot}, {motion.duration:.2f} s; dashed: limits", fontsize=11)
    axes = figure.subplots(len(rows), fingers, sharex=True, sharey="row", squeeze=False)
    thin = slice(None, None, max(1, len(motion) // MAX_POINTS))
    times = motion.times[thin]
    for finger in range(fingers):
        own = range(finger * each, (finger + 1) * each)
        column = axes[:, finger]
        title = (
            f"finger {finger}" if is_trifinger(motion.robot) else f"joints {own[0]} to {own[-1]}"
        )
        column[0].set_title(title if fingers > 1 else "", fontsize=10)
        for colour, joint in enumerate(own):
            style = {"color": COLOURS[colour % len(COLOURS)]}
            label = motion.joints[joint].removeprefix("finger_").replace("_joint", "")
            column[0].plot(times, samples.positions[thin, joint], label=label, **style)
            column[1].plot(times, samples.velocities[thin, joint], **style)
            if facts is not None:
                # A limit far away would make the curves flat.
                reach = samples.positions
                for edge in (facts.soft_lower[joint], facts.soft_upper[joint]):
                    if reach.min() - 0.5 < edge < reach.max() + 0.5:
                        column[0].axhline(edge, ls="--", lw=0.8, **style)
            if speeds is not None:
                # A limit for the direction in which the joint moves.
                moving = np.where(samples.velocities >= 0, speeds, -speeds)[thin, joint]
                _limit(column[1], times, moving, samples.velocities, style)
            if torques is not None and facts is not None:
                column[2].plot(times, torques[thin, joint], **style)
                most = np.full(len(times), facts.max_torque[joint])
                for limit in (most, -most):
                    _limit(column[2], times, limit, torques, style)
        column[0].legend(fontsize=7, loc="best")
        if tips is not None:
            for axis, name in enumerate("xyz"):
                column[-1].plot(times, tips[thin, finger, axis], color=COLOURS[axis], label=name)
            column[-1].legend(fontsize=7, loc="best", ncols=3)
        column[-1].set_xlabel("time [s]")
    for row, name in enumerate(rows):
        axes[row, 0].set_ylabel(name)
    for one in axes.flat:
        one.grid(visible=True, alpha=0.3)
        one.margins(x=0)
    return figure


def _limit(
    axes: Any,
    times: NDArray[np.float64],
    limit: NDArray[np.float64],
    values: NDArray[np.float64],
    style: dict[str, str],
) -> None:
    # Drawn only where it is near, for the same reason.
    near = np.where(np.abs(limit) < 1.5 * np.abs(values).max() + 1e-9, limit, np.nan)
    if np.isfinite(near).any():
        axes.plot(times, near, ls="--", lw=0.8, **style)
