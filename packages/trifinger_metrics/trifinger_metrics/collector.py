# SPDX-License-Identifier: BSD-3-Clause
"""What a scrape gets: everything is read when it is asked for."""

import threading
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from importlib import resources
from pathlib import Path
from typing import Any

import trifinger
from prometheus_client import metrics_core
from trifinger.session_info import session_folder

from trifinger_metrics.files import Files
from trifinger_metrics.robots import Robot

UNITS = ("bytes", "joules", "ratio", "seconds")


@cache
def table() -> dict[str, dict[str, tuple[str, str]]]:
    """The labels and the help of each metric, by its type and its name in metrics.toml."""
    text = (resources.files("trifinger_metrics") / "metrics.toml").read_text()
    return tomllib.loads(text)


def families() -> dict[str, Any]:
    """All metrics without samples, by their names in metrics.toml."""
    made = {}
    for kind, metrics in table().items():
        family = getattr(metrics_core, f"{kind}MetricFamily")
        for name, (labels, about) in metrics.items():
            made[name] = family(f"trifinger_{name}", about, labels=labels.split())
            unit = name.rpartition("_")[2]
            made[name].unit = unit if unit in UNITS else ""
    return made


class Collector:
    """Reads robots, recordings and jobs at each scrape, and nothing between scrapes.

    `names` are robots, by default all of this machine. `logs` and `jobs` are folders, as for
    `Files`. What cannot be read is counted, and `report` gets a sentence about it, once.
    """

    def __init__(
        self,
        names: Sequence[str] = (),
        logs: Iterable[Path] = (),
        jobs: Iterable[Path] = (),
        report: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._names = names
        self._robots: dict[str, Robot] = {}
        self._files = Files(names, logs, jobs)
        self._report = report
        self._errors = Counter(dict.fromkeys(("session", "recording", "job"), 0))
        self._reported: set[str] = set()
        self._lock = threading.Lock()

    def describe(self) -> Iterable[metrics_core.Metric]:
        """The metrics without samples, so that a registry need not read anything."""
        return families().values()

    def collect(self) -> Iterable[metrics_core.Metric]:
        """Reads everything. Never raises."""
        made = families()

        def add(name: str, value: Any, *labels: str, **sums: float) -> None:
            made[name].add_metric(labels, value, **sums)

        with self._lock:
            self._guard("session", partial(self._read_robots, add))
            self._guard("job", partial(self._files.read, add, self._guard))
            for source, count in self._errors.items():
                add("read_errors", count, source)
        return made.values()

    def _guard(self, source: str, work: Callable[[], None]) -> None:
        try:
            work()
        except (trifinger.SessionNotFound, trifinger.RobotStopped, FileNotFoundError):
            pass  # it ended, or the next session began, while it was read
        except Exception as error:  # whatever others have written, a scrape does not fail
            self._errors[source] += 1
            sentence = f"{source}: {error}"
            if sentence not in self._reported and len(self._reported) < 100:
                self._reported.add(sentence)
                self._report(sentence)

    def _read_robots(self, add: Callable[..., None]) -> None:
        listed = [info.name for info in trifinger.list_sessions()]
        found = {path.name.split(".")[1] for path in session_folder().glob("trifinger.*.state")}
        for name in sorted(set(self._names) or found):
            if name not in found:
                add("up", 0, name)
                continue
            robot = self._robots.setdefault(name, Robot(name))
            companions = [one.partition(".")[2] for one in listed if one.startswith(f"{name}.")]
            self._guard("session", partial(robot.read, add, companions, self._guard))
