# SPDX-License-Identifier: BSD-3-Clause
"""Bridges show a running robot in other programs, live: Foxglove and ROS 2."""
