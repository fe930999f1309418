# SPDX-License-Identifier: BSD-3-Clause
"""Finds objects with coloured faces in the images of calibrated cameras.

    tracker = Tracker(calibration, tracked_object("sim"))
    estimate = tracker.track(images)
    if estimate.is_sure:
        print(estimate.position, estimate.orientation)

`calibration` is the text of a calibration, such as `CameraRenderer.calibration`. docs/tracking.md
says how it works and how well.
"""

from trifinger._trifinger import (
    Estimate as Estimate,
    TrackedObject as TrackedObject,
    Tracker as Tracker,
    balanced_blocks as balanced_blocks,
    coloured_box as coloured_box,
    coloured_mesh as coloured_mesh,
    faces_in_blocks as faces_in_blocks,
    tracked_object as tracked_object,
)
