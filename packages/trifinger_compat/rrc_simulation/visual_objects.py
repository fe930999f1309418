# SPDX-License-Identifier: BSD-3-Clause
"""The same as trifinger_simulation.visual_objects."""

from trifinger_simulation.visual_objects import *  # noqa: F403
