# SPDX-License-Identifier: BSD-3-Clause
"""The reference of configuration keys is what the program reads."""

import runpy
import subprocess
from pathlib import Path

import pytest
from conftest import PROGRAM

WRITER = Path(__file__).parents[2] / "tools" / "write_reference.py"


def test_the_page_has_every_key_as_the_program_reads_it() -> None:
    writer = runpy.run_path(str(WRITER))
    if writer["page"](str(PROGRAM)) != writer["PAGE"].read_text():
        pytest.fail(f"configurations have changed; write the page again: python {WRITER}")


def test_every_key_of_the_documented_configuration_is_in_it() -> None:
    writer = runpy.run_path(str(WRITER))
    page = writer["PAGE"].read_text()
    for path in writer["meanings"](writer["DOCUMENTED"].read_text()):
        last = path.rpartition(".")[2]
        assert (
            f".{last}`" in page
            or f"`{last}" in page
            or f".{last}." in page
            or last
            in (
                "objects",
                "contact",
                "joints",
                "plausibility",
            )
        ), path


def test_config_prints_values_and_what_is_allowed() -> None:
    command = [PROGRAM, "config", "sim", "--set", "contact.tip_friction=0.8"]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    (line,) = (line for line in lines if line.startswith("contact.tip_friction "))
    assert line.split() == ["contact.tip_friction", "0.8", "0.001", "to", "5"]
    wrong = subprocess.run([PROGRAM, "config", "simm"], capture_output=True, text=True, check=False)
    assert wrong.returncode != 0
    assert "there is no configuration 'simm'" in wrong.stderr
