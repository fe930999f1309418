# SPDX-License-Identifier: BSD-3-Clause
"""The reference of configuration keys: values and what is allowed from the program itself.

What a key means stands beside it in the configuration files that come with the program.
"""

import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import yaml
from tracked_files import ROOT
from write_reference import BEGIN, END, keys, keys_of, meanings

from .pages import ORPHAN, Pages, list_of

FOLDER = "reference/configuration"
PROGRAM = str(ROOT / ".venv/bin/trifinger")
MOTOR = re.compile(r"^(dynamixel\.(?:motors|reset\.untangle))\.\w+")


@dataclass(frozen=True)
class Key:
    """A key of a configuration."""

    path: str
    value: str
    allowed: str
    meaning: str


def explained(rows: Iterable[tuple[str, str, str]], *files: str) -> Iterator[Key]:
    """Yields keys with what the comments of these files of config/ say about them."""
    texts: dict[str, str] = {}
    for file in files:
        texts |= meanings((ROOT / "config" / file).read_text())
    seen = set()
    for path, value, allowed in rows:
        general = MOTOR.sub(r"\1.NAME", path)  # for each motor the same
        if general not in seen:
            seen.add(general)
            yield Key(general.replace(".0.", "[i]."), value, allowed, texts.get(path, ""))


def page(title: str, text: str, found: Iterable[Key]) -> str:
    """Returns a page with a section for each first word of the keys."""
    shown = f"{ORPHAN}# {title}\n\n{text}\n"
    section = ""
    for key in found:
        first = re.split(r"\W", key.path)[0]
        if first != section and "." in key.path:
            section = first
            shown += f"\n## `{section}`\n"
        shown += f"\n````{{confval}} {key.path}\n"
        shown += f":type: {json.dumps(key.allowed)}\n:default: {json.dumps(f'`` {key.value} ``')}\n"
        shown += f"\n{key.meaning}\n````\n"
    return shown


def table(title: str, text: str, found: Iterable[Key]) -> str:
    """Returns a page with a table of keys."""
    rows = "".join(f"| `{key.path}` | `` {key.value} `` | {key.meaning} |\n" for key in found)
    return f"{ORPHAN}# {title}\n\n{text}\n\n| key | in the file | meaning |\n|---|---|---|\n{rows}"


def values(node: object, path: str = "") -> Iterator[tuple[str, str, str]]:
    """Yields path and value of each key in a file whose keys no command lists."""
    if isinstance(node, dict):
        for name, value in node.items():
            yield from values(value, f"{path}.{name}" if path else str(name))
    else:
        text = str(node)
        yield path, text if len(text) < 70 else f"{text[:70]} …", ""


def skill_pages() -> Pages:
    """Returns a page for each configuration of `trifinger manipulate`."""
    result = {}
    for file in sorted((ROOT / "config/skills").glob("*.yml")):
        name = f"skills/{file.name}"
        file_page = f"[config/{name}](/source/config/{name}.md)"
        text = f"`trifinger manipulate` reads it. The file is {file_page}."
        rows = values(yaml.safe_load(file.read_text()))
        result[f"{FOLDER}/skills_{file.stem}"] = table(name, text, explained(rows, name))
    return result


def pages() -> Pages:
    """Returns the pages of all keys."""
    of_trifinger = list(explained(keys(PROGRAM), "trifinger_edu_can.yml", "trifinger_edu.yml"))
    known = {key.path for key in of_trifinger}
    cameras = keys_of(PROGRAM, ROOT / "config/sim_tracked.yml")
    of_cameras = explained(cameras, "sim_cameras.yml", "sim_tracked.yml")
    files = keys_of(PROGRAM, ROOT / "config/dclaw_dynamixel.yml")
    of_files = explained(files, "dclaw.yml", "dclaw_dynamixel.yml")
    of_skills = skill_pages()
    result = {
        f"{FOLDER}/trifinger": page(
            "Keys of a TriFinger",
            "A TriFinger or one of its fingers, simulated or on motor boards.",
            of_trifinger,
        ),
        f"{FOLDER}/cameras": page(
            "Keys of cameras",
            "The section `cameras` of a robot with [cameras](/cameras.md).",
            (key for key in of_cameras if key.path.startswith("cameras.")),
        ),
        f"{FOLDER}/robot_from_a_file": page(
            "Keys of a robot from a file",
            "A robot from an MJCF or URDF file, simulated or on Dynamixel motors, has these keys"
            " and, as a TriFinger does, `name`, `driver`, `backend` and `stop`.",
            (key for key in of_files if key.path not in known),
        ),
    }
    text = (
        "`trifinger config ROBOT` prints these keys with the values of a robot."
        " [Configurations](/configuration.md) says how files extend each other."
    )
    links = {
        re.split(r"\n", shown.removeprefix(ORPHAN))[0][2:]: name for name, shown in result.items()
    }
    skills = {f"{name.rpartition('/')[2].replace('_', '/', 1)}.yml": name for name in of_skills}
    lists = f"{list_of(links)}\n\n## Motions with objects\n\n{list_of(skills)}"
    index = f"# Configuration keys\n\n{text}\n\n{lists}\n"
    return result | of_skills | {f"{FOLDER}/index": index}


def without_table(text: str) -> str:
    """Returns the page docs/configuration.md, whose table of all keys the reference replaces."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}[The reference](/{FOLDER}/index.md) has every key.\n{after}"
