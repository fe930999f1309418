# SPDX-License-Identifier: BSD-3-Clause
"""Back-ends of simulated robots."""

from robot_fingers.pybullet_drivers import (
    create_single_finger_backend as create_single_finger_backend,
    create_trifinger_backend as create_trifinger_backend,
)
