# SPDX-License-Identifier: BSD-3-Clause
"""Lets .venv use the package in a build folder, and those of packages/, as if installed there.

    tools/link_into_venv.py FOLDER

Python finds the packages by a .pth file. Their programs go into the `bin` of this virtual
environment; they work as soon as the folder is built.
"""

import sys
import sysconfig
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECTS = (ROOT / "pyproject.toml", *sorted(ROOT.glob("packages/*/pyproject.toml")))
ENTRY_POINT = """\
#!{python}
import sys
from {module} import {name}
sys.exit({function}())
"""


def replace(path: Path, text: str, mode: int) -> None:
    """Replaces a file by a new one; hard links to the old file keep the old content."""
    path.unlink(missing_ok=True)
    path.write_text(text)
    path.chmod(mode)


def scripts() -> dict[str, str]:
    """Returns the programs of all packages, MODULE:FUNCTION by their names."""
    made: dict[str, str] = {}
    for path in PROJECTS:
        made |= tomllib.loads(path.read_text())["project"].get("scripts", {})
    return made


def write_scripts(folder: Path) -> None:
    """Writes the programs of all packages into a folder, as pip does."""
    for program, target in scripts().items():
        module, _, function = target.partition(":")
        name = function.partition(".")[0]
        text = ENTRY_POINT.format(
            python=sys.executable, module=module, name=name, function=function
        )
        replace(folder / program, text, 0o755)


def link(package_folder: Path) -> None:
    """Lets this virtual environment use the package in a folder, which need not exist yet."""
    folders = [package_folder, *(path.parent for path in PROJECTS[1:])]
    lines = "".join(f"{folder}\n" for folder in folders)
    replace(Path(sysconfig.get_path("purelib"), "trifinger.pth"), lines, 0o644)
    programs = Path(sysconfig.get_path("scripts"))
    launcher = (ROOT / "python/scripts/trifinger").read_text()
    replace(programs / "trifinger", launcher.replace("#!python", f"#!{sys.executable}", 1), 0o755)
    write_scripts(programs)


if __name__ == "__main__":
    link(Path(sys.argv[1]).resolve())
