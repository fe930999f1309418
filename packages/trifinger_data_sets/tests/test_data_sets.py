# SPDX-License-Identifier: BSD-3-Clause
"""Logs as data sets: what was recorded is what readers of LeRobot and Minari find."""

import itertools
import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import minari
import numpy as np
import pyarrow.parquet as pq
import pytest
import trifinger
from conftest import BUILD
from gymnasium import wrappers
from lerobot_reader import Reader
from trifinger._trifinger import limits_of_file_robot, robot_configuration
from trifinger.environments import Environment, Options
from trifinger.errors import InvalidArgument
from trifinger.log.images import LoggedCameras
from trifinger_data_sets import (
    cloning,
    lerobot,
    lerobot_layout,
    lerobot_videos,
    minari as minari_format,
    rows,
)
from trifinger_data_sets.commands import clone as clone_command
from trifinger_data_sets.commands.export import logs_of, main
from trifinger_data_sets.episodes import find_episodes
from trifinger_data_sets.marks import Decisions, EpisodeMarks, Mark, read_marks
from trifinger_data_sets.recorded_environment import RecordEpisodes
from trifinger_data_sets.rows import Choice, Rows

CAMERAS = ("camera60", "camera180", "camera300")
SIZE = 108
OVERRIDES = {"cameras.size": SIZE, "cameras.rate": 20, "cameras.delay": 0.005}
EPISODE_STEPS = (301, 450)


@dataclass
class Recorded:
    """A folder with a log, and the marks in it."""

    folder: Path
    seed: int

    @property
    def sessions(self) -> list[trifinger.LoggedSession]:
        return trifinger.Log(self.folder).sessions


def record(folder: Path, seed: int, config: str, overrides: dict[str, object]) -> Recorded:
    """Two sessions of a robot that moves all the time, and a mark in each, of half of it."""
    random = np.random.default_rng(seed)
    simulation = trifinger.Simulation(config, overrides)
    with (
        simulation.record(folder, images="raw") as recorder,
        EpisodeMarks(folder / "run.episodes.jsonl") as marks,
    ):
        for count in EPISODE_STEPS:
            with simulation.connect() as robot:
                start = robot.latest_observation().position
                swing = random.choice([-0.5, 0.5], len(start))
                for i in range(count):
                    action = robot.new_action(position=start + swing * np.sin(0.02 * i))
                    t = robot.append_desired_action(action)
                    robot.wait_until_time_index(t)
                    if i == count // 2:
                        marks.add(robot, 10, t, task="Swing", success=count == EPISODE_STEPS[0])
                robot.finish()
        recorder.stop()
    return Recorded(folder, seed)


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return record(tmp_path_factory.mktemp("seen"), 1, "sim_cameras", OVERRIDES)


@pytest.fixture(scope="module")
def blind(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return record(tmp_path_factory.mktemp("blind"), 2, "sim", {})


@pytest.fixture(scope="module")
def finger(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return record(tmp_path_factory.mktemp("blind"), 3, "sim", {})


def export(*words: str | Path, status: int = 0) -> None:
    assert main([str(word) for word in words]) == status


def check_rows(reader: Reader, sessions: list[trifinger.LoggedSession], firsts: list[int]) -> None:
    """Holds rows to the log: observations, the actions that follow, all steps between."""
    step = reader.column("step")
    for number, (session, first) in enumerate(zip(sessions, firsts, strict=True)):
        rows = np.flatnonzero(reader.column("episode_index") == number)
        own = step[rows]
        expected = first + np.floor(np.arange(len(rows)) / (reader.fps * session.period) + 1e-9)
        np.testing.assert_array_equal(own, expected)
        y = session.observations[own]
        state = np.concatenate([y[name] for name in y.dtype.names], axis=1)
        np.testing.assert_array_equal(reader.column("observation.state")[rows], np.float32(state))
        action = np.float32(session.desired_actions["position"])
        np.testing.assert_array_equal(reader.column("action")[rows], action[own + 1])
        k = int(np.ceil(1 / (reader.fps * session.period) - 1e-9))
        end = reader.episodes[number]["source/end_step"]
        for row, t in zip(rows, own, strict=True):
            before = np.clip(np.arange(t - k + 1, t + 1), first, None)
            after = np.clip(np.arange(t + 1, t + k + 1), None, end - 1)
            position = np.float32(session.observations["position"])
            high_rate = reader.columns["high_rate.observation.position"][row]
            np.testing.assert_array_equal(np.float32(high_rate), position[before])
            desired = reader.columns["high_rate.action.position"][row]
            np.testing.assert_array_equal(np.float32(desired), action[after])
            applied = reader.columns["high_rate.applied_action.torque"][row]
            torque = np.float32(session.applied_actions["torque"])
            np.testing.assert_array_equal(np.float32(applied), torque[after])


def test_every_step_between_two_rows_is_in_the_data_set(blind: Recorded) -> None:
    for rate in (30, 50, 1000):
        episodes = find_episodes(logs_of([blind.folder]))
        table = Rows(episodes, Choice(rate=rate))
        for episode in episodes:
            steps = table.steps(episode)
            kept = {t + i for t in steps for i in range(1, table.stride + 1)}
            assert kept >= set(range(episode.first + 1, episode.end))
            assert steps[-1] + 1 < episode.end <= steps[-1] + 1 + table.stride


def test_no_thread_of_an_encoder_has_real_time_priority(tmp_path: Path) -> None:
    for encoder in lerobot_videos.encoders():
        videos = lerobot_videos.Videos(tmp_path, encoder, 10, encoder)
        videos.begin_episode()
        videos.add(np.zeros((SIZE, SIZE, 3), np.uint8))
        threads = [int(task.name) for task in Path("/proc/self/task").iterdir()]
        assert not {os.SCHED_FIFO, os.SCHED_RR} & set(map(os.sched_getscheduler, threads))
        videos.close()


@pytest.mark.parametrize("rate", [250, 1000])
def test_films_may_have_the_rate_of_the_loop(
    seen: Recorded, tmp_path: Path, rate: int, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("lerobot", seen.folder, "--cameras", CAMERAS[0], "--from", "0.1", "--to", "0.15")
    export(*words, "-o", tmp_path / "set", "--rate", str(rate))
    assert "libsvtav1 takes at most 240 images/s" in capsys.readouterr().err
    reader = Reader(tmp_path / "set")
    reader.check()
    assert reader.fps == rate
    for row in range(len(reader.column("index"))):
        reader.image(f"observation.images.{CAMERAS[0]}", row)
    slow = ("--rate", str(rate), "--encoder", "libsvtav1")
    export(*words, "-o", tmp_path / "other", *slow, status=2)
    text = capsys.readouterr().err
    assert f"libsvtav1 writes videos of up to 240 images/s, not of {rate}: choose" in text
    assert "Traceback" not in text
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("images", ["video", "image"])
def test_a_reader_of_the_format_finds_what_the_log_has(
    seen: Recorded, tmp_path: Path, images: str
) -> None:
    export("lerobot", seen.folder, "-o", tmp_path / "set", "--images", images, "--task", "Wave")
    reader = Reader(tmp_path / "set")
    reader.check()
    assert reader.fps == 20
    assert reader.info["robot_type"] == "trifinger"
    assert list(reader.tasks.values()) == ["Wave"]
    firsts = [episode["source/first_step"] for episode in reader.episodes]
    assert all(0 <= first <= 6 for first in firsts)  # when the first images had arrived
    check_rows(reader, seen.sessions, firsts)
    for number, session in enumerate(seen.sessions):
        cameras = LoggedCameras(session)
        rows = np.flatnonzero(reader.column("episode_index") == number)
        steps = reader.column("step")[rows]
        recorded = [cameras.get_latest_at(int(t)) for t in steps]
        for name in CAMERAS:
            own = np.array([one[name] for one in recorded if one is not None], float)
            found = np.array([reader.image(f"observation.images.{name}", row) for row in rows])
            if images == "image":
                np.testing.assert_array_equal(found, own)
                continue
            # A film is not exact, but each of its images is nearest to its own.
            differences = np.abs(found[:, None].astype(float) - own[None]).mean(axis=(2, 3, 4))
            assert np.diagonal(differences).max() < 8
            # At the beginning it hardly moves.
            nearest = differences.argmin(axis=1)
            np.testing.assert_array_equal(nearest[2:], np.arange(len(rows))[2:])
        ages = [
            (t - one.element["stamp"]["capture_index"]) * session.period
            for t, one in zip(steps, recorded, strict=True)
            if one is not None
        ]
        np.testing.assert_allclose(reader.column("image_age")[rows, 0], ages, atol=1e-6)


def test_many_files_are_in_global_order(
    seen: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lerobot_layout, "DATA_SIZE", 0)
    monkeypatch.setattr(lerobot_layout, "VIDEO_SIZE", 0)
    monkeypatch.setattr(lerobot_layout, "FILES_PER_CHUNK", 1000)
    monkeypatch.setattr(lerobot_layout, "WAITING", 1)
    folder = tmp_path / "set"
    export("lerobot", seen.folder, seen.folder, "-o", folder, "--episodes", "marks")
    reader = Reader(folder)
    reader.check()
    assert len(reader.data_files) == len(reader.episodes) == 2, "a log given twice counts once"
    assert len(list(folder.glob("videos/*camera60/*/*.mp4"))) == 2
    assert all(
        one["videos/observation.images.camera60/from_timestamp"] == 0 for one in reader.episodes
    )


def test_marks_are_episodes_with_their_task_and_end(blind: Recorded, tmp_path: Path) -> None:
    export("lerobot", blind.folder, "-o", tmp_path / "set", "--episodes", "marks", "--rate", "25")
    reader = Reader(tmp_path / "set")
    reader.check()
    assert list(reader.tasks.values()) == ["Swing"]
    assert [one["source/first_step"] for one in reader.episodes] == [10, 10]
    ends = [one["source/end_step"] for one in reader.episodes]
    assert ends == [count // 2 for count in EPISODE_STEPS]
    check_rows(reader, blind.sessions, [10, 10])
    done = reader.column("next.done")
    last = [one["dataset_to_index"] - 1 for one in reader.episodes]
    np.testing.assert_array_equal(np.flatnonzero(done), last)
    np.testing.assert_array_equal(np.flatnonzero(reader.column("next.success")), last[:1])


def test_two_logs_become_one_data_set(blind: Recorded, finger: Recorded, tmp_path: Path) -> None:
    export("lerobot", blind.folder, finger.folder, "-o", tmp_path / "set", "--from", "0.1")
    reader = Reader(tmp_path / "set")
    reader.check()
    assert len(reader.episodes) == 4
    check_rows(reader, blind.sessions + finger.sessions, [100] * 4)


def test_logs_that_do_not_fit_together_are_refused(
    blind: Recorded, seen: Recorded, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export("lerobot", seen.folder, blind.folder, "-o", tmp_path / "out/set", status=2)
    assert "other cameras" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    export("lerobot", seen.folder, blind.folder, "-o", tmp_path / "out/set", "--cameras")
    Reader(tmp_path / "out/set").check()


def test_the_robot_may_be_any_and_its_log_may_have_gaps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write = [str(BUILD / "tests/python/write_log"), str(tmp_path), "odd"]
    subprocess.run([*write, "600", "200", "249"], check=True)
    export("lerobot", tmp_path / "log.mcap", "-o", tmp_path / "set")
    assert "steps are missing, so it becomes 2 episodes" in capsys.readouterr().err
    reader = Reader(tmp_path / "set")
    reader.check()
    assert reader.info["robot_type"] == "odd"
    assert [one["source/first_step"] for one in reader.episodes] == [0, 250]
    session = trifinger.Log(tmp_path / "log.mcap").session()
    steps = reader.column("step")
    assert not np.isin(np.arange(199, 250), steps).any()
    names = reader.features["observation.state"]["names"]
    assert names == ["left.angle", "left.speed", "right.angle", "right.speed"]
    assert reader.features["observation.gears"]["dtype"] == "int64"
    for row, t in enumerate(steps):
        y = session.get_observation(int(t))
        a = session.get_desired_action(int(t) + 1)
        assert reader.columns["observation.state"][row][3] == y["right"]["speed"]
        assert reader.columns["observation.gears"][row] == y["gears"].ravel().tolist()
        action = [*a["speed"], *a["gear"], a["colour"]]
        np.testing.assert_array_equal(reader.columns["action"][row], np.float32(action))


# The check is a function of Python, which cannot hand its error to anybody in the last step.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_session_that_ended_with_a_fault_is_an_episode_until_then(tmp_path: Path) -> None:
    calls = itertools.count()
    error = ValueError("broken")

    def break_down(_: trifinger.Element, __: trifinger.Element) -> None:
        if next(calls) >= 200:
            raise error

    def drive() -> None:
        with trifinger.simulate(record=tmp_path / "logs", checks=[break_down]) as robot:
            position = robot.latest_observation().position
            for i in range(1000):
                action = robot.new_action(position=position + 1e-3 * i)
                robot.wait_until_time_index(robot.append_desired_action(action))

    with pytest.raises(trifinger.RobotStopped, match="broken"):
        drive()
    session = trifinger.Log(tmp_path / "logs").session()
    assert session.fault is not None
    assert session.steps is not None
    export("lerobot", tmp_path / "logs", "-o", tmp_path / "set")
    reader = Reader(tmp_path / "set")
    reader.check()
    check_rows(reader, [session], [0])
    assert reader.episodes[0]["source/end_step"] == session.steps


def test_actions_that_were_not_always_given_are_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with trifinger.simulate(record=tmp_path / "logs") as robot:
        position = robot.latest_observation().position
        for i in range(100):
            action = (
                robot.new_action(position=position)
                if i < 50
                else robot.new_action(torque=np.full(9, 0.01))
            )
            robot.wait_until_time_index(robot.append_desired_action(action))
        robot.finish()
    export("lerobot", tmp_path / "logs", "-o", tmp_path / "set", status=2)
    message = capsys.readouterr().err
    assert "'position' of the desired action was not given in some steps" in message
    assert "--action: torque" in message
    export("lerobot", tmp_path / "logs", "-o", tmp_path / "set", "--action", "torque")
    Reader(tmp_path / "set").check()


def test_what_is_there_stays_unless_it_may_be_replaced(
    blind: Recorded, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out/set").mkdir(parents=True)
    (tmp_path / "out/set/mine").write_text("dear to me")
    export("lerobot", blind.folder, "-o", tmp_path / "out/set", status=2)
    assert "--force replaces it" in capsys.readouterr().err
    assert (tmp_path / "out/set/mine").read_text() == "dear to me"
    export("lerobot", blind.folder, "-o", tmp_path / "out/set", "--force")
    Reader(tmp_path / "out/set").check()
    assert [one.name for one in (tmp_path / "out").iterdir()] == ["set"]


def test_an_export_that_fails_leaves_nothing(
    blind: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise OSError("the disk is full")

    monkeypatch.setattr(lerobot._Writer, "finish", fail)
    (tmp_path / "out/set").mkdir(parents=True)
    export("lerobot", blind.folder, "-o", tmp_path / "out/set", "--force", status=1)
    assert [one.name for one in (tmp_path / "out").iterdir()] == ["set"]
    assert list((tmp_path / "out/set").iterdir()) == []


def test_a_killed_export_leaves_no_data_set(blind: Recorded, tmp_path: Path) -> None:
    program = f"""
import sys
from trifinger_data_sets.commands import clone as clone_command
from trifinger_data_sets.commands.export import main
from trifinger_data_sets import cloning, lerobot, minari as minari_format, rows
describe = lerobot._Writer._describe
def wait(*arguments):
    describe(*arguments)
    print("half", flush=True)
    sys.stdin.read()
lerobot._Writer._describe = wait
main(["lerobot", {str(blind.folder)!r}, "-o", {str(tmp_path / "out/set")!r}])
"""
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "half\n"
        process.send_signal(signal.SIGKILL)
    (left,) = (tmp_path / "out").iterdir()
    assert left.name.startswith(".set.")


def test_marks_survive_a_kill_and_say_where_they_are_wrong(tmp_path: Path) -> None:
    path = tmp_path / "x.episodes.jsonl"
    mark = Mark(session_id=2**63 + 5, first=3, end=9, task="Ω", success=True)
    with EpisodeMarks(path) as marks:
        marks.write(mark)
        marks.write(mark)
    assert read_marks(path) == [mark, mark]
    whole = path.read_bytes()
    for size in range(len(whole) // 2 + 1, len(whole)):
        path.write_bytes(whole[:size])
        assert read_marks(path) == [mark]
    path.write_text('{"version": 1, "first": 1}\n')
    with pytest.raises(InvalidArgument, match="line 1: no mark of an episode"):
        read_marks(path)
    path.write_bytes(b'{"version": 1, "task": "\xff"}\n')
    with pytest.raises(InvalidArgument, match="line 1: 'utf-8'"):
        read_marks(path)
    with pytest.raises(InvalidArgument, match="no steps"):
        Mark(session_id=1, first=3, end=3)


def test_decisions_of_an_environment_come_back_from_a_file_bit_for_bit(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    made = {
        "steps": np.arange(5),
        "observations": random.normal(size=(5, 3)).astype(np.float32),
        "actions": random.normal(size=(4, 2)).astype(np.float32),
        "rewards": random.normal(size=4),
    }
    decisions = Decisions(environment="{}", seed=1, episode=2, **made)
    with EpisodeMarks(tmp_path / "x.episodes.jsonl") as marks:
        marks.write(Mark(session_id=1, first=0, end=4, decisions=decisions))
    (found,) = read_marks(tmp_path / "x.episodes.jsonl")
    assert found.decisions is not None
    for name, values in made.items():
        np.testing.assert_array_equal(getattr(found.decisions, name), values)
        assert getattr(found.decisions, name).dtype == values.dtype
    with pytest.raises(InvalidArgument, match="3 actions need as many rewards"):
        Decisions(environment="", seed=1, episode=2, **(made | {"actions": made["actions"][:3]}))
    with pytest.raises(InvalidArgument, match="the observations of an episode have the shape"):
        Decisions(environment="", seed=1, episode=2, **(made | {"observations": [1, 2, 3, 4, 5]}))


EXPORT_MANY = """
import sys
from dataclasses import replace
from pathlib import Path
import trifinger
from trifinger_data_sets import lerobot, lerobot_layout, minari, statistics
from trifinger_data_sets.episodes import find_episodes

# Buffers are full after a few episodes, so what grows is what is kept of each.
lerobot_layout.EPISODES_SIZE = lerobot_layout.GROUP_SIZE = 1
statistics.MEMORY = 1 << 20
(whole,) = find_episodes([trifinger.Log(sys.argv[1])])[:1]
format, folder, count = sys.argv[2], Path(sys.argv[3]), int(sys.argv[4])
episodes = [replace(whole, first=20 + i % 100, end=140 + i % 100) for i in range(count)]
write = lerobot.write if format == "lerobot" else minari.write
assert write(episodes, folder if format == "lerobot" else "many-v0").episodes == count
(line,) = [one for one in Path("/proc/self/status").read_text().split("\\n") if "VmHWM" in one]
print(line.split()[1])
"""


def peak_of_export(log: Path, format_: str, folder: Path, count: int) -> float:
    """The most memory that an export of so many episodes had [MB]."""
    words = [sys.executable, "-c", EXPORT_MANY, log, format_, folder / f"{count}", f"{count}"]
    settings = {
        # What allocators keep for later is not what is meant.
        "ARROW_DEFAULT_MEMORY_POOL": "system",
        "MALLOC_ARENA_MAX": "1",
        minari_format.ROOT: str(folder / f"{count}"),
    }
    done = subprocess.run(
        words, stdout=subprocess.PIPE, text=True, check=True, env=os.environ | settings
    )
    return int(done.stdout.splitlines()[-1]) / 1e3


@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_episodes(blind: Recorded, tmp_path: Path) -> None:
    few, many = (peak_of_export(blind.folder, "lerobot", tmp_path, n) for n in (50, 200))
    assert many - few < 5
    reader = Reader(tmp_path / "200")
    reader.check()
    places = [
        tuple(one[f"meta/episodes/{key}"] for key in ("chunk_index", "file_index"))
        for one in reader.episodes
    ]
    files = sorted((tmp_path / "200").glob("meta/episodes/chunk-*/file-*.parquet"))
    assert len(set(places)) == len(files) > 10
    for file, place in zip(files, sorted(set(places)), strict=True):
        assert pq.read_metadata(file).num_rows == places.count(place)


@pytest.mark.slow
def test_memory_of_minari_is_bounded(blind: Recorded, tmp_path: Path) -> None:
    # HDF5 keeps a cache of some MB, which is full after some hundred episodes.
    few, many = (peak_of_export(blind.folder, "minari", tmp_path, n) for n in (600, 1400))
    assert many - few < 10


# ---- Minari ----


@pytest.fixture
def minari_root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "minari"
    folder.mkdir()
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(folder))
    return folder


@dataclass
class Played:
    """Episodes of an environment: what it returned, and the folder of its log."""

    folder: Path
    observations: list[Any]
    actions: list[Any]
    rewards: list[Any]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Played:
    folder = tmp_path_factory.mktemp("played")
    found = Played(folder, [], [], [])
    random = np.random.default_rng(1)
    environment = RecordEpisodes(Environment("reach"), folder, sentence="Reach")
    for episode in range(3):
        observation, _ = environment.reset(seed=episode)
        observations, actions, rewards = [observation], [], []
        ended = False
        while not ended:
            action = random.uniform(-0.5, 0.5, 9).astype(np.float32)
            observation, reward, terminated, truncated, _ = environment.step(action)
            observations.append(observation)
            actions.append(action)
            rewards.append(reward)
            ended = terminated or truncated or (episode == 2 and len(actions) == 20)
        found.observations.append(np.array(observations))
        found.actions.append(np.array(actions))
        found.rewards.append(np.array(rewards))
    environment.close()
    return found


@pytest.mark.usefixtures("minari_root")
def test_minari_loads_what_an_environment_saw_chose_and_got(played: Played) -> None:
    export("minari", played.folder, "--episodes", "marks", "-o", "trifinger/tests/reach-v3")
    data = minari.load_dataset("trifinger/tests/reach-v3")
    assert minari.list_local_datasets().keys() == {"trifinger/tests/reach-v3"}
    assert set(minari.namespace.list_local_namespaces()) == {"trifinger", "trifinger/tests"}
    assert data.total_episodes == 3
    assert data.total_steps == sum(map(len, played.actions))
    for number, episode in enumerate(data.iterate_episodes()):
        np.testing.assert_array_equal(episode.observations, played.observations[number])
        np.testing.assert_array_equal(episode.actions, played.actions[number])
        np.testing.assert_array_equal(episode.rewards, played.rewards[number])
        assert not episode.terminations.any()
        np.testing.assert_array_equal(
            np.flatnonzero(episode.truncations), [len(played.actions[number]) - 1]
        )
    environment = data.recover_environment()
    assert environment.observation_space == data.observation_space
    # It is the same environment: the same actions lead to the same rewards.
    environment.reset(seed=1)
    for action, reward in zip(played.actions[1], played.rewards[1], strict=True):
        assert environment.step(action)[1] == reward
    environment.close()


def play(environment: Any, folder: Path, count: int) -> tuple[list[Any], list[float]]:
    """Records the beginning of an episode; returns its actions and rewards."""
    recorded = RecordEpisodes(environment, folder)
    recorded.action_space.seed(1)
    recorded.reset(seed=7)
    actions = [recorded.action_space.sample() for _ in range(count)]
    rewards = [float(recorded.step(action)[1]) for action in actions]
    recorded.close()
    return actions, rewards


def check_recovered(
    name: str, actions: list[Any], rewards: list[float], *, digits: float = 0.0
) -> Any:
    """The environment of a data set has its spaces, and gives its rewards again."""
    data = minari.load_dataset(name)
    (episode,) = data.iterate_episodes()
    np.testing.assert_array_equal(episode.actions, actions)
    np.testing.assert_array_equal(episode.rewards, rewards)
    environment = data.recover_environment()
    assert environment.observation_space == data.observation_space
    assert environment.action_space == data.action_space
    environment.reset(seed=7)
    again = [environment.step(action)[1] for action in actions]
    np.testing.assert_allclose(again, rewards, rtol=digits)
    environment.close()
    return environment


def test_limits_without_end_keep_their_sign() -> None:
    assert [minari_format._number(value) for value in (-np.inf, np.inf, -1e-7, 2.5)] == [
        "-.inf",
        ".inf",
        "-1e-07",
        "2.5",
    ]


# Gymnasium tells that it makes single numbers of double ones.
@pytest.mark.filterwarnings("ignore:.*precision lowered")
@pytest.mark.usefixtures("minari_root")
def test_a_recovered_environment_has_the_wrappers_of_the_recorded_one(tmp_path: Path) -> None:
    environment: Any = wrappers.RescaleAction(Environment("reach"), -5.0, np.float32(5.0))
    environment = wrappers.StickyAction(environment, 0.3)
    environment = wrappers.FrameStackObservation(environment, 3)
    actions, rewards = play(environment, tmp_path / "logs", 30)
    assert np.abs(actions).max() > 4
    export("minari", tmp_path / "logs", "--episodes", "marks", "-o", "wrapped-v0")
    recovered = check_recovered("wrapped-v0", actions, rewards)
    assert recovered.observation_space.shape[0] == 3
    for kind in (wrappers.RescaleAction, wrappers.StickyAction, wrappers.FrameStackObservation):
        around = recovered
        while not isinstance(around, kind):
            around = around.env


class Unnamed(gymnasium.Wrapper[Any, Any, Any, Any]):
    """A wrapper that does not say how it was made."""


@pytest.mark.filterwarnings("ignore:.*precision lowered")
@pytest.mark.parametrize(
    ("wrap", "reason"),
    [
        (wrappers.NormalizeObservation, "its statistics change with every step"),
        (wrappers.NormalizeReward, "its statistics change with every step"),
        (lambda one: wrappers.TransformReward(one, lambda r: 2 * r), r"\(func\) are not all JSON"),
        (Unnamed, "it does not say how it was made"),
        (lambda one: wrappers.RescaleAction(one, -np.arange(1, 10.0), 1.0), "making it again"),
    ],
)
def test_a_wrapper_that_a_data_set_cannot_name_is_refused(
    wrap: Any, reason: str, tmp_path: Path
) -> None:
    environment = wrap(Environment("reach"))
    name = type(environment).__name__
    with pytest.raises(trifinger.InvalidArgument, match=rf"{name}.*{reason}.*{name}\(RecordEpis"):
        RecordEpisodes(environment, tmp_path / "logs")
    environment.close()
    assert not (tmp_path / "logs").exists()
    wrap(RecordEpisodes(Environment("reach"), tmp_path / "logs")).close()


@pytest.mark.usefixtures("minari_root")
def test_an_environment_is_recovered_where_the_file_of_its_robot_is_not(
    arm: str, tmp_path: Path, minari_root: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.chdir(Path(arm).parent)
    options = Options.of("reach", frames=("hand",), duration=0.5)
    environment = Environment("reach", config="arm.yml", options=options)
    actions, rewards = play(environment, tmp_path / "logs", 10)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    for name in ("arm.yml", "arm.xml"):
        (Path(arm).parent / name).unlink()
    Path("arm.yml").write_text("name: another\n")
    export("minari", tmp_path / "logs", "--episodes", "marks", "-o", "arm-v0")
    # MuJoCo writes masses into the model of a log with seven digits.
    check_recovered("arm-v0", actions, rewards, digits=1e-5)
    metadata = json.loads((minari_root / "arm-v0/data/metadata.json").read_text())
    assert metadata["recorded_with"]["config"] == arm
    # A policy names the robot's own file, and no other of that name.
    examples = cloning.read("arm-v0")
    assert not examples.environment
    assert examples.note == f"{arm}, the file of its robot, is not here"
    assert clone_command.main(["arm-v0", "-o", "arm.policy", "--epochs", "1"]) == 0
    assert f"not for trifinger run-policy: {examples.note}." in capsys.readouterr().out


@pytest.mark.usefixtures("minari_root")
@pytest.mark.parametrize(
    ("extended", "options"),
    [("trifinger_edu_can", {}), ("dclaw_dynamixel", {"frames": ("FFtip",)})],
)
def test_an_environment_is_recovered_whatever_drives_the_robot(
    extended: str, options: dict[str, Any], tmp_path: Path
) -> None:
    config = tmp_path / "own.yml"
    config.write_text(f"extends: {extended}\nname: own\n")
    environment = Environment("reach", config=str(config), duration=0.5, **options)
    actions, rewards = play(environment, tmp_path / "logs", 10)
    config.unlink()
    export("minari", tmp_path / "logs", "--episodes", "marks", "-o", "driven-v0")
    check_recovered("driven-v0", actions, rewards, digits=1e-5)


@pytest.mark.usefixtures("minari_root")
def test_a_simulation_of_a_connected_robot_is_recovered(tmp_path: Path) -> None:
    config = tmp_path / "own.yml"
    config.write_text("extends: trifinger_edu\n")
    robot = trifinger.Simulation(str(config))
    recorder = robot.record(tmp_path / "logs")
    environment = Environment("reach", config=str(config), connect=robot.connect, duration=0.5)
    expected = robot_configuration(*environment.scene)
    play(environment, tmp_path / "logs", 10)
    recorder.stop()
    config.unlink()
    export("minari", tmp_path / "logs", "--episodes", "marks", "-o", "connected-v0")
    recovered = minari.load_dataset("connected-v0").recover_environment().unwrapped
    assert recovered.simulation is not None
    assert robot_configuration(*recovered.scene) == expected
    recovered.close()


@pytest.mark.usefixtures("minari_root")
def test_a_joint_without_stops_has_none_where_its_environment_is_recovered(
    arm: str, tmp_path: Path
) -> None:
    for path, old, new in (
        (Path(arm).with_suffix(".xml"), ' range="-2 2"', ""),
        (Path(arm), "soft_lower: -1.8, soft_upper: 1.8", "soft_lower: -.inf, soft_upper: .inf"),
    ):
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))
    environment = Environment("reach", config=arm, frames=("hand",), duration=0.5)
    limits = limits_of_file_robot(*environment.scene)
    assert limits["shoulder"]["soft_lower"] == limits["shoulder"]["hard_lower"] < -1e5
    actions, rewards = play(environment, tmp_path / "logs", 10)
    export("minari", tmp_path / "logs", "--episodes", "marks", "-o", "endless-v0")
    recovered = check_recovered("endless-v0", actions, rewards, digits=1e-5)
    assert recovered.unwrapped.scene[0] != arm
    assert limits_of_file_robot(*recovered.unwrapped.scene) == limits


@pytest.mark.usefixtures("minari_root")
@pytest.mark.parametrize("format_", ["minari", "lerobot"])
def test_a_data_set_of_a_log_that_was_cut_off_says_so(
    format_: str, played: Played, minari_root: Path, tmp_path: Path, capsys: Any
) -> None:
    (log,) = played.folder.glob("*.mcap")
    (marks,) = played.folder.glob("*.episodes.jsonl")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size * 2 // 3])
    (tmp_path / marks.name).write_bytes(marks.read_bytes())
    place = "cut-v0" if format_ == "minari" else str(tmp_path / "set")
    export(format_, cut, "--episodes", "marks", "-o", place)
    said = capsys.readouterr().err
    if format_ == "minari":
        losses = json.loads((minari_root / "cut-v0/data/metadata.json").read_text())["losses"]
    else:
        losses = json.loads((tmp_path / "set/meta/losses.json").read_text())
    assert any("cut.mcap was not written: the recording was cut off" in loss for loss in losses)
    assert any("are an episode, but the log ends before step" in loss for loss in losses)
    for loss in losses:
        assert said.count(f"trifinger export: {loss}.\n") == 1


@pytest.mark.usefixtures("minari_root")
@pytest.mark.parametrize("observation", ["flat", "dictionary"])
def test_minari_loads_what_a_robot_measured(seen: Recorded, observation: str) -> None:
    export("minari", seen.folder, "-o", "wave-v0", "--observation", observation)
    data = minari.load_dataset("wave-v0")
    cameras = [LoggedCameras(session) for session in seen.sessions]
    for number, episode in enumerate(data.iterate_episodes()):
        session = seen.sessions[number]
        step = episode.infos["step"]
        assert len(step) == len(episode.actions) + 1 == len(episode.rewards) + 1
        y = session.observations[step]
        state = np.float32(np.concatenate([y[name] for name in y.dtype.names], axis=1))
        action = np.float32(session.desired_actions["position"][step[:-1] + 1])
        np.testing.assert_array_equal(episode.actions, action)
        if observation == "flat":
            np.testing.assert_array_equal(episode.observations[:, : state.shape[1]], state)
            continue
        np.testing.assert_array_equal(episode.observations["state"], state)
        for name in CAMERAS:
            recorded = [cameras[number].get_latest_at(int(t)) for t in step]
            own = np.array([one[name] for one in recorded if one is not None])
            np.testing.assert_array_equal(episode.observations[name], own)
        for i in range(len(step)):
            row = {name: values[i] for name, values in episode.observations.items()}
            assert data.observation_space.contains(row)


@pytest.mark.usefixtures("minari_root")
def test_minari_and_lerobot_have_the_same_steps_between_rows(
    blind: Recorded, played: Played, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export("minari", blind.folder, "-o", "swing-v0", "--high-rate")
    export("minari", blind.folder, "-o", "swing-v1")
    export("lerobot", blind.folder, "-o", tmp_path / "set")
    reader = Reader(tmp_path / "set")
    names = [name for name in reader.features if name.startswith("high_rate.")]
    assert {name.split(".")[1] for name in names} == {"observation", "action", "applied_action"}
    for number, episode in enumerate(minari.load_dataset("swing-v0").iterate_episodes()):
        rows = np.flatnonzero(reader.column("episode_index") == number)
        for name in names:
            expected = np.array([reader.columns[name][row] for row in rows])
            np.testing.assert_array_equal(episode.infos[name], np.float32(expected))
    for episode in minari.load_dataset("swing-v1").iterate_episodes():
        assert list(episode.infos) == ["step"]
    marked = ("minari", played.folder, "--episodes", "marks", "--high-rate", "-o", "reach-v0")
    export(*marked, status=2)
    assert "--observation flat" in capsys.readouterr().err
    export(*marked, "--observation", "flat")


def test_names_that_minari_would_not_find_are_refused(
    blind: Recorded, minari_root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("reach", "../reach-v0", "/reach-v0", "a//b-v0", "reach-v", "a b-v0"):
        export("minari", blind.folder, "-o", name, status=2)
        assert "names no data set of Minari" in capsys.readouterr().err
    assert not list(minari_root.iterdir())


@pytest.mark.slow
@pytest.mark.usefixtures("minari_root")
def test_parts_in_which_a_log_is_read_do_not_show(
    seen: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for number, steps in enumerate((20_000, 130)):
        monkeypatch.setattr(rows, "STEPS", steps)
        folder = tmp_path / f"set{number}"
        export("lerobot", seen.folder, "-o", folder, "--images", "image")
        export("minari", seen.folder, "-o", f"wave-v{number}")
        found.append((Reader(folder), minari.load_dataset(f"wave-v{number}")))
    (one, same), (other, equal) = found
    assert other.columns == one.columns
    assert other.stats == one.stats
    assert other.episodes == one.episodes
    for a, b in zip(same.iterate_episodes(), equal.iterate_episodes(), strict=True):
        np.testing.assert_array_equal(a.actions, b.actions)
        for name in a.observations:
            np.testing.assert_array_equal(a.observations[name], b.observations[name])


def test_marks_of_an_environment_belong_to_the_steps_of_the_log(
    played: Played, tmp_path: Path
) -> None:
    (path,) = played.folder.glob("*.episodes.jsonl")
    sessions = {one.session_id: one for one in trifinger.Log(played.folder).sessions}
    environment = Environment("reach")
    marks = read_marks(path)
    assert [mark.task for mark in marks] == ["Reach"] * 3
    for mark, observations in zip(marks, played.observations, strict=True):
        assert mark.decisions is not None
        session = sessions[mark.session_id]
        steps = mark.decisions.steps
        y = np.array([session.get_observation(int(t))["position"] for t in steps])
        seen = environment.entries(observations)["joint_position"]
        np.testing.assert_allclose(seen, y, atol=1e-5)
        assert (mark.first, mark.end) == (steps[0], steps[-1])
    environment.close()
    export("lerobot", played.folder, "--episodes", "marks", "-o", tmp_path / "set")
    reader = Reader(tmp_path / "set")
    reader.check()
    for number, rewards in enumerate(played.rewards):
        own = reader.column("episode_index") == number
        total = reader.column("next.reward")[own].sum()
        assert total == pytest.approx(rewards.sum(), rel=1e-5)
