# SPDX-License-Identifier: BSD-3-Clause
"""The type of arrays in annotations."""

from typing import Any

import numpy.typing as npt

Array = npt.NDArray[Any]
