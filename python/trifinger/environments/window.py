# SPDX-License-Identifier: BSD-3-Clause
"""The window of environments with render_mode="human"."""

import os
import sys
import threading
import time

from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.extras import sentence
from trifinger.foreign_models import model_of
from trifinger.look import look_of
from trifinger.picture import SceneCamera, View, draw_marks


class Window:
    """A window of MuJoCo's viewer, which shows an episode at real speed."""

    def __init__(self, mjcf: str, view: View, frame_time: float, instead: str) -> None:
        """Opens the window; raises InvalidArgument if there is no screen or no library for it.

        `instead` says in the error what needs no screen.
        """
        if sys.platform.startswith("linux") and not (
            os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        ):
            raise InvalidArgument(f"there is no screen for a window; {instead} needs none")
        try:
            import mujoco
            import mujoco.viewer
        except ImportError as error:
            raise InvalidArgument(f"{sentence('window', 'glfw')} ({error})") from error
        self._mujoco = mujoco
        self._model = model_of(mjcf, look_of)
        self._data = mujoco.MjData(self._model)
        self._scene_camera = SceneCamera(self._model, view)
        others = threading.enumerate()
        self._viewer = mujoco.viewer.launch_passive(
            self._model, self._data, show_left_ui=False, show_right_ui=False
        )
        with self._viewer.lock():
            begin, camera = self._scene_camera.camera, self._viewer.cam
            camera.type, camera.fixedcamid = begin.type, begin.fixedcamid
            camera.azimuth, camera.elevation = begin.azimuth, begin.elevation
            camera.lookat[:], camera.distance = begin.lookat, begin.distance
        self._threads = [thread for thread in threading.enumerate() if thread not in others]
        self._frame_time = frame_time
        self._next = time.monotonic()

    def draw(self, configuration: Array, marks: Array) -> None:
        """Shows a configuration and goals, `frame_time` [s] after the last one."""
        with self._viewer.lock():
            self._data.qpos[:] = configuration[: self._model.nq]
            self._mujoco.mj_forward(self._model, self._data)
            self._scene_camera.clear(self._data, self._viewer.cam)
            draw_marks(self._viewer.user_scn, marks)
        self._viewer.sync()
        time.sleep(max(0.0, self._next - time.monotonic()))
        self._next = max(self._next, time.monotonic()) + self._frame_time

    def close(self) -> None:
        """Closes the window."""
        self._viewer.close()
        # The viewer does not wait for its thread, which must end before its model is deleted.
        for thread in self._threads:
            thread.join(timeout=5.0)
