# SPDX-License-Identifier: BSD-3-Clause
"""Makes all files of a release, and checks them as users would."""

import os
import shutil
import subprocess
import sys

from make_release import VERSION, pythons

from .build import build
from .setup import PYTHON, VENV, install_debian_packages, setup
from .steps import ROOT, StepFailed, Steps

PACKAGES = ROOT / "build" / "packages"
AGAIN = ROOT / "build" / "again" / "sources"  # another folder for the same sources


def release(*options: str) -> int:
    """Makes build/packages; with --check also tries them.

    Raises:
        StepFailed: if something cannot be made
    """
    require_clean_tree()
    setup()
    build("release", "apps/all", "bindings/all")  # Their helps become manual pages.
    steps = Steps("release")
    install_debian_packages(steps, ("dpkg-dev", "lintian", "debootstrap", "podman", "buildah"))
    steps.run("wheels, packages, sources", [PYTHON, "tools/make_release.py", str(PACKAGES)])
    for path in sorted(PACKAGES.iterdir()):
        print(f"    {path.relative_to(ROOT)}, {path.stat().st_size / 2**20:.1f} MiB")
    print(f"Version {VERSION} of pyproject.toml, notes in NOTES.md, checksums in SHA256SUMS.")
    return check(steps) if "--check" in options else 0


def require_clean_tree() -> None:
    """Raises StepFailed if files differ from the commit, which alone is released."""
    git = ["git", "-C", str(ROOT), "status", "--porcelain"]
    changes = subprocess.run(git, check=True, capture_output=True, text=True).stdout
    if changes:
        print(f"./run release: commit or remove these changes first:\n{changes}", file=sys.stderr)
        raise StepFailed


def check(steps: Steps) -> int:
    """Runs all checks, also after one failed, and returns the exit status."""
    lintian = ["lintian", "--fail-on", "error,warning", "--allow-root"]
    passed = [
        same_bytes(steps),
        steps.check("lintian", [*lintian, *map(str, PACKAGES.glob("*.deb"))]).succeeded,
    ]
    for version, python in pythons().items():
        use = ["tests/packages/use_wheel.sh", str(PACKAGES), str(python)]
        passed.append(checked(steps, f"wheel with Python {version}", use))
    if os.geteuid() != 0:
        print("  not run: a bare Debian needs root")
        return 1
    for label, script in {
        "wheel on a bare Debian": "use_wheel.sh",
        "packages on a bare Debian": "use_debian_packages.sh",
    }.items():
        use = [f"/tests/packages/{script}", "/packages"]
        passed.append(
            checked(steps, label, ["tools/on_bare_debian", "bookworm", str(PACKAGES), *use])
        )
    use = ["tests/packages/use_container.sh", str(PACKAGES)]
    passed.append(checked(steps, "a container", use))
    return 0 if all(passed) else 1


def checked(steps: Steps, label: str, command: list[str]) -> bool:
    """Runs a check, prints the figures that it names, and says whether it passed."""
    step = steps.check(label, command)
    for line in step.output.splitlines():
        if ", at most " in line or line.endswith("running robot"):
            print(f"    {line}")
    return step.succeeded


def same_bytes(steps: Steps) -> bool:
    """Makes everything again from a clone in another folder and compares."""
    shutil.rmtree(AGAIN, ignore_errors=True)
    steps.run("clone", ["git", "clone", "--quiet", str(ROOT), str(AGAIN)])
    (AGAIN / "build").mkdir()
    for environment in (VENV, *(ROOT / "build").glob("python3.*")):
        (AGAIN / environment.relative_to(ROOT)).symlink_to(environment)
    made = AGAIN / "build" / "packages"
    # Its own Python lets paths begin with its folder, as ccache wants them.
    python = str(AGAIN / ".venv" / "bin" / "python")
    steps.run("the same again", [python, str(AGAIN / "tools" / "make_release.py"), str(made)])
    sums = [PACKAGES / "SHA256SUMS", made / "SHA256SUMS"]
    return steps.check("the same bytes", ["diff", *map(str, sums)]).succeeded
