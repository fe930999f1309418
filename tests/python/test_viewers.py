# SPDX-License-Identifier: BSD-3-Clause
"""What 3D viewers need is in a log: the robot's description, its frames and its joints.

The official readers decode it, and ours, which know nothing of it, do not mind.
"""

import subprocess
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
import pytest
import trifinger
from conftest import PROGRAM
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

TOPICS = ("robot_description", "tf_static", "tf", "joint_states")
STEPS = 450
EVERY = 125  # steps between messages for viewers
OBJECTS = [{"name": "cube", "type": "cube"}]


def messages_of(path):
    """All messages that viewers use, by topic without the robot; with times since 1970 [ns]."""
    found = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            topic = channel.topic.rpartition("/")[2]
            found.setdefault(topic, []).append((message.log_time, decoded))
    return found


@pytest.fixture(
    scope="module",
    params=[
        ("trifinger_edu", "upright"),
        ("trifinger_pro", "upright"),
        ("trifinger_edu", "flipped"),
    ],
    ids=" ".join,
)
def recorded(request, tmp_path_factory):
    """A log of a robot that moves at random, and its scene."""
    folder = tmp_path_factory.mktemp("log")
    config, platform = request.param
    simulation = trifinger.Simulation(config, {"platform": platform, "objects": OBJECTS})
    random = np.random.default_rng(1)
    with simulation.record(folder) as recorder, simulation.connect() as robot:
        for t in range(STEPS):
            if t % 50 == 0:
                torque = random.uniform(-0.2, 0.2, 9)
            robot.wait_until_time_index(
                robot.append_desired_action(robot.new_action(torque=torque))
            )
        robot.finish()
    return recorder.file


def robot_of(path):
    """The name of the robot in a log."""
    return trifinger.Log(path).session().name


def matrix_of(transform):
    """The 4 x 4 matrix of a transform in a message."""
    place, turn = transform.translation, transform.rotation
    matrix, rotation = np.eye(4), np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array([turn.w, turn.x, turn.y, turn.z]))
    matrix[:3, :3] = rotation.reshape(3, 3)
    matrix[:3, 3] = place.x, place.y, place.z
    return matrix


def poses_of(transforms):
    """The poses of all frames in the world."""
    parents = {one.child_frame_id: one for one in transforms}
    poses = {"world": np.eye(4)}

    def pose(name):
        if name not in poses:
            one = parents[name]
            poses[name] = pose(one.header.frame_id) @ matrix_of(one.transform)
        return poses[name]

    for name in parents:
        pose(name)
    return poses


def test_frames_are_where_the_links_were(recorded):
    messages = messages_of(recorded)
    session = trifinger.Log(recorded).session()
    model = mujoco.MjModel.from_xml_string(session.documents["model.xml"])
    data = mujoco.MjData(model)
    (static,) = (decoded for _, decoded in messages["tf_static"])
    moving = messages["tf"]
    assert len(moving) == -(-STEPS // EVERY)
    for number, (time, message) in enumerate(moving):
        assert time == messages["step"][EVERY * number][0]
        poses = poses_of([*static.transforms, *message.transforms])
        data.qpos[:9] = session.observations["position"][EVERY * number]
        mujoco.mj_kinematics(model, data)
        names = [model.body(i).name for i in range(1, model.nbody)]
        names = [name for name in names if "finger" in name]
        assert len(names) == 12
        for name in names:
            pose = poses[f"{robot_of(recorded)}/{name}"]
            assert pose[:3, 3] == pytest.approx(data.body(name).xpos, abs=2e-4)
            assert pose[:3, :3].ravel() == pytest.approx(data.body(name).xmat, abs=5e-4)
        for site in range(model.nsite):
            name = model.site(site).name
            pose = poses[f"{robot_of(recorded)}/{name}"]
            assert pose[:3, 3] == pytest.approx(data.site(name).xpos, abs=2e-4)


def test_objects_are_where_they_were_seen(recorded):
    messages = messages_of(recorded)
    seen = trifinger.Log(recorded).session().companion("object").observations
    times = {time: i for i, (time, _) in enumerate(messages["object"])}
    assert len(times) > 20
    stamps = []
    for _, message in messages["tf"]:
        for one in message.transforms:
            if one.child_frame_id != f"{robot_of(recorded)}/cube":
                continue
            stamp = one.header.stamp.sec * 10**9 + one.header.stamp.nanosec
            captures = seen["stamp"]["capture_index"] * 10**6
            begin = messages["step"][0][0]
            row = int(np.flatnonzero(captures + begin == stamp)[0])
            pose = matrix_of(one.transform)
            assert pose[:3, 3] == pytest.approx(seen["cube"]["position"][row], abs=1e-4)
            stamps.append(stamp)
    assert len(stamps) >= 3
    assert stamps == sorted(stamps)


def test_the_description_is_of_those_frames_and_joints(recorded):
    messages = messages_of(recorded)
    ((_, description),) = messages["robot_description"]
    robot = ElementTree.fromstring(description.data)  # noqa: S314, it is our own
    links = {link.get("name") for link in robot.findall("link")}
    frames = {
        one.child_frame_id
        for _, message in [*messages["tf_static"], *messages["tf"]]
        for one in message.transforms
    }
    assert links == frames
    name = robot_of(recorded)
    assert {f"{name}/base_link", f"{name}/table", f"{name}/cube"} < links
    parents = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}
    for _, message in messages["tf"]:
        for one in message.transforms:
            joint = parents[one.child_frame_id]
            assert joint.find("parent").get("link") == one.header.frame_id
    revolute = [j.get("name") for j in robot.findall("joint") if j.get("type") == "revolute"]
    positions = trifinger.Log(recorded).session().observations["position"]
    for number, (_, joints) in enumerate(messages["joint_states"]):
        assert list(joints.name) == revolute
        assert list(joints.position) == pytest.approx(positions[EVERY * number], abs=1e-4)
    assert not robot.findall(".//mesh")


def test_readers_and_tools_keep_them(recorded, tmp_path):
    def run(*words):
        command = [PROGRAM, "log", *map(str, words)]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    assert not trifinger.Log(recorded).damage
    run("check", recorded)
    whole = messages_of(recorded)
    part, recovered = tmp_path / "part.mcap", tmp_path / "recovered.mcap"
    run("cut", recorded, "--first", "150", "--last", "350", "-o", part)
    run("recover", recorded, "-o", recovered)
    for topic in TOPICS:
        found = messages_of(recovered)[topic]
        assert [time for time, _ in found] == [time for time, _ in whole[topic]]
    found = messages_of(part)
    assert len(found["robot_description"]) == 1
    assert len(found["tf_static"]) == 1
    assert [time for time, _ in found["tf"]] == [time for time, _ in whole["tf"][2:3]]
    assert trifinger.Log(recovered).session().steps == STEPS
