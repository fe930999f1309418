# SPDX-License-Identifier: BSD-3-Clause
"""The tasks of the competitions."""

from trifinger_simulation.tasks import (
    move_cube as move_cube,
    move_cube_on_trajectory as move_cube_on_trajectory,
    move_cuboid as move_cuboid,
    rearrange_dice as rearrange_dice,
)
