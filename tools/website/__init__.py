# SPDX-License-Identifier: BSD-3-Clause
"""Writes the sources of the documentation site: pages of the repository and generated reference."""
