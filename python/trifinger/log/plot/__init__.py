# SPDX-License-Identifier: BSD-3-Clause
"""Plots of sessions of any robot, as a picture or as a page in which one can zoom."""

from pathlib import Path

from trifinger import extras
from trifinger._trifinger import Log
from trifinger.errors import InvalidArgument
from trifinger.log.steps import step_range
from trifinger.whole_file import whole_file


def plot(
    log: Log,
    path: Path,
    robot: str = "",
    begin: float | None = None,
    end: float | None = None,
) -> None:
    """Draws the newest session of `robot` into a file: .png, .svg, .pdf, or a page as .html."""
    if path.suffix not in (".png", ".svg", ".pdf", ".html"):
        raise InvalidArgument(f"{path} must end in .png, .svg, .pdf or .html")
    session = log.session(robot)
    steps = step_range(session, begin, end)
    if path.suffix == ".html":
        from trifinger.log.plot.page import page

        text = page(log, session, *steps)
        with whole_file(path) as part:
            part.write_text(text, encoding="utf-8")
        return
    extras.require("plot", "matplotlib")
    from trifinger.log.plot.matplotlib_figure import draw

    figure = draw(log, session, *steps)
    with whole_file(path) as part:
        figure.savefig(part, dpi=120)
