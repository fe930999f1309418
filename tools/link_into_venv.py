# SPDX-License-Identifier: BSD-3-Clause
"""Lets .venv use the package in a build folder, as if it were installed there.

    tools/link_into_venv.py FOLDER

Python finds the package by a .pth file. The programs of the package go into the `bin` of this
virtual environment; they work as soon as the folder is built.
"""

import sys
import sysconfig
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ENTRY_POINT = """\
#!{python}
import sys
from {module} import {function}
sys.exit({function}())
"""


def replace(path: Path, text: str, mode: int) -> None:
    """Replaces a file by a new one; hard links to the old file keep the old content."""
    path.unlink(missing_ok=True)
    path.write_text(text)
    path.chmod(mode)


def link(package_folder: Path) -> None:
    """Lets this virtual environment use the package in a folder, which need not exist yet."""
    replace(Path(sysconfig.get_path("purelib"), "trifinger.pth"), f"{package_folder}\n", 0o644)
    programs = Path(sysconfig.get_path("scripts"))
    launcher = (ROOT / "python/scripts/trifinger").read_text()
    replace(programs / "trifinger", launcher.replace("#!python", f"#!{sys.executable}", 1), 0o755)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for name, target in project["scripts"].items():
        module, _, function = target.partition(":")
        text = ENTRY_POINT.format(python=sys.executable, module=module, function=function)
        replace(programs / name, text, 0o755)


if __name__ == "__main__":
    link(Path(sys.argv[1]).resolve())
