# SPDX-License-Identifier: BSD-3-Clause
"""The page of `trifinger log plot -o run.html`: one file, in which one can zoom.

The page needs no server and no network: it contains Plotly and the numbers. For each line it holds
the smallest and the largest number of up to 100 000 stretches of time. Zooming draws the visible
part again from these numbers, as the smallest and the largest number of as many stretches as a
screen shows. So no peak is ever lost, and a log of hours does not make a larger page.
"""

import html
from pathlib import Path

from trifinger import extras
from trifinger._trifinger import Log, LoggedSession
from trifinger.log.plot.panels import Contents, contents_of, title_of
from trifinger.log.plot.plotly_figure import PlotlyFigure

MAX_NUMBERS = 8_000_000  # limit for all lines of a page
MAX_STRETCHES = 100_000  # limit for a line
FOLDER = Path(__file__).parent


def stretches_of(session: LoggedSession) -> int:
    """How many stretches of each line a page holds at most."""
    numbers = 0
    for dtype in (session.observation_dtype, session.action_dtype, session.applied_action_dtype):
        numbers += dtype.itemsize // 8
    return min(MAX_STRETCHES, max(2000, MAX_NUMBERS // (2 * max(numbers, 1))))


def facts_of(session: LoggedSession, contents: Contents) -> str:
    """The headline and the texts above the figure, as HTML."""
    curves = contents.curves
    headline, facts = title_of(curves)
    per_stretch = -(-(curves.last - curves.first) // curves.bins)
    if curves.bins < curves.last - curves.first:
        held = (
            f"For each line the page holds the smallest and the largest number of {curves.bins} "
            f"stretches of up to {per_stretch} steps, and draws those of as many as a screen shows."
        )
    else:
        held = (
            "The page holds every step; where there are more than a screen shows, the smallest and "
            "the largest number of each stretch are drawn."
        )
    fault = session.fault
    bad = ""
    if fault is not None and fault.needs_recovery:
        bad = f'<p class="bad">{html.escape(session.fault_text)}</p>'
    return (
        f"<h1>{html.escape(headline)}</h1>\n<p>{html.escape(facts)}</p>\n{bad}\n"
        f"<p>{html.escape(contents.left_out)}</p>\n"
        f"<p>Drag to zoom, double-click to see all; a click on a name in the legend hides its "
        f'lines. {held}</p>\n<p class="bad" id="error"></p>'
    )


def tables_of(log: Log, session: LoggedSession) -> str:
    """Tables of what the log holds besides numbers: origin, gaps, damage, events, documents."""
    rows = [
        ("files", ", ".join(path.name for path in log.files)),
        ("recorded by", f"trifinger {log.origin.get('trifinger_version', 'unknown')}"),
        ("host", session.host),
        ("end", session.fault_text or "went on when the recording ended"),
        *(("gap", f"steps {gap.first} to {gap.last}: {gap.reason}") for gap in session.gaps),
        *(("damage", damage.reason) for damage in log.damage),
        *((event.level, f"{event.source}: {event.text}") for event in log.events),
    ]
    table = "\n".join(
        f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
        for name, value in rows
    )
    documents = "\n".join(
        f"<details><summary>{html.escape(name)}</summary><pre>{html.escape(value)}</pre></details>"
        for name, value in session.documents.items()
    )
    return f"<table>\n{table}\n</table>\n{documents}"


def page(log: Log, session: LoggedSession, first: int | None, last: int | None) -> str:
    """The whole page, as HTML."""
    extras.require("plot", "plotly")  # before the log is read, which may take long
    contents = contents_of(log, session, first, last, stretches_of(session))
    figure = PlotlyFigure(contents)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{html.escape(session.name)}: {html.escape(log.files[0].name)}</title>
<style>{(FOLDER / "page.css").read_text()}</style>
</head>
<body>
{facts_of(session, contents)}
{figure.numbers.to_html()}
{figure.to_html((FOLDER / "page.js").read_text())}
{tables_of(log, session)}
</body>
</html>
"""
