# SPDX-License-Identifier: Apache-2.0
"""Photograph the page of the view for the docs: `./leg python tools/view_pictures.py`."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

from headless_browser import open_browser
from playwright.sync_api import Browser, ViewportSize

from leg_kinematics import load_robot
from leg_statics.view.page import Page
from leg_statics.view.standing import Playground

DOCS = Path(__file__).resolve().parent.parent / "docs"
PICTURES = {"view_hexapod": ("hexapod", "rough"), "view_quadruped": ("quadruped", "steps")}
SIZE = ViewportSize(width=1360, height=800)
ASKED = 0.56, 0.62  # where the ground is clicked, as shares of the canvas
TIMEOUT = 600e3  # ms: without a graphics card a frame takes seconds


def main() -> int:
    """Write the pictures."""
    with open_browser() as browser:
        for name, (robot, terrain) in PICTURES.items():
            with closing(Page(Playground.of(load_robot(robot), terrain), port=0)) as page:
                photograph(browser, page, DOCS / f"{name}.png")
    return 0


def photograph(browser: Browser, page: Page, path: Path) -> None:
    """Ask for a place on the ground and take a picture of the page."""
    tab = browser.new_page(viewport=SIZE)
    tab.set_default_timeout(TIMEOUT)
    tab.goto(page.address)
    tab.get_by_role("cell", name="load capacity").wait_for()
    tab.locator(".mantine-Notification-closeButton").click()  # that it has no graphics card
    box = tab.locator("canvas").first.bounding_box()
    assert box is not None
    across, down = ASKED
    tab.mouse.click(box["x"] + across * box["width"], box["y"] + down * box["height"])
    tab.get_by_text("Click a place").wait_for(state="hidden")
    (client,) = page.server.get_clients().values()
    client.get_render(32, 32)  # which comes when all is drawn
    tab.screenshot(path=path, timeout=TIMEOUT)
    tab.close()
    print(path)


if __name__ == "__main__":
    sys.exit(main())
