# SPDX-License-Identifier: BSD-3-Clause
"""Writes the type stub of the C++ module, which Python must find on its path."""

import contextlib
import io
import sys
from pathlib import Path

from nanobind import stubgen

ROOT = Path(__file__).resolve().parent.parent
STUB = ROOT / "python" / "trifinger" / "_trifinger.pyi"
PATTERNS = ROOT / "bindings" / "stub_patterns.txt"
HEADER = "# SPDX-License-Identifier: BSD-3-Clause\n"


def write(path: Path) -> None:
    """Writes the stub of the module that Python finds to `path`."""
    with contextlib.redirect_stdout(io.StringIO()):
        what = ["--quiet", "--exclude-values", "-m", "trifinger._trifinger"]
        stubgen.main([*what, "-p", str(PATTERNS), "-o", str(path)])
    path.write_text(HEADER + path.read_text())


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else STUB)
