# SPDX-License-Identifier: BSD-3-Clause
"""The commands of `trifinger` that are written in Python, a file for each."""
