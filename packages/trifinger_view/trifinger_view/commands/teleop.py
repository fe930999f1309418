# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger teleop`."""

import argparse
import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import trifinger
from trifinger._trifinger import Guide
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, say
from trifinger.errors import Error
from trifinger.progress import Line

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
        description="Move the fingers of a robot with a keyboard, a gamepad or a device of yours.",
        epilog=f"Keys:\n{keyboard.HELP}\nA tip moves while its key is held.\n\n"
        f"Gamepad:\n{gamepad.HELP}\n\n"
        "Examples:\n"
        "  trifinger teleop sim\n"
        "  trifinger teleop sim --device gamepad\n"
        "  trifinger teleop sim --device my_module:my_function",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("robot", metavar="NAME", help="name of the running robot")
    parser.add_argument(
        "--device",
        default="keyboard",
        help="keyboard (default), gamepad, gamepad:FILE for one of several (/dev/input/event5), or "
        "MODULE:FUNCTION, a function that returns a trifinger_view.teleoperation.Command",
    )
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger teleop`."""
    arguments = parse(words)
    return command_line.run(lambda: run(arguments.robot, arguments.device))


def run(robot: str, device_name: str) -> None:
    """Moves the robot until the person ends it."""
    # The device comes first: without it, the robot is not touched.
    with (
        command_line.ended_by_signals(),
        opened(device_name) as (device, how_to),
        trifinger.guide(robot) as guide,
    ):
        command_line.wait_until_measured(guide, robot)
        if isinstance(device, Keyboard | Gamepad):
            device.num_fingers = guide.num_fingers
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

    def show(self, command: Command, finger: int) -> None:
        """Shows the finger that a command moves, and what the device and the guide have to say."""
        try:
            state = self._guide.state()
        except Error:  # the session has ended: whoever steers hears of it
            return
        if command.message:
            self._say(command.message)
        if state.refusal and state.refusal != self._refusal:
            self._say(state.refusal)
        self._refusal = state.refusal
        x, y, z = 1000 * state.tips[finger]
        self._line.show(f"  finger {finger + 1}  {x:6.1f} {y:6.1f} {z:6.1f} mm  {state.mode}")

    def _say(self, sentence: str) -> None:
        self._line.clear()
        say(sentence, flush=True)
