# SPDX-License-Identifier: BSD-3-Clause
"""What is made of logs: tables, plots and films."""
