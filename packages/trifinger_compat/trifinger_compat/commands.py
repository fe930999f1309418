# SPDX-License-Identifier: BSD-3-Clause
"""How the commands of the tasks end."""

import sys
from collections.abc import Callable


def print_result(run: Callable[[], str]) -> int:
    """Prints what `run` returns, or on stderr why it failed; returns the exit status."""
    try:
        print(run())
    except Exception as error:
        print(error, file=sys.stderr)
        return 1
    return 0
