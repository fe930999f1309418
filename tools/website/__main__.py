# SPDX-License-Identifier: BSD-3-Clause
"""Writes the sources of the site into a folder: python -m website FOLDER."""

import re
import shutil
import sys
from pathlib import Path

from tracked_files import ROOT, tracked_files

from . import configuration, cpp_reference, faults, figures, films, programs, python_reference
from .contents import CONTENTS, SEARCHED
from .pages import (
    COPIED,
    Copies,
    Pages,
    contents_of,
    copies_of,
    documents,
    linked_sources,
    pages_of,
    shown_files,
    with_entries,
    write,
)


def reference() -> Pages:
    """Returns all pages that are made of headers, stubs, programs, configurations and faults."""
    return {
        **python_reference.pages(python_reference.modules()),
        **cpp_reference.pages(),
        **programs.pages(),
        **configuration.pages(),
    }


STILL = re.compile(r"!\[([^\]]*)\]\(/(images/films/\w+)\.jpg\)")
FILM = (
    r'<video src="\2.webm" poster="\2.jpg" aria-label="\1" autoplay loop muted playsinline></video>'
)
LOG_PAGE = re.compile(r"\[!\[([^\]]*)\]\([^)]*log\.jpg\)\]\([^)]*\)")
LOG_FRAME = r'<iframe src="log.html" title="\1" loading="lazy"></iframe>'


def home(text: str) -> str:
    """Returns the first page with a log to play with, followed by the lists of the side bar."""
    text = LOG_PAGE.sub(LOG_FRAME, text)
    for caption, names in CONTENTS.items():
        entries = "\n".join(name if "<" in name else f"/{name}" for name in names)
        text += f"\n```{{toctree}}\n:hidden:\n:caption: '{caption}'\n\n{entries}\n```\n"
    return text


def site() -> tuple[Pages, Copies]:
    """Returns all pages of the site, and the files that it takes as they are."""
    generated = reference()
    pages, linked = pages_of(documents())
    generated["faults"] = faults.page()
    plots = ROOT / "build/docs/figures"
    shutil.rmtree(plots, ignore_errors=True)
    generated["figures"] = figures.page(plots)
    linked |= linked_sources("".join(generated.values()))
    pages["index"] = home(pages["index"])
    for name in ("index", "skills", "training"):
        pages[name] = STILL.sub(FILM, pages[name])
    pages["configuration"] = configuration.without_table(pages["configuration"])
    for name, words in SEARCHED.items():
        pages[name] = with_entries(pages[name], words)
    folders = {
        "decisions": ("Decisions", "Why things are as they are: requirement, options, choice."),
        "results": ("Results", "Experiments, each repeated by `./run evaluate`."),
        "packages": ("Packages", "Distributions that are installed on their own."),
    }
    for folder, (title, text) in folders.items():
        names = sorted(name for name in pages if name.startswith(f"{folder}/"))
        pages |= contents_of(folder, title, text, names)
    copies = copies_of(path for path in linked if path.suffix in COPIED)
    copies |= copies_of(tracked_files(".ipynb"))
    copies |= {f"figures/{plot.name}": plot for plot in plots.glob("*.svg")}
    return pages | generated | shown_files(linked), copies


def write_extra(folder: Path) -> None:
    """Writes what the site has as it is beside its pages: films, and a log to play with."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(films.FOLDER, folder / "images/films")
    films.log_page(folder / "log.html")


if __name__ == "__main__":
    write_extra(ROOT / "build/docs/extra")
    cpp_reference.tidy(ROOT / "build/docs/doxygen/xml")
    write(*site(), ROOT / sys.argv[1])
