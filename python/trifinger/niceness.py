# SPDX-License-Identifier: BSD-3-Clause
"""Programs that leave the processor to others."""

import contextlib
import os
from pathlib import Path

NICENESS = 10


def be_nice() -> None:
    """Lets everything else on this machine go first: this process and its threads are nice.

    Between login sessions Linux compares another number (sched(7), "The autogroup feature"), so the
    leader of a session of its own sets that one as well.
    """
    with contextlib.suppress(OSError):
        os.nice(NICENESS)
        if os.getsid(0) == os.getpid():
            Path("/proc/self/autogroup").write_text(str(NICENESS))
