# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger view`: a page that shows a running robot or a log.

`scene` makes plain data of the model in a session and `frame` of its elements; neither knows where
a frame comes from or who draws it. `live` observes a running robot, `logged` reads a log. `page`
shows frames in a browser, behind `gate`. `html_file` writes one file that needs no server.
"""
