# SPDX-License-Identifier: BSD-3-Clause
"""The reference of programs: what each command says about itself when asked for --help."""

import os
import re
import subprocess
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

from tracked_files import ROOT

from .pages import ORPHAN, Pages, list_of

# The lists of commands in the help of a command have titles such as these.
LIST = re.compile(r"^(?:Commands|Programs|Python package)[^\n]*:\n((?: .*\n)+)", re.MULTILINE)
ENTRY = re.compile(r"^  (\S+)  +(.*)$", re.MULTILINE)
FOLDER = "reference/programs"

Help = Callable[[list[str]], str]


def run_help(words: Sequence[str]) -> str:
    """Returns what a command says when asked for help, with lines of at most 100 columns."""
    command = [str(ROOT / ".venv/bin" / words[0]) if words[0] == "trifinger" else words[0]]
    return subprocess.run(
        [*command, *words[1:], "--help"],
        cwd=ROOT,
        env={**os.environ, "COLUMNS": "100"},
        capture_output=True,
        check=True,
        text=True,
    ).stdout


def subcommands(text: str) -> Iterator[str]:
    """Yields the names of the commands that a help lists."""
    for block in LIST.findall(text):
        yield from (name for name, _ in ENTRY.findall(block))


def sections(words: list[str], text: str, help_of: Help, depth: int = 1) -> str:
    """Returns the help of a command, followed by those of its subcommands."""
    name = " ".join(words)
    label = "-".join(words).replace("./", "")
    shown = f"({label})=\n{'#' * depth} `{name}`\n\n```text\n{text.strip()}\n```\n\n"
    for each in subcommands(text):
        shown += sections([*words, each], help_of([*words, each]), help_of, depth + 1)
    return shown


def pages(help_of: Help = run_help) -> Pages:
    """Returns the pages of all programs: one for each command of `trifinger`, and `./run`."""
    whole = help_of(["trifinger"])
    names = list(subcommands(whole))
    with ThreadPoolExecutor(2) as pool:
        texts = list(pool.map(lambda name: help_of(["trifinger", name]), names))
    result = {
        f"{FOLDER}/{name}": ORPHAN + sections(["trifinger", name], text, help_of)
        for name, text in zip(names, texts, strict=True)
    }
    links = {f"trifinger {name}": f"{FOLDER}/{name}" for name in names}
    links["./run"] = f"{FOLDER}/run_verbs"
    result[links["./run"]] = ORPHAN + sections(["./run"], help_of(["./run"]), help_of)
    text = f"What the programs say about themselves.\n\n```text\n{whole.strip()}\n```"
    result[f"{FOLDER}/index"] = f"# Programs\n\n{text}\n\n{list_of(links)}\n"
    return result
