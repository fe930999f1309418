# SPDX-License-Identifier: BSD-3-Clause
"""Finds missing packages that only some commands need, and says how to install them.

An extra is a list of such packages in pyproject.toml, as in `pip install ".[learning]"`.
"""

import re
from importlib import metadata, util

from trifinger.errors import Error

MODULES = {
    "demo": ("matplotlib", "OpenGL"),
    "plot": ("matplotlib", "plotly"),
    "film": ("matplotlib", "OpenGL", "av"),
    "cameras": ("cv2", "yaml"),
    "export": ("pandas", "pyarrow"),
    "lerobot": ("pandas", "pyarrow", "av", "PIL"),
    "minari": ("minari", "h5py", "gymnasium"),
    "learning": ("gymnasium", "stable_baselines3", "torch", "tensorboard", "tqdm", "moviepy"),
    "foxglove": ("websockets",),
    "ros2": ("cyclonedds", "zenoh"),
    "window": ("glfw",),
    "view": ("viser", "websockets"),
}
"""Modules to import for each extra."""


def require(extra: str, *modules: str) -> None:
    """Raises Error with what to install if some of these modules (default: all) are missing."""
    lacking = [one for one in modules or MODULES[extra] if util.find_spec(one) is None]
    if lacking:
        raise Error(sentence(extra, *lacking))


def sentence(extra: str, *modules: str) -> str:
    """A sentence that names missing modules of an extra and says how to install it."""
    names = " and ".join(filter(None, (", ".join(modules[:-1]), modules[-1])))
    return f"{names} {'is' if len(modules) == 1 else 'are'} missing: {how_to_install(extra)}"


def how_to_install(extra: str) -> str:
    """The command that installs the packages of an extra."""
    try:
        requirements = metadata.requires("trifinger") or []
    except metadata.PackageNotFoundError:  # a build folder, used from the sources
        return "./run setup"
    marker = re.compile(rf"""; *extra *== *["']{extra}["']$""")
    own = [marker.sub("", each).strip() for each in requirements if marker.search(each)]
    return f"pip install {' '.join(own)}"
