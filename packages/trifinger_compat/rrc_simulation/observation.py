# SPDX-License-Identifier: BSD-3-Clause
"""The same as trifinger_simulation.observation."""

from trifinger_simulation.observation import *  # noqa: F403
