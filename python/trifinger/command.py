# SPDX-License-Identifier: BSD-3-Clause
"""What all commands in Python share."""

import sys
from collections.abc import Callable

from trifinger.errors import Error, InvalidArgument


def run(work: Callable[[], int | None]) -> int:
    """Does the work of a command and returns its exit status; prints an error as one sentence."""
    try:
        return work() or 0
    except (Error, OSError) as error:
        print(f"trifinger: {error}", file=sys.stderr)
        return 2 if isinstance(error, InvalidArgument) else 1
    except KeyboardInterrupt:
        return 130
