# SPDX-License-Identifier: BSD-3-Clause
"""Builds the documentation site into build/docs/html and tests it."""

import os
import shutil
import tomllib

from tracked_files import public_header, tracked_files

from .build import build, jobs
from .counting import Count
from .setup import PYTHON, install_debian_packages, setup
from .steps import ROOT, StepFailed, Steps

FOLDER = ROOT / "build" / "docs"
PACKAGES = FOLDER / "packages"
PINS = PACKAGES / "pins"
DEBIAN_PACKAGES = ("doxygen", "graphviz")


def docs() -> int:
    """Builds the site, runs its pages, and tests it in a browser."""
    setup()
    build("release", "apps/all", "bindings/all")
    count = Count()
    pages = run_pages(count)
    build_site()
    page = FOLDER / "html" / "index.html"
    print(f"    {page.relative_to(ROOT)}")
    return 0 if look_at_site(count) and pages else 1


def run_pages(count: Count) -> bool:
    """Runs pages and notebooks, whose pictures the site then shows."""
    pytest = [PYTHON, "-m", "pytest", "-n", str(jobs()), "--dist", "worksteal"]
    files = ["tests/python/test_pages.py", "tests/python/test_notebooks.py"]
    return count.pytest(Steps("docs"), "pages are run", [*pytest, *files]).succeeded


def build_site() -> None:
    """Builds the site; a warning is an error.

    Raises:
        StepFailed: if a package cannot be installed, a link leads nowhere, or anything else is
            wrong with a page
    """
    steps = Steps("docs")
    install_debian_packages(steps, DEBIAN_PACKAGES)
    install_python_packages(steps)
    if comments_have_changed():
        steps.run("comments of C++", ["doxygen", "docs/Doxyfile"])
    path = os.pathsep.join([str(PACKAGES), str(ROOT / "tools"), str(ROOT / "benchmarks")])
    steps.run("pages", [PYTHON, "-m", "website", "build/docs/source"], PYTHONPATH=path)
    # Sphinx forgets index entries of pages that it does not write again: a search would miss them.
    sphinx = [PYTHON, "-m", "sphinx", "--write-all", "--fail-on-warning", "--keep-going"]
    folders = ["-c", "docs", "-d", "build/docs/doctrees", "build/docs/source", "build/docs/html"]
    site = steps.check("site", [*sphinx, *folders], PYTHONPATH=path)
    if not site.succeeded:  # Sphinx would not say again what is wrong with a page that it has read
        shutil.rmtree(FOLDER / "doctrees", ignore_errors=True)
        raise StepFailed


def comments_have_changed() -> bool:
    """Says whether a header is newer than what Doxygen has read; Sphinx reads that anew."""
    index = FOLDER / "doxygen" / "xml" / "index.xml"
    headers = filter(public_header, tracked_files(".hpp"))
    sources = [ROOT / "docs" / "Doxyfile", *(ROOT / header for header in headers)]
    newest = max(source.stat().st_mtime for source in sources)
    return not index.exists() or index.stat().st_mtime < newest


def look_at_site(count: Count) -> bool:
    """Follows all links, and searches in a browser."""
    pytest = [PYTHON, "-m", "pytest", "tests/site"]
    return count.pytest(Steps("docs"), "links and search", pytest).succeeded


def install_python_packages(steps: Steps) -> None:
    """Installs Sphinx beside .venv, which stays as it is for everything else."""
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text())
    packages = pyproject["dependency-groups"]["docs"]
    wanted = "\n".join([*packages, ""])
    if not PINS.exists() or PINS.read_text() != wanted:
        pip = [PYTHON, "-m", "pip", "install", "--disable-pip-version-check", "--upgrade"]
        steps.run("Python packages of the site", [*pip, "--target", str(PACKAGES), *packages])
        PINS.write_text(wanted)
