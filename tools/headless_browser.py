# SPDX-License-Identifier: Apache-2.0
"""A browser without a screen, for tests and screenshots of the page."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome")
INSTALL = (
    ["apt-get", "update", "-qq"],
    ["apt-get", "install", "-qq", "--yes", "--no-install-recommends", "chromium"],
)
INSTALL_TIMEOUT = 900.0  # s
# No sandbox, which the root of a container cannot have; pictures are drawn without a graphics card.
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


class NoBrowserError(Exception):
    """There is no browser; the message says why none could be had."""


def find_browser() -> str:
    """Return the path of a Chromium, installed by apt if there is none and this is root.

    Raises:
        NoBrowserError: If there is none and none can be installed.
    """
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is not None:
        return found
    if os.geteuid() != 0 or shutil.which("apt-get") is None:
        raise NoBrowserError(
            f"no browser ({', '.join(NAMES)}), and only root of a Debian can install one here"
        )
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for command in INSTALL:
        try:
            done = subprocess.run(
                command, env=environment, capture_output=True, text=True, timeout=INSTALL_TIMEOUT
            )
        except subprocess.TimeoutExpired:
            raise NoBrowserError(f"{' '.join(command)} took too long") from None
        if done.returncode:
            raise NoBrowserError(f"{' '.join(command)} failed: {done.stderr.strip()[-300:]}")
    return find_browser()


@contextmanager
def open_browser() -> Iterator[Browser]:
    """Open a browser without a screen.

    Raises:
        NoBrowserError: If there is none and none can be installed.
    """
    path = find_browser()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()
