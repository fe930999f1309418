# SPDX-License-Identifier: BSD-3-Clause
"""Trackers of the original stack, on top of this project's own."""

from trifinger_object_tracking import (
    py_lightblue_segmenter as py_lightblue_segmenter,
    py_object_tracker as py_object_tracker,
    py_tricamera_types as py_tricamera_types,
)
