# SPDX-License-Identifier: BSD-3-Clause
"""Takes the pages of the repository over to the site, where links lead to pages of the site.

A page of docs/ keeps its name. Every other file that a page links to gets a page that shows it:
for a public header that is its reference, for a folder the list of its files.
"""

import re
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

from tracked_files import ROOT, public_header, tracked_files

LINK = re.compile(r"\]\((?P<path>[^)\s#]+)(?P<anchor>#[^)\s]*)?\)")
# What tests/python/pages.py does with a block: a file to be saved, an output, and so on.
FENCE = re.compile(r"^```(\w+) ([^\n]+)$", re.MULTILINE)
COPIED = (".png", ".jpg", ".svg", ".ipynb")  # taken over as they are
# Where the newest files of these folders are, if the tests have made them.
MADE = {
    Path("docs/images/tutorials"): ROOT / "build/docs/pictures",
    Path("docs/notebooks"): ROOT / "build/docs/notebooks",
}
LANGUAGES = {
    ".cpp": "cpp",
    ".hpp": "cpp",
    ".py": "python",
    ".sh": "bash",
    ".toml": "toml",
    ".xml": "xml",
    ".yml": "yaml",
}

# The side bar has no pages below a reference: with them, it would be most of each page.
ORPHAN = "---\norphan: true\n---\n"
NOT_SEARCHED = "---\norphan: true\nnosearch: true\n---\n"

Pages = dict[str, str]
"""Texts by the names of pages, without `.md`."""
Copies = dict[str, Path]
"""Files by their places on the site."""


def name_of(path: Path) -> str:
    """Returns the name on the site of a file or folder of the repository."""
    if header := public_header(path):
        return f"reference/cpp/{header.removesuffix('.hpp')}"
    if path.suffix == ".md" and path.parts[0] == "docs":
        return str(path.relative_to("docs").with_suffix(""))
    if path.name == "README.md":
        return str(path.parent) if path.parent.parts else "readme"
    if path.suffix == ".md" and len(path.parts) == 1:
        return path.stem.lower()
    if path == Path("docs/decisions"):
        return "decisions/index"
    return f"source/{path}" if (ROOT / path).is_file() else f"source/{path}/index"


def repository_path(target: str, document: Path) -> Path | None:
    """Returns what of the repository a link in `document` leads to; None for other links."""
    path = (ROOT / document.parent / target).resolve()
    inside = path.is_relative_to(ROOT) and path.exists() and not re.match(r"\w+:", target)
    return path.relative_to(ROOT) if inside else None


def with_links_of_the_site(text: str, document: Path, linked: set[Path]) -> str:
    """Returns the text of `document` with links to pages, and adds what they show to `linked`."""

    def rewritten(link: re.Match[str]) -> str:
        path = repository_path(link["path"], document)
        if path is None:
            return link[0]
        linked.add(path)
        return f"]({place_of(path)}{link['anchor'] or ''})"

    return LINK.sub(rewritten, FENCE.sub(with_caption, text))


def with_caption(fence: re.Match[str]) -> str:
    """Returns the beginning of a block that shows what a reader does with it."""
    language, use = fence[1], fence[2]
    if use.startswith("output"):
        return f"```{{code-block}} {language}\n:class: output\n"
    if use == "stays":
        return f"```{{code-block}} {language}\n:caption: keeps running in a terminal of its own\n"
    if use.startswith(("typed", "tests/", "packages/", "needs ")):
        return f"```{language}"
    return f"```{{code-block}} {language}\n:caption: {use}\n"


def linked_sources(text: str) -> set[Path]:
    """Returns the files that a page of the site shows by links to their pages."""
    return {Path(link) for link in re.findall(r"\]\(/source/(\S+?)\.md[)#]", text)}


def copied_name(path: Path) -> str:
    """Returns the place on the site of a file that is taken as it is."""
    return str(path.relative_to("docs") if path.parts[0] == "docs" else path)


def place_of(path: Path) -> str:
    """Returns where a link to a file or folder of the repository leads on the site."""
    return f"/{copied_name(path)}" if path.suffix in COPIED else f"/{name_of(path)}.md"


def documents() -> list[Path]:
    """Returns the pages of the repository that the site has."""
    return [
        path
        for path in tracked_files(".md")
        if path.parts[0] in ("docs", "benchmarks", "packages") or len(path.parts) == 1
    ]


def pages_of(documents: Iterable[Path]) -> tuple[Pages, set[Path]]:
    """Returns the pages of the site for `documents`, and all files and folders they link to."""
    linked: set[Path] = set()
    pages = {
        name_of(path): with_links_of_the_site((ROOT / path).read_text(), path, linked)
        for path in documents
    }
    return pages, linked


def shown_files(linked: Iterable[Path]) -> Pages:
    """Returns pages that show linked files and list linked folders; they are not searched."""
    pages: Pages = {}
    waiting = [path for path in linked if name_of(path).startswith("source/")]
    for path in waiting:
        if (ROOT / path).is_dir():
            files = [file for file in tracked_files() if file.is_relative_to(path)]
            waiting.extend(file for file in files if name_of(file).startswith("source/"))
            links = (f"- [{file.relative_to(path)}]({place_of(file)})" for file in files)
            body = "\n".join(links)
        elif path.suffix in COPIED:
            continue
        else:
            language = LANGUAGES.get(path.suffix, "text")
            body = f"``````{language}\n{(ROOT / path).read_text()}\n``````"
        pages[name_of(path)] = f"{NOT_SEARCHED}# `{path}`\n\n{body}\n"
    return pages


def with_entries(text: str, words: Iterable[str]) -> str:
    """Returns a page that a search for these words finds, though the page may not have them.

    They are entries of the index, which a search shows first, and each word is a keyword.
    """
    words = list(words)
    entries = ", ".join(f"! {each}" for each in words)
    keywords = ", ".join(sorted({word for each in words for word in re.findall(r"\w+", each)}))
    text = re.sub(r"(?m)^# .*$", rf"\g<0>\n\n```{{index}} {entries}\n```", text, count=1)
    return f"---\nmyst:\n  html_meta:\n    keywords: {keywords}\n---\n{text}"


def list_of(pages: Mapping[str, str]) -> str:
    """Returns a list of links to pages, which have these titles."""
    return "\n".join(f"- [`{title}`](/{name}.md)" for title, name in pages.items())


def contents_of(folder: str, title: str, text: str, pages: Iterable[str]) -> Pages:
    """Returns the page of a folder: a title, a text, and the list of the pages in it."""
    entries = "\n".join(f"/{page}" for page in pages)
    tree = f"```{{toctree}}\n:maxdepth: 1\n\n{entries}\n```"
    return {f"{folder}/index": f"# {title}\n\n{text}\n\n{tree}\n"}


def newest(path: Path) -> Path:
    """Returns what a tutorial or notebook has just made, or what is kept."""
    made = MADE.get(path.parent, ROOT / path.parent) / path.name
    return made if made.exists() else ROOT / path


def copies_of(paths: Iterable[Path]) -> Copies:
    """Returns the newest of these files of the repository by their places on the site."""
    return {copied_name(path): newest(path) for path in paths}


def write(pages: Pages, copies: Copies, folder: Path) -> None:
    """Writes pages and copies below `folder`, and removes what is no longer there.

    A page that stays the same keeps its time, so Sphinx does not read it again.
    """
    texts = {folder / f"{name}.md": text for name, text in pages.items()}
    files = {folder / place: source for place, source in copies.items()}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path not in texts and path not in files:
            path.unlink()
    for path, text in texts.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
    for path, source in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, path)
