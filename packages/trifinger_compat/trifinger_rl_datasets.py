# SPDX-License-Identifier: BSD-3-Clause
"""Stands where `trifinger_rl_datasets` is not installed; if it is, Python finds that one."""

import sys

from trifinger_compat import data_set_policies as evaluate_sim
from trifinger_compat.data_set_policies import (
    PolicyBase as PolicyBase,
    PolicyConfig as PolicyConfig,
    TriFingerDatasetEnv as TriFingerDatasetEnv,
)

# `from trifinger_rl_datasets.evaluate_sim import load_policy_class`, and so on.
utils = evaluate_sim
sys.modules[f"{__name__}.evaluate_sim"] = evaluate_sim
sys.modules[f"{__name__}.utils"] = utils
