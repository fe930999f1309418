# SPDX-License-Identifier: BSD-3-Clause
"""Runs each of the programs on stdin in a process of its own; says on stdout how each one ended.

With the word `pybullet` a module with PyBullet's interface is installed; without the word `cv2`,
OpenCV is not.
"""

import importlib
import json
import os
import sys
import traceback
import warnings

# What takes time to import and is no package of the original, or of PyBullet.
import gymnasium  # noqa: F401
import numpy as np  # noqa: F401
import scipy.spatial.transform  # noqa: F401
import trifinger  # noqa: F401


def run(program: str) -> str:
    """The error with which a program ends; empty if there is none."""
    read, write = os.pipe()
    process = os.fork()
    if process == 0:
        warnings.simplefilter("ignore")
        error = ""
        try:
            if "cv2" not in sys.argv[1:]:
                sys.modules["cv2"] = None  # type: ignore[assignment]
            if "pybullet" in sys.argv[1:]:
                bullet = importlib.import_module("trifinger_compat.bullet")
                stand_in = importlib.import_module("pybullet_stand_in").PyBullet()
                bullet.installed = lambda: stand_in
            exec(compile(program, "program", "exec"), {"__name__": "__main__"})  # noqa: S102  # its purpose
        except BaseException:
            error = traceback.format_exc()
        os.write(write, error[-4000:].encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as said:
        text = said.read()
    os.waitpid(process, 0)
    return text


if __name__ == "__main__":
    print(json.dumps([run(program) for program in json.load(sys.stdin)]))
