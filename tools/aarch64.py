# SPDX-License-Identifier: BSD-3-Clause
"""Makes what users of 64-bit ARM get (Jetson, Raspberry Pi 5), on another machine.

    .venv/bin/python tools/aarch64.py FOLDER    # after ./run build release, on Debian 12

These are a wheel for Debian 12's Python, and the packages of Debian. Debian's cross compiler makes
them, and qemu runs them here: `./run soak aarch64` does so. Libraries come from packages of Debian
for arm64, which are only unpacked, and from wheels for such machines, in build/aarch64.
"""

import io
import os
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

from make_release import checksums, make_debian_packages, put_bills_beside, run
from make_wheel import ROOT, make_wheel, make_wheels_of_packages

BUILD = ROOT / "build" / "aarch64"
DEBIAN = BUILD / "debian"
PACKAGES = BUILD / "python"
LIBRARIES = DEBIAN / "usr" / "lib" / "aarch64-linux-gnu"
TOOLCHAIN = ROOT / "cmake" / "aarch64.cmake"
# What the programs of this machine need: `./run soak aarch64` installs them.
TOOLS = ("crossbuild-essential-arm64", "mmdebstrap", "qemu-user", "dpkg-dev")
SUITE = "bookworm"
DEBIAN_PACKAGES = (
    *("libc6-dev", "libstdc++-12-dev", "libeigen3-dev", "libyaml-cpp-dev"),
    *("libfmt-dev", "libcli11-dev", "libzstd-dev", "liblz4-dev", "libdeflate-dev"),
    *("nlohmann-json3-dev", "libgtest-dev", "libgmock-dev", "librapidcheck-dev"),
    *("python3.11", "libpython3.11-dev", "libturbojpeg0"),
)
PYTHON_PACKAGES = ("mujoco-core", "numpy", "eiquadprog")
PLATFORMS = (
    "manylinux_2_34",
    "manylinux_2_28",
    "manylinux_2_27",
    "manylinux_2_17",
    "manylinux2014",
)
# What Python says of the other machine, for its extension modules and wheels.
OTHER_PYTHON = {
    "_PYTHON_HOST_PLATFORM": "linux-aarch64",
    "SETUPTOOLS_EXT_SUFFIX": ".cpython-311-aarch64-linux-gnu.so",
    "LD_LIBRARY_PATH": str(LIBRARIES),  # auditwheel finds libraries there
}


def fetch() -> None:
    """Fetches libraries, headers and Python of the other machine, if they are missing."""
    if not DEBIAN.exists():
        part = DEBIAN.with_suffix(".part")
        shutil.rmtree(part, ignore_errors=True)
        part.parent.mkdir(parents=True, exist_ok=True)
        unpack = ("mmdebstrap", "--quiet", "--variant=extract", "--architectures=arm64")
        keep = "--skip=cleanup/apt/cache"
        run(*unpack, keep, f"--include={','.join(DEBIAN_PACKAGES)}", SUITE, part)
        shutil.rmtree(part / "dev")  # The emulator shall find that of this machine.
        register(part)
        part.rename(DEBIAN)
    if not PACKAGES.exists():
        part = PACKAGES.with_suffix(".part")
        shutil.rmtree(part, ignore_errors=True)
        unpack_wheels(part, "--constraint", ROOT / "requirements.lock", *PYTHON_PACKAGES)
        part.rename(PACKAGES)


def unpack_wheels(folder: Path, *which: str | Path) -> None:
    """Unpacks wheels for the other machine into a folder, as pip would install them there."""
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "install")
    what = ("--only-binary=:all:", "--no-deps", "--python-version=3.11")
    where = (f"--platform={name}_aarch64" for name in PLATFORMS)
    run(*pip, *what, *where, "--target", folder, *which)


def register(debian: Path) -> None:
    """Tells dpkg-shlibdeps which package has which library, and from which version on."""
    database = debian / "var" / "lib" / "dpkg"
    archives = sorted((debian / "var" / "cache" / "apt" / "archives").glob("*.deb"))
    with (database / "status").open("w") as status:
        for archive in archives:
            control = BUILD / "control"
            run("dpkg-deb", "--control", archive, control)
            fields = (control / "control").read_text()
            (name,) = re.findall("^Package: (.+)$", fields, re.MULTILINE)
            status.write(f"{fields}Status: install ok installed\n\n")
            owner = f"{name}:arm64" if "Multi-Arch: same" in fields else name
            for kind in ("symbols", "shlibs"):
                if (control / kind).exists():
                    shutil.copy(control / kind, database / "info" / f"{owner}.{kind}")
            listing = ("dpkg-deb", "--fsys-tarfile", archive)
            content = subprocess.run(listing, check=True, capture_output=True).stdout
            with tarfile.open(fileobj=io.BytesIO(content)) as files:
                paths = [f"{DEBIAN / path}\n" for path in files.getnames()]
            (database / "info" / f"{owner}.list").write_text("".join(paths))
            shutil.rmtree(control)
            archive.unlink()
    (database / "info" / "format").write_text("1\n")


def emulated(*arguments: str | Path, packages: Path = PACKAGES) -> str:
    """What the other machine's Python prints; raises CalledProcessError if it fails."""
    python = DEBIAN / "usr" / "bin" / "python3.11"
    command = ["qemu-aarch64", "-L", DEBIAN, python, *arguments]
    variables = {"PYTHONPATH": str(packages), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        list(map(str, command)),
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return done.stdout


def wheel(folder: Path) -> Path:
    """Makes the wheel."""
    variables = {
        "CMAKE_TOOLCHAIN_FILE": str(TOOLCHAIN),
        "CMAKE_CXX_COMPILER": "aarch64-linux-gnu-g++",
        "MuJoCo_ROOT": str(PACKAGES / "mujoco"),
        "Eiquadprog_ROOT": str(PACKAGES / "cmeel.prefix"),
    }
    return make_wheel(folder, variables, machine="aarch64", environment=OTHER_PYTHON)


def installed(wheel: Path, folder: Path) -> Path:
    """Unpacks a wheel of ours into a folder, and links what it needs beside it."""
    unpack_wheels(folder, wheel)
    for path in PACKAGES.iterdir():
        if not (folder / path.name).exists():
            (folder / path.name).symlink_to(path)
    return folder


def debian_packages(folder: Path) -> None:
    """Makes the packages of Debian with CPack."""
    make_debian_packages(
        folder,
        "package-aarch64",
        DPKG_ADMINDIR=str(DEBIAN / "var" / "lib" / "dpkg"),
        DEB_HOST_ARCH="arm64",
        LD_LIBRARY_PATH=f"{LIBRARIES}:{DEBIAN / 'lib' / 'aarch64-linux-gnu'}",
    )


def main(folder: Path) -> None:
    """Makes the files in a folder, and nothing else is in it then."""
    fetch()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    wheel(folder)
    make_wheels_of_packages(folder)
    debian_packages(folder)
    put_bills_beside(folder)
    (folder / "SHA256SUMS").write_text(checksums(folder))


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
