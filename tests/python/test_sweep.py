# SPDX-License-Identifier: BSD-3-Clause
"""Sweeps: equal tables however they were run, and trials that were killed."""

import csv
import fcntl
import importlib.util
import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import trifinger
from trifinger import evaluation
from trifinger.commands import sweep
from trifinger.errors import InvalidArgument
from trifinger.evaluation import SEED
from trifinger.sweep.trials import LOG, RESULT, STARTS, TABLES, Sweep

HERE = Path(__file__).parent

# Four of the shortest trainings that have a checkpoint in their midst.
SHORT = ("duration=0.2", "batch_size=20", "layers=(16,16)", "random_actions=15")
REACHES = ("reach", "--shared", "--episodes", "30", "--seeds", "1-2")
REACHES += ("--set", "learning_rate=1e-3,1e-4", *(f"--set={one}" for one in SHORT))

# Stands for the program of Slurm: runs all tasks of an array job, the last one first.
SBATCH = """#!{python}
import os, subprocess, sys
open("sbatch.txt", "w").write(" ".join(sys.argv))
(array,) = [word for word in sys.argv if word.startswith("--array=0-")]
open("script.sh", "w").write(sys.stdin.read())
print("Submitted batch job 7", flush=True)
last = int(array.removeprefix("--array=0-").partition("%")[0])
for task in reversed(range(last + 1)):
    subprocess.run(["bash", "script.sh"], env=os.environ | {{"SLURM_ARRAY_TASK_ID": str(task)}})
"""


def tables(folder):
    return [(folder / name).read_bytes() for name in TABLES]


def logs(folder):
    return [path.read_text() for path in sorted(folder.glob(f"trials/*/{LOG}"))]


def program(folder, name, text):
    path = folder / name
    path.write_text(text)
    path.chmod(0o755)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The folder of a sweep whose trials were run one after the other."""
    folder = tmp_path_factory.mktemp("sweep") / "alone"
    assert sweep.main([*REACHES, "-o", str(folder), "--jobs", "1"]) == 0
    return folder


def begun(folder):
    """The same sweep in another folder, before its first trial."""
    return sweep.begin(sweep.parse([*REACHES, "-o", str(folder)]))


def resume(folder, *words):
    return sweep.main(["--resume", str(folder), *words])


# ---- tables ----


@pytest.mark.slow
def test_the_table_of_the_page_has_a_row_for_each_seed_and_setting(alone):
    rows = list(csv.DictReader((alone / "table.csv").read_text().splitlines()))
    keys = [(row["task"], row["algorithm"], row["learning_rate"], row["seed"]) for row in rows]
    assert keys == [
        ("reach", "ddpg", rate, seed) for rate in ("0.001", "0.0001") for seed in ("1", "2")
    ]
    for number, row in enumerate(rows):
        text = (alone / f"trials/{number:03}/curve.csv").read_text()
        curve = list(csv.DictReader(text.splitlines()))
        assert row["median"] == curve[-1]["median"]
        assert (alone / f"trials/{number:03}/reach.policy").exists()
        assert list((alone / f"trials/{number:03}/tensorboard").iterdir())
    assert len({row["median"] for row in rows}) == 4
    settings = (alone / "table.md").read_text().splitlines()[2:4]
    assert [line.split(" | ")[2:4] for line in settings] == [["0.001", "2"], ["0.0001", "2"]]


@pytest.mark.slow
def test_four_processes_make_the_same_table_as_one(alone, tmp_path):
    assert sweep.main([*REACHES, "-o", str(tmp_path / "four"), "--jobs", "4"]) == 0
    assert tables(tmp_path / "four") == tables(alone)


@pytest.mark.slow
def test_a_killed_worker_costs_a_restart_from_its_checkpoint(alone, tmp_path, monkeypatch):
    plain = Sweep._command
    marker = tmp_path / "was_killed"

    def command(self, number):
        made = plain(self, number)
        if number != 1:
            return made
        place = made.words.index("--resume")
        words = (sys.executable, str(HERE / "killed_trial.py"), str(marker), "280")
        return replace(made, words=words + made.words[place:])

    monkeypatch.setattr(Sweep, "_command", command)
    said = []
    assert begun(tmp_path / "killed").run(jobs=2, say=said.append) == []
    assert marker.exists()
    assert tables(tmp_path / "killed") == tables(alone)
    assert [line.count("seed") for line in logs(tmp_path / "killed")] == [1, 2, 1, 1]
    assert len(said) == 5
    assert sum(line.endswith("; it starts again") for line in said) == 1


def locked(folder):
    """Trials that a process runs."""
    found = []
    for path in sorted(folder.glob("trials/*/lock")):
        with path.open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                found.append(path)
    return found


@pytest.mark.slow
def test_a_sweep_that_is_interrupted_ends_its_workers_and_goes_on(alone, tmp_path):
    begun(tmp_path / "cut")
    words = (sys.executable, "-m", "trifinger.commands.sweep", "--resume", str(tmp_path / "cut"))
    with subprocess.Popen([*words, "--jobs", "1"], stderr=subprocess.PIPE, text=True) as process:
        first = process.stderr.readline()
        process.send_signal(signal.SIGINT)
        rest = process.stderr.read()
    assert process.returncode == 130
    assert re.match(r"trial \d, one of 4 .* success", first), first
    assert "goes on" in rest
    assert locked(tmp_path / "cut") == []
    done = {path: path.stat().st_mtime_ns for path in tmp_path.glob(f"cut/trials/*/{RESULT}")}
    assert 1 <= len(done) < 4
    assert resume(tmp_path / "cut") == 0
    assert {path: path.stat().st_mtime_ns for path in done} == done
    assert tables(tmp_path / "cut") == tables(alone)


@pytest.mark.slow
def test_slurm_runs_trials_as_tasks_of_an_array_job(alone, tmp_path, monkeypatch):
    program(tmp_path, "sbatch", SBATCH.format(python=sys.executable))
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    assert sweep.main([*REACHES, "-o", "here", "--executor", "slurm", "--jobs", "2"]) == 0
    assert tables(tmp_path / "here") == tables(alone)
    words = (tmp_path / "sbatch.txt").read_text().split()
    assert {"--wait", "--array=0-3%2", "--cpus-per-task=1"} <= set(words)


def test_slurm_that_takes_no_job_is_said(tmp_path, monkeypatch, capsys):
    begun(tmp_path / "sweep")
    monkeypatch.setenv("PATH", f"{tmp_path}")
    assert resume(tmp_path / "sweep", "--executor", "slurm") == 1
    assert "sbatch is missing" in capsys.readouterr().err
    program(tmp_path, "sbatch", "#!/bin/sh\necho sbatch: invalid partition >&2; exit 1\n")
    assert resume(tmp_path / "sweep", "--executor", "slurm") == 1
    assert "Slurm has not taken the jobs: sbatch: invalid partition" in capsys.readouterr().err


@pytest.mark.slow
def test_ray_makes_the_same_table(alone, tmp_path):
    if importlib.util.find_spec("ray") is None:
        pytest.skip("ray is not installed")
    words = (sys.executable, "-m", "trifinger.commands.sweep", *REACHES, "--executor", "ray")
    subprocess.run([*words, "-o", str(tmp_path / "ray")], check=True)
    assert tables(tmp_path / "ray") == tables(alone)


@pytest.mark.slow
def test_weights_and_biases_gets_the_learning_curves(tmp_path, monkeypatch):
    if importlib.util.find_spec("wandb") is None:
        pytest.skip("wandb is not installed")
    monkeypatch.setenv("WANDB_MODE", "offline")
    words = [*REACHES, "--seeds", "1", "--set", "gamma=0.9", "-o", str(tmp_path / "shown")]
    assert sweep.main([*words, "--wandb", "reaches"]) == 0
    runs = list(tmp_path.glob("shown/trials/*/wandb/offline-run-*/run-*.wandb"))
    assert len(runs) == 2
    assert all(b"success" in path.read_bytes() for path in runs)


# ---- evaluations ----


@pytest.mark.slow
def test_an_evaluation_in_parts_is_the_same_as_in_one(alone, tmp_path):
    file = alone / "trials/000/reach.policy"
    words = ["--policies", str(file), "--conditions", "as documented,worn", "--episodes", "60"]
    assert sweep.main([*words, "-o", str(tmp_path / "judged"), "--jobs", "2"]) == 0
    assert len(list(tmp_path.glob(f"judged/trials/*/{RESULT}"))) == 4
    rows = list(csv.DictReader((tmp_path / "judged/table.csv").read_text().splitlines()))
    for row, condition in zip(rows, ("as documented", "worn"), strict=True):
        whole = evaluation.evaluate(
            trifinger.Policy(file), "reach", 60, SEED, condition=condition
        ).summary()
        assert row["condition"] == condition
        assert float(row["median"]) == whole.median
        assert float(row["success"]) == whole.success
        assert int(row["episodes"]) == 60


def test_evaluations_share_no_episode(tmp_path):
    for seeds, episodes in (((1, 2), 2), ((7, 1, 5), 3)):
        with pytest.raises(InvalidArgument, match="would have the same episodes"):
            Sweep.of_evaluations(tmp_path, [], seeds=seeds, episodes=episodes)


@pytest.mark.slow
def test_a_trial_that_fails_by_itself_is_said_and_not_started_again(alone, tmp_path, capsys):
    good, bad = alone / "trials/000/reach.policy", tmp_path / "push.policy"
    bad.write_bytes(good.read_bytes().replace(b'"task":"reach"', b'"task":"push"'))
    assert trifinger.Policy(bad).metadata["task"] == "push"
    folder = tmp_path / "judged"
    assert sweep.main(["--policies", str(good), str(bad), "-o", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "1 of 2 trials have failed, such as trial 1: per_finger is for tasks" in said
    assert "starts again" not in said
    rows = list(csv.DictReader((folder / "table.csv").read_text().splitlines()))
    assert [bool(row["median"]) for row in rows] == [True, False]
    assert resume(folder) == 1  # tries again


def test_a_trial_that_is_always_killed_is_given_up(tmp_path, monkeypatch):
    this = begun(tmp_path / "killed")
    plain = Sweep._command
    killed = ("sh", "-c", "echo no memory; kill -9 $$")
    monkeypatch.setattr(Sweep, "_command", lambda *one: replace(plain(*one), words=killed))
    assert this.run(jobs=1) == [0, 1, 2, 3]
    assert logs(this.folder) == ["no memory\n" * STARTS] * 4
    assert this.why(2) == "it was killed, and the last that it has printed is 'no memory'"


# ---- what is said ----


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "either tasks, --policies or --resume is needed"),
        ("reach --policies a.policy", "either tasks, --policies or --resume is needed"),
        ("reach --seeds 1-x", "'1-x' is no number and no range such as 1-4"),
        ("reach --seeds 4-1", "'4-1' has no number, or one of them twice"),
        ("reach --seeds 1-3,2", "'1-3,2' has no number, or one of them twice"),
        ("reach --set gamma", "'gamma' is no KEY=LIST"),
        ("reach --set gama=0.9,0.95", "did you mean 'gamma'?"),
        ("reach --set gamma=0.9,high", "gamma is 'high', must be like 0.9"),
        ("reach --set gamma=0.9 --set gamma=0.95", "'gamma' is said twice"),
        ("reach --set seed=1,2", "'seed' is said twice, or has an option of its own"),
        ("reach --algorithm ddpg,pp", "there is no algorithm 'pp'"),
        (
            "reach --algorithm ddpg,ppo",
            "'reach' is learned by ddpg or td3 or sac, as far as is known",
        ),
        ("reach throw", "nothing learns 'throw', as far as is known"),
        ("lift", "'lift' is not learned from scratch, as far as is known"),
        ("reach --conditions worn", "--conditions does not go with tasks"),
        ("reach --jobs 0", "--jobs is 0, must be at least 1"),
        ("reach --episodes 0", "episodes is 0, must be at least 1"),
        ("rech", "there is no task 'rech'"),
        ("--policies a.policy --shared", "--shared does not go with --policies"),
        ("--policies a.policy --conditions wornn", "did you mean 'worn'?"),
        ("--policies a.policy", "a.policy: No such file or directory"),
        ("--resume nowhere", "there is no sweep in nowhere"),
        ("--resume nowhere --seeds 2", "--seeds does not go with --resume"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    try:
        status = sweep.main(words.split())
    except SystemExit as error:
        status = error.code
    assert status in (1, 2)
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "sweep").exists()


def test_each_task_has_its_own_algorithm_unless_one_is_said():
    def rows(words):
        return [
            (row["task"], row["algorithm"], plan.recipe.algorithm)
            for row, plan in sweep.plans_of(sweep.parse(words.split()))
        ]

    assert rows("reach push") == [("reach", "ddpg", "ddpg"), ("push", "ppo", "ppo")]
    assert rows("reach throw --algorithm sac --untried") == [
        ("reach", "sac", "sac"),
        ("throw", "sac", "sac"),
    ]


def test_a_folder_with_something_in_it_is_no_place_for_a_sweep(tmp_path, capsys):
    (tmp_path / "notes.txt").touch()
    assert sweep.main([*REACHES, "-o", str(tmp_path)]) == 2
    assert f"--resume {tmp_path} goes on" in capsys.readouterr().err


def test_commas_separate_values_but_not_in_brackets():
    assert sweep.values_of("gamma=0.9,0.95") == ("gamma", [0.9, 0.95])
    assert sweep.values_of("layers=(16,16),(32,)") == ("layers", [(16, 16), (32,)])
    nested = ("a", [(1, (2, 3)), {"b": (0.1, 0.2), "c": (1.0, 2.0)}])
    assert sweep.values_of('a=(1,(2,3)),{"b": (0.1, 0.2), "c": (1.0, 2.0)}') == nested
    assert sweep.values_of("condition=as built,worn") == ("condition", ["as built", "worn"])
    assert sweep.values_of("action=torque,position") == ("action", ["torque", "position"])
    assert sweep.numbers_of("3,1-2,7") == [3, 1, 2, 7]


def test_a_task_that_only_a_file_names_is_not_imported(tmp_path, capsys):
    this = begun(tmp_path / "sweep")
    path = this.folder / "sweep.json"
    fields = json.loads(path.read_text())
    fields["trials"][2]["plan"]["task"] = "evil:Task"
    path.write_text(json.dumps(fields))
    assert resume(this.folder, "--index", "2") == 2
    assert "has a training of 'evil:Task', not of 'reach'" in capsys.readouterr().err
    fields["trials"][2]["task"] = "evil:Task"
    path.write_text(json.dumps(fields))
    assert resume(this.folder, "--index", "0") == 2
    assert "say --task evil:Task" in capsys.readouterr().err
