# SPDX-License-Identifier: BSD-3-Clause
"""Tests in a virtual machine with Debian's real-time kernel, which has CAN and control groups.

    tools/can_machine.py RESULTS

runs the tests in tools/can_machine_init.sh with the programs of build/release, and leaves their
JUnit files in the folder RESULTS. docs/decisions/virtual_machine.md says why it is made like this.
"""

import argparse
import lzma
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "can_machine"
KERNEL = FOLDER / "kernel"  # vmlinuz, and modules/ in the order in which they are loaded
INIT = ROOT / "tools" / "can_machine_init.sh"
RELEASE = ROOT / "build" / "release"

PACKAGE = "linux-image-rt-amd64"
MODULES = ("can-raw", "vcan")
OUR_PROGRAMS = (
    RELEASE / "apps" / "trifinger",
    RELEASE / "tests" / "can" / "can_test",
    RELEASE / "tests" / "machine" / "machine_test",
)
PROGRAMS = ("busybox", "candump", "cansend", "cangen")
LIMIT = 15 * 60  # [s]


class NotPossibleHere(Exception):  # noqa: N818, it reads better
    """This machine cannot run the tests; the sentence says why."""


# The kernel


def fetch_kernel() -> None:
    """Downloads the kernel and unpacks what is needed, unless it is there. Installs nothing.

    Raises:
        NotPossibleHere: if there is no such package, or no Debian
    """
    if platform.machine() != "x86_64":
        raise NotPossibleHere(f"there is no {PACKAGE} for {platform.machine()}")
    for program in ("qemu-system-x86_64", "apt-get", "dpkg-deb", *PROGRAMS):
        find_program(program)
    if KERNEL.exists():
        return
    FOLDER.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=FOLDER) as folder:
        package = download(Path(folder))
        unpacked = Path(folder) / "kernel"
        unpack(package, unpacked)
        unpacked.rename(KERNEL)


def find_program(name: str) -> Path:
    """Returns the path of an installed program."""
    places = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"
    path = shutil.which(name, path=places)
    if path is None:
        raise NotPossibleHere(f"the program {name} is not installed; './run setup' installs it")
    return Path(path)


def download(folder: Path) -> Path:
    """Downloads the package of the kernel to `folder` and returns its path.

    The package lists of this machine may be missing or old. Then newer ones are loaded, which
    needs no administrator because they go to `folder`.
    """
    lists = folder / "lists"
    (lists / "partial").mkdir(parents=True)
    own_lists = ["-o", f"Dir::State::Lists={lists}", "-o", f"Dir::Cache={folder / 'cache'}"]
    answer = None
    for options in ([], own_lists):
        # apt would drop the administrator's rights to be a user who cannot write here.
        apt = [*options, "-o", "APT::Sandbox::User="]
        if options:
            subprocess.run(["apt-get", *apt, "update"], capture_output=True, check=False)
        show = ["apt-cache", *options, "show", "--no-all-versions", PACKAGE]
        answer = subprocess.run(show, capture_output=True, text=True, check=False)
        depends = re.search(r"^Depends:.*?\b(linux-image-\S+-rt-amd64)", answer.stdout, re.M)
        if depends is None:
            continue
        get = ["apt-get", *apt, "download", depends[1]]
        answer = subprocess.run(get, cwd=folder, capture_output=True, text=True, check=False)
        if answer.returncode == 0:
            (package,) = folder.glob("*.deb")
            return package
    reason = " ".join(answer.stderr.split()) if answer else ""
    raise NotPossibleHere(f"apt-get cannot download what {PACKAGE} needs: {reason}")


def unpack(package: Path, folder: Path) -> None:
    """Unpacks the kernel and its modules for CAN."""
    (folder / "modules").mkdir(parents=True)
    modules: dict[str, bytes] = {}
    with (
        subprocess.Popen(["dpkg-deb", "--fsys-tarfile", package], stdout=subprocess.PIPE) as dpkg,
        tarfile.open(fileobj=dpkg.stdout, mode="r|") as files,
    ):
        for file in files:
            path = Path(file.name)
            if path.name.startswith("vmlinuz-"):
                (folder / "vmlinuz").write_bytes(content_of(files, file))
            elif re.search(r"/net/(.*/)?can/.*\.ko(\.xz)?$", file.name):
                content = content_of(files, file)
                modules[path.name.partition(".")[0]] = (
                    lzma.decompress(content) if path.suffix == ".xz" else content
                )
    for number, name in enumerate(in_order(MODULES, modules)):
        (folder / "modules" / f"{number}-{name}.ko").write_bytes(modules[name])


def content_of(archive: tarfile.TarFile, member: tarfile.TarInfo) -> bytes:
    """Returns the content of a file in an archive."""
    file = archive.extractfile(member)
    return file.read() if file else b""


def in_order(names: Sequence[str], modules: Mapping[str, bytes]) -> list[str]:
    """Returns the modules with all that they need, each after what it needs."""
    order: list[str] = []
    for name in names:
        if name not in modules:
            raise NotPossibleHere(f"the kernel of {PACKAGE} has no module '{name}' for CAN")
        needs = re.search(rb"\0depends=([^\0]*)\0", modules[name])
        needed = needs[1].decode().split(",") if needs and needs[1] else []
        order += in_order(needed, modules)
        order.append(name)
    return list(dict.fromkeys(order))


# Its file system


def make_initramfs() -> bytes:
    """Returns an archive of all files of the machine, as the kernel wants it."""
    files = {"/init": INIT}
    for program in [*OUR_PROGRAMS, *map(find_program, PROGRAMS)]:
        files[f"/bin/{program.name}"] = program
        files.update({str(library): library for library in libraries_of(program)})
    for config in (ROOT / "config").rglob("*.yml"):
        files[f"/config/{config.relative_to(ROOT / 'config')}"] = config
    for module in (KERNEL / "modules").iterdir():
        files[f"/modules/{module.name}"] = module
    names = {str(parent) for name in files for parent in Path(name).parents} - {"/"}
    archive = [cpio_entry(name, 0o040755) for name in sorted(names)]
    archive += [cpio_entry(name, 0o100755, file.read_bytes()) for name, file in files.items()]
    return b"".join([*archive, cpio_entry("TRAILER!!!", 0)])


def libraries_of(program: Path) -> Iterator[Path]:
    """Yields the libraries that the program loads; a static one loads none."""
    answer = subprocess.run(["ldd", program], capture_output=True, text=True, check=False)
    for path in re.findall(r"^\s*(?:\S+ => )?(/\S+) \(0x", answer.stdout, re.M):
        yield Path(path)


def cpio_entry(name: str, mode: int, content: bytes = b"") -> bytes:
    """Returns a file or folder in the format that cpio calls newc."""
    path = name.lstrip("/").encode() + b"\0"
    links = 2 if mode == 0o040755 else 1
    fields = (0, mode, 0, 0, links, 0, len(content), 0, 0, 0, 0, len(path), 0)
    header = b"070701" + b"".join(b"%08X" % field for field in fields) + path
    return padded(header) + padded(content)


def padded(content: bytes) -> bytes:
    """Returns the bytes, and zeros up to the next multiple of four."""
    return content + bytes(-len(content) % 4)


# The machine


def boot(results: Path) -> None:
    """Starts the machine, waits until it switches itself off, and unpacks what it has sent."""
    sent = FOLDER / "results.tar"
    sent.unlink(missing_ok=True)
    initramfs = FOLDER / "initramfs"
    initramfs.write_bytes(make_initramfs())
    command = [
        *("qemu-system-x86_64", "-nodefaults", "-no-user-config", "-no-reboot"),
        *("-display", "none", "-m", "1G", "-cpu", "max", "-smp", "1"),
        # One instruction takes 1 ns of the machine's time, and idle time takes none of ours.
        *("-accel", "tcg", "-icount", "shift=0,sleep=off"),
        *("-kernel", str(KERNEL / "vmlinuz"), "-initrd", str(initramfs)),
        *("-append", "console=ttyS0 quiet panic=-1 tsc=reliable mitigations=off no5lvl"),
        *("-serial", "stdio", "-serial", f"file:{sent}"),
    ]
    try:
        subprocess.run(command, stdin=subprocess.DEVNULL, timeout=LIMIT, check=True)
    except subprocess.TimeoutExpired:
        sys.exit(f"error: the machine was still running after {LIMIT} s")
    except subprocess.CalledProcessError as error:
        sys.exit(f"error: qemu has failed with exit code {error.returncode}")
    try:
        with tarfile.open(sent, "r:") as archive:
            if hasattr(tarfile, "data_filter"):  # Debian 12's Python has none
                archive.extraction_filter = tarfile.data_filter
            archive.extractall(results)  # noqa: S202, our own machine has made it
    except (tarfile.TarError, OSError) as error:
        sys.exit(f"error: the machine stopped before it sent its results: {error}")


def failures(results: Path) -> Iterator[str]:
    """Yields a sentence for each test that has failed, or was left out, in the machine."""
    for line in (results / "exit_codes").read_text().splitlines():
        program, code = line.split()
        if code != "0":
            yield f"{program} ended with exit code {code}"
        if not (results / f"{program}.xml").exists():
            yield f"{program} left no results"
    for file in results.glob("*.xml"):
        for case in ElementTree.parse(file).iter("testcase"):  # noqa: S314, our own files
            name = f"{case.get('classname')}.{case.get('name')}"
            if case.find("failure") is not None:
                yield f"{name} failed"
            if case.find("skipped") is not None:
                yield f"{name} was skipped, but this machine has all that it needs"


def main() -> int:
    """Boots the machine and returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("results", type=Path, help="folder for the JUnit files")
    results = parser.parse_args().results
    results.mkdir(parents=True, exist_ok=True)
    for old in (*results.glob("*.xml"), results / "exit_codes"):
        old.unlink(missing_ok=True)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # qemu ends, too
    try:
        fetch_kernel()
    except NotPossibleHere as reason:
        sys.exit(f"error: {reason}")
    boot(results)
    found = list(failures(results))
    for sentence in found:
        print(f"error: {sentence}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
