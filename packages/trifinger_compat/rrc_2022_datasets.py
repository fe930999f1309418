# SPDX-License-Identifier: BSD-3-Clause
"""Stands where `rrc_2022_datasets` is not installed; if it is, Python finds that one."""

import sys

from trifinger_compat import data_set_policies as utils
from trifinger_compat.data_set_policies import (
    PolicyBase as PolicyBase,
    PolicyConfig as PolicyConfig,
    TriFingerDatasetEnv as TriFingerDatasetEnv,
)

# `from rrc_2022_datasets.utils import get_pose_from_keypoints`.
sys.modules[f"{__name__}.utils"] = utils
