# SPDX-License-Identifier: BSD-3-Clause
"""The same as trifinger_simulation.sample."""

from trifinger_simulation.sample import *  # noqa: F403
