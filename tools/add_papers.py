# SPDX-License-Identifier: BSD-3-Clause
"""Puts manual pages and the bill of materials into a wheel.

    tools/add_papers.py WHEEL [BUILD]    where it was compiled

pip installs the pages into share/man of an environment, where `man` finds them if its `bin` is on
the PATH. The bill is in sboms/ of the metadata, as PEP 770 says.
"""

import email
import sys
from pathlib import Path

from auditwheel.wheeltools import InWheel
from bill_of_materials import bill
from manual_pages import pages


def add_papers(wheel: Path, build: Path | None) -> None:
    """Replaces a wheel by one that has them, with the time of SOURCE_DATE_EPOCH.

    Args:
        wheel: the file
        build: where it was compiled, if anything was

    Raises:
        LookupError: if the wheel contains a library that the bill does not know
    """
    with InWheel(wheel, wheel) as folder:
        (information,) = folder.glob("*.dist-info")
        metadata = email.message_from_bytes((information / "METADATA").read_bytes())
        name = metadata["Name"]
        texts = {
            folder / f"{information.stem}.data/data/share/man/man1/{file}": text
            for file, text in pages(("", name) if build else (name,)).items()
        }
        requirements = metadata.get_all("Requires-Dist", [])
        path = information / "sboms" / f"{name}.spdx.json"
        texts[path] = bill(name, folder, build, requirements=requirements)
        for path, text in texts.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)


if __name__ == "__main__":
    wheel, *compiled = (Path(word).resolve() for word in sys.argv[1:])
    add_papers(wheel, compiled[0] if compiled else None)
