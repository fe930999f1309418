# SPDX-License-Identifier: BSD-3-Clause
"""Motions: trajectories of joints that can be kept, changed, drawn and played.

    from trifinger_view.motion import Motion, play

    motion = Motion.load("wave.motion").trim(0.5, 4.0).smooth(5.0).slow(2.0)
    motion.save("slow_wave.motion")
    with trifinger.connect("sim") as robot:
        play(robot, motion)

docs/motions.md has the file format and the equation of each change.
"""

from trifinger_view.motion.facts import JointFacts as JointFacts
from trifinger_view.motion.file import MotionFileError as MotionFileError
from trifinger_view.motion.limits import Violation as Violation
from trifinger_view.motion.motion import Motion as Motion
from trifinger_view.motion.playing import Plan as Plan, plan as plan, play as play
