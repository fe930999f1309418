# SPDX-License-Identifier: BSD-3-Clause
"""Times of sessions are of a clock that begins with the machine; those of the original since 1970.

The difference is taken once, so that all times of a process fit together.
"""

import time

SINCE_1970 = time.time() - time.monotonic()  # [s]
