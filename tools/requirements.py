# SPDX-License-Identifier: BSD-3-Clause
"""Prints all Python packages in pyproject.toml as requirements for pip."""

import tomllib
from pathlib import Path

pyproject = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())
groups = [
    pyproject["build-system"]["requires"],
    pyproject["project"]["dependencies"],
    *pyproject["project"]["optional-dependencies"].values(),
]
print("\n".join(sorted({requirement for group in groups for requirement in group})))
