#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Compiles the safety chain for GPUs of NVIDIA, from the headers that robots use.

    packages/trifinger_gpu/tools/write_ptx.py FILE [SOURCE]

Clang alone does it: neither CUDA nor a GPU is needed. PTX is what the driver of a GPU compiles for
it; the kernel in it is `trifinger_apply_safety`, which src/gpu/safety_worlds.cpp describes.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
ROOT = PACKAGE.parents[1]
SOURCE = PACKAGE / "src" / "gpu" / "safety_worlds.cpp"
KERNEL = "trifinger_apply_safety"
COMPILER = "clang++"  # Debian's, which setup installs
ARCHITECTURE = "sm_75"  # Turing; drivers compile PTX for later ones, too


def problem_of(text: str) -> str | None:
    """Says what is wrong with PTX: a kernel that is missing, or functions that nobody gives it."""
    if not re.search(rf"\.visible \.entry {KERNEL}\(", text):
        return f"has no kernel {KERNEL}"
    if missing := re.findall(r"^\.extern \.func .*?(\w+)\s*$", text, re.MULTILINE):
        return f"calls {', '.join(missing)}, which a GPU does not have"
    return None


def write(path: Path, source: Path = SOURCE) -> None:
    """Writes the PTX.

    Raises:
        SystemExit: with a sentence that says why this is not possible
    """
    compiler = shutil.which(COMPILER)
    if compiler is None:
        sys.exit(f"{COMPILER} is missing: apt install clang (./run setup does it)")
    path.parent.mkdir(parents=True, exist_ok=True)
    includes = (f"-I{PACKAGE / 'src'}", f"-I{ROOT / 'include'}")
    # The library's headers need these two words, which headers of CUDA would define. Products and
    # sums stay apart, as on a processor, so that both give the same bits. Clang warns that it does
    # not know the version of CUDA; there is none.
    words = (f"-D__{one}__=__attribute__(({one}))" for one in ("host", "device"))
    command = [compiler, "-x", "cuda", "--cuda-device-only", f"--cuda-gpu-arch={ARCHITECTURE}"]
    command += ["-nocudainc", "-nocudalib", "-Wno-unknown-cuda-version", "-ffp-contract=off"]
    command += ["-std=c++20", "-O2", "-Wall", "-Werror", "-S", *words, *includes]
    done = subprocess.run([*command, "-o", str(path), str(source)])
    if done.returncode != 0:
        sys.exit(f"{compiler} cannot compile {source}")
    if problem := problem_of(path.read_text()):
        sys.exit(f"{path} {problem}")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    write(*map(Path, sys.argv[1:]))
    print(f"wrote {sys.argv[1]}")
