# SPDX-License-Identifier: BSD-3-Clause
"""Files of results appear whole or not at all, whatever ends the program that writes them."""

import ast
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from trifinger.whole_file import whole_file

ROOT = Path(__file__).parents[2]
PLACES = [ROOT / "python/trifinger", *(ROOT / "packages").iterdir()]
SOURCES = [
    pytest.param(path, str(path.relative_to(place)), id=str(path.relative_to(place)))
    for place in PLACES
    for path in sorted(place.rglob("*.py"))
    if "tests" not in path.parts[len(ROOT.parts) :]
]
WRITERS = ("savefig", "imsave", "imwrite", "ParquetWriter", "write_table", "savez")
METHODS = ("write_text", "write_bytes", "save", "tofile")
OPENERS = ("open", "File")  # of anybody: Python, gzip, PyAV, h5py
MODES = ("w", "wb", "wt", "x", "xb", "w+b")
WHOLE = ("whole_file", "whole_folder")
ELSEWHERE = {
    # The caller gives the path inside of a whole file.
    "log/tables.py": ("to_csv", "to_parquet"),
    "log/original.py": ("_open_text",),
    # Motion.save() and ResetStates.save() write a whole file.
    "training/run.py": ("__init__",),
    "trifinger_view/commands/motion.py": ("work",),
    "trifinger_view/commands/teach.py": ("save",),
    # A folder of many files, which grows.
    "log/images.py": ("save_images",),
    # In a whole folder.
    "trifinger_data_sets/lerobot.py": ("write_json", "_png"),
    "trifinger_data_sets/lerobot_tables.py": ("_write", "close", "add"),
    "trifinger_data_sets/lerobot_videos.py": ("add",),
    "trifinger_data_sets/statistics.py": ("__init__",),
    "trifinger_data_sets/minari.py": ("_write_episodes",),
    # In a temporary folder.
    "trifinger_data_sets/recorded_environment.py": ("make",),
    "commands/policy.py": ("network_of",),
    "commands/run_policy_of_python.py": ("_configuration_of",),
    "training/learner.py": ("serve", "policy"),
    # A file that is locked, and has nothing in it.
    "sweep/trials.py": ("run_trial",),
    # What a process says as long as it runs; a secret that nobody else may read for an instant.
    "training/on_robot.py": ("_launch", "_claimed"),
    # Into the memory.
    "log/camera_film.py": ("__init__",),
    "trifinger_camera_calibration/colour_labels.py": ("_source",),
    "training/checkpoint.py": ("dump",),
    "trifinger_view/to_browser.py": ("jpeg",),
    # A number of the kernel.
    "niceness.py": ("be_nice",),
    # Nothing: it asks whether a device may be written.
    "robot_fingers/programs.py": ("_require_targets",),
}
"""Functions that write otherwise, and why they may."""


def is_writer(node: ast.AST) -> bool:
    """True if a call writes a file."""
    if not isinstance(node, ast.Call):
        return False
    is_method = isinstance(node.func, ast.Attribute)
    name = node.func.attr if is_method else getattr(node.func, "id", "")
    modes = [*node.args, *(word.value for word in node.keywords if word.arg == "mode")]
    return (
        name in WRITERS
        or (is_method and name in METHODS and bool(node.args))
        or (
            name in OPENERS
            and any(isinstance(mode, ast.Constant) and mode.value in MODES for mode in modes)
        )
    )


def writers(node: ast.AST, function: str = "", is_whole: bool = False) -> Iterator[tuple[str, int]]:
    """Yields the function and the line of each writer outside of whole files and folders."""
    if isinstance(node, ast.FunctionDef):
        function, is_whole = node.name, False
    if isinstance(node, ast.With):
        made = [item.context_expr for item in node.items]
        is_whole = is_whole or any(
            isinstance(one, ast.Call) and getattr(one.func, "id", "") in WHOLE for one in made
        )
    if is_writer(node) and not is_whole:
        yield function, node.lineno  # type: ignore[attr-defined]  # a call
    for child in ast.iter_child_nodes(node):
        yield from writers(child, function, is_whole)


@pytest.mark.parametrize(("path", "name"), SOURCES)
def test_every_writer_writes_whole_files(path: Path, name: str) -> None:
    allowed = ELSEWHERE.get(name, ())
    for function, line in writers(ast.parse(path.read_text())):
        assert function in allowed, f"{name}:{line}: {function} writes under the final name"


def test_an_error_leaves_the_file_before(tmp_path: Path) -> None:
    path = tmp_path / "files" / "one.png"
    path.parent.mkdir()
    path.write_bytes(b"before")

    def fail() -> None:
        with whole_file(path) as part:
            assert part.suffix == ".png"
            part.write_bytes(b"after")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert [file.read_bytes() for file in path.parent.iterdir()] == [b"before"]
    with whole_file(path) as part:
        part.write_bytes(b"after")
    assert [file.read_bytes() for file in path.parent.iterdir()] == [b"after"]


def test_a_file_that_must_not_be_replaced_stays(tmp_path: Path) -> None:
    path = tmp_path / "files" / "one"
    path.parent.mkdir()
    path.write_bytes(b"before")
    with pytest.raises(FileExistsError), whole_file(path, replace=False) as part:
        part.write_bytes(b"after")
    assert [file.read_bytes() for file in path.parent.iterdir()] == [b"before"]


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o666, 0o400])
def test_a_file_that_is_replaced_keeps_its_mode(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"before")
    path.chmod(mode)
    with whole_file(path) as part:
        assert part.stat().st_mode & 0o077 == 0
        part.write_bytes(b"after")
    assert path.read_bytes() == b"after"
    assert path.stat().st_mode & 0o777 == mode


def test_a_folder_may_be_unreadable() -> None:
    """As a mailbox of others: it may be written and searched, but not listed."""
    is_administrator = os.geteuid() == 0  # who may read all
    with tempfile.TemporaryDirectory() as outer:  # others do not reach pytest's folders
        Path(outer).chmod(0o711)
        folder = Path(outer) / "folder"
        folder.mkdir()
        folder.chmod(0o733 if is_administrator else 0o300)
        try:
            if is_administrator:
                os.seteuid(65534)
            with whole_file(folder / "file") as part:
                part.write_bytes(b"after")
        finally:
            if is_administrator:
                os.seteuid(0)
            folder.chmod(0o700)
        assert [file.read_bytes() for file in folder.iterdir()] == [b"after"]


@pytest.mark.parametrize("name", ["n" * 255, "n" * 251 + ".png", "ä" * 127, "n." + "x" * 253])
def test_a_name_may_have_any_length(tmp_path: Path, name: str) -> None:
    for text in (b"before", b"after"):
        with whole_file(tmp_path / name) as part:
            part.write_bytes(text)
        assert (tmp_path / name).read_bytes() == text


def test_a_file_that_is_mounted_alone_is_written(tmp_path: Path) -> None:
    """As containers do it: no other file can take its place."""
    inside, source = tmp_path / "folder" / "inside", tmp_path / "source"
    inside.parent.mkdir()
    inside.write_bytes(b"before")
    source.write_bytes(b"longer than before")
    mount = ["unshare", "--mount", "sh", "-c", 'mount --bind "$1" "$2" || exit 77; shift 2; "$@"']
    files = [source, inside]
    if subprocess.run([*mount, "sh", *files, "true"], check=False, capture_output=True).returncode:
        pytest.skip("only an administrator may mount a file")
    subprocess.run([*mount, "sh", *files, sys.executable, "-c", WRITE, inside], check=True)
    assert source.read_bytes() == b"after"
    assert [file.read_bytes() for file in inside.parent.iterdir()] == [b"before"]


def test_a_link_and_a_device_stay(tmp_path: Path) -> None:
    target = tmp_path / "target"
    link = tmp_path / "link"
    link.symlink_to(target)
    with whole_file(link) as part:
        part.write_bytes(b"after")
    assert link.is_symlink()
    assert target.read_bytes() == b"after"
    with whole_file("/dev/null") as part:
        assert part == Path("/dev/null")


WRITE = """
import sys
from trifinger.whole_file import whole_file

with whole_file(sys.argv[1]) as part:
    part.write_bytes(b"after")
"""

# Draws a film, of which some images are written, and waits.
FILM = """
import sys, numpy as np
from pathlib import Path
from trifinger.picture import save_film

def images():
    for number in range(200):
        yield np.random.default_rng(number).integers(0, 255, (240, 320, 3), np.uint8)
    print("drawn", flush=True)
    sys.stdin.read()

save_film(images(), Path(sys.argv[1]), 30)
"""


@pytest.mark.slow
def test_a_killed_film_has_not_its_final_name(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    for before in (None, b"an earlier film"):
        if before is not None:
            path.write_bytes(before)
        with subprocess.Popen(
            [sys.executable, "-c", FILM, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        ) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == b"drawn\n"
            process.kill()
        assert (path.read_bytes() if path.exists() else None) == before
