# SPDX-License-Identifier: BSD-3-Clause
"""People at a robot: they watch it, lead it by the hand, steer it, and play motions.

`trifinger view` is a page that shows a running robot or a log. `scene` makes plain data of the
model in a session and `frame` of its elements; neither knows where a frame comes from or who draws
it. `live` observes a running robot, `logged` reads a log. `to_browser` says what a browser is told,
and the scripts in `web` draw it. `page` tells it by a `page_server`, behind `authentication`;
`html_file` writes it into one file that needs no server. `bridges`, `teaching`, `teleoperation` and
`motion` have a module each.
"""

from importlib.util import find_spec

if find_spec("trifinger") is None:
    raise ModuleNotFoundError(
        "trifinger-view needs the package `trifinger`, which is not installed and on no "
        "index: install it from its sources or its wheel, as docs/installing.md says",
        name="trifinger",
    )

PAGE = ("trifinger-view", "PIL", "websockets")
"""What a page needs, for `trifinger.extras.require`."""
