# SPDX-License-Identifier: BSD-3-Clause
"""The window of a simulation, where the original opens that of its physics engine."""

import logging
from typing import TYPE_CHECKING, Any

import numpy as np
import trifinger
from trifinger.errors import InvalidArgument

if TYPE_CHECKING:
    from trifinger_compat.world import World

FRAME_TIME = 0.04  # time of the simulation between two pictures [s]
_log = logging.getLogger(__name__)


class Show:
    """Shows a world in a window if there is a screen; says once why there is none otherwise."""

    def __init__(self, world: "World") -> None:
        self._world = world
        self._window: Any = None
        self._shown: object = None
        self._steps = max(1, round(FRAME_TIME / world.time_step))
        self._step = 0
        self._is_possible = True

    def update(self) -> None:
        """Call it after each step."""
        self._step += 1
        if self._is_possible and self._step % self._steps == 0:
            try:
                self._draw()
            except InvalidArgument as error:
                self._is_possible = False
                _log.warning("this simulation is not shown: %s", error)

    def _draw(self) -> None:
        from trifinger.environments.window import Window
        from trifinger.picture import View

        if self._shown is not self._world.core:  # another set of objects
            if self._window is not None:
                self._window.close()
            mjcf = trifinger.export_mjcf(self._world.config, self._world.overrides)
            self._window = Window(mjcf, View(), FRAME_TIME, "a simulation without visualization")
            self._shown = self._world.core
        self._window.draw(self._world.core.configuration(), np.zeros((0, 3)))
