# SPDX-License-Identifier: BSD-3-Clause
"""The evaluation of skills: what is kept, what is run again, and what a page claims."""

import json
import stat
import sys
from pathlib import Path

import pytest
import skills
from skills import Batch, Results, Row

ROW = Row(
    table="skills",
    name="turn",
    skill="turn",
    what="turn a cube",
    reach="18 of 20",
    needed=0.9,
    most_trials=1000,
    figure="time",
    unit="s",
    scale=1.0,
    like="",
    is_real_time=False,
    is_on_boards=False,
)
# Stands for run_trial: notes its seeds, fails seed 3, dies of seed 4, and is killed in seed 6.
PROGRAM = """\
#!{python}
import json, os, resource, signal, sys
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
seed = int(sys.argv[sys.argv.index("--seeds") + 1])
with open("{seen}", "a") as seen:
    seen.write(f"{{seed}}\\n")
if seed == 4:
    os.kill(os.getpid(), signal.SIGSEGV)
if seed == 6:
    os.kill(os.getpid(), signal.SIGKILL)
trial = {{"seed": seed, "succeeds": seed != 3, "why": "" if seed != 3 else "it fell", "note": ""}}
if seed != 3:
    trial["figure"] = float(seed)
print(json.dumps(trial | {{"figures": {{}}}}))
"""


@pytest.fixture
def seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file in which a program in place of run_trial notes the seeds that it runs."""
    program, file = tmp_path / "run_trial", tmp_path / "seen"
    program.write_text(PROGRAM.format(python=sys.executable, seen=file))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    file.touch()
    monkeypatch.setattr(skills, "PROGRAM", program)
    return file


def run(file: Path, seeds: range) -> Results:
    results = Results(file, [ROW])
    assert list(skills.run(results, [Batch(ROW, "as built", "", seeds)], 2))
    return results


def test_trials_that_are_kept_are_not_run_again(seen: Path, tmp_path: Path) -> None:
    run(tmp_path / "kept.jsonl", range(1, 3))
    trials = run(tmp_path / "kept.jsonl", range(1, 6)).of(ROW, "as built")
    assert sorted(seen.read_text().split()) == ["1", "2", "3", "4", "5"]
    assert set(trials) == {"1", "2", "3", "4", "5"}
    read = Results(tmp_path / "kept.jsonl", [ROW]).of(ROW, "as built")
    assert list(read.items()) == list(trials.items())  # so a page is the same, too


def test_a_trial_that_somebody_kills_says_nothing(seen: Path, tmp_path: Path) -> None:
    run(tmp_path / "kept.jsonl", range(1, 3))
    with pytest.raises(skills.KilledError, match="turn --seeds 6"):
        run(tmp_path / "kept.jsonl", range(6, 7))
    assert set(Results(tmp_path / "kept.jsonl", [ROW]).of(ROW, "as built")) == {"1", "2"}
    assert "6" in seen.read_text()


def test_again_runs_only_what_is_asked_for(seen: Path, tmp_path: Path) -> None:
    results = run(tmp_path / "kept.jsonl", range(1, 4))
    again = skills.run(results, [Batch(ROW, "as built", "", range(1, 2))], 1, again=True)
    assert len(list(again)) == 1
    assert sorted(seen.read_text().split()) == ["1", "1", "2", "3"]
    assert set(results.of(ROW, "as built")) == {"1", "2", "3"}


@pytest.mark.usefixtures("seen")
def test_failures_count_and_have_no_figure(tmp_path: Path) -> None:
    results = run(tmp_path / "kept.jsonl", range(1, 6))
    trials = results.of(ROW, "as built")
    assert skills.rate(trials, "as built") == "3 of 5"  # too few to claim a rate
    assert skills.figure(ROW, trials) == "2 s (1 to 5)"
    page = skills.page("skills", [ROW], results)
    assert "| turn | as built | 3 | it fell |" in page
    assert "| turn | as built | 4 | the program ended by signal 11 |" in page
    assert not skills.holds(ROW, results, "as built")


def test_a_rate_is_claimed_by_enough_trials() -> None:
    trials = {str(seed): {"succeeds": seed > 0} for seed in range(20)}
    assert skills.rate(trials, "as built") == "19 of 20 (76 to 99 %)"
    del trials["7"]
    assert skills.rate(trials, "as built") == "18 of 19"
    assert skills.rate(trials, "worn").startswith("18 of 19 (")


def test_the_interval_of_a_rate_is_wilsons() -> None:
    stats = pytest.importorskip("scipy.stats")
    for trials in (10, 20, 57):
        for good in range(trials + 1):
            wanted = stats.binomtest(good, trials).proportion_ci(method="wilson")
            assert skills.interval(good, trials) == pytest.approx(tuple(wanted), abs=1e-4)


def test_trials_of_another_judge_are_old(seen: Path, tmp_path: Path) -> None:
    file = tmp_path / "kept.jsonl"
    run(file, range(1, 3))
    line = json.loads(file.read_text())
    assert not Results(file, [ROW]).is_old
    file.write_text(json.dumps(line | {"judge": "0" * 12}) + "\n")
    assert Results(file, [ROW]).is_old
    run(file, range(1, 3))
    assert sorted(seen.read_text().split()) == ["1", "1", "2", "2"]


def test_a_judge_is_its_code_and_what_it_includes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge = tmp_path / "packages" / "turn" / "judge.cpp"
    helper = tmp_path / "evaluation" / "helper.hpp"
    condition = tmp_path / "src" / "sim" / "condition.cpp"
    for file in (judge, helper, condition):
        file.parent.mkdir(parents=True)
        file.touch()
    monkeypatch.setattr(skills, "ROOT", tmp_path)
    monkeypatch.setattr(skills, "SKILLS", tmp_path / "packages")
    judge.write_text('#include "evaluation/helper.hpp"\nint row = "turn";\n')
    helper.write_text("int limit = 1;\n")
    before = skills.judge_of(ROW)
    judge.write_text('#include "evaluation/helper.hpp"\n// Why.\nint  row = "turn";\n')
    assert skills.judge_of(ROW) == before
    helper.write_text("int limit = 2;\n")
    assert skills.judge_of(ROW) != before
