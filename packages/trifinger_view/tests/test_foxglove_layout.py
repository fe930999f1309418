# SPDX-License-Identifier: BSD-3-Clause
"""What the layout for Foxglove wants to show is in a log of the robot `sim`."""

import json
import re
from pathlib import Path

import pytest
import trifinger
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

LAYOUT = Path(__file__).parents[3] / "config" / "foxglove_layout.json"
PATH = re.compile(r"(?P<topic>/[\w/]+)\.(?P<fields>[\w.]+)(?:\[(?P<index>\d+)\])?")


@pytest.fixture(scope="module")
def layout():
    return json.loads(LAYOUT.read_text())


@pytest.fixture(scope="module")
def messages(tmp_path_factory):
    """The last message of every topic."""
    folder = tmp_path_factory.mktemp("log")
    simulation = trifinger.Simulation()
    with simulation.record(folder) as recorder, simulation.connect() as robot:
        robot.get_observation(robot.append_desired_action(robot.new_action()))
        robot.finish()
    with recorder.file.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}


def panels_in(part):
    """The names of all panels of a part of the layout."""
    if isinstance(part, str):
        return [part]
    return panels_in(part["first"]) + panels_in(part["second"])


def test_every_panel_has_its_place_and_its_settings(layout):
    assert sorted(panels_in(layout["layout"])) == sorted(layout["configById"])


def test_every_line_is_a_number_of_a_message(layout, messages):
    lines = [
        line["value"] for panel in layout["configById"].values() for line in panel.get("paths", [])
    ]
    assert len(lines) > 40
    for line in lines:
        path = PATH.fullmatch(line)
        assert path, line
        value = messages[path["topic"]]
        for field in path["fields"].split("."):
            value = getattr(value, field)
        if path["index"]:
            value = value[int(path["index"])]
        float(value)


def test_the_events_are_shown(layout, messages):
    topics = [
        panel["topicToRender"]
        for panel in layout["configById"].values()
        if "topicToRender" in panel
    ]
    assert topics == ["/events"]
    assert messages["/events"].msg
