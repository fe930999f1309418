# SPDX-License-Identifier: BSD-3-Clause
"""The same as trifinger_simulation.camera, with images of 270 pixels."""

from typing import Any

from trifinger_simulation.camera import (
    Camera as Camera,
    CameraArray as CameraArray,
    TriFingerCameras as _TriFingerCameras,
)


class TriFingerCameras(_TriFingerCameras):
    """The cameras 60, 180 and 300; arguments are those of Camera."""

    def __init__(self, **camera_kwargs: Any) -> None:
        camera_kwargs.setdefault("image_size", (270, 270))
        super().__init__(**camera_kwargs)
