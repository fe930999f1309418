# SPDX-License-Identifier: BSD-3-Clause
"""The plot of what `trifinger manipulate` has written, for skills of any phases and columns."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trifinger.log.manipulation import Trace, colours_of, draw_line, save_report

matplotlib_figure = pytest.importorskip("matplotlib.figure")

POSES = [f"{kind}_{part}" for kind in ("desired", "estimated") for part in "xyz"]
QUATERNIONS = [f"{kind}_q{part}" for kind in ("desired", "estimated") for part in "wxyz"]


def invented_trace(folder: Path, phases: list[str], forces: bool, **report: object) -> Trace:
    """A trace with 20 rows for each of these phases, with or without the tips' forces."""
    folder.mkdir()
    columns = ["step", "phase", *POSES, *QUATERNIONS, "torque_share", "cycle_time"]
    if forces:
        columns += [f"{kind}_{i}" for kind in ("normal", "tangential") for i in range(3)]
    rows = [",".join(columns)]
    for step, phase in enumerate(np.repeat(phases, 20)):
        numbers = [0.01 * np.sin(step / 9), 0.01 * np.cos(step / 9), 0.02] * 2
        numbers += [1.0, 0.0, 0.0, 0.0] * 2
        numbers += [0.5] * (len(columns) - 2 - len(numbers))
        rows.append(",".join([str(10 * step), str(phase), *map(str, numbers)]))
    (folder / "trace.csv").write_text("\n".join(rows) + "\n")
    common = {"period": 1e-3, "task": "juggle", "is_done": True, "failure": ""}
    (folder / "report.json").write_text(json.dumps({**common, **report}))
    return Trace(folder)


@pytest.mark.parametrize(
    ("forces", "report", "panels"),
    [
        (False, {}, 3),
        (True, {"position_rms": 1e-3, "orientation_rms": 0.01}, 5),
        (False, {"nib_reach": 0.065}, 4),
    ],
)
def test_there_is_a_panel_for_what_the_table_has(
    forces: bool,
    report: dict[str, float],
    panels: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    saved: list[int] = []
    save = matplotlib_figure.Figure.savefig

    def note(self: Any, path: Path, **settings: Any) -> None:
        saved.append(len(self.axes))
        save(self, path, **settings)

    monkeypatch.setattr(matplotlib_figure.Figure, "savefig", note)
    phases = ["look", "grasp", "juggle", "draw", "done"]
    trace = invented_trace(tmp_path / "report", phases, forces, **report)
    save_report(trace, tmp_path / "report.png")
    assert saved == [panels]
    assert (tmp_path / "report.png").stat().st_size > 0


def test_a_phase_has_the_same_colour_whenever_it_comes() -> None:
    colours = colours_of(["grasp", "draw", "lift", "draw", "release"])
    assert list(colours) == ["grasp", "draw", "lift", "release"]
    assert colours["draw"] != colours["lift"]
    many = [f"phase {i}" for i in range(40)]
    assert set(colours_of(many)) == set(many)


def test_a_drawn_line_is_where_the_nib_was(tmp_path: Path) -> None:
    trace = invented_trace(tmp_path / "drawn", ["grasp", "draw"], forces=False, nib_reach=0.065)
    axes = matplotlib_figure.Figure().subplots()
    draw_line(axes, trace)
    # The stick is not turned, so the nib is 65 mm from its centre along x. Phase "draw" counts.
    x = np.array(axes.get_lines()[0].get_xdata(), dtype=float)
    assert np.isnan(x[:20]).all()
    np.testing.assert_allclose(x[20:], 1e2 * (trace.columns["desired_x"][20:] + 0.065))
