# SPDX-License-Identifier: BSD-3-Clause
"""Writes what a file of a release contains: a bill of materials in SPDX 2.3.

    tools/bill_of_materials.py PACKAGE FOLDER BUILD OBJECTS

This is for CPack: FOLDER has the files of the package of Debian, whose objects are below OBJECTS, a
list with commas, in the folder BUILD. A library that has no row in PARTS is an error.
"""

import hashlib
import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any
from urllib.parse import quote

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
OWNERS = "Organization: The TriFinger developers"


@dataclass(frozen=True)
class Part:
    """What others wrote, and files of ours contain."""

    name: str
    licence: str
    source: str
    """The package with its headers, as in a package URL."""
    library: str = ""
    """How the file of its shared library begins; without one, all of it is compiled in."""


PARTS = (
    Part("Eigen", "MPL-2.0", "deb/debian/libeigen3-dev"),
    Part("CLI11", "BSD-3-Clause", "deb/debian/libcli11-dev"),
    Part("JSON for Modern C++", "MIT", "deb/debian/nlohmann-json3-dev"),
    Part("fmt", "MIT", "deb/debian/libfmt-dev", "libfmt"),
    Part("yaml-cpp", "MIT", "deb/debian/libyaml-cpp-dev", "libyaml-cpp"),
    Part("LZ4", "BSD-2-Clause", "deb/debian/liblz4-dev", "liblz4"),
    Part("Zstandard", "BSD-3-Clause OR GPL-2.0-only", "deb/debian/libzstd-dev", "libzstd"),
    Part("libdeflate", "MIT", "deb/debian/libdeflate-dev", "libdeflate"),
    Part("MuJoCo", "Apache-2.0", "pypi/mujoco-core", "libmujoco"),
    Part("eiquadprog", "LGPL-3.0-or-later", "pypi/eiquadprog"),
    Part("nanobind", "BSD-3-Clause", "pypi/nanobind"),
    Part("robin-map", "MIT", "generic/robin-map"),  # inside nanobind
)
# That of this machine, also while packages are made for another one.
DPKG = ("dpkg-query", "--admindir=/var/lib/dpkg")
# Headers of the system and of Python make nothing a part of a file.
SYSTEM = re.compile(
    r"deb/debian/(libc6-dev|linux-libc-dev|libgcc-\d+-dev|libstdc\+\+-\d+-dev|libpython3.*-dev)"
    r"(-\w+-cross)?"
    r"|generic/python|pypi/numpy"
)


def owner(header: str) -> str:
    """Returns the package of a header that Debian does not have; empty if it is ours."""
    if re.search(r"/include/.*python3\.", header):
        return "generic/python"
    if "/robin_map/" in header:
        return "generic/robin-map"
    folder = r"/(?:site-packages|aarch64/python)/(?:cmeel.prefix/include/)?(\w+)/"
    if path := re.search(folder, header):
        return f"pypi/{path[1].replace('mujoco', 'mujoco-core')}"
    return "" if Path(header).is_relative_to(ROOT) else header


def compiled_in(build: Path, objects: Iterable[str] = ("",)) -> list[str]:
    """Returns the packages of others whose headers are in objects of a build, as ninja knows."""
    ninja = ["ninja", "-C", str(build), "--quiet", "-t", "deps"]
    log = subprocess.run(ninja, check=True, capture_output=True, text=True).stdout
    headers = {
        os.path.realpath(build / line.strip()).removeprefix(str(ROOT / "build/aarch64/debian"))
        for entry in log.split("\n\n")
        if re.match(rf"({'|'.join(objects)})\S*\.o:", entry)
        for line in entry.splitlines()[1:]
    }
    query = [*DPKG, "--search", *(path for path in headers if path.startswith("/usr/"))]
    told = subprocess.run(query, capture_output=True, text=True).stdout.splitlines()
    known = {path: line.partition(":")[0] for line in told for path in [line.split(": ", 1)[1]]}
    found = {f"deb/debian/{name}" for name in known.values()}
    found |= {owner(path) for path in headers if path not in known}
    return sorted(source for source in found if source and not SYSTEM.fullmatch(source))


def part_of(what: str) -> Part:
    """Returns the part that a package or the name of a library stands for."""
    for part in PARTS:
        if what == part.source or (part.library and what.startswith(part.library)):
            return part
    raise LookupError(f"{what} is not in PARTS of tools/bill_of_materials.py")


def element(name: str, source: str, number: str, **more: Any) -> dict[str, Any]:
    """Returns a package of SPDX."""
    purl = f"pkg:{source}@{quote(number)}" if number else f"pkg:{source}"
    reference = {"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl"}
    return {
        "SPDXID": "SPDXRef-" + re.sub(r"[^A-Za-z0-9.]+", "-", source),
        "name": name,
        **({"versionInfo": number} if number else {}),
        "downloadLocation": "NOASSERTION",
        "filesAnalyzed": False,
        "externalRefs": [{**reference, "referenceLocator": purl}],
        **more,
    }


def element_of(part: Part, **more: Any) -> dict[str, Any]:
    """Returns a part with the version that is installed here."""
    kind, _, name = part.source.rpartition("/")
    query = [*DPKG, "-W", "-f", "${Version}", name]
    number = subprocess.run(query, capture_output=True, text=True).stdout
    number = version(name) if kind == "pypi" else number
    licences = {"licenseConcluded": part.licence, "licenseDeclared": part.licence}
    return element(part.name, part.source, number, **licences, **more)


def parts(
    folder: Path, build: Path | None, objects: Iterable[str], requirements: Iterable[str]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yields what files contain or need, each with its relation to them."""
    for text in requirements:
        needed = Requirement(text)
        if not needed.marker:  # An extra is nobody's need.
            number = str(needed.specifier).partition("==")[2]
            yield "DEPENDS_ON", element(needed.name, f"pypi/{needed.name}", number, comment=text)
    for path in sorted(folder.rglob("*.so*")):
        if not path.name.startswith("_trifinger"):
            digest = hashlib.sha256(path.read_bytes()).hexdigest()
            sums = [{"algorithm": "SHA256", "checksumValue": digest}]
            file = str(path.relative_to(folder))
            yield "CONTAINS", element_of(part_of(path.name), packageFileName=file, checksums=sums)
    for source in compiled_in(build, objects) if build else ():
        part = part_of(source)
        yield "DYNAMIC_LINK" if part.library else "STATIC_LINK", element_of(part)


def bill(
    name: str,
    folder: Path,
    build: Path | None = None,
    objects: Iterable[str] = ("",),
    requirements: Iterable[str] = (),
) -> str:
    """Returns the bill of a wheel or package.

    Args:
        name: of the distribution
        folder: its files
        build: where it was compiled, if anything was
        objects: how the paths of its objects begin there
        requirements: Python packages that it requires

    Raises:
        LookupError: if a library has no row in PARTS
    """
    number = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))
    licences = dict.fromkeys(("licenseConcluded", "licenseDeclared"), "BSD-3-Clause")
    # Not as on PyPI: there, somebody else has the name.
    own = element(name, f"generic/{name}", number, supplier=OWNERS, **licences)
    packages = {own["SPDXID"]: own}
    relations = [("SPDXRef-DOCUMENT", "DESCRIBES", own["SPDXID"])]
    for relation, part in parts(folder, build, objects, requirements):
        if packages.setdefault(part["SPDXID"], part) is part:
            relations.append((own["SPDXID"], relation, part["SPDXID"]))
    digest = hashlib.sha256(json.dumps(list(packages.values())).encode()).hexdigest()[:16]
    keys = ("spdxElementId", "relationshipType", "relatedSpdxElement")
    document = {
        "spdxVersion": "SPDX-2.3",
        "dataLicense": "CC0-1.0",
        "SPDXID": "SPDXRef-DOCUMENT",
        "name": f"{name} {number}",
        # No address has been published: this domain is for examples.
        "documentNamespace": f"https://trifinger.example/spdx/{name}-{number}-{digest}",
        "creationInfo": {
            "created": f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%SZ}",
            "creators": [OWNERS, "Tool: bill_of_materials.py"],
        },
        "packages": list(packages.values()),
        "relationships": [dict(zip(keys, each, strict=True)) for each in relations],
    }
    return json.dumps(document, indent=2) + "\n"


if __name__ == "__main__":
    package, staged, build, objects = sys.argv[1:]
    path = Path(staged, f"usr/share/doc/{package}/{package}.spdx.json")
    path.write_text(bill(package, Path(staged), Path(build), objects.split(",")))
    path.chmod(0o644)
