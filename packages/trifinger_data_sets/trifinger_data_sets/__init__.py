# SPDX-License-Identifier: BSD-3-Clause
"""Logs as data sets for learning, in the formats of LeRobot and Minari, and policies from them."""

from importlib.util import find_spec

if find_spec("trifinger") is None:
    raise ModuleNotFoundError(
        "trifinger-data-sets needs the package `trifinger`, which is not installed and on no "
        "index: install it from its sources or its wheel, as docs/installing.md says",
        name="trifinger",
    )

LEROBOT = ("trifinger-data-sets[lerobot]", "pandas", "pyarrow", "av", "PIL")
"""The extra for data sets of LeRobot and its modules, for `trifinger.extras.require`."""
MINARI = ("trifinger-data-sets[minari]", "minari", "h5py", "gymnasium")
"""The extra for data sets of Minari and its modules."""
