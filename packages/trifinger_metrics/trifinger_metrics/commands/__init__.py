# SPDX-License-Identifier: BSD-3-Clause
"""The commands of this package, a file for each."""
