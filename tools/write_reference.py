# SPDX-License-Identifier: BSD-3-Clause
"""Writes the table of all configuration keys into docs/configuration.md.

Keys and allowed values come from the readers themselves, by `trifinger config`; what a key means
stands beside it in config/trifinger_edu.yml, or for motor boards in config/trifinger_edu_can.yml.
"""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "configuration.md"
DOCUMENTED = ROOT / "config" / "trifinger_edu.yml"
BOARDS = ROOT / "config" / "trifinger_edu_can.yml"
BEGIN = "<!-- keys: written by tools/write_reference.py -->\n"
END = "<!-- end of keys -->\n"
SURFACES = ("tip", "link", "object", "table", "boundary")
PAIRS = [
    f"{one}_{other}"
    for i, one in enumerate(SURFACES[:3])  # the others do not move
    for other in SURFACES[i:]
]
# What the documented file leaves out because it is optional.
OPTIONAL = """
objects:
  - name: cube
    type: cube
    size: [0.065]
    mass: 0.094
    position: [0, 0, 0.0325]
    orientation: [1, 0, 0, 0]
    velocity: [0, 0, 0]
    angular_velocity: [0, 0, 0]
    colours: [red, green, blue, cyan, magenta, yellow]
identified:
  rotor_inertia: [3.6e-4, 3.6e-4, 3.6e-4, 3.6e-4, 3.6e-4, 3.6e-4, 3.6e-4, 3.6e-4, 3.6e-4]
  damping: [0.001, 0.001, 0.001, 0.001, 0.001, 0.001, 0.001, 0.001, 0.001]
  friction: [0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01]
  torque_scale: [1, 1, 1, 1, 1, 1, 1, 1, 1]
  backlash: [0, 0, 0, 0, 0, 0, 0, 0, 0]
  zero_offset: [0, 0, 0, 0, 0, 0, 0, 0, 0]
  link_mass: [1, 1, 1, 1, 1, 1, 1, 1, 1]
  link_center_x: [0, 0, 0, 0, 0, 0, 0, 0, 0]
  link_center_y: [0, 0, 0, 0, 0, 0, 0, 0, 0]
  link_center_z: [0, 0, 0, 0, 0, 0, 0, 0, 0]
  torque_delay: 0
  measurement_delay: 0
stop:
  damping_time: 0.5
  rest_position: [0, 0.9, -1.7]
  move_time: 3
"""


def meanings(text: str) -> dict[str, str]:
    """Returns the comments of a configuration by the paths of the keys that they precede.

    Sections that are optional are in comments themselves: those of objects, `stop`, `identified`.
    """
    found: dict[str, str] = {}
    waiting: list[str] = []
    parents: list[tuple[int, str]] = []
    for line in text.splitlines():
        of_object = re.match(r"#   (\w+): [^#]*# (.+)", line)
        if of_object:
            found[f"objects.0.{of_object[1]}"] = of_object[2]
            continue
        line = re.sub(r"^# (?=stop:|identified:|  #|  \w+:)", "", line)
        key = re.match(r"( *)(\w+):", line)
        if not key:
            comment = line.strip()
            waiting = [*waiting, comment.lstrip("# ")] if comment.startswith("#") else []
            continue
        indentation = len(key[1])
        parents = [parent for parent in parents if parent[0] < indentation]
        parents.append((indentation, key[2]))
        if waiting:
            found[".".join(name for _, name in parents)] = " ".join(waiting)
        waiting = []
    return found


def keys(program: str) -> Iterator[tuple[str, str, str]]:
    """Yields path, value and what is allowed of every key there is."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "whole.yml"
        friction = ", ".join(f"{pair}: 1" for pair in PAIRS)
        text = DOCUMENTED.read_text().replace("objects: []\n", "")
        file.write_text(text.replace("  friction: {}", f"  friction: {{{friction}}}") + OPTIONAL)
        yield from keys_of(program, file)
    yield from (key for key in keys_of(program, BOARDS) if key[0].startswith("boards."))


def keys_of(program: str, file: Path) -> Iterator[tuple[str, str, str]]:
    """Yields path, value and what is allowed of every key in a configuration."""
    command = [program, "config", str(file)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    for line in output.splitlines():
        path, value, allowed = re.split(r"  +", line, maxsplit=2)
        yield path, value, allowed


def table(program: str) -> str:
    """Returns the table in Markdown."""
    comments = meanings(BOARDS.read_text()) | meanings(DOCUMENTED.read_text())
    lines = ["| key | in the file | allowed | meaning |", "|---|---|---|---|"]
    for path, value, allowed in keys(program):
        if path.startswith("contact.friction."):
            if not path.endswith(PAIRS[0]):
                continue
            path = "contact.friction.PAIR"
        meaning = comments.get(path.removesuffix(".PAIR"), "")
        shown = path.replace(".0.", "[i].")
        lines.append(f"| `{shown}` | `{value}` | {allowed} | {meaning} |")
    return "\n".join(lines) + "\n"


def page(program: str) -> str:
    """Returns the whole page with the table as it should be."""
    before, _, rest = PAGE.read_text().partition(BEGIN)
    _, _, after = rest.partition(END)
    return before + BEGIN + table(program) + END + after


if __name__ == "__main__":
    PAGE.write_text(page(sys.argv[1] if len(sys.argv) > 1 else "trifinger"))
