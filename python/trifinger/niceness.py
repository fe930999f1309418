# SPDX-License-Identifier: BSD-3-Clause
"""Programs that leave the processor to others."""

import contextlib
import os
import time
from pathlib import Path

NICENESS = 5  # a third of the share of an equal process


def be_nice() -> None:
    """Leaves most of a busy processor to others: this process and its threads are nice.

    Between login sessions Linux compares another number (sched(7), "The autogroup feature"), so the
    leader of a session of its own sets that one as well.
    """
    with contextlib.suppress(OSError):  # as on a kernel without these groups
        os.nice(NICENESS)
        for _ in range(20 * (os.getsid(0) == os.getpid())):
            try:
                Path("/proc/self/autogroup").write_text(str(NICENESS))
                break
            except BlockingIOError:  # all users together may do it ten times a second
                time.sleep(0.1)
