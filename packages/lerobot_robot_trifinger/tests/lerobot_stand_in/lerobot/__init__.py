# SPDX-License-Identifier: BSD-3-Clause
"""The part of LeRobot's interface that plugins use, for tests: LeRobot does not install here."""
