# SPDX-License-Identifier: BSD-3-Clause
"""Students: what they see, what they are told, and that their files do what they have learned."""

import json
import os

import numpy as np
import onnxruntime
import pytest
import torch
from conftest import PROGRAM, output_of
from gymnasium.spaces import flatten
from link_into_venv import write_scripts
from trifinger import Policy, policy_file
from trifinger.commands import distill as command
from trifinger.environments import Environment, Options, VectorEnvironment, policy_metadata
from trifinger.errors import InvalidArgument
from trifinger.evaluation import act_of, evaluate, vectors_of
from trifinger.training.distillation import (
    Layout,
    Lessons,
    Student,
    _Examples,
    _Robots,
    distill,
    options_of_student,
)

SHORT = {"duration": 0.4, "action": "position_change", "position_change": 0.06}
SEEING = {"observation": "images", "camera_size": 20, "camera_rate": 50.0}
FEW = Lessons(episodes=8, rounds=2, num_envs=2, every=3, epochs=3, looks=1, layers=(16, 8))


@pytest.fixture(scope="module")
def teacher(tmp_path_factory):
    """A policy that steps toward the goal as nobody else would: linear, of what it sees turned."""
    options = Options.of("push", **SHORT, symmetric_view=True, object_offsets=True)
    with_all = VectorEnvironment("push", 1, options=options)
    size = with_all.single_observation_space.shape[0]
    with_all.close()
    random = np.random.default_rng(3)
    layers = [(random.normal(0.0, 0.6, (9, size)), np.zeros(9), "tanh")]
    path = tmp_path_factory.mktemp("teacher") / "teacher.policy"
    metadata = policy_metadata("push", options)
    return policy_file.write(path, layers, low=[-1.0] * 9, high=[1.0] * 9, metadata=metadata)


@pytest.fixture
def _installed(tmp_path_factory, monkeypatch):
    """The programs are where somebody who has installed them has them."""
    folder = tmp_path_factory.mktemp("programs")
    write_scripts(folder)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")


def test_the_student_is_told_what_moves_the_robot_as_the_teacher_would(teacher):
    quiet = Lessons(episodes=4, rounds=1, num_envs=2, every=1, noise=0.0)
    robots = _Robots(teacher, options_of_student(teacher, symmetric_view=False), quiet)
    examples = _Examples(robots.layout, robots.num_actions, robots.num_examples)
    robots.act(None, examples)
    robots.close()
    assert len(examples.entries) == robots.num_examples == 4 * 20
    assert examples._places.abs().max() > 0.01
    # What was said moves a robot of the student's alone just as the teacher moves its own.
    options = Options.from_json(teacher.metadata["options"])
    alone, own = (
        VectorEnvironment("push", 2, options=one, physics_step=0.005)
        for one in (options.changed(symmetric_view=False), options)
    )
    alone.reset(seed=1_000_000)
    seen, _ = own.reset(seed=1_000_000)
    told = examples._actions.reshape(-1, 2, 9)[:20]
    for actions in told.numpy():
        alone.step(actions)
        seen, *_ = own.step(act_of(teacher)(seen))
        for index in range(2):
            assert alone._core.configuration(index) == own._core.configuration(index)
    # Both have moved, and some robots are turned.
    assert told.abs().max() > 0.1
    alone.close()
    own.close()


def test_a_student_learns_what_it_is_told(teacher, tmp_path):
    deviations = []
    lessons = Lessons(episodes=240, rounds=4, num_envs=20, every=2, epochs=10, layers=(64, 64))
    student = distill(
        teacher,
        tmp_path / "student.onnx",
        options=options_of_student(teacher, object_position_noise=0.001),
        lessons=lessons,
        watch=lambda _, deviation: deviations.append(deviation),
    )
    assert deviations[0] == np.inf
    # It sees nearly what its teacher sees, and does nearly the same; random actions are 0.9 away.
    assert deviations[-1] < 0.3
    assert deviations[-1] < deviations[1]
    assert Options.from_json(student.metadata["options"]).object_position_noise == 0.001
    assert student.metadata["task"] == "push"


def test_the_file_of_a_student_that_sees_images_does_what_the_student_does(teacher, tmp_path):
    path = tmp_path / "student.onnx"
    options = options_of_student(teacher, **SEEING)
    assert not options.symmetric_view
    policy = distill(teacher, path, options=options, lessons=FEW)
    environment = VectorEnvironment("push", 3, options=options)
    observations, _ = environment.reset(seed=5)
    for _ in range(4):
        observations, *_ = environment.step(environment.action_space.sample())
    space = environment.single_observation_space
    rows = vectors_of(observations, 3)
    for index, row in enumerate(rows):
        one = {name: part[index] for name, part in observations.items()}
        np.testing.assert_array_equal(row, flatten(space, one))
    ours = act_of(policy)(rows)
    session = onnxruntime.InferenceSession(path)
    theirs = np.concatenate([session.run(None, {"observation": row[None]})[0] for row in rows])
    np.testing.assert_allclose(ours, theirs, atol=2e-6)
    assert np.ptp(ours, axis=0).max() > 1e-4  # it looks at what it sees
    environment.close()
    assert evaluate(policy, "push", 2).paths.shape == (2, 21, 3)


@pytest.mark.usefixtures("_installed")
def test_a_student_that_sees_images_moves_a_robot_with_cameras(teacher, tmp_path, start_program):
    path, report = tmp_path / "student.onnx", tmp_path / "report"
    distill(teacher, path, options=options_of_student(teacher, **SEEING), lessons=FEW)
    words = ("run", "sim_cameras", "--name", "p", "--non-real-time", "--set", "cameras.size=20")
    start_program(*words, "--set", "cameras.rate=50").wait_for("waits for a user")
    words = (PROGRAM, "run-policy", path, "--robot", "p", "--episodes", "2", "-o", report)
    assert "0 of 2 episodes" in output_of(*map(str, words))
    assert [one["actions"] for one in json.loads(report.read_text())] == [20, 20]


def test_images_are_split_as_they_are_joined():
    options = Options.of("push", **SHORT, **SEEING)
    environment = Environment("push", options=options)
    space = environment.observation_space
    observation, _ = environment.reset(seed=2)
    environment.close()
    layout = Layout.of(space)
    student = Student(layout, 9, (8,)).eval()
    row = torch.from_numpy(flatten(space, observation))[None]
    entries, images = layout.split({name: part[None] for name, part in observation.items()})
    found = student.see(torch.from_numpy(np.moveaxis(images, -1, 1)).float())
    with torch.no_grad():
        torch.testing.assert_close(student(row), student.act(torch.from_numpy(entries), found))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--set", "action=torque"], "its actions mean something else"),
        (["--set", "episodes=3"], "must be at least 200"),
        (["--set", "rounds=0"], "rounds is 0, must be at least 1"),
        (["--set", "colour=1"], "there is no option 'colour'"),
        (["-o", "student.policy"], "ends in .onnx"),
    ],
)
def test_what_no_student_can_be_is_refused(teacher, tmp_path, capfd, words, said):
    path = tmp_path / "teacher.policy"
    teacher.save(path)
    assert command.main([str(path), *words]) == 2
    assert said in capfd.readouterr().err


def test_a_teacher_must_say_what_it_knows(tmp_path):
    nameless = policy_file.write(tmp_path / "p", [(np.zeros((9, 4)), np.zeros(9), "tanh")])
    with pytest.raises(InvalidArgument, match="does not say its 'options'"):
        options_of_student(nameless)


@pytest.mark.usefixtures("_installed")
def test_the_command_writes_a_student(teacher, tmp_path):
    teacher.save(tmp_path / "teacher.policy")
    few = ("episodes=4", "rounds=2", "num_envs=2", "epochs=1", "layers=(8,)")
    said = output_of(
        PROGRAM,
        "distill",
        "teacher.policy",
        *(word for one in few for word in ("--set", one)),
        cwd=tmp_path,
    )
    assert "student.onnx is a policy" in said
    assert Policy(tmp_path / "student.onnx").num_outputs == 9
