# SPDX-License-Identifier: BSD-3-Clause
"""Moves a robot by hand from afar: keyboard, gamepad, or a device of your own.

A device is a function that says what the person wants now. It is called many times a second:

    from trifinger_view.teleoperation import Command, teleoperate

    def device() -> Command:
        return Command(velocity=(0.02, 0.0, 0.0), frame=0)

    with trifinger.guide("sim") as guide:
        teleoperate(guide, device)
"""

from trifinger_view.teleoperation.command import (
    Command as Command,
    Device as Device,
    Request as Request,
)
from trifinger_view.teleoperation.devices import load_device as load_device
from trifinger_view.teleoperation.gamepad import Gamepad as Gamepad, open_gamepad as open_gamepad
from trifinger_view.teleoperation.keyboard import Keyboard as Keyboard, Terminal as Terminal
from trifinger_view.teleoperation.steering import teleoperate as teleoperate
