# SPDX-License-Identifier: BSD-3-Clause
"""Finds missing packages that only some commands need, and says how to install them.

An extra is a list of such packages in pyproject.toml, as in `pip install ".[learning]"`. One of
another package of the project is written as pip does: "trifinger-view[ros2]". Without brackets it
is what that package always needs.
"""

import re
import shlex
from importlib import metadata, util

from trifinger.errors import Error

MODULES = {
    "demo": ("matplotlib", "OpenGL"),
    "plot": ("matplotlib", "plotly"),
    "film": ("matplotlib", "OpenGL", "av"),
    "export": ("pandas", "pyarrow"),
    "learning": (
        "gymnasium",
        "stable_baselines3",
        "rsl_rl",
        "torch",
        "tensorboard",
        "tqdm",
        "moviepy",
    ),
    "window": ("glfw",),
}
"""Modules to import for each extra of `trifinger` itself."""


def require(extra: str, *modules: str) -> None:
    """Raises Error with what to install if some of these modules are missing.

    Without `modules` these are all of an extra of `trifinger`.
    """
    lacking = [one for one in modules or MODULES[extra] if util.find_spec(one) is None]
    if lacking:
        raise Error(sentence(extra, *lacking))


def sentence(extra: str, *modules: str) -> str:
    """A sentence that names missing modules of an extra and says how to install it."""
    names = " and ".join(filter(None, (", ".join(modules[:-1]), modules[-1])))
    return f"{names} {'is' if len(modules) == 1 else 'are'} missing: {how_to_install(extra)}"


def how_to_install(extra: str) -> str:
    """The command that installs the packages of an extra."""
    package, _, name = extra.rstrip("]").partition("[")
    if "-" not in package:
        package, name = "trifinger", extra
    try:
        requirements = metadata.requires(package) or []
    except metadata.PackageNotFoundError:  # a build folder, used from the sources
        return "./run setup"
    marker = re.compile(rf"""; *extra *== *["']{name}["']$""")
    if not name:
        own = [each for each in requirements if "extra ==" not in each]
    else:
        own = [marker.sub("", each).strip() for each in requirements if marker.search(each)]
    return shlex.join(["pip", "install", *own])  # a shell takes "<" for something else
