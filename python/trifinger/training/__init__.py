# SPDX-License-Identifier: BSD-3-Clause
"""Trainings with Stable-Baselines3, which can go on after a kill.

    plan = training.Plan.of("reach", "ddpg", is_shared=True)
    summary = training.Training(plan, Path("run")).run()

docs/training.md describes the command and the files in the folder of a run.
"""

from trifinger.training.plan import PLAN, Plan, Recipe, name_of, parse_setting
from trifinger.training.run import CHECKPOINT, CURVE, Training

__all__ = ["CHECKPOINT", "CURVE", "PLAN", "Plan", "Recipe", "Training", "name_of", "parse_setting"]
