# SPDX-License-Identifier: BSD-3-Clause
"""What all robots have in common."""

from trifinger_compat.generic import (
    ErrorStatus as ErrorStatus,
    RobotBackendTerminationReason as RobotBackendTerminationReason,
    Status as Status,
)
