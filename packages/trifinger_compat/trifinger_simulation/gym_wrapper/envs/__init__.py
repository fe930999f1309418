# SPDX-License-Identifier: BSD-3-Clause
"""The environments, a module for each."""
