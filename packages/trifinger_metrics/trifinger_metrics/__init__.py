# SPDX-License-Identifier: BSD-3-Clause
"""Robots, recorders, cameras and jobs of a machine for Prometheus.

`metrics.toml` lists all metrics. `robots` reads sessions in shared memory, `files` recordings,
jobs and their locks, and `collector` calls both at each scrape. `for_prometheus` has alert rules
and a dashboard for Grafana.
"""

from importlib.util import find_spec

if find_spec("trifinger") is None:
    raise ModuleNotFoundError(
        "trifinger-metrics needs the package `trifinger`, which is not installed and on no "
        "index: install it from its sources or its wheel, as docs/installing.md says",
        name="trifinger",
    )
