# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger compat-check` says of small programs of every kind what happens when they run."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from backend import environment
from trifinger_compat import bullet, check
from trifinger_compat.generation import VARIABLE
from trifinger_compat.scopes import loaded_by
from trifinger_compat.symbols import MISSING, PACKAGES

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
PLATFORM = """
from trifinger_simulation import TriFingerPlatform
platform = TriFingerPlatform()
finger, cube = platform.simfinger, platform.cube
client = finger._pybullet_client_id
"""
BULLET = f"import pybullet as p\n{PLATFORM}"
PROGRAMS = {
    # Imports.
    "a module": "import trifinger_simulation.camera as camera\ncamera.TriFingerCameras",
    "a name that is not there": "from trifinger_simulation import nothing",
    "a module that is not there": "import trifinger_simulation.nothing",
    "a name of a module": "from trifinger_simulation.tasks import move_cube\nmove_cube.Pose()",
    "a wrong name of a module": "from trifinger_simulation.tasks import move_cube as m\nm.pose()",
    "all names": "from trifinger_simulation.tasks.move_cube import *\nsample_goal(1)",
    "a private name after all names": "from trifinger_simulation.tasks.move_cube import *\nPose()",
    "a module that its package loads": "import trifinger_simulation as t\nt.camera.Camera",
    "a module that its package does not load": "import trifinger_simulation as t\n"
    "t.visual_objects.CubeMarker",
    "a module that another import loads": "import trifinger_simulation as t\n"
    "import trifinger_simulation.visual_objects\nt.visual_objects.CubeMarker",
    "a module that a function imports": "import trifinger_simulation as t\n"
    "def f():\n    from trifinger_simulation import visual_objects\nf()\n"
    "t.visual_objects.CubeMarker",
    "the first of two packages": "try:\n    import rrc_simulation as s\nexcept ImportError:\n"
    "    import trifinger_simulation as s\ns.tasks.move_cube.Pose()",
    "a name that is caught": "try:\n    from trifinger_simulation import nothing\n"
    "except ImportError:\n    nothing = None\nprint(nothing)",
    "a module that is caught by its other name": "try:\n"
    "    import trifinger_simulation.nothing as n\nexcept ModuleNotFoundError:\n    n = None",
    "an error that is not caught by another": "try:\n    from trifinger_simulation import nothing\n"
    "except ValueError:\n    pass",
    "a name for type checkers": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n"
    "    from trifinger_simulation import nothing",
    "Gym": "import gym",
    "Pinocchio": "import pinocchio",
    "data of PyBullet": "import pybullet_data",
    # Names that hide others.
    "a loop": "from trifinger_simulation import camera\nclass C: image = 1\n"
    "for camera in [C()]:\n    camera.image",
    "a loop after the module was used": "from trifinger_simulation import camera\n"
    "camera.nothing\nfor camera in []:\n    camera.image",
    "a comprehension": "from trifinger_simulation import camera\nclass C: image = 1\n"
    "[camera.image for camera in [C()]]\ncamera.Camera",
    "a module after a comprehension": "from trifinger_simulation import camera\nclass C: image = 1\n"
    "[camera.image for camera in [C()]]\ncamera.image",
    "an argument": "from trifinger_simulation import camera\nclass C: image = 1\n"
    "def show(camera):\n    return camera.image\nshow(C())",
    "an argument of a lambda": "from trifinger_simulation import camera\n"
    "(lambda camera: camera.real)(1)",
    "a local variable": "from trifinger_simulation import camera\ndef f():\n    camera = 1\n"
    "    return camera.real\nf()",
    "a local variable of another function": "from trifinger_simulation import camera\n"
    "def f():\n    camera = 1\ndef g():\n    return camera.real\ng()",
    "a file": "from trifinger_simulation import camera\nimport os\n"
    "with open(os.devnull) as camera:\n    camera.read()",
    "an error": "from trifinger_simulation import camera\ntry:\n    1 / 0\n"
    "except ZeroDivisionError as camera:\n    camera.args",
    "a global variable": "from trifinger_simulation import camera\nimport builtins\n"
    "def f():\n    camera.nothing\ncamera = type('C', (), {'nothing': 1})\nf()",
    "a name in a class": "from trifinger_simulation import camera\nclass C:\n    camera = 1\n"
    "    def f(self):\n        return camera.Camera\nC().f()",
    "another name of a module": "import trifinger_simulation as t\nm = t.tasks.move_cube\nm.nothing",
    "another name of a module that works": "import trifinger_simulation as t\n"
    "m = t.tasks.move_cube\nm.sample_goal(1)",
    # Arguments.
    "half a millisecond": "from trifinger_simulation import SimFinger\n"
    "SimFinger('trifingerpro', time_step=0.0005)",
    "four milliseconds": "from trifinger_simulation import SimFinger\nSimFinger('fingerone', 0.004)",
    "an offset": "import trifinger_simulation as t\n"
    "t.SimFinger('trifingerpro', robot_position_offset=(0, 0, 0.1))",
    "an argument that is not there": "from trifinger_simulation import TriFingerPlatform\n"
    "TriFingerPlatform(gui=True)",
    "an argument too many": "from trifinger_simulation.tasks import move_cube\n"
    "move_cube.sample_goal(1, 2)",
    "an argument that is missing": "from trifinger_simulation.tasks import move_cube\n"
    "move_cube.Pose.from_dict()",
    "arguments in a list": "from trifinger_simulation.tasks import move_cube\nwords = [1]\n"
    "move_cube.sample_goal(*words)",
    "a mesh": "from trifinger_simulation.collision_objects import import_mesh as load\nload('a')",
    # Files.
    "a description of the robot beside the package": "import os, trifinger_simulation\n"
    "folder = os.path.join(os.path.dirname(trifinger_simulation.__file__),\n"
    "                      'robot_properties_fingers/urdf')\n"
    "open(os.path.join(folder, 'pro', 'trifingerpro.urdf'))",
    "calibrations in the package": "import trifinger_simulation\nfrom pathlib import Path\n"
    "here = Path(trifinger_simulation.__file__).resolve().parent\n"
    "(here / 'data' / 'camera_params' / 'camera60_cropped.yml').read_text()",
    "calibrations by the path of a package": "import trifinger_simulation\n"
    "open(trifinger_simulation.__path__[0] + '/data/camera_params/camera60.yml')",
    "calibrations in a text": "import os, trifinger_simulation as t\ni = 60\n"
    "open(f'{os.path.dirname(t.__file__)}/data/camera_params/camera{i}_cropped.yml')",
    "calibrations as a resource": "import importlib.resources as r\n"
    "(r.files('trifinger_simulation') / 'data' / 'camera_params').iterdir().__next__()",
    "calibrations in the folder of data": "from trifinger_simulation import get_data_dir\n"
    "(get_data_dir() / 'camera_params' / 'camera60_cropped.yml').read_text()",
    "a description that ROS finds": "import os\n"
    "from ament_index_python.packages import get_package_share_directory as share\n"
    "from trifinger_simulation import finger_types_data as f\n"
    "open(os.path.join(share('robot_properties_fingers'), 'urdf', f.get_finger_urdf('fingerpro')))",
    "a description of a finger": f"{PLATFORM}open(finger.finger_urdf_path)",
    "a file of the package": "import os, trifinger_simulation as t\n"
    "open(os.path.join(os.path.dirname(t.__file__), 'sim_finger.py'))",
    "a file of somebody else": "import os\nopen(os.path.join(os.path.dirname(os.__file__), 'io.py'))",
    # PyBullet.
    "a constant": "import pybullet\npybullet.URDF_USE_INERTIA_FROM_FILE",
    "a constant that is not there": "import pybullet\npybullet.NO_CONSTANT",
    "a call that is not there": "import pybullet\npybullet.noSuchCall()",
    "all names of PyBullet": "from pybullet import *\nconnect(DIRECT)",
    "its error": "import pybullet\ntry:\n    pass\nexcept pybullet.error:\n    pass",
    "mathematics": "from pybullet import getQuaternionFromEuler as q\nq([0.0, 0.0, 1.0])",
    "a view": f"{BULLET}p.configureDebugVisualizer(p.COV_ENABLE_GUI, 0, physicsClientId=client)",
    "the view of nobody": "import pybullet as p\np.resetDebugVisualizerCamera(1.0, 2, 3, [0, 0, 0])",
    "a world of its own": "import pybullet as p\nc = p.connect(p.DIRECT)\n"
    "p.loadURDF('plane.urdf')\np.stepSimulation()",
    "a pose": f"{BULLET}p.getBasePositionAndOrientation(cube._object_id, physicsClientId=client)",
    "a pose of the robot": f"{BULLET}p.getBasePositionAndOrientation(finger.finger_id)",
    "a speed of a body": f"{BULLET}body = platform.cube.block\np.getBaseVelocity(body)",
    "joints": f"{BULLET}p.getJointStates(finger.finger_id, finger.pybullet_link_indices)",
    "joints of the cube": f"{BULLET}p.getJointStates(cube._object_id, [2])",
    "a mass": f"{BULLET}p.changeDynamics(cube._object_id, -1, mass=0.1, physicsClientId=client)",
    "friction": f"{BULLET}p.changeDynamics(cube._object_id, -1, lateralFriction=0.1)",
    "contacts of the cube": f"{BULLET}p.getContactPoints(finger.finger_id, cube._object_id)",
    "a step of the platform": f"{BULLET}p.stepSimulation(physicsClientId=client)",
    "a step of the platform by a name of its own": f"{BULLET}class Mine:\n"
    "    def __init__(self):\n        self.id = platform.simfinger._pybullet_client_id\n"
    "        p.setGravity(0, 0, 0, physicsClientId=self.id)\nMine()",
    "a mirror": f"{BULLET}c = p.connect(p.DIRECT)\npose = p.getBasePositionAndOrientation(\n"
    "    cube._object_id)\np.resetBasePositionAndOrientation(3, [0.0], [0.0], physicsClientId=0)",
    # OpenCV.
    "a raw image": "import numpy as np\nfrom trifinger_cameras.utils import convert_image\n"
    "convert_image(np.zeros((4, 4), np.uint8))",
    "a segmented image": "import trifinger_object_tracking as o, numpy as np\n"
    "o.py_lightblue_segmenter.segment_image(np.zeros((4, 4, 3), np.uint8))",
    "a cube in images": "from trifinger_object_tracking.py_tricamera_types import CubeVisualizer\n"
    "class Pose: position, orientation = [0, 0, 0], [0, 0, 0, 1]\n"
    "CubeVisualizer([]).draw_cube([], Pose)",
    "a rotation of images": "from trifinger_cameras import utils\nutils.rodrigues_to_matrix([0, 0, 1])",
    "a call that is caught": "import pybullet as p\ntry:\n    p.connect(p.DIRECT)\n"
    "except NotImplementedError:\n    pass",
}
DICE = """
from trifinger_simulation import TriFingerPlatform, get_data_dir, camera
from trifinger_simulation.tasks import rearrange_dice
from trifinger_simulation.trifinger_platform import ObjectType
import numpy as np
from trifinger_compat.generation import chosen
platform = TriFingerPlatform(object_type=ObjectType.DICE)
seen = np.zeros((3, chosen().image_size, chosen().image_size))  # as segmented images are
cameras = camera.load_camera_parameters(get_data_dir() / "camera_params", "camera{id}_SUFFIX.yml")
masks = rearrange_dice.generate_goal_mask(cameras, rearrange_dice.sample_goal())
rearrange_dice.evaluate_state(masks, seen)
"""


@pytest.mark.parametrize("package", ["trifinger_simulation", "robot_fingers"])
def test_the_check_knows_what_is_loaded(package: str) -> None:
    program = f"import json, sys, {package}\nprint(json.dumps(sorted(sys.modules)))"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, check=True)
    ours = (*PACKAGES, "trifinger_compat")
    loaded = {name for name in json.loads(done.stdout) if name.partition(".")[0] in ours}
    assert loaded_by(frozenset([package])) == loaded


def ends(programs: list[str], *words: str, **variables: str) -> list[str]:
    """The error with which each of the programs ends."""
    done = subprocess.run(
        [sys.executable, str(HERE / "run_programs.py"), *words],
        input=json.dumps(programs),
        env=environment(**variables),
        capture_output=True,
        text=True,
        check=True,
    )
    return list(json.loads(done.stdout.splitlines()[-1]))


def missing(program: str) -> list[str]:
    """What does not work, as the check says."""
    findings = check.check_text(program, Path("program"))
    return [str(each) for each in findings if each.verdict == MISSING]


@pytest.mark.parametrize(("has_bullet", "has_opencv"), [(False, True), (True, False)])
def test_what_the_check_says_is_what_happens(
    has_bullet: bool, has_opencv: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not has_opencv:
        monkeypatch.setitem(sys.modules, "cv2", None)  # type: ignore[arg-type]
    if bullet.find_installed() is None:
        monkeypatch.setattr(check, "_has_bullet", lambda: has_bullet)
    programs = {
        name: text
        for name, text in PROGRAMS.items()
        # What comes with PyBullet cannot stand in for it, and a world needs files.
        if bullet.find_installed() is None or name not in ("a world of its own", "a mirror")
    }
    words = ["pybullet"] if has_bullet and bullet.find_installed() is None else []
    words += ["cv2"] if has_opencv else []
    ended = dict(zip(programs, ends([*programs.values()], *words), strict=True))
    wrong = {
        name: (missing(text), ended[name])
        for name, text in programs.items()
        if bool(missing(text)) != bool(ended[name])
    }
    assert wrong == {}
    fails = sum(map(bool, ended.values()))
    assert min(fails, len(ended) - fails) > 20  # the law says something


@pytest.mark.parametrize("name", ["2021", "2022", "2024"])
def test_programs_whose_images_have_another_size_learn_which_generation_they_need(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, name)
    suffixes = {"cropped": "2024", "cropped_and_downsampled": "2021 or 2022"}
    programs = [DICE.replace("SUFFIX", suffix) for suffix in suffixes]
    errors = ends(programs, "cv2", **{VARIABLE: name})
    for program, error, others in zip(programs, errors, suffixes.values(), strict=True):
        said = missing(program)
        fits = name in others
        assert (error == "", said == []) == (fits, fits)
        for text in () if fits else (error, *said):
            assert f"images of generation {name} have" in text
            assert f"{VARIABLE}={others}" in text
