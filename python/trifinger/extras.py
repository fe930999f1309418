# SPDX-License-Identifier: BSD-3-Clause
"""Packages that only some commands need: which of them are missing, and how to get them.

An extra is a list of such packages in pyproject.toml: `pip install ".[learning]"`.
"""

import re
from importlib import metadata, util

from trifinger.errors import Error

MODULES = {
    "demo": ("matplotlib", "OpenGL"),
    "plot": ("matplotlib", "plotly"),
    "film": ("matplotlib", "OpenGL", "av"),
    "export": ("pandas", "pyarrow"),
    "learning": ("gymnasium", "stable_baselines3", "torch", "tensorboard", "tqdm", "moviepy"),
    "window": ("glfw",),
}
"""What the packages of an extra are imported as."""


def missing(extra: str) -> list[str]:
    """Returns the modules of an extra that cannot be imported."""
    return [module for module in MODULES[extra] if util.find_spec(module) is None]


def require(extra: str, *modules: str) -> None:
    """Raises Error with what to install, unless these modules of an extra, or all, are there."""
    lacking = [module for module in missing(extra) if module in modules or not modules]
    if lacking:
        raise Error(sentence(extra, *lacking))


def sentence(extra: str, *modules: str) -> str:
    """Says that modules of an extra are missing, and how to install it."""
    names = " and ".join(filter(None, (", ".join(modules[:-1]), modules[-1])))
    return f"{names} {'is' if len(modules) == 1 else 'are'} missing: {how_to_install(extra)}"


def how_to_install(extra: str) -> str:
    """The command that installs the packages of an extra, by their own names."""
    try:
        requirements = metadata.requires("trifinger") or []
    except metadata.PackageNotFoundError:  # a build folder, used from the sources
        return "./run setup"
    marker = re.compile(rf"""; *extra *== *["']{extra}["']$""")
    own = [marker.sub("", each).strip() for each in requirements if marker.search(each)]
    return f"pip install {' '.join(own)}"
