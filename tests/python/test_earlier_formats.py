# SPDX-License-Identifier: BSD-3-Clause
"""Files of earlier commits are read with the same numbers, or refused in one sentence.

The files in tests/earlier_formats begin with their commit. Configurations are copies. The motion
was written by the program of its commit; options are the defaults of theirs. Policy and cameras
have the bytes that the page and the source of their commits say. The log is of 8526e3e8, the first
format; tests/log/golden_test.cpp has the formulas that it was made with. The logs with images were
written by the recorder of the commit that began to keep images.
"""

import json
import math
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import PROGRAM
from ruamel.yaml import YAML
from trifinger import policy_file
from trifinger.commands import evaluate
from trifinger.environments import Options
from trifinger.errors import InvalidArgument
from trifinger.log.images import LoggedCameras
from trifinger_view.motion import Motion

ROOT = Path(__file__).parents[2]
FILES = ROOT / "tests" / "earlier_formats"


# ---- logs ----


def test_a_log_of_the_first_format_has_its_numbers() -> None:
    log = trifinger.Log(ROOT / "tests/log/data/format_1.mcap")
    session = log.session("odd")
    t = np.array([*range(20), *range(30, 50)])
    assert session.time_index.tolist() == t.tolist()
    assert [(gap.first, gap.last, gap.reason) for gap in session.gaps] == [
        (20, 29, "the disk was full")
    ]
    assert session.period == 0.001
    assert session.session_id == 42
    observations, desired, applied = (
        session.get_observations(0, 20),
        session.get_desired_actions(0, 20),
        session.get_applied_actions(30, 50),
    )
    np.testing.assert_array_equal(observations["left"]["angle"], 0.5 * t[:20])
    np.testing.assert_array_equal(observations["right"]["speed"], 2.0 * t[:20])
    np.testing.assert_array_equal(observations["gears"][:, 1, 1], t[:20])
    np.testing.assert_array_equal(desired["speed"], np.column_stack([0.125 * t[:20], [7.0] * 20]))
    np.testing.assert_array_equal(desired["colour"], 1000 + t[:20])
    np.testing.assert_array_equal(applied["was_clipped"], t[20:] % 2)
    statuses = session.get_statuses(30, 50)
    np.testing.assert_array_equal(statuses["time"], (100 + t[20:]) * 1_000_000 + t[20:])
    lamp = log.session("odd.lamp").observations
    np.testing.assert_array_equal(lamp["stamp"]["capture_index"], 3 * np.arange(10) - 2)
    np.testing.assert_array_equal(lamp["colour"], [(i, 2, 3) for i in range(10)])
    assert session.documents == {"configuration.yml": "colour: red\n"}


@pytest.mark.parametrize("storage", ["raw", "jpeg"])
def test_a_log_with_images_of_the_first_format_has_its_pixels(storage: str) -> None:
    session = trifinger.Log(FILES / f"820002a1_{storage}.mcap").session("robot")
    cameras = LoggedCameras(session)
    assert cameras.names == ("camera60", "camera180", "camera300")
    assert "distortion: [-0.2, 0, 0, 0, 0]" in cameras.calibration
    assert len(cameras) == 5
    rows, columns = np.indices((16, 16))
    for number, images in enumerate(cameras):
        latest = cameras.get_latest_at(min(10 * number + 9, 40))
        assert latest is not None
        assert latest.index == number
        for camera, name in enumerate(cameras.names):
            frame = images.frame(name)
            assert frame.number == number
            if (camera, number) == (1, 2):  # The camera was late.
                assert frame.state == "none"
                assert not images.has(name)
                continue
            drawn = 40 + 2 * rows + 3 * columns + 10 * camera + 4 * number
            error = images.raw(name).astype(int) - drawn
            assert images.recorded(name)[0] == {"raw": "bayer_rggb8", "jpeg": "jpeg"}[storage]
            assert np.abs(error).max() <= {"raw": 0, "jpeg": 6}[storage]
            lag = images.time_of(name) - images.time_of("camera60")
            assert lag == np.timedelta64(7000 * camera, "ns")


# ---- policies, and the options of environments in them ----


def test_a_policy_of_the_first_format_computes_the_same() -> None:
    policy = trifinger.Policy(FILES / "88e42d4e.policy")
    assert policy.metadata == {"robot": "trifinger_pro"}
    x = np.array([0.6, -1.0, 0.8])
    scaled = np.clip((x - [0.1, 0.2, 0.3]) / np.sqrt(np.add([1.0, 4.0, 0.25], 1e-8)), -10, 10)
    scaled = scaled.astype(np.float32)  # as in training
    hidden = np.maximum(0, [[0.5, -0.25, 1.0], [-1.5, 0.75, 0.125]] @ scaled + [0.25, 0.5])
    y = np.tanh([[1.0, -0.5], [0.25, 2.0]] @ hidden + [-0.125, 0.0625])
    low, high = np.array([-0.36, -0.5]), np.array([0.36, 1.5])
    np.testing.assert_allclose(policy(x), low + (y + 1) / 2 * (high - low), rtol=0, atol=1e-12)


@pytest.mark.parametrize("commit", ["dc2987ec", "f9bebc82"])
def test_options_of_earlier_environments_keep_their_values(commit: str) -> None:
    text = (FILES / f"{commit}_options.json").read_text()
    now = json.loads(Options.from_json(text).to_json())
    assert {name: now[name] for name in json.loads(text)} == json.loads(text)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ((FILES / "28b811f6_options.json").read_text(), "'torque_noise'"),
        ("[1]", "must be a JSON object"),
        ("nonsense", "must be a JSON object"),
    ],
)
def test_options_that_there_are_no_longer_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, sentence: str
) -> None:
    with pytest.raises(InvalidArgument, match=sentence):
        Options.from_json(text)
    file = tmp_path / "old.policy"
    layer = (np.zeros((9, 36)), np.zeros(9), "tanh")
    policy_file.write(file, [layer], metadata={"task": "reach", "options": text})
    assert evaluate.main([str(file), "--episodes", "1"]) == 2
    assert sentence in capsys.readouterr().err.splitlines()[-1]


# ---- motions and cameras ----


def test_a_motion_of_the_first_format_has_its_numbers() -> None:
    motion = Motion.load(FILES / "32460a48_motion.csv")
    assert motion.robot == "trifinger-edu-single"
    assert motion.joints == ("upper", "middle", "lower")
    assert motion.history == ("made for a test",)
    np.testing.assert_array_equal(motion.times, np.arange(5) * 0.001)
    rows = [[0.1 * j + 0.01 * i for j in range(3)] for i in range(5)]
    np.testing.assert_array_equal(motion.positions, rows)
    assert motion.tips is not None
    np.testing.assert_array_equal(
        motion.tips[:, 0], [(0.1 + 0.001 * i, 0.2, 0.3) for i in range(5)]
    )


def test_a_calibration_of_cameras_of_the_first_format_has_its_numbers() -> None:
    path = FILES / "453e7503_cameras.yml"
    calibration = trifinger.CameraCalibration.read(path)
    known = YAML(typ="safe").load(path)
    assert calibration.date == known["date"]
    assert calibration.residual == known["residual"]
    assert len(calibration.cameras) == 2
    for camera, expected in zip(calibration.cameras, known["cameras"], strict=True):
        assert camera.name == expected["name"]
        assert camera.serial == expected["serial"]
        assert [camera.width, camera.height] == [expected["width"], expected["height"]]
        assert camera.pixels == expected["pixels"]
        assert list(camera.lens.focal_length) == expected["focal_length"]
        assert list(camera.lens.principal_point) == expected["principal_point"]
        assert list(camera.lens.distortion) == expected["distortion"]
        np.testing.assert_array_equal(camera.pose[:3, 3], expected["position"])
        w, x, y, z = expected["orientation"]
        first_column = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
        np.testing.assert_allclose(camera.pose[:3, 0], first_column, atol=1e-15)


# ---- configurations ----


def leaves(node: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Path and value of each key in a file."""
    if isinstance(node, dict):
        for name, value in node.items():
            yield from leaves(value, f"{path}.{name}" if path else name)
    elif isinstance(node, list) and node and isinstance(node[0], dict):
        for number, value in enumerate(node):
            yield from leaves(value, f"{path}.{number}")
    else:
        yield path, node


def shown(value: Any) -> Any:
    """A value that can be compared: a list of equal entries is like one of them."""
    if isinstance(value, list):
        entries = [shown(each) for each in value]
        return entries[0] if entries and all(each == entries[0] for each in entries) else entries
    return math.inf if value == ".inf" else value


@pytest.mark.parametrize(
    "name",
    [
        "0c775ed4_sim",
        "edb6c30b_trifinger_edu",
        "edb6c30b_trifinger_pro",
        "4e589ab4_trifinger_edu_can",
        "eb446a72_sim_cameras",
        "a94d0809_dclaw_dynamixel",
    ],
)
def test_an_earlier_configuration_means_the_same(name: str) -> None:
    path = FILES / f"{name}.yml"
    command = [PROGRAM, "config", path, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    yaml = YAML(typ="safe")
    known = {key["path"]: yaml.load(key["value"]) for key in json.loads(done.stdout)["keys"]}
    given = [(key, value) for key, value in leaves(yaml.load(path)) if key != "extends"]
    assert len(given) > 5
    for key, value in given:
        if value not in ({}, []):  # `trifinger config` leaves out what is empty.
            assert shown(known[key]) == shown(value), key


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("0c775ed4_trifinger_pro", "13:3: fingers.soft_tips is missing"),
        ("28b811f6_trifinger_one", "32:3: safety.max_power is not a known key; known are "),
        ("6c3b60dc_trifinger_edu_can", "17:3: boards.self_test is missing"),
    ],
)
def test_a_configuration_from_before_the_first_release_is_refused_with_its_line(
    name: str, sentence: str
) -> None:
    command = [PROGRAM, "config", FILES / f"{name}.yml"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert f"{name}.yml:{sentence}" in done.stderr
    assert len(done.stderr.splitlines()) == 1
