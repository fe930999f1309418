# SPDX-License-Identifier: BSD-3-Clause
"""Programs that leave the processor to others."""

import contextlib
import os
from pathlib import Path

NICENESS = 5  # a third of the share of an equal process


def be_nice() -> None:
    """Leaves most of a busy processor to others: this process and its threads are nice.

    Between login sessions Linux compares another number (sched(7), "The autogroup feature"), so the
    leader of a session of its own sets that one as well.
    """
    with contextlib.suppress(OSError):
        os.nice(NICENESS)
        if os.getsid(0) == os.getpid():
            Path("/proc/self/autogroup").write_text(str(NICENESS))
