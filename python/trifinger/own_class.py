# SPDX-License-Identifier: BSD-3-Clause
"""Classes of the user's own by their names MODULE:CLASS: tasks and algorithms."""

import importlib
import sys
from pathlib import Path
from typing import Any

from trifinger.errors import InvalidArgument


def load(kind: str, name: str) -> Any:
    """What MODULE has under the name CLASS, or None; `kind` is "task" or "algorithm".

    The module is found like any other, or in the current folder. Raises InvalidArgument.
    """
    module_name, colon, class_name = name.partition(":")
    if not colon:
        raise InvalidArgument(f"there is no {kind} '{name}'")
    missing = (
        f"there is no module '{module_name}' for the {kind} '{name}': it must be in the current "
        "folder, installed, or on PYTHONPATH"
    )
    if not all(part.isidentifier() for part in module_name.split(".")):
        raise InvalidArgument(missing)
    here = str(Path.cwd())
    added = here not in sys.path and "" not in sys.path
    if added:
        sys.path.append(here)
    try:
        return getattr(importlib.import_module(module_name), class_name, None)
    except ModuleNotFoundError as error:
        # What the module itself imports may be missing, too.
        if not f"{module_name}.".startswith(f"{error.name}."):
            raise
        raise InvalidArgument(missing) from error
    finally:
        if added:
            sys.path.remove(here)


def name_of_file(kind: str, named: str, said: str | None, file: Path) -> str:
    """The name that a file has for its task or algorithm, or `said`, what the user says it is.

    The file need not be trusted, so a module that only the file names is not imported. Raises
    InvalidArgument.
    """
    if said is None and ":" in named:
        raise InvalidArgument(
            f"{file} is for the {kind} '{named}', which runs what is in the module "
            f"'{named.partition(':')[0]}': if you would run that, say --{kind} {named}"
        )
    return said or named
