# SPDX-License-Identifier: BSD-3-Clause
"""Evaluations of trainings: their tables show the results, also of trainings that failed."""

import dataclasses
import resource
import subprocess
import sys

import move_cube
import numpy as np
import pytest
from trifinger.evaluation import Evaluation, Summary

import learning


def summary(median):
    return Summary(
        episodes=50, lower_quartile=0.0, median=median, upper_quartile=1.0, largest=1.0, success=0.5
    )


def runs(**changes):
    figures = {"reach": 0.010, "reach_shared": 0.002, "early": 0.008, "as_built": 0.015}
    figures |= {"time": 270.0}
    figures |= changes
    return [
        learning.Run(
            kind,
            seed,
            [
                (0, summary(0.1)),
                (100, summary(figures["early"])),
                (700, summary(figures[kind.name])),
            ],
            {"as built": summary(figures["as_built"]), "worn": summary(0.03)},
            processor_time=figures["time"],
            wall_time=1000.0,  # beside others
        )
        for kind in learning.KINDS
        for seed in (1, 2, 3)
    ]


def test_the_table_holds_by_its_narrowest_row():
    rows = learning.table(runs())
    holds, line = learning.verdict(rows)
    assert holds
    assert line == (
        "The table holds: the narrowest, 'three fingers, one network: processor time', is "
        "270.00 s of 300 s, 10 % below."
    )
    assert len(rows) == 7
    page = learning.page(runs(), rows, 3)
    assert "| three fingers, one network: after 700 episodes | 1.2 cm | 1.00 cm |" in page
    assert (
        "| three fingers, one network | 1 | 0.80 | 1.00 | 100.00 | 50 | 1.50 | 50 | 3.00 | 50 "
        in page
    )


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"reach": 0.013}, "three fingers, one network: after 700 episodes"),
        ({"as_built": 0.021}, "three fingers, one network: on robots as built"),
        ({"reach_shared": 0.004}, "one policy shared by the fingers: after 700 episodes"),
        ({"early": 0.011}, "one policy shared by the fingers: after 100 episodes"),
        ({"time": 400.0}, "three fingers, one network: processor time"),
    ],
)
def test_what_does_not_hold_is_named(changes, what):
    holds, line = learning.verdict(learning.table(runs(**changes)))
    assert not holds
    assert f"'{what}'" in line
    assert line.endswith("% ABOVE.")


def test_the_median_of_the_seeds_counts():
    all_runs = runs()
    worse = dataclasses.replace(all_runs[2], curve=[(700, summary(0.5))])
    assert learning.verdict(learning.table([*all_runs[:2], worse, *all_runs[3:]]))[0]


def test_the_times_of_a_training_are_its_own(tmp_path, monkeypatch):
    """They leave out the processor time of this process and of others that ended earlier."""
    monkeypatch.setattr(learning, "RUNS", tmp_path)
    monkeypatch.setattr(learning, "read_curve", lambda _: [(learning.EPISODES, summary(0.01))])
    monkeypatch.setattr(learning, "judge", lambda _: {})
    burn = "import time\nwhile time.process_time() < 0.5: pass\n"
    subprocess.run([sys.executable, "-c", burn], check=True)
    kind = dataclasses.replace(learning.KINDS[0], words=("--help",))
    usage_before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = learning.train(kind, 1)
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = usage.ru_utime + usage.ru_stime - usage_before.ru_utime - usage_before.ru_stime
    assert run.processor_time == pytest.approx(spent, abs=1e-3)
    assert run.wall_time > 0.0


@pytest.mark.slow
def test_a_failed_training_names_its_log(tmp_path, monkeypatch):
    monkeypatch.setattr(learning, "RUNS", tmp_path)
    kind = dataclasses.replace(learning.KINDS[0], words=("--set", "gama=1"))
    with pytest.raises(SystemExit, match=str(tmp_path / "reach_1.log")):
        learning.train(kind, 1)
    assert "gama" in (tmp_path / "reach_1.log").read_text()


def test_pushes_are_told_by_how_far_the_cube_had_to_go():
    starts = np.array([[0.03, 0, 0], [0, 0.12, 0], [0, 0.14, 0], [0.25, 0, 0]])
    evaluation = Evaluation(
        distances=np.array([0.01, 0.01, 0.03, 0.2]),
        successes=np.array([True, True, False, False]),
        paths=starts[:, None],
    )
    assert move_cube.table(evaluation).splitlines() == [
        "| 0 to 5 cm | 1 | 100 % | 1.00 cm | 1.00 to 1.00 cm |",
        "| 10 to 15 cm | 2 | 50 % | 2.00 cm | 1.50 to 2.50 cm |",
        "| over 20 cm | 1 | 0 % | 20.00 cm | 20.00 to 20.00 cm |",
        "| all | 4 | 50 % | 2.00 cm | 1.00 to 7.25 cm |",
    ]
