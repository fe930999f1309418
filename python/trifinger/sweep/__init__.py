# SPDX-License-Identifier: BSD-3-Clause
"""Many trainings or evaluations: `trials` says what they are, `executors` where they run.

docs/training.md describes the command and the files in the folder of a sweep.
"""
