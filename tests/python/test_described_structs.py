# SPDX-License-Identifier: BSD-3-Clause
"""What the compiler says of a struct that cannot be described."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COMPILERS = [name for name in ("g++", "clang++") if shutil.which(name)]

STRUCT = """
#include <array>
#include <cstdint>
#include <string>
#include <tuple>
#include "trifinger/core/description.hpp"
struct Inner {{ double value; }};
enum class Gear : std::uint8_t {{ kFirst }};
struct Action {{
  double speed;
  {member} odd;
  static constexpr auto fields() {{
    return std::tuple{{trifinger::field("speed", &Action::speed, "rad/s"),
                      trifinger::field("odd", &Action::odd)}};
  }}
}};
static_assert(trifinger::Described<Action>);
"""


def compile_with(compiler: str, member: str, folder: Path) -> subprocess.CompletedProcess[str]:
    source = folder / "action.cpp"
    source.write_text(STRUCT.format(member=member))
    command = [compiler, "-std=c++20", "-fsyntax-only", "-fdiagnostics-color=never"]
    return subprocess.run(
        [*command, f"-I{ROOT / 'include'}", source], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize(
    "member", ["bool", "Gear", "double*", "long double", "std::array<bool, 3>", "Inner"]
)
def test_fault_75_a_field_that_cannot_be_is_named_with_the_remedy(
    member: str, compiler: str, tmp_path: Path
) -> None:
    result = compile_with(compiler, member, tmp_path)
    assert result.returncode != 0
    assert "the type of this field is no number of fixed size" in result.stderr
    assert "take std::uint8_t instead of bool" in result.stderr
    lines = (tmp_path / "action.cpp").read_text().splitlines()
    (place,) = (i for i, line in enumerate(lines, 1) if "&Action::odd" in line)
    assert f"action.cpp:{place}:" in result.stderr
    assert f"action.cpp:{place - 1}:" not in result.stderr, "the other field is good"


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_field_of_fixed_size_compiles(compiler: str, tmp_path: Path) -> None:
    assert compile_with(compiler, "std::uint64_t", tmp_path).returncode == 0
