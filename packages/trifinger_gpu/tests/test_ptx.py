# SPDX-License-Identifier: BSD-3-Clause
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).resolve().parents[1] / "tools" / "write_ptx.py"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("clang++") is None, reason="clang++ is missing"),
]


def write(*arguments: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, TOOL, *arguments], capture_output=True, text=True, timeout=120
    )


def test_the_chain_becomes_a_kernel_that_calls_nothing_else(tmp_path: Path) -> None:
    done = write(tmp_path / "safety.ptx")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "safety.ptx").read_text()
    assert text.count(".visible .entry trifinger_apply_safety(") == 1
    assert "sqrt.rn.f64" in text  # the last check: limit_velocity
    assert "fma.rn" not in text  # products and sums are rounded as on a processor


def test_a_function_that_a_gpu_does_not_have_is_named(tmp_path: Path) -> None:
    source = tmp_path / "sine.cpp"
    source.write_text(
        'extern "C" __attribute__((device)) double sin(double);\n'
        'extern "C" __attribute__((global)) void trifinger_apply_safety(double* x)'
        " { *x = sin(*x); }\n"
    )
    done = write(tmp_path / "sine.ptx", source)
    assert done.returncode != 0
    assert done.stderr.strip().endswith("calls sin, which a GPU does not have")
    source.write_text('extern "C" __attribute__((global)) void other(double* x) { *x = 1.0; }\n')
    done = write(tmp_path / "other.ptx", source)
    assert done.returncode != 0
    assert done.stderr.strip().endswith("has no kernel trifinger_apply_safety")
