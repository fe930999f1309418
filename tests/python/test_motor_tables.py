# SPDX-License-Identifier: BSD-3-Clause
"""What is known of Dynamixel motors, against the tables that their maker publishes."""

from __future__ import annotations

import importlib.util
import math
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from conftest import BUILD

pytestmark = pytest.mark.bindings

# What is named otherwise there.
NAMES = {"secondary_id": "Secondary(Shadow) ID"}
# Not known here, because nobody uses them: pins of XM540 for sensors.
NOT_OURS = {f"External Port {kind} {pin}" for kind in ("Mode", "Data") for pin in (1, 2, 3)}
# These files say what torque a step of a current gives; all others say no unit.
CURRENTS_AS_TORQUES = {"XC330-T181", "XC330-T288"}
NEWER = "_fw52"  # Files of this firmware say it in their names; the others are older.
# The published units are rounded, or those of 4095 instead of 4096 steps.
ROUNDED = 1e-3


@dataclass
class Register:
    """A number in the memory of a motor."""

    address: int
    size: int
    is_signed: bool
    unit: str
    scale: float


@dataclass
class Model:
    """What is known of a type of motor."""

    number: int
    registers: dict[str, Register] = field(default_factory=dict)
    blocks: list[list[int]] = field(default_factory=list)


Known = tuple[dict[str, Model], float]


@pytest.fixture(scope="module")
def known() -> Known:
    """Returns the models by their names, and a step of a position [rad]."""
    tool = str(BUILD / "tests/python/motor_tables")
    text = subprocess.run([tool], capture_output=True, text=True, check=True).stdout
    models: dict[str, Model] = {}
    step = 0.0
    for line in text.splitlines():
        match line.split("\t"):
            case ["position", value]:
                step = float(value)
            case ["model", name, number]:
                model = models[name] = Model(int(number))
            case ["register", name, address, size, is_signed, unit, scale]:
                model.registers[name] = Register(
                    int(address), int(size), is_signed == "1", unit, float(scale)
                )
            case ["block", *numbers]:
                model.blocks.append([int(number) for number in numbers])
    return models, step


MODELS = (
    *("XM430-W210", "XM430-W350", "XH430-W210", "XH430-W350", "XL430-W250", "2XL430-W250"),
    *("XM540-W270", "XM540-W150", "XL330-M077", "XL330-M288"),
    *("XC330-T181", "XC330-T288", "XC330-M181", "XC330-M288"),
)
SDK = importlib.util.find_spec("dynamixel_easy_sdk")
TABLES = Path(str(SDK.origin) if SDK else "").parent / "control_table"
FILES = [
    (name, file)
    for name in MODELS
    for file in sorted(TABLES.glob(f"{name.lower().replace('-', '_')}*.model"))
]
EACH_FILE = pytest.mark.parametrize(
    ("name", "file"), [pytest.param(*each, id=each[1].stem) for each in FILES]
)


def section(file: Path, name: str) -> list[list[str]]:
    """Returns the lines of a section without its heading, as words."""
    _, _, rest = file.read_text().partition(f"[{name}]\n")
    lines = rest.partition("\n[")[0].splitlines()[1:]
    return [line.split("\t") for line in lines if line]


def test_the_published_tables_are_there() -> None:
    """They come with the package `dynamixel-sdk`."""
    assert {name for name, _ in FILES} == set(MODELS)
    newer = {name for name, file in FILES if file.stem.endswith(NEWER)}
    assert newer == {name for name in MODELS if "330" in name}


def test_models_have_their_published_numbers(known: Known) -> None:
    models, _ = known
    assert set(models) == set(MODELS)
    lines = (TABLES / "dynamixel.model").read_text().splitlines()[1:]
    published = {file: int(number) for number, file in (line.split("\t") for line in lines)}
    for name, model in models.items():
        assert published[f"{name.lower().replace('-', '_')}.model"] == model.number


@EACH_FILE
def test_registers_are_where_they_are_published(known: Known, name: str, file: Path) -> None:
    models, _ = known
    published = {
        register: (int(address), int(size))
        for address, size, register in section(file, "control table")
        if register not in NOT_OURS and not register.startswith("Indirect")
    }
    ours = {}
    for own, register in models[name].registers.items():
        words = NAMES.get(own, own.replace("_", " ")).casefold()
        ours[words] = (register.address, register.size)
    assert ours == {register.casefold(): place for register, place in published.items()}


@EACH_FILE
def test_units_are_the_published_ones(known: Known, name: str, file: Path) -> None:
    models, position_step = known
    units = section(file, "unit info")
    assert units
    for register, value, unit, sign in units:
        ours = models[name].registers[register.lower().replace(" ", "_")]
        assert ours.is_signed == (sign == "signed"), register
        if "Current" in register:
            assert unit == ("N/m" if name in CURRENTS_AS_TORQUES else "raw"), register
            assert ours.unit == "A"
        else:
            assert ours.unit == unit, register
            assert math.isclose(ours.scale, float(value), rel_tol=ROUNDED), register
    angles = dict(section(file, "type info"))
    steps = [int(angles[f"value_of_{end}_radian_position"]) for end in ("min", "zero", "max")]
    assert steps == [0, 2048, 4095]
    turn = float(angles["max_radian"]) - float(angles["min_radian"])
    assert math.isclose(position_step, turn / (steps[2] - steps[0]), rel_tol=ROUNDED)


@EACH_FILE
def test_indirect_data_are_where_they_are_published(known: Known, name: str, file: Path) -> None:
    models, _ = known
    places = {
        register: int(address)
        for address, _, register in section(file, "control table")
        if register.startswith("Indirect")
    }
    firmware = 52 if file.stem.endswith(NEWER) else 51
    blocks = [block for block in models[name].blocks if block[3] <= firmware <= block[4]]
    pairs = {(first + 2 * i, data + i) for first, data, count, *_ in blocks for i in range(count)}
    for kind in ("1", "Write", "Read"):
        assert (places[f"Indirect Address {kind}"], places[f"Indirect Data {kind}"]) in pairs
