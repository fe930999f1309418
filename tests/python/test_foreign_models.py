# SPDX-License-Identifier: BSD-3-Clause
"""The model in a log may come from anybody: it opens nothing and stays within limits."""

import ast
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
import trifinger
from trifinger.environments import Environment, Options
from trifinger.foreign_models import model_of
from trifinger.picture import Painter
from trifinger_view.scene import Scene

PYTHON = Path(trifinger.__file__).parent
JOINT = '<worldbody><body name="b"><joint name="a"/><geom size="0.1"/></body></worldbody>'


def model_with(more: str) -> str:
    return f"<mujoco>\n{more}{JOINT}</mujoco>"


@pytest.mark.parametrize("reader", [model_of, Scene, Painter])
@pytest.mark.parametrize(
    "element",
    [
        '<include file="{}"/>',
        '<asset><mesh name="m" file="{}"/></asset>',
        '<asset><model name="m" file="{}"/></asset>',
        '<asset><texture name="t" type="cube" fileback="{}"/></asset>',
    ],
)
def test_fault_77_a_text_on_its_own_opens_no_file(reader, element, tmp_path):
    os.mkfifo(tmp_path / "fifo.stl")  # whoever opens it waits for ever
    text = model_with(element.format(tmp_path / "fifo.stl"))
    with pytest.raises(trifinger.InvalidArgument, match="text"):
        reader(text)


@pytest.mark.parametrize(
    ("element", "problem"),
    [
        ('<size nuser_body="2000000000"/>', "may be at most 1000"),
        (
            '<asset><texture name="t" type="2d" builtin="flat" width="99999" height="9"/></asset>',
            "may be at most 16384",
        ),
        ('<extension><plugin plugin="mujoco.pid"/></extension>', "<plugin>"),
        ('<option timestep="nonsense"/>', "bad format"),
    ],
)
def test_fault_77_a_text_on_its_own_is_judged(element, problem, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(trifinger.InvalidArgument, match=problem) as caught:
        model_of(model_with(element))
    assert "the model cannot be read: " in str(caught.value)
    assert "2" in str(caught.value)  # the line
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_fault_77_warnings_of_mujoco_leave_no_file(tmp_path, monkeypatch):
    import mujoco

    monkeypatch.chdir(tmp_path)
    model = model_of(model_with('<option timestep="0.1"/>'))
    data = mujoco.MjData(model)
    data.qvel[:] = np.nan
    mujoco.mj_step(model, data)
    assert data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number == 1
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


@pytest.mark.parametrize("is_same", [True, False])
def test_fault_77_a_connected_robot_names_no_other_files(arm, is_same, tmp_path):
    shutil.copy(tmp_path / "arm.xml", tmp_path / "other.xml")
    model = "arm.xml" if is_same else "other.xml"
    robot = trifinger.Simulation(arm, {"robot.mjcf": str(tmp_path / model)})
    options = Options(frames=("hand",))
    environment = Environment("reach", options=options, config=arm, connect=robot.connect)
    (tmp_path / "other.xml").write_text("whoever opens this fails in another way")
    if is_same:
        environment.reset(seed=0)
        return
    with pytest.raises(trifinger.InvalidArgument, match=r"other\.xml, which is not the file that"):
        environment.reset(seed=0)


def test_fault_77_python_gives_mujoco_texts_in_one_place():
    readers = {"from_xml_string", "from_xml_path", "from_binary_path", "from_string", "from_file"}
    found = {
        path.name
        for path in PYTHON.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and node.attr in readers
    }
    assert found == {"foreign_models.py"}


def test_free_bodies_have_the_names_of_their_sessions():
    scene = Scene(
        model_with(
            '<worldbody><body name="my ball"><freejoint/><geom size="0.1"/></body>'
            '<body><freejoint/><geom size="0.1"/></body></worldbody>'
        )
    )
    assert scene.object_names == ("my_ball", "body2")
    pose = np.array([1.0, 2, 3, 1, 0, 0, 0])
    positions, _ = scene.poses(None, {"my_ball": pose, "body2": pose})
    shown = {body.object: row for body, row in zip(scene.bodies, positions, strict=True)}
    np.testing.assert_allclose(shown["my_ball"], pose[:3])
    np.testing.assert_allclose(shown["body2"], pose[:3])
