# SPDX-License-Identifier: BSD-3-Clause
"""What the packages of the original stack share here. Programs do not import this one."""

from importlib.util import find_spec

if find_spec("trifinger") is None:
    raise ModuleNotFoundError(
        "trifinger-compat needs the package `trifinger`, which is not installed and on no "
        "index: install it from its sources or its wheel, as docs/installing.md says",
        name="trifinger",
    )
