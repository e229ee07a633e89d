# SPDX-License-Identifier: Apache-2.0
"""Figures 2 and 5 to 8 of paper 000: its leg before and after the optimisation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from leg_kinematics.description import load_leg_types
from leg_statics.commands.leg_pictures import friction_picture
from leg_statics.commands.plot_index_map import main as plot_index_map
from leg_statics.drawing.designs import plot_designs
from leg_statics.drawing.style import write_figure
from leg_statics.grounds import Ground
from leg_statics.published.paper_000 import GROUNDS, OPTIMISED_LENGTHS, paper_search

STAGES = ("initial", "optimised")


def draw(folder: Path) -> None:
    """Draw the figures into a folder."""
    types = load_leg_types("hexapod")
    for stage in STAGES:
        plot_index_map(["--type", stage, "--all", str(folder)])
    mechanisms = {stage: types[stage].mechanism for stage in STAGES}
    grounds = [Ground(name, *friction) for name, friction in GROUNDS.items()]
    write_figure(friction_picture(mechanisms, grounds), folder / "hexapod_both_8.png")
    found = paper_search()
    marked = {
        "initial": found.before,
        "paper's optimum": found.means[found.find(tuple(OPTIMISED_LENGTHS.values()))],
        "best by (33)": found.means[np.argmax(found.objective)],
    }
    figure = plot_designs(found.means[found.known], marked, before=found.before)
    write_figure(figure, folder / "hexapod_initial_7.png")
