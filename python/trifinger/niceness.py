# SPDX-License-Identifier: BSD-3-Clause
"""Programs that leave the processor to others."""

import contextlib
import os
import time
from pathlib import Path

NICENESS = 5  # a third of the share of an equal process


def be_nice() -> None:
    """Leaves one processor, and most of the rest, to other processes. Threads begun later do, too.

    A loop that wakes where another process computes is late: nine steps of ten within 32 us instead
    of 18 beside a learner, within 22 us where the learner stays off its processor.
    Between login sessions Linux compares another number (sched(7), "The autogroup feature"), so the
    leader of a session of its own sets that one as well.
    """
    processors = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, processors[1:] or processors)
    with contextlib.suppress(OSError):  # as on a kernel without these groups
        os.nice(NICENESS)
        for _ in range(20 * (os.getsid(0) == os.getpid())):
            try:
                Path("/proc/self/autogroup").write_text(str(NICENESS))
                break
            except BlockingIOError:  # all users together may do it ten times a second
                time.sleep(0.1)
