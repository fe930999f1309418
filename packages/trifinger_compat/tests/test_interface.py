# SPDX-License-Identifier: BSD-3-Clause
"""Whatever calls the original takes are taken here, and mean the same."""

import inspect
import io
import logging
import re
from ast import literal_eval
from pathlib import Path

import numpy as np
import pytest
from test_symbols import find
from trifinger_cameras.py_camera_types import CameraParameters as MeasuredCamera
from trifinger_object_tracking.py_object_tracker import MODELS
from trifinger_object_tracking.py_tricamera_types import CubeVisualizer
from trifinger_simulation import (
    TriFingerPlatform,
    camera,
    collision_objects,
    get_data_dir,
    sample,
)
from trifinger_simulation.tasks import move_cube_on_trajectory, rearrange_dice

LINES = Path(__file__).with_name("interface_of_the_original.txt").read_text().splitlines()
INTERFACE = [line for line in LINES if not line.startswith("#")]
# Defaults that are others: a renderer of PyBullet, and the size of images of the newest generation.
OTHERS = {"renderer", "image_size"}


def parameters_of(text: str) -> dict[str, str | None]:
    """Names of arguments, and their defaults as text."""
    names = re.findall(r"(?:^|, )(\w+)(?==|,|$)", re.sub(r"=(\([^()]*\)|\[[^\]]*\])", "=0", text))
    parts = [part.partition("=") for part in re.split(rf", (?=(?:{'|'.join(names)})\b)", text)]
    return {name: default if equals else None for name, equals, default in parts if name}


@pytest.mark.filterwarnings("ignore::FutureWarning")
@pytest.mark.parametrize("line", INTERFACE, ids=lambda line: line.partition("(")[0])
def test_calls_of_the_original_are_taken(line: str) -> None:
    path, bracket, arguments = line.partition("(")
    thing = find(path)
    if not bracket:
        return
    theirs = parameters_of(arguments.removesuffix(")"))
    needs_self = re.search(r":\w+\.\w+$", path) and not inspect.ismethod(thing)
    signature = inspect.signature(thing)
    own = [object()] if needs_self and "self" in signature.parameters else []
    needed = [name for name, default in theirs.items() if default is None]
    by_place = signature.bind(*own, *theirs)
    signature.bind(*own, *needed)
    signature.bind(*own, **dict.fromkeys(theirs))
    if not any(each.kind is each.VAR_POSITIONAL for each in signature.parameters.values()):
        assert list(by_place.arguments)[len(own) :] == list(theirs)
    for name, default in theirs.items():
        ours = signature.parameters.get(name)
        if default is None or ours is None or name in OTHERS:
            continue
        if default.startswith("<ObjectType"):
            assert f"{ours.default!r}" == default
        else:
            assert np.array_equal(ours.default, literal_eval(default))


def test_lenses_have_five_numbers() -> None:
    folder = get_data_dir() / "camera_params"
    for each in camera.load_camera_parameters(folder, "camera{id}_cropped.yml"):
        assert each.distortion_coefficients.shape == (5,)
        text = io.StringIO()
        each.dump(text)
        again = camera.CameraParameters.load(io.StringIO(text.getvalue()))
        assert np.array_equal(again.distortion_coefficients, each.distortion_coefficients)
        assert re.search(r"distortion_coefficients:\s+rows: 1\s+cols: 5", text.getvalue())
    assert MeasuredCamera().distortion_coefficients.shape == (5,)


def test_a_cube_without_a_pose_is_at_the_origin() -> None:
    platform = TriFingerPlatform()
    client = platform.simfinger._pybullet_client_id
    cube = collision_objects.ColoredCubeV2(pybullet_client_id=client)
    assert cube.get_state() == ([0, 0, 0], [0, 0, 0, 1])


def test_the_cube_has_a_description_for_other_worlds() -> None:
    text = (get_data_dir() / "cube_v2" / "cube_v2.urdf").read_text()
    assert text.count('<box size="0.065 0.065 0.065"/>') == 2
    assert float(re.findall(r'mass value="([\d.]+)"', text)[0]) == 0.094
    inertia = float(re.findall(r'ixx="([\d.e-]+)"', text)[0])
    assert inertia == pytest.approx(0.094 * 0.065**2 / 6, rel=0.01)


def test_distorting_an_image_is_what_the_lens_does() -> None:
    platform = TriFingerPlatform()
    folder = get_data_dir() / "camera_params"
    (parameters, *_) = camera.load_camera_parameters(folder, "camera{id}_cropped.yml")
    lens, size = parameters.distortion_coefficients, (parameters.width, parameters.height)
    margins = 20, 30
    eye = camera.CalibratedCamera(
        parameters.camera_matrix,
        lens,
        parameters.tf_world_to_camera,
        size,
        pybullet_client_id=platform.simfinger._pybullet_client_id,
    )
    width, height = size[0] + 2 * margins[0], size[1] + 2 * margins[1]
    # Each pixel has its own place as its colour.
    image = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=2).astype(float)
    distorted = eye.distort_image(image)
    assert distorted.shape == image.shape
    (fx, _, cx), (_, fy, cy), _ = parameters.camera_matrix
    centre = np.array([cx + margins[0], cy + margins[1]])
    rows, columns = np.mgrid[40:height:60, 40:width:60]
    is_black = distorted[rows, columns].max(axis=2) == 0  # nothing is seen that far outside
    assert np.count_nonzero(is_black) < 0.1 * is_black.size
    rows, columns = rows[~is_black], columns[~is_black]
    for column, row in zip(columns.ravel(), rows.ravel(), strict=True):
        x, y = (distorted[row, column] - centre) / (fx, fy)
        k1, k2, p1, p2, k3 = lens
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        # OpenCV's model, from the place without distortion to the one with it.
        seen = np.array(
            [
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
            ]
        )
        assert seen * (fx, fy) + centre == pytest.approx([column, row], abs=1.2)
    # Without distortion nothing changes.
    plain = camera.CalibratedCamera(
        parameters.camera_matrix, np.zeros(5), parameters.tf_world_to_camera, size
    )
    assert np.array_equal(plain.distort_image(image), image)


@pytest.mark.parametrize(
    ("near", "far", "error"),
    [
        (0, 1, ValueError),
        (2, 1.6, ValueError),
        (0.3, 100, NotImplementedError),
        (0.02, 0.4, NotImplementedError),
    ],
)
def test_planes_that_would_hide_something_are_refused(
    near: float, far: float, error: type[Exception]
) -> None:
    planes = {"near_plane_distance": near, "far_plane_distance": far}
    for make in (
        lambda: camera.Camera([0, 0, 1], [1, 0, 0, 0], **planes),
        lambda: camera.CalibratedCamera(np.eye(3), np.zeros(5), np.eye(4), (4, 4), **planes),
        lambda: camera.TriFingerCameras(**planes),
    ):
        with pytest.raises(error, match=f"near_plane_distance is {near} m and far_plane"):
            make()
    camera.TriFingerCameras(near_plane_distance=0.05, far_plane_distance=1.5)


@pytest.mark.parametrize("model", MODELS)
def test_models_that_cannot_be_drawn_are_refused(model: str) -> None:
    folder = get_data_dir() / "camera_params"
    files = [folder / f"camera{number}_cropped.yml" for number in (60, 180, 300)]
    if model == "cube_v2":
        CubeVisualizer(model, files)
        return
    with pytest.raises(NotImplementedError, match=rf"'cube_v2'.*'{model}', whose size and colours"):
        CubeVisualizer(model, files)


def test_errors_begin_as_those_of_the_original() -> None:
    def said(call: object, *words: object) -> str:
        with pytest.raises(Exception, match=r".") as error:
            call(*words)  # type: ignore[operator]
        return f"{error.typename}: {error.value}"

    task, dice = move_cube_on_trajectory, rearrange_dice
    place = (0, 0, 0.05)
    for found, expected in (
        (said(task.validate_goal, []), "ValueError: Trajectory is empty"),
        (
            said(task.validate_goal, [(5, place)]),
            "ValueError: First goal does not start at t=0",
        ),
        (
            said(task.validate_goal, [(0, place), (9, place), (3, place)]),
            "ValueError: Goal 2 starts before previous goal",
        ),
        (
            said(dice.validate_goal, [(0, 0, 0.011)]),
            "InvalidGoalError: Wrong number of positions.  Expected 25, got 1",
        ),
        (
            said(dice.validate_goal, [(0, 0)] * 25),
            "InvalidGoalError: Position 0 has invalid shape.",
        ),
        (
            said(dice.validate_goal, [(0.5, 0, 0.011)] * 25),
            "OutOfArenaError: Position (0.5, 0, 0.011) is outside the arena.",
        ),
        (
            said(sample.get_tip_positions_around_position, 2, [0, 0, 0]),
            "ValueError: Invalid number of fingers",
        ),
    ):
        assert found.startswith(expected)


def test_a_simulation_that_cannot_be_shown_speaks_of_what_its_user_knows(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    platform = TriFingerPlatform(visualization=True)
    with caplog.at_level(logging.WARNING):
        for _ in range(100):
            platform.append_desired_action(platform.Action())
    (message,) = (record.getMessage() for record in caplog.records)
    assert "there is no screen for a window" in message
    assert "visualization" in message
    assert "render_mode" not in message
