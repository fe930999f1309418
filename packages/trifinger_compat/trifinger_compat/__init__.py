# SPDX-License-Identifier: BSD-3-Clause
"""What the packages of the original stack share here. Programs do not import this one."""
