# SPDX-License-Identifier: BSD-3-Clause
"""Simulates with the wheel for 64-bit ARM, in an emulator, and compares with this machine's.

use_aarch64.py FOLDER    of the wheel
"""

import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))

import aarch64
import numpy as np
import trifinger

STEPS = 1000
CLOSE = 1e-9  # [rad]


def positions() -> list[list[float]]:
    """Joint positions of a robot that moves in the air, in steps of 1 ms [rad].

    A contact makes more of the last digit: fingers that hit each other at step 400 were 1e-8 rad
    apart after 1000 steps, and 2e-16 before.
    """
    seen = []
    with trifinger.simulate() as robot:
        start = robot.latest_observation().position
        for t in range(STEPS):
            wave = 0.15 * np.sin(0.01 * t * (1 + np.arange(9) / 9))
            now = robot.append_desired_action(robot.new_action(position=start + wave))
            seen.append(robot.get_observation(now).position.tolist())
    return seen


def main(folder: Path) -> None:
    """Compares, and prints the largest difference."""
    (wheel,) = folder.glob("trifinger-*_aarch64.whl")
    with tempfile.TemporaryDirectory() as temporary:
        packages = aarch64.installed(wheel, Path(temporary, "packages"))
        command = f"import sys; sys.path.append({str(Path(__file__).parent)!r}); "
        command += "import use_aarch64; use_aarch64.show()"
        theirs = json.loads(aarch64.emulated("-c", command, packages=packages))
    machine, other = theirs
    ours = np.array(positions())
    moved = np.ptp(ours, axis=0).min()
    difference = np.abs(ours - np.array(other)).max()
    print(f"{machine}: {STEPS} steps, {difference:.1e} rad apart, at most {CLOSE:.0e}")
    if machine != "aarch64" or moved < 0.01 or not difference <= CLOSE:
        sys.exit("failed: it does not compute the same")


def show() -> None:
    """Prints the machine and the positions there."""
    import platform

    print(json.dumps([platform.machine(), positions()]))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
