# SPDX-License-Identifier: BSD-3-Clause
"""Debian's Chromium without a screen, for measures and tests of pages."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Browser

EXECUTABLE = "/usr/bin/chromium"
OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    # Mesa draws. Chromium's own renderer gets nearly nothing of a busy processor: its threads yield
    # instead of waiting.
    "--use-angle=gl-egl",
    "--ignore-gpu-blocklist",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--no-first-run",
)


@contextmanager
def open_browser() -> Iterator[Browser]:
    """A browser that draws without a graphics card; it ends with the block."""
    from playwright.sync_api import sync_playwright

    # Chromium makes folders in it, and refuses long paths of sockets.
    environment: dict[str, str | float | bool] = {**os.environ, "TMPDIR": "/tmp"}  # noqa: S108
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=EXECUTABLE, args=list(OPTIONS), env=environment
        )
        try:
            yield browser
        finally:
            browser.close()
