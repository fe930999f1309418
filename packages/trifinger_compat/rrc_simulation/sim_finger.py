# SPDX-License-Identifier: BSD-3-Clause
"""A robot in simulation, with the figures of 2020-08."""

from trifinger_compat.generation import FIRST
from trifinger_compat.types import Numbers
from trifinger_simulation.sim_finger import SimFinger as _SimFinger


class SimFinger(_SimFinger):
    """A simulated robot of one or three fingers; a step takes 4 ms by default."""

    _generation = FIRST

    def __init__(
        self,
        finger_type: str,
        time_step: float = FIRST.time_step,
        enable_visualization: bool = False,
        robot_position_offset: Numbers = (0, 0, 0),
    ) -> None:
        """`time_step` is in whole milliseconds [s]. Raises ValueError for an unknown type."""
        super().__init__(finger_type, time_step, enable_visualization, robot_position_offset)
