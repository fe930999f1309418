# SPDX-License-Identifier: BSD-3-Clause
"""Every notebook is run as it stands; the site shows what came out."""

import gc
from pathlib import Path

import nbformat
import pytest
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from website.pages import MADE

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
FOLDER = Path("docs/notebooks")
NOTEBOOKS = sorted((ROOT / FOLDER).glob("*.ipynb"))
LONGEST = 240
"""Time that a cell may take on a busy machine [s]."""


def pictures(notebook: nbformat.NotebookNode) -> list[int]:
    """The cells that show a picture."""
    return [
        number
        for number, cell in enumerate(notebook.cells)
        if any("image/png" in output.get("data", {}) for output in cell.get("outputs", []))
    ]


def test_there_are_three() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["first_look", "reading_a_log", "training"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_does_what_it_says(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    kept = nbformat.read(path, as_version=4)
    nbformat.validate(kept)
    run = nbformat.from_dict(kept)
    # A kernel listens on sockets that no other user can open.
    kernel = AsyncKernelManager(transport="ipc", connection_file=str(tmp_path / "kernel.json"))
    NotebookClient(
        run,
        km=kernel,
        timeout=LONGEST,
        iopub_timeout=LONGEST,
        startup_timeout=LONGEST,
        record_timing=False,
        resources={"metadata": {"path": str(tmp_path)}},
    ).execute(cleanup_kc=True)  # otherwise only of a kernel that it has made itself
    gc.collect()  # What is left open is an error of this test, not of one that comes later.
    MADE[FOLDER].mkdir(parents=True, exist_ok=True)
    nbformat.write(run, MADE[FOLDER] / path.name)
    assert pictures(run) == pictures(kept), "python -m website.pictures keeps the new ones"
