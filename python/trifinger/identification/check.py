# SPDX-License-Identifier: BSD-3-Clause
"""Whether a robot still is what was identified."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from trifinger.identification.fit import CENTERS, SURE, Figure

# Many figures are compared, so a difference counts only if chance hardly makes it.
SURE_OF_CHANGE = 4.0  # standard deviations
_LEAST = {"rotor_inertia": 5e-5, "damping": 5e-4, "friction": 2e-3, "backlash": 1e-3}
_LEAST |= {"zero_offset": 3e-3, "torque_scale": 0.03, "link_mass": 0.03, "delay": 5e-4}
_LEAST |= dict.fromkeys(CENTERS, 2e-3)


@dataclass(frozen=True)
class Change:
    """A figure that is no longer what it was."""

    before: Figure
    now: Figure

    def __str__(self) -> str:
        joint = f" of joint '{self.now.joint}'" if self.now.joint else ""
        return (
            f"{self.now.name}{joint} is {self.now.value:.4g} ({self.now.low:.4g} to "
            f"{self.now.high:.4g}), was {self.before.value:.4g} ({self.before.low:.4g} to "
            f"{self.before.high:.4g})"
        )


def check(before: Sequence[Figure], now: Sequence[Figure]) -> list[Change]:
    """The figures that have changed, of those that both logs tell."""
    old = {(one.name, one.joint): one for one in before if one.is_told}
    changes = []
    for figure in now:
        other = old.get((figure.name, figure.joint))
        if other is None or not figure.is_told:
            continue
        deviation = math.hypot(_deviation(figure), _deviation(other))
        difference = abs(figure.value - other.value)
        if difference > max(SURE_OF_CHANGE * deviation, _LEAST[figure.name]):
            changes.append(Change(other, figure))
    return changes


def _deviation(figure: Figure) -> float:
    return (figure.high - figure.value) / SURE


def figures_of(saved: Mapping[str, Any]) -> list[Figure]:
    """The figures in what `save` has written as identified.json."""
    return [Figure(**figure) for figure in saved["figures"]]
