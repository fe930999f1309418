# SPDX-License-Identifier: BSD-3-Clause
"""Logs in Python: what was written is what NumPy, pandas, CSV and Parquet have."""

import contextlib
import csv
import os
import pickle
import re
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import BUILD
from hypothesis import given, strategies as st

pytestmark = pytest.mark.bindings

SERIES = ("desired_action", "applied_action", "observation", "status")
STEPS = 600


@dataclass
class Written:
    """A log, and what went into it."""

    folder: Path

    @property
    def path(self) -> Path:
        return self.folder / "log.mcap"

    @property
    def log(self) -> trifinger.Log:
        return trifinger.Log(self.path)

    def elements(self, series: str, dtype: np.dtype[Any]) -> Any:
        return np.frombuffer((self.folder / f"{series}.bin").read_bytes(), dtype)


def write_log(folder: Path, robot: str, *options: int) -> Written:
    folder.mkdir(exist_ok=True)
    command = [str(BUILD / "tests/python/write_log"), str(folder), robot, *map(str, options)]
    subprocess.run(command, check=True)
    return Written(folder)


@pytest.fixture(scope="module", params=["trifinger", "odd"])
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_log(tmp_path_factory.mktemp(request.param), request.param, STEPS)


@pytest.fixture(scope="module")
def trifinger_log(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_log(tmp_path_factory.mktemp("trifinger"), "trifinger", STEPS)


@pytest.fixture(scope="module")
def log_with_gap(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_log(tmp_path_factory.mktemp("gap"), "trifinger", STEPS, 200, 249)


def dtypes(session: trifinger.LoggedSession | trifinger.Frontend) -> dict[str, np.dtype[Any]]:
    return {
        "desired_action": session.action_dtype,
        "applied_action": session.applied_action_dtype,
        "observation": session.observation_dtype,
        "status": session.status_dtype,
    }


# ---- series ----


def test_whole_series_are_what_was_written(written: Written) -> None:
    session = written.log.session("robot")
    whole = {
        "desired_action": session.desired_actions,
        "applied_action": session.applied_actions,
        "observation": session.observations,
        "status": session.statuses,
    }
    for series, dtype in dtypes(session).items():
        assert whole[series].dtype == dtype
        assert whole[series].tobytes() == written.elements(series, dtype)[:STEPS].tobytes()
    assert session.time_index.tolist() == list(range(STEPS))
    lamp = session.companions[0]
    expected = written.elements("companion", lamp.observation_dtype)
    assert lamp.observations.tobytes() == expected.tobytes()


@given(st.integers(0, STEPS), st.integers(0, STEPS), st.integers(1, 250))
def test_every_range_is_what_was_written(
    trifinger_log: Written, a: int, b: int, count: int
) -> None:
    first, last = sorted((a, b))
    session = trifinger_log.log.session()
    for series, dtype in dtypes(session).items():
        get = {
            "desired_action": session.get_desired_actions,
            "applied_action": session.get_applied_actions,
            "observation": session.get_observations,
            "status": session.get_statuses,
        }[series]
        expected = trifinger_log.elements(series, dtype)[first:last].tobytes()
        assert get(first, last).tobytes() == expected
        parts = list(session.chunks(count, first, last, series=(series,)))
        assert all(len(part) == count for part in parts[:-1])
        name = "statuses" if series == "status" else series + "s"
        assert b"".join(getattr(part, name).tobytes() for part in parts) == expected


def test_the_dtypes_are_those_of_the_front_end(trifinger_log: Written) -> None:
    with trifinger.simulate() as robot:
        assert dtypes(trifinger_log.log.session()) == dtypes(robot)
        cube = robot.companion("object")
        logged = trifinger_log.log.session("robot.object")
        assert logged.observation_dtype == cube.observation_dtype


def test_elements_are_those_of_the_front_end(trifinger_log: Written) -> None:
    session = trifinger_log.log.session()
    y = session.get_observation(7)
    assert isinstance(y, trifinger.Element)
    assert np.array_equal(y.position, session.observations["position"][7], equal_nan=True)
    assert session.get_status(STEPS).flags == trifinger.Status.END


def test_the_end_has_an_observation_but_no_action(written: Written) -> None:
    session = written.log.session()
    assert session.range("observation") == (0, STEPS + 1)
    assert session.range("applied_action") == (0, STEPS)
    expected = written.elements("observation", session.observation_dtype)
    assert session.get_observations(0, STEPS + 1).tobytes() == expected.tobytes()
    with pytest.raises(trifinger.NotInLog, match=f"step {STEPS}.*steps 0 to {STEPS - 1}"):
        session.get_desired_action(STEPS)


def test_some_fields_can_be_read_alone(trifinger_log: Written) -> None:
    session = trifinger_log.log.session()
    some = session.get_observations(10, 20, fields=("torque", "position"))
    assert some.dtype.names == ("position", "torque")
    assert np.array_equal(some["torque"], session.observations["torque"][10:20], equal_nan=True)
    steps = session.read(5, 9, series={"observation": "velocity", "status": None})
    assert steps.observations.dtype.names == ("velocity",)
    assert steps.statuses.dtype == session.status_dtype
    assert steps.desired_actions is None


def test_time_selects_steps(trifinger_log: Written) -> None:
    session = trifinger_log.log.session()
    assert session.between(0.1, 0.25) == (100, 250)
    assert session.between(-1.0, 1e9) == (0, STEPS)
    times = session.times
    assert times[0] == np.datetime64("2023-11-14T22:13:20")
    assert np.all(np.diff(times) == np.timedelta64(1, "ms"))


def test_the_newest_pose_is_known_at_every_step(trifinger_log: Written) -> None:
    cube = trifinger_log.log.session().companion("object")
    for t in (0, 9, 10, 311, STEPS):
        latest = cube.get_latest_at(t)
        assert latest is not None
        assert latest.stamp.arrival_index == min(t, STEPS - 10) // 10 * 10
    with pytest.raises(trifinger.NotInLog):
        cube.get_latest_at(STEPS + 1)


def test_what_is_missing_is_named_and_left_out(log_with_gap: Written) -> None:
    session = log_with_gap.log.session()
    assert session.gaps == [trifinger.Gap(200, 249, "the disk was full")]
    assert session.time_index.tolist() == [*range(200), *range(250, STEPS)]
    expected = log_with_gap.elements("observation", session.observation_dtype)
    assert session.observations.tobytes() == expected[session.time_index].tobytes()
    with pytest.raises(trifinger.NotInLog, match="steps 200 to 249: the disk was full"):
        session.get_observations(190, 210)


def test_a_log_says_what_it_is_about(written: Written) -> None:
    log = written.log
    assert log.files == [written.path]
    assert log.size == written.path.stat().st_size
    assert log.is_finished
    assert log.origin["precision"] == "double"
    assert (log.damage, log.lost_bytes) == ([], 0)
    assert [event.text for event in log.events] == ["the disk is nearly full"]
    session = log.session()
    assert (session.name, session.steps, session.period) == ("robot", STEPS, 0.001)
    assert session.documents == {"configuration.yml": "period: 0.001 s\n"}
    assert session.fault == trifinger.Fault("action_late", 0, STEPS, needs_recovery=True)


def test_many_threads_read_one_log(written: Written) -> None:
    session = written.log.session()
    expected = written.elements("observation", session.observation_dtype)
    wrong = []

    def read() -> None:
        for first in range(0, STEPS, 50):
            if session.get_observations(first, first + 50).tobytes() != (
                expected[first : first + 50].tobytes()
            ):
                wrong.append(first)

    threads = [threading.Thread(target=read) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


# ---- other processes ----


def in_child(call: Callable[[], object]) -> int:
    """Calls a function in a forked child; returns the exit code: 0 if it returned True."""
    child = os.fork()
    if child == 0:
        try:
            os._exit(0 if call() is True else 2)
        except BaseException:  # the child must not go on with the tests
            traceback.print_exc()
            os._exit(3)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_fault_64_a_log_opened_before_a_fork_is_read_by_the_child(
    written: Written, log_with_gap: Written, tmp_path: Path
) -> None:
    log = written.log
    session = log.session("robot")
    expected = written.elements("observation", session.observation_dtype)
    other = tmp_path / "other"
    other.write_bytes(b"other people's bytes" * 4096)

    def read() -> bool:
        with contextlib.ExitStack() as stack:
            # If the child's descriptors were closed, their numbers would now be those of others.
            opened = [stack.enter_context(other.open("rb")) for _ in range(64)]
            also = log_with_gap.log.session()
            return (
                session.get_observations(0, STEPS).tobytes() == expected[:STEPS].tobytes()
                and log.lost_bytes == 0
                and len(also.observations) == STEPS - 50
                and all(file.read(5) == b"other" for file in opened)
            )

    assert in_child(read) == 0
    assert read()


@pytest.mark.slow
def test_fault_64_a_log_that_a_thread_reads_during_a_fork_is_whole_in_the_child(
    trifinger_log: Written,
) -> None:
    session = trifinger_log.log.session()
    expected = trifinger_log.elements("observation", session.observation_dtype)[:STEPS].tobytes()
    is_done = threading.Event()

    def read() -> bool:
        return session.get_observations(0, STEPS).tobytes() == expected

    def read_on() -> None:
        while not is_done.is_set():
            read()

    thread = threading.Thread(target=read_on)
    thread.start()
    codes = [in_child(read) for _ in range(20)]
    is_done.set()
    thread.join()
    assert codes == [0] * 20


def test_pickles_of_a_log_are_the_same_log(
    written: Written, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(written.folder)
    log = trifinger.Log("log.mcap")
    session = log.session("robot")
    pickled = pickle.dumps([log, session, *session.companions])
    monkeypatch.chdir(tmp_path)
    same_log, same, *companions = pickle.loads(pickled)  # noqa: S301
    assert same_log.files == [written.path]
    assert repr(same) == repr(session)
    assert same.observations.tobytes() == session.observations.tobytes()
    for found, companion in zip(companions, session.companions, strict=True):
        assert found.name == companion.name
        assert found.observations.tobytes() == companion.observations.tobytes()
    assert pickle.loads(pickle.dumps(same)).name == session.name  # noqa: S301


def test_a_pickle_of_a_log_that_was_replaced_is_an_error(tmp_path: Path) -> None:
    for folder in ("one", "other"):
        with trifinger.simulate("finger_edu", record=tmp_path / folder) as robot:
            robot.wait_until_time_index(robot.append_desired_action(robot.new_action()))
    log, other = trifinger.Log(tmp_path / "one"), trifinger.Log(tmp_path / "other")
    pickled = [pickle.dumps(log), pickle.dumps(log.session())]
    other.files[0].replace(log.files[0])
    for one in pickled:
        with pytest.raises(trifinger.Error, match=r"\.mcap was replaced by another one"):
            pickle.loads(one)  # noqa: S301


def test_whole_series_are_kept_and_cannot_be_changed(written: Written) -> None:
    session = written.log.session()
    assert session.observations is session.observations
    with pytest.raises(ValueError, match="read-only"):
        session.statuses["flags"] = 1


def test_damage_is_named_and_the_rest_is_read(trifinger_log: Written, tmp_path: Path) -> None:
    damaged = Written(tmp_path)
    content = bytearray(trifinger_log.path.read_bytes())
    content[len(content) // 2] ^= 1
    damaged.path.write_bytes(content)
    log = damaged.log
    assert log.lost_bytes > 0
    assert log.damage[0].file == damaged.path
    (gap,) = log.session().gaps
    assert gap.last - gap.first + 1 == 50  # a chunk
    assert len(log.session().observations) == STEPS - 50


# ---- against the official reader ----


def fields_of(message: object, dtype: np.dtype[Any]) -> list[Any]:
    """The numbers of a decoded message in the order of `dtype`, bit by bit."""
    numbers: list[Any] = []
    for name in dtype.names or ():
        value, inner = getattr(message, name), dtype[name]
        if inner.names is not None:
            numbers += fields_of(value, inner)
        else:
            numbers.append(np.asarray(value, inner.base).tobytes())
    return numbers


def test_the_official_decoder_sees_the_same_numbers(written: Written) -> None:
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_ros2.decoder")
    session = written.log.session()
    parts = dict(zip(SERIES, SERIES, strict=True))
    seen = 0
    with written.path.open("rb") as file:
        messages = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        for _, channel, _, message in messages.iter_decoded_messages(topics=["/robot/step"]):
            assert channel.metadata["role"] == "step"
            t = message.time_index
            for series, part in parts.items():
                dtype = dtypes(session)[series]
                element = getattr(session, f"get_{series}")(t)
                expected = b"".join(fields_of(getattr(message, part), dtype))
                assert np.asarray(element).tobytes() == expected
            seen += 1
    assert seen == STEPS


# ---- wrong arguments ----


@pytest.mark.parametrize(
    ("use", "error", "text"),
    [
        (lambda s: s.get_observations(5, 2), trifinger.InvalidArgument, "last is 2"),
        (lambda s: s.get_observations(0, 10**15), trifinger.NotInLog, "has steps 0 to 600"),
        (lambda s: s.get_observations(-3, 2), trifinger.NotInLog, "step -3"),
        (
            lambda s: s.get_observations(0, 2, fields=("angle",)),
            trifinger.InvalidArgument,
            "no field 'angle'; there are 'position'",
        ),
        (lambda s: s.get_observations(0, 2, fields=()), trifinger.InvalidArgument, "None stands"),
        (
            lambda s: s.read(series=("observations",)),
            trifinger.InvalidArgument,
            "no series 'observations'; there are desired_action",
        ),
        (
            lambda s: s.read(series=("status", "status")),
            trifinger.InvalidArgument,
            "'status' is there twice",
        ),
        (lambda s: s.chunks(0), trifinger.InvalidArgument, "count is 0"),
        (lambda s: s.companion("camera"), trifinger.InvalidArgument, "it has 'object'"),
        (lambda s: s.between(2.0, 1.0), trifinger.InvalidArgument, "must not lie before"),
        (lambda s: s.get_latest_at(1), trifinger.InvalidArgument, "use get_observation"),
        (
            lambda s: s.companion("object").desired_actions,
            trifinger.InvalidArgument,
            "no series 'desired_action'",
        ),
    ],
)
def test_wrong_arguments_get_helpful_errors(
    trifinger_log: Written,
    use: Callable[[trifinger.LoggedSession], object],
    error: type[Exception],
    text: str,
) -> None:
    with pytest.raises(error, match=text):
        use(trifinger_log.log.session())


def test_what_is_no_log_is_said_to_be_none(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        trifinger.Log(tmp_path / "nothing.mcap")
    (tmp_path / "text.mcap").write_text("hello, I am no log")
    with pytest.raises(trifinger.Error, match="is no MCAP file"):
        trifinger.Log(tmp_path / "text.mcap")
    (tmp_path / "empty").mkdir()
    with pytest.raises(trifinger.InvalidArgument, match="has no"):
        trifinger.Log(tmp_path / "empty")


# ---- tables ----


def columns(elements: Any, prefix: str) -> dict[str, Any]:
    """Each number of structured elements under the name that a table has for it."""
    found: dict[str, Any] = {}
    for name in elements.dtype.names:
        values = elements[name]
        if values.dtype.names is not None:
            found |= columns(values, f"{prefix}{name}.")
            continue
        for index in np.ndindex(values.shape[1:]):
            suffix = "".join(f"[{i}]" for i in index)
            found[prefix + name + suffix] = values[(slice(None), *index)]
    return found


def expected_table(session: trifinger.LoggedSession) -> dict[str, Any]:
    steps = session.read()
    table: dict[str, Any] = {"time_index": steps.time_index, "time": steps.times}
    for prefix, elements in (
        ("observation.", steps.observations),
        ("applied_action.", steps.applied_actions),
        ("desired_action.", steps.desired_actions),
        ("status.", steps.statuses),
    ):
        table |= columns(elements, prefix)
    return table


def assert_same_table(frame: Any, expected: dict[str, Any]) -> None:
    assert list(frame) == list(expected)
    for name, values in expected.items():
        found = frame[name].to_numpy()
        if values.dtype.kind in "iu":
            assert np.array_equal(found, values), name
        elif values.dtype.kind == "f":
            found = found.astype(values.dtype)
            assert np.array_equal(found, values, equal_nan=True), name
        else:
            assert np.all(found.astype("datetime64[ns]") == values), name


def test_pandas_has_a_column_per_number(written: Written) -> None:
    pytest.importorskip("pandas")
    session = written.log.session()
    assert_same_table(session.to_pandas(), expected_table(session))
    assert len(session.to_pandas(10, 20)) == 10


@pytest.mark.slow
@pytest.mark.parametrize("rows", [7, 100_000])
def test_csv_and_parquet_read_back_the_same(
    written: Written, tmp_path: Path, rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    monkeypatch.setattr("trifinger.log.steps.ROWS", rows)
    session = written.log.session()
    session.to_csv(tmp_path / "a.csv")
    session.to_parquet(tmp_path / "a.parquet")
    expected = expected_table(session)
    assert_same_table(pandas.read_parquet(tmp_path / "a.parquet"), expected)
    assert_same_table(pandas.read_csv(tmp_path / "a.csv", parse_dates=["time"]), expected)


def test_units_are_in_the_parquet_file(trifinger_log: Written, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    trifinger_log.log.session().to_parquet(tmp_path / "a.parquet")
    schema = parquet.read_schema(tmp_path / "a.parquet")
    assert schema.field("observation.position[3]").metadata == {b"unit": b"rad"}


def test_csv_needs_nothing_but_numpy(written: Written, tmp_path: Path) -> None:
    text = f"""
import sys
sys.modules["pandas"] = sys.modules["pyarrow"] = None
import trifinger
trifinger.Log({str(written.path)!r}).session().to_csv("a.csv")
"""
    subprocess.run([sys.executable, "-c", text], check=True, cwd=tmp_path)
    session = written.log.session()
    with (tmp_path / "a.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    expected = expected_table(session)
    assert header == list(expected)
    assert len(rows) == len(session.time_index)
    for name, column in zip(header, zip(*rows, strict=True), strict=True):
        values = expected[name]
        if values.dtype.kind == "M":
            found = np.array(column, "datetime64[ns]")
        else:
            found = np.array(column).astype(values.dtype)
        np.testing.assert_array_equal(found, values, err_msg=name)


@pytest.mark.parametrize(
    ("missing", "program"),
    [
        ("pandas", "session.to_pandas()"),
        ("pyarrow", "session.to_parquet('a.parquet')"),
    ],
)
def test_a_missing_library_is_named_with_its_remedy(
    trifinger_log: Written, tmp_path: Path, missing: str, program: str
) -> None:
    text = f"""
import sys
sys.modules[{missing!r}] = None
import trifinger
session = trifinger.Log({str(trifinger_log.path)!r}).session()
try:
    {program}
except trifinger.Error as error:
    print(error)
"""
    output = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, check=True, cwd=tmp_path
    ).stdout
    assert re.search(rf"{missing} is missing: ./run setup", output)
