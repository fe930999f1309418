# SPDX-License-Identifier: BSD-3-Clause
"""Whatever is compiled of ours is static, so no binary interface can break unseen."""

from conftest import BUILD


def test_the_only_shared_library_is_the_module_of_python() -> None:
    """If this fails, docs/decisions/stability.md has to be decided again."""
    found = {path.resolve() for path in BUILD.rglob("*.so*") if path.is_file()}
    (ours,) = (path for path in found if not path.name.startswith("libmujoco"))
    assert ours.name.startswith("_trifinger.")
