# SPDX-License-Identifier: BSD-3-Clause
"""The same as trifinger_simulation.finger_types_data."""

from trifinger_simulation.finger_types_data import *  # noqa: F403
