# SPDX-License-Identifier: Apache-2.0
"""Figures 3 and 4 of paper 001: maps of K_F and K_J, beside all others of the leg."""

from __future__ import annotations

from pathlib import Path

from leg_statics.commands.plot_index_map import main as plot_index_map

MAPPED = ("planar_force", "planar_imbalance")


def draw(folder: Path) -> None:
    """Draw the figures into a folder."""
    plot_index_map(["--robot", "quadruped", "--all", str(folder)])
    for name in MAPPED:
        path = folder / f"{name}.png"
        plot_index_map(["--robot", "quadruped", "--index", name, "--output", str(path)])
