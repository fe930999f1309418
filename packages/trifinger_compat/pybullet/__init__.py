# SPDX-License-Identifier: BSD-3-Clause
"""PyBullet beside the simulations of `trifinger_simulation`, in one program.

Calls on the ids of such a simulation act on it. All others go to PyBullet, if it is installed in
whatever folder; else mathematics and calls of the view work, and the others raise
NotImplementedError, which says what to use instead. Constants are PyBullet's.
"""

from typing import Any as _Any

from trifinger_compat import bullet as _bullet

globals().update(_bullet.names(_bullet.installed()))


def __getattr__(name: str) -> _Any:  # also says to type checkers that names come as it runs
    raise AttributeError(f"module 'pybullet' has no attribute '{name}'", name=name, obj=__name__)
