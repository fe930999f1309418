# SPDX-License-Identifier: BSD-3-Clause
"""Every page is run as it stands; tutorials make the pictures that they show."""

import os
import re
import shutil
from pathlib import Path

import pytest
from conftest import patient_backend
from pages import ROOT, Page, blocks, documents, pictures
from website.contents import CONTENTS
from website.pages import MADE

pytestmark = pytest.mark.slow

DOCS = ROOT / "docs"
PICTURES = MADE[Path("docs/images/tutorials")]
TUTORIALS = [DOCS / f"{name}.md" for name in CONTENTS["Tutorials"]]
PAGES = [path for path in documents() if any(block.is_typed for block in blocks(path.read_text()))]


def patient_configurations(folder: Path) -> Path:
    """The program's configurations, for a machine that may stall for as long as it likes."""
    shutil.copytree(ROOT / "config", folder)
    for path in folder.rglob("*.yml"):
        text = re.sub(
            r"(max_repeats|max_skipped_ticks|max_late_steps): \d+", r"\1: 1000000", path.read_text()
        )
        text = re.sub(r"receive_timeout: [\d.]+", "receive_timeout: 10", text)
        # Readers wait for these two.
        text = re.sub(r"silent_after: [\d.]+", "silent_after: 3", text)
        path.write_text(re.sub(r"move_time: [\d.]+", "move_time: 1", text))
    for path in folder.glob("*.yml"):
        limits = r"(stuck_time|max_position_rate|max_velocity_error): [\d.]+"
        path.write_text(re.sub(limits, r"\1: .inf", path.read_text()))
    return folder


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_does_what_it_says(path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "reader"
    folder.mkdir()
    variables = {
        **os.environ,
        "PATH": f"{ROOT}/.venv/bin:{os.environ['PATH']}",
        "TRIFINGER_CONFIG_DIR": str(patient_configurations(tmp_path / "config")),
        "BROWSER": "true",  # opens nothing
        "MPLBACKEND": "agg",
        "MUJOCO_GL": "egl",
        "MINARI_DATASETS_PATH": str(tmp_path / "minari"),
    }
    page = Page(path, folder, variables, added={"arm.yml": patient_backend(period=0.001)})
    if path in TUTORIALS:  # they build on each other
        for before in TUTORIALS[: TUTORIALS.index(path)]:
            Page(before, folder, variables).save_files()
    page.run()
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in pictures(page.text):
        shutil.copy(folder / name, PICTURES / name)
