# SPDX-License-Identifier: BSD-3-Clause
"""The verbs of ./run: main.py has their names, steps.py the lines that they print."""
