# SPDX-License-Identifier: BSD-3-Clause
"""Writes manual pages of `trifinger` and its commands, made of what --help prints.

    tools/manual_pages.py FOLDER

It asks the `trifinger` of .venv, and writes the pages of the commands that are compiled
with it, compressed as Debian wants them. Helps have the form of docs/decisions/command_line.md.
The pages have the date of SOURCE_DATE_EPOCH, so the same commit gives the same bytes.
"""

import gzip
import os
import re
import sys
import textwrap
import tomllib
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from website.programs import run_help

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "Python package "
COMPILED = ("Commands", "Programs of their own")
LIST = re.compile(rf"(Arguments|Options|{'|'.join(COMPILED)}|{PACKAGE}.*|Not installed.*):\n")
ROW = re.compile(r"^  (\S.*?)(?:  +|\n {30})(.*(?:\n {30}.*)*)", re.MULTILINE)
EXAMPLES = re.compile(r"^Examples?:\n((?:  .*\n)+)", re.MULTILINE)
EXIT_STATUS = {
    "0": "The command has done what it was asked to do.",
    "1": "It has failed. A sentence on standard error says what happened and what to do.",
    "2": "It was called in a wrong way. A sentence on standard error says what would be right.",
    "130": "Ctrl-C has ended it, unless the notes say what Ctrl-C does.",
}
ENVIRONMENT = {
    "TRIFINGER_CONFIG_DIR": "A folder of configurations that are found by name, before others.",
    "TRIFINGER_LOG_DIR": "The folder for the logs of faults; default: ~/.local/state/trifinger.",
}

Words = tuple[str, ...]
"""A command, such as ("trifinger", "log", "info")."""
Rows = Mapping[str, str]
"""Descriptions by what is described."""


@dataclass(frozen=True)
class Command:
    """A command, and the parts of its help."""

    words: Words
    summary: str
    """What the help of the command above says of it."""
    package: str
    """The Python package that brings it; empty: it is compiled with `trifinger`."""
    usage: str
    about: str
    lists: Mapping[str, Rows]
    """By headings such as "Options"."""
    notes: str
    examples: str

    @staticmethod
    def parsed(words: Words, summary: str, package: str, text: str) -> "Command":
        """Takes a help apart."""
        usage, *blocks = re.split(r"\n\n+", text.rstrip("\n"))
        lists: dict[str, Rows] = {}
        texts = ["", ""]  # before the lists, and after them
        for block in blocks:
            if heading := LIST.match(block):
                rows = ROW.findall(block[heading.end() :])
                lists[heading[1]] = {name: " ".join(told.split()) for name, told in rows}
            else:
                texts[bool(lists)] += f"{block}\n\n"
        about, rest = texts
        parts = (about, lists, EXAMPLES.sub("", rest), "".join(EXAMPLES.findall(rest)))
        return Command(words, summary, package, usage.removeprefix("Usage: "), *parts)


def commands(packages: Collection[str], help_of: Callable[[Words], str]) -> list[Command]:
    """Returns `trifinger` with the commands that are compiled, and those of Python packages."""
    top = ("trifinger",)
    about = "control the TriFinger and other robots at 1 kHz"
    level = [Command.parsed(top, about, "", help_of(top))]
    found = list(level)
    with ThreadPoolExecutor() as pool:
        while level:
            below = [
                ((*above.words, name), summary, package)
                for above in level
                for heading, rows in above.lists.items()
                for package in [heading.removeprefix(PACKAGE)]
                if heading in COMPILED or package in packages
                for package in [above.package if heading in COMPILED else package]
                for name, summary in rows.items()
            ]
            texts = pool.map(help_of, [words for words, *_ in below])
            level = [Command.parsed(*each, text) for each, text in zip(below, texts, strict=True)]
            found += level
    return found


def escaped(text: str) -> str:
    """Returns a text that troff prints as it is."""
    names: dict[str, str | int | None] = {
        "\\": "\\e",
        "-": "\\-",
        "'": "\\(aq",
        "`": "\\(ga",
        "^": "\\(ha",
        "~": "\\(ti",
    }
    return text.translate(str.maketrans(names))


def lines(texts: Collection[str]) -> str:
    """Returns lines of which none is taken for a request to troff."""
    return "".join(f"\\&{text}\n" if text.startswith(".") else f"{text}\n" for text in texts)


def filled(text: str) -> str:
    """Returns a paragraph."""
    return lines(textwrap.wrap(escaped(text), 78, break_on_hyphens=False, break_long_words=False))


def typed(text: str) -> str:
    """Returns what a user types: bold, and in italics the words in capitals, which he replaces."""
    parts = re.split(r"(\b(?:[A-Z][A-Z_]+|N)\b)", text)
    return "".join(f"\\f{'BI'[i % 2]}{escaped(part)}\\fR" for i, part in enumerate(parts) if part)


def entries(rows: Rows) -> str:
    """Returns a list of names with their descriptions."""
    return "".join(f".TP\n{typed(name)}\n{filled(text)}" for name, text in rows.items())


def paragraphs(text: str) -> str:
    """Returns paragraphs; lines that are indented stay as they are."""
    page = ""
    text = re.sub(r"(?m)^(\S.*:\n)(?= )", r"\n\1", text)  # the title of what follows
    for block in re.findall(r"(?:^ .*\n)+|(?:^\S.*\n)+", text, re.MULTILINE):
        kept = lines(escaped(textwrap.dedent(block)).splitlines())
        page += f".RS\n.nf\n{kept}.fi\n.RE\n" if block[0] == " " else f".PP\n{filled(block)}"
    return page.removeprefix(".PP\n")


def page(command: Command, pages: Collection[Command], version: str, date: str) -> str:
    """Returns the page of a command; `pages` are all commands that have one."""
    name, summary = escaped("-".join(command.words)), escaped(command.summary)
    below = {each.words[-1]: each for each in pages if each.words[:-1] == command.words}
    told = f"{command.about} {command.notes} {command.lists.get('Options')}"
    related = sorted(
        "-".join(each.words)
        for each in pages
        if command.words[:-1] == each.words
        or each in below.values()
        or (each is not command and re.search(rf"'{' '.join(each.words)}[' ]", told))
    )
    sections = {
        "NAME": f"{name} \\- {summary[:1].lower()}{summary[1:]}\n",
        "SYNOPSIS": f"{typed(command.usage)}\n",
        "DESCRIPTION": paragraphs(command.about),
        "ARGUMENTS": entries(command.lists.get("Arguments", {})),
        "OPTIONS": entries(command.lists.get("Options", {})),
        "COMMANDS": entries({word: each.summary for word, each in below.items()}),
        "NOTES": paragraphs(command.notes),
        "EXIT STATUS": entries(EXIT_STATUS),
        "ENVIRONMENT": entries(ENVIRONMENT) if len(command.words) == 1 else "",
        "EXAMPLES": paragraphs(command.examples),
        "SEE ALSO": ",\n".join(f".BR {escaped(each)} (1)" for each in related) + "\n",
    }
    header = f'.TH {name.upper()} 1 {date} "TriFinger {version}" "User Commands"\n.nh\n.ad l\n'
    return header + "".join(f".SH {title}\n{text}" for title, text in sections.items() if text)


def pages(
    packages: Collection[str] = ("",), help_of: Callable[[Words], str] = run_help
) -> dict[str, str]:
    """Returns manual pages by the names of their files.

    Args:
        packages: Python packages whose commands get one; "" is what is compiled
        help_of: what a command prints when it is asked for help
    """
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))
    date = f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d}"
    found = commands(packages, help_of)
    return {
        f"{'-'.join(command.words)}.1": page(command, found, version, date)
        for command in found
        if command.package in packages
    }


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages().items():
        (folder / f"{name}.gz").write_bytes(gzip.compress(text.encode(), 9, mtime=0))
