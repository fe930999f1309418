# SPDX-License-Identifier: BSD-3-Clause
"""What a user of LeRobot does with our robots: `./run soak lerobot` starts it.

    PYTHON use_lerobot.py

PYTHON's environment has LeRobot, trifinger and lerobot_robot_trifinger. Everything happens in a
folder that is removed at the end, without a network.
"""

import ast
import importlib
import inspect
import json
import logging
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

PROGRAMS = Path(sys.executable).parent
PACKAGE = Path(__file__).parents[2] / "packages" / "lerobot_robot_trifinger"
STAND_IN = PACKAGE / "tests" / "lerobot_stand_in"
RATE = 15  # of the data set [Hz]
SIZE = 54  # of the images [pixel]
SECONDS = 4
CHUNKS = 20  # of actions of the policy
POLL = 0.1  # s between two looks whether a program still runs
# The machine may be busy; then actions are repeated, but the robot does not stop.
BUSY = (
    *("--set", "safety.plausibility.stuck_time=.inf"),
    *("--set", "safety.plausibility.max_position_rate=.inf"),
    *("--set", "safety.plausibility.max_velocity_error=.inf"),
    *("--set", "backend.late_action.policy=repeat"),
    *("--set", "backend.late_action.max_repeats=1000000"),
    *("--set", "backend.max_skipped_ticks=1000000"),
)


def main() -> None:
    """Does everything; an assertion says what is wrong."""
    with tempfile.TemporaryDirectory(prefix="trifinger_lerobot_") as name:
        folder = Path(name)
        os.chdir(folder)
        os.environ.update(
            HF_HUB_OFFLINE="1",
            HF_HOME=str(folder / "huggingface"),
            HF_LEROBOT_HOME=str(folder / "lerobot"),
            TRIFINGER_SESSION_DIR=str(folder),
            TRIFINGER_LOG_DIR=str(folder / "logs"),
            WANDB_MODE="disabled",
        )
        # It warns at length that another decoder of films is used.
        logging.getLogger("lerobot.utils.import_utils").setLevel(logging.ERROR)
        interfaces_agree()
        programs_find_what_they_read()
        images = ("--set", f"cameras.size={SIZE}", "--set", "cameras.rate=30")
        seeing = ("--set", "cameras.pixels=rgb8", *images, *BUSY, "--record", "logs/seeing")
        with running("sim_cameras", "seeing", *seeing), running("sim", "leader", *BUSY), a_hand():
            data_set = record(folder / "recorded")
            replay(data_set)
            teleoperate()
        the_robot_did_what_it_was_sent(data_set)
        policy = train(data_set)
        train(exported(folder))
        acting = ("--set", "cameras.pixels=rgb8", *images, *BUSY, "--record", "logs/acting")
        with running("sim_cameras", "seeing", *acting):
            sent = let_act(policy)
        the_robot_did_what_the_policy_sent(sent)


def interfaces_agree() -> None:
    """The stand-in of our tests demands what LeRobot demands, and offers nothing else."""
    for module, classes in {
        "robots": ("Robot", "RobotConfig"),
        "teleoperators": ("Teleoperator", "TeleoperatorConfig"),
        "cameras": ("Camera", "CameraConfig"),
    }.items():
        theirs = importlib.import_module(f"lerobot.{module}")
        for name in classes:
            real = getattr(theirs, name)
            own = definition_of(STAND_IN / "lerobot" / module / "__init__.py", name)
            demanded = set(getattr(real, "__abstractmethods__", ()))
            abstract = {one.name for one in functions_of(own) if is_abstract(one)}
            assert abstract == demanded, f"{name}: ours demands {abstract}, LeRobot {demanded}"
            fields = set(getattr(real, "__dataclass_fields__", ()))
            ours = {line.target.id for line in own.body if isinstance(line, ast.AnnAssign)} - {
                "known"
            }
            assert ours == fields, f"{name}: ours has the fields {ours}, LeRobot {fields}"
            for function in functions_of(own):
                if function.name.startswith("_"):
                    continue
                found = inspect.getattr_static(real, function.name)
                found = getattr(found, "fget", None) or getattr(found, "__func__", found)
                parameters = list(inspect.signature(found).parameters)
                mine = [one.arg for one in function.args.args]
                assert mine == parameters, f"{name}.{function.name}: {mine}, LeRobot {parameters}"
    print("the stand-in demands what LeRobot demands")


def definition_of(path: Path, name: str) -> ast.ClassDef:
    """The text of a class in a file."""
    tree = ast.parse(path.read_text())
    (found,) = (one for one in tree.body if isinstance(one, ast.ClassDef) and one.name == name)
    return found


def functions_of(of: ast.ClassDef) -> Iterator[ast.FunctionDef]:
    """The functions that it defines."""
    return (one for one in of.body if isinstance(one, ast.FunctionDef))


def is_abstract(function: ast.FunctionDef) -> bool:
    """Whether subclasses must have it."""
    return any("abstractmethod" in ast.dump(one) for one in function.decorator_list)


def programs_find_what_they_read() -> None:
    """Whatever LeRobot's programs read of a robot or teleoperator, ours has."""
    from lerobot.utils.import_utils import register_third_party_plugins

    register_third_party_plugins()
    from lerobot.robots import RobotConfig, make_robot_from_config
    from lerobot.teleoperators import TeleoperatorConfig, make_teleoperator_from_config

    robot = make_robot_from_config(RobotConfig.get_choice_class("trifinger")())
    leader = TeleoperatorConfig.get_choice_class("trifinger_leader")
    devices = {"robot": robot, "teleop": make_teleoperator_from_config(leader())}
    count = 0
    for program in ("record", "replay", "teleoperate"):
        module = importlib.import_module(f"lerobot.scripts.lerobot_{program}")
        for node in ast.walk(ast.parse(inspect.getsource(module))):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                device = devices.get(node.value.id)
                # This one is of another robot, for its keyboard.
                if device is None or node.attr == "_from_keyboard_to_base_action":
                    continue
                assert hasattr(device, node.attr), f"lerobot-{program} reads {ast.unparse(node)}"
                count += 1
    assert count > 20, f"only {count} such places were found"
    print(f"{count} places of LeRobot's programs find what they read of our devices")


@contextmanager
def running(*words: str) -> Iterator[None]:
    """A robot, until it is stopped: its file, its name and options."""
    robot, name, *options = words
    command = [PROGRAMS / "trifinger", "run", robot, "--name", name, *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    said = []
    for line in process.stdout:
        said.append(line)
        if "waits for a user" in line:
            break
    assert "waits for a user" in "".join(said), "".join(said)
    reader = threading.Thread(target=lambda: said.extend(process.stdout or ()), daemon=True)
    reader.start()
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait() == 0, "".join(said[-20:])


@contextmanager
def a_hand() -> Iterator[None]:
    """Moves the robot "leader" up and down, as somebody's hand would."""
    import numpy as np
    import trifinger

    is_over = threading.Event()

    def move() -> None:
        with trifinger.connect("leader") as leader:
            rest = leader.latest_observation().position
            step = 0
            while not is_over.is_set():
                offset = 0.2 * np.sin(2 * np.pi * 0.5e-3 * (step + np.arange(100)))
                for one in offset:
                    action = leader.new_action(position=rest + one)
                    step = leader.append_desired_action(action)
                leader.wait_until_time_index(step - 50)
            leader.finish()

    hand = threading.Thread(target=move)
    hand.start()
    try:
        yield
    finally:
        is_over.set()
        hand.join()


def lerobot(program: str, *options: str) -> str:
    """Runs a program of LeRobot and returns what it has printed."""
    print(f"lerobot-{program}", flush=True)
    command = [PROGRAMS / f"lerobot-{program}", *options]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout[-6000:]
    return done.stdout


def seeing() -> Sequence[str]:
    """The options of our robot with two cameras."""
    cameras = {
        name: {"type": "trifinger", "width": SIZE, "height": SIZE}
        for name in ("camera60", "camera180")
    }
    return (
        "--robot.type=trifinger",
        "--robot.robot=seeing",
        f"--robot.cameras={json.dumps(cameras)}",
    )


LEADER = ("--teleop.type=trifinger_leader", "--teleop.robot=leader")


def record(folder: Path) -> Path:
    """Records two episodes with images; looks at what is in them."""
    import numpy as np
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    lerobot(
        "record",
        *seeing(),
        *LEADER,
        "--dataset.repo_id=local/recorded",
        f"--dataset.root={folder}",
        "--dataset.single_task=Follow the hand",
        f"--dataset.fps={RATE}",
        "--dataset.num_episodes=2",
        f"--dataset.episode_time_s={SECONDS}",
        "--dataset.reset_time_s=0.1",
        "--dataset.push_to_hub=false",
        "--dataset.no_stamp=true",
        "--dataset.video=false",
        "--play_sounds=false",
    )
    found = LeRobotDataset("local/recorded", root=folder)
    assert found.num_episodes == 2
    assert len(found) > RATE * SECONDS / 2, f"only {len(found)} rows"
    images = [np.asarray(found[i]["observation.images.camera60"]) for i in (0, len(found) - 1)]
    assert images[0].shape == (3, SIZE, SIZE)
    assert images[0].std() > 0.02, "the image has nothing in it"
    assert not np.array_equal(*images), "the image never changes"
    actions = np.array([np.asarray(found[i]["action"]) for i in range(len(found))])
    assert actions.std(axis=0).max() > 0.02, "the robot did not follow the hand"
    print(f"recorded {len(found)} rows with two images each, {found.num_episodes} episodes")
    return folder


def replay(folder: Path) -> None:
    """Replays the first episode."""
    lerobot(
        "replay",
        *seeing(),
        "--dataset.repo_id=local/recorded",
        f"--dataset.root={folder}",
        "--dataset.episode=0",
        "--play_sounds=false",
    )


def teleoperate() -> None:
    """Lets the robot follow the hand for two seconds."""
    lerobot("teleoperate", *seeing(), *LEADER, "--fps=30", "--teleop_time_s=2")


def the_robot_did_what_it_was_sent(folder: Path) -> None:
    """Looks into the log: it was recorded, replayed and teleoperated; counts repeated actions."""
    import numpy as np
    import trifinger
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    found = trifinger.Log("logs/seeing").sessions
    # After each user the robot waits for the next one, in a session without steps.
    sessions = [one for one in found if not one.is_companion and len(one.time_index) > 0]
    lengths = [len(one.time_index) for one in sessions]
    assert len(sessions) == 3, f"sessions of {lengths} steps are in the log"
    replayed = LeRobotDataset("local/recorded", root=folder, episodes=[0])
    last = np.asarray(replayed[len(replayed) - 1]["action"])
    desired = sessions[1].desired_actions[-1]["position"]
    reached = sessions[1].observations[-1]["position"]
    assert np.allclose(desired, last, atol=1e-6), f"the last action was {desired}, not {last}"
    assert np.abs(reached - last).max() < 0.1, f"it is at {reached}, not at {last}"
    repeated = sum(int((one.statuses["action_repeats"] > 0).sum()) for one in sessions)
    steps = sum(lengths)
    # No bound here: a machine that is too busy for 1 kHz repeats some.
    print(f"{steps} steps at 1 kHz in {len(sessions)} sessions, {repeated} with a repeated action")


def exported(folder: Path) -> Path:
    """What `trifinger export lerobot` makes of the log."""
    target = folder / "exported"
    words = [
        "export",
        "lerobot",
        "logs/seeing",
        "-o",
        target,
        "--task",
        "Follow",
        "--rate",
        str(RATE),
    ]
    subprocess.run([PROGRAMS / "trifinger", *words], check=True)
    return target


def train(folder: Path) -> Path:
    """Two steps of training of ACT. Returns the folder of the policy."""
    output = folder.with_name(f"{folder.name}_trained")
    lerobot(
        "train",
        "--policy.type=act",
        "--policy.device=cpu",
        "--policy.push_to_hub=false",
        "--policy.pretrained_backbone_weights=null",
        "--policy.chunk_size=4",
        "--policy.n_action_steps=4",
        "--policy.dim_model=32",
        "--policy.dim_feedforward=32",
        "--policy.n_heads=2",
        "--dataset.repo_id=local/data",
        f"--dataset.root={folder}",
        f"--output_dir={output}",
        "--batch_size=2",
        "--num_workers=0",
        "--steps=2",
        "--log_freq=1",
        "--wandb.enable=false",
    )
    (weights,) = output.glob("checkpoints/*2/pretrained_model/model.safetensors")
    print(f"trained two steps on {folder.name}: {weights.stat().st_size} bytes of weights")
    return weights.parent


def let_act(policy: Path) -> list[tuple[float, ...]]:
    """Lets a policy move the robot "seeing", as the README says. Returns the actions it sent."""
    from lerobot.async_inference.configs import PolicyServerConfig
    from lerobot.async_inference.policy_server import PolicyServer, serve

    sent: list[tuple[float, ...]] = []
    is_enough = threading.Event()
    predict = PolicyServer._predict_action_chunk

    def predict_and_keep(*given: Any) -> Any:
        chunk = predict(*given)
        sent.extend(tuple(one.get_action().tolist()) for one in chunk)
        if len(sent) >= 4 * CHUNKS:
            is_enough.set()
        return chunk

    PolicyServer._predict_action_chunk = predict_and_keep
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = PolicyServerConfig(host="127.0.0.1", port=port)
    threading.Thread(target=serve, args=(server,), daemon=True).start()
    print("robot_client", flush=True)
    logging.disable(logging.INFO)  # the server tells much
    words = [
        *("-m", "lerobot.async_inference.robot_client", *seeing(), "--policy_type=act"),
        *(f"--pretrained_name_or_path={policy}", f"--server_address=127.0.0.1:{port}"),
        *("--actions_per_chunk=4", "--aggregate_fn_name=latest_only", f"--fps={RATE}"),
    ]
    with (
        Path("client.txt").open("w+") as said,
        subprocess.Popen([sys.executable, *words], stdout=said, stderr=said) as client,
    ):
        while not is_enough.wait(POLL) and client.poll() is None:
            pass  # a client that has died sends nothing
        client.send_signal(signal.SIGINT)
        client.wait()
        said.seek(0)
        text = said.read()
    assert len(sent) >= 4 * CHUNKS, text[-6000:]
    assert "Client stopped" in text, text[-6000:]
    return sent


def the_robot_did_what_the_policy_sent(sent: Sequence[tuple[float, ...]]) -> None:
    """Looks into the log: the desired actions are those of the policy, and the robot moved."""
    import numpy as np
    import trifinger

    found = trifinger.Log("logs/acting").sessions
    (session,) = (one for one in found if not one.is_companion and len(one.time_index) > 0)
    desired = session.desired_actions["position"]
    is_new = np.any(np.diff(desired, axis=0) != 0, axis=1)
    actions = [tuple(one) for one in desired[1:][is_new]]  # without the pose at the beginning
    # The next chunk comes when half of one is left, so it replaces some of its actions.
    assert len(actions) >= CHUNKS // 2, f"only {len(actions)} actions arrived"
    foreign = set(actions) - set(sent)
    assert not foreign, f"{len(foreign)} actions were not sent by the policy: {foreign}"
    moved = np.ptp(session.observations["position"], axis=0).max()
    assert moved > 0.01, f"the robot moved by {moved} rad only"
    print(f"{len(actions)} actions of the policy arrived; a joint moved by {moved:.2f} rad")


if __name__ == "__main__":
    main()
