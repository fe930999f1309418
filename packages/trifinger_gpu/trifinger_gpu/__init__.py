# SPDX-License-Identifier: BSD-3-Clause
"""Simulations for learning whose physics are those of MuJoCo Warp, on a GPU: docs/gpu.md."""

from importlib.util import find_spec

if find_spec("trifinger") is None:
    raise ModuleNotFoundError(
        "trifinger-gpu needs the package `trifinger`, which is not installed and on no "
        "index: install it from its sources or its wheel, as docs/installing.md says",
        name="trifinger",
    )

from trifinger_gpu.environment import WarpEnvironment as WarpEnvironment
