# SPDX-License-Identifier: BSD-3-Clause
"""The same as trifinger_simulation.action."""

from trifinger_simulation.action import *  # noqa: F403
