# SPDX-License-Identifier: BSD-3-Clause
"""The task of 2020-08."""

from rrc_simulation.tasks import move_cube as move_cube
