# SPDX-License-Identifier: BSD-3-Clause
"""Scaling numbers to -1 to 1, and back."""

from typing import Any

import numpy as np


def scale(x: Any, space: Any) -> Any:
    """Numbers of a space, so that its bounds become -1 and 1."""
    return 2.0 * (np.asarray(x) - space.low) / (space.high - space.low) - 1.0


def unscale(y: Any, space: Any) -> Any:
    """The inverse of scale()."""
    return space.low + (np.asarray(y) + 1.0) / 2.0 * (space.high - space.low)
