# SPDX-License-Identifier: Apache-2.0
"""Figures 2, 5, 7, 8, 9 and 12 of paper 003: the six-bar leg beside Theo Jansen's, in cranks."""

from __future__ import annotations

from pathlib import Path

from leg_statics.commands.six_bar_pictures import six_bar_pictures
from leg_statics.drawing.crank_legs import Scale
from leg_statics.drawing.style import write_figure
from leg_statics.published.paper_003 import SAMPLES, legs


def draw(folder: Path) -> None:
    """Draw the figures into a folder."""
    found = legs()
    synthesized = "six-bar, φmax = 168°", found.optimum
    direct = "six-bar, direct search", found.direct
    pictures = six_bar_pictures(synthesized, direct, Scale(1.0, "crank lengths"), SAMPLES)
    for name, picture in pictures.items():
        write_figure(picture(), folder / f"{name}.png")
