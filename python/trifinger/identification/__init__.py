# SPDX-License-Identifier: BSD-3-Clause
"""The simulation that fits one robot, from logs of it: `trifinger identify`."""

from trifinger.identification.check import Change, check
from trifinger.identification.fit import Figure, Identification, identify
from trifinger.identification.motion import Motion, read_motion
from trifinger.identification.page import save

__all__ = [
    "Change",
    "Figure",
    "Identification",
    "Motion",
    "check",
    "identify",
    "read_motion",
    "save",
]
