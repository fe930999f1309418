# SPDX-License-Identifier: BSD-3-Clause
"""Logs as data sets for learning, in the formats of LeRobot and Minari, and policies from them."""
