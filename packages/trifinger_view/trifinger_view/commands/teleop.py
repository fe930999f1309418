# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger teleop`."""

import argparse
import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import trifinger
from trifinger._trifinger import Guide, GuideState
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, add_robot, say
from trifinger.errors import Error
from trifinger.progress import Line

from trifinger_view.commands.options import add_frames
from trifinger_view.teleoperation import (
    Command,
    Device,
    Gamepad,
    Keyboard,
    Terminal,
    gamepad,
    keyboard,
    load_device,
    open_gamepad,
    teleoperate,
)


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger teleop",
        description="Move a robot with a keyboard, a gamepad or a device of yours.",
        epilog=f"Keys:\n{keyboard.HELP}\nThe robot moves while a key is held.\n\n"
        f"Gamepad:\n{gamepad.HELP}\n\n"
        "Example:\n"
        "  trifinger teleop sim\n"
        "  trifinger teleop sim --device gamepad\n"
        "  trifinger teleop sim --device my_module:my_function\n"
        "  trifinger teleop panda --frame right_hand",
    )
    add_robot(parser)
    parser.add_argument(
        "--device",
        default="keyboard",
        help="one of keyboard (default), gamepad, gamepad:FILE (such as /dev/input/event5), or "
        "MODULE:FUNCTION, a function that returns a trifinger_view.teleoperation.Command",
    )
    add_frames(parser)
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger teleop`."""
    arguments = parse(words)
    return command_line.run(lambda: run(arguments.robot, arguments.device, arguments.frame))


def run(robot: str, device_name: str, frames: Sequence[str] = ()) -> None:
    """Moves the robot until the person ends it."""
    # The device comes first: without it, the robot is not touched.
    with (
        command_line.ended_by_signals(),
        opened(device_name) as (device, how_to),
        trifinger.guide(robot, frames=frames) as guide,
    ):
        command_line.wait_until_measured(guide, robot)
        if isinstance(device, Keyboard | Gamepad):
            device.num_frames = len(guide.frame_names)
            device.num_joints = guide.num_joints
        say(f"The robot '{robot}' holds its pose.\n{how_to}", flush=True)
        with Line() as line:
            teleoperate(guide, device, watch=Display(guide, line).show)
    say(
        f"The session of '{robot}' has ended, so the robot comes to rest as its configuration says."
    )


@contextlib.contextmanager
def opened(name: str) -> Iterator[tuple[Device, str]]:
    """The device of a name, and how to use it; the end of the block gives it back."""
    kind, _, place = name.partition(":")
    if name == "keyboard":
        with Terminal() as terminal:
            yield Keyboard(terminal.read), keyboard.HELP
    elif kind == "gamepad":
        path = Path(place) if place else None
        with contextlib.closing(Gamepad(lambda: open_gamepad(path))) as pad:
            yield pad, f"{pad.name}:\n{gamepad.HELP}"
    else:
        yield load_device(name), f"{name} moves it. Ctrl-C ends this."


class Display:
    """Shows what the robot does, on a line that is drawn again and again."""

    def __init__(self, guide: Guide, line: Line) -> None:
        self._guide = guide
        self._line = line
        self._refusal = ""
        self._joint: int | None = None

    def show(self, command: Command, frame: int) -> None:
        """Shows what a command moves, and what the device and the guide have to say."""
        try:
            state = self._guide.state()
        except Error:  # the session has ended: whoever steers hears of it
            return
        if command.message:
            self._say(command.message)
        if state.refusal and state.refusal != self._refusal:
            self._say(state.refusal)
        self._refusal = state.refusal
        self._line.show(f"  {self._moved(command, frame, state)}  {state.mode}")

    def _moved(self, command: Command, frame: int, state: GuideState) -> str:
        """What moves, and where it is."""
        if command.rate or not self._guide.frame_names:
            self._joint = command.joint or (self._joint if command.joint is None else 0)
        elif any(command.velocity):
            self._joint = None
        if self._joint is None and self._guide.frame_names:
            x, y, z = 1000 * state.frames[frame]
            return f"{self._guide.frame_names[frame]}  {x:6.1f} {y:6.1f} {z:6.1f} mm"
        joint = self._joint or 0
        unit = self._guide.joint_units[joint]
        return f"{self._guide.joint_names[joint]}  {state.joints[joint]:7.3f} {unit}"

    def _say(self, sentence: str) -> None:
        self._line.clear()
        say(sentence, flush=True)
