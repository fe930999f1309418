# SPDX-License-Identifier: BSD-3-Clause
"""Writes what Python's types know of the C++ module, which must be on Python's path.

The type stub of the module, and the fields of `trifinger.environments.Options`.
"""

import contextlib
import importlib
import io
import json
import sys
import textwrap
from pathlib import Path

from nanobind import stubgen

ROOT = Path(__file__).resolve().parent.parent
STUB = ROOT / "python" / "trifinger" / "_trifinger.pyi"
PATTERNS = ROOT / "bindings" / "stub_patterns.txt"
HEADER = "# SPDX-License-Identifier: BSD-3-Clause\n"
OPTIONS = ROOT / "python" / "trifinger" / "environment_options.py"
OPTIONS_BEGIN = '''"""Options of environments; tools/write_stub.py writes them from those of C++."""

import dataclasses
from collections.abc import Mapping
from typing import Literal

FloatRange = tuple[float, float]


@dataclasses.dataclass(frozen=True, kw_only=True)
class OptionFields:
    """The settings of an environment, without their functions."""

'''


def write(path: Path) -> None:
    """Writes the stub of the module that Python finds to `path`."""
    with contextlib.redirect_stdout(io.StringIO()):
        what = ["--quiet", "-m", "trifinger._trifinger"]
        stubgen.main([*what, "-p", str(PATTERNS), "-o", str(path)])
    path.write_text(HEADER + path.read_text())


def options() -> str:
    """Returns the module with the fields of `trifinger.environments.Options`."""
    text = HEADER + OPTIONS_BEGIN
    module = importlib.import_module("trifinger._trifinger")
    for name, type_, value, meaning in module.describe_environment_options():
        default = json.loads(value)
        if isinstance(default, dict):
            shown = "dataclasses.field(default_factory=dict, hash=False)"
        else:
            shown = repr(tuple(default) if isinstance(default, list) else default)
        short_type = type_.replace("tuple[float, float]", "FloatRange")
        text += f"    {name}: {short_type} = {shown}\n".replace("'", '"')
        lines = textwrap.wrap(meaning, 90)
        text += textwrap.indent('"""' + "\n".join(lines) + '"""\n', "    ")
    return text


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else STUB)
    if len(sys.argv) == 1:
        OPTIONS.write_text(options())
