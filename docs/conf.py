# SPDX-License-Identifier: BSD-3-Clause
"""Settings of Sphinx for the documentation site. tools/website writes its sources: `./run docs`."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

project = "TriFinger"
author = "the TriFinger contributors"
extensions = ["myst_nb", "breathe", "sphinx.ext.graphviz"]
templates_path: list[str] = []
html_theme = "furo"
html_title = "TriFinger"
html_static_path = [str(ROOT / "docs/static")]
html_extra_path = [str(ROOT / "build/docs/extra")]
html_css_files = ["site.css"]
html_search_scorer = str(ROOT / "docs/static/scorer.js")
html_copy_source = False
html_show_sphinx = False
html_permalinks_icon = "#"
pygments_style = "tango"
pygments_dark_style = "native"
highlight_language = "none"
maximum_signature_line_length = 80
add_module_names = False
toc_object_entries_show_parents = "hide"
graphviz_output_format = "svg"
GREY = "#7f7f7f"  # to be read on white and on black
graphviz_dot_args = [
    *("-Gbgcolor=transparent", "-Nfontname=sans-serif", "-Efontname=sans-serif"),
    *(f"-{what}{colour}={GREY}" for what in "NE" for colour in ("color", "fontcolor")),
]

nb_execution_mode = "off"  # tests/python/test_notebooks.py carries them out
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 4
suppress_warnings = [
    "duplicate_declaration.cpp",  # each header names its namespace
    "myst.header",  # a page may begin with a deeper heading
    "ref.python",  # a short name in an annotation may mean one of several classes
]

breathe_projects = {"trifinger": str(ROOT / "build/docs/doxygen/xml")}
breathe_default_project = "trifinger"
breathe_default_members = ("members",)
breathe_show_include = False
