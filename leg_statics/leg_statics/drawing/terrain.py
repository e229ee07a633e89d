# SPDX-License-Identifier: Apache-2.0
"""Pictures of terrain from above: the ground, and what it is worth to each leg."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array
from leg_statics.drawing.style import (
    COLOUR_MAP,
    FONT_SIZE,
    WORKSPACE_GREY,
    finish_bar,
    new_figure,
    plain,
    titled,
)
from leg_statics.footholds import Verdict
from leg_statics.terrain import FootholdMap, Survey

PANEL = 45.0  # mm, of the height of a panel
MARGIN = 0.6  # m


def plot_terrain(
    ground: Survey,
    maps: Mapping[str, FootholdMap],
    *,
    feet: Mapping[str, ArrayLike] | None = None,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw heights and the scores of each leg where they reach, x to the right and y upwards.

    What is out of reach, or no foothold, is grey; what is unknown is white.

    Args:
        ground: The ground.
        maps: Foothold maps by the names of their legs.
        feet: Points to mark in the panels of these legs (3,) [m].
        title: Title of the figure.
        figure: Figure to draw into.
    """
    figure = new_figure(figure, PANEL * (1 + len(maps)) + 14.0 + (5.0 if title else 0.0))
    axes = figure.subplots(1 + len(maps), 1, sharex=True, squeeze=False)[:, 0]
    height = np.where(ground.known, ground.points[..., 2], np.nan)
    mesh = _panel(axes[0], ground, height, "copper", "height")
    finish_bar(figure.colorbar(mesh, ax=axes[0], aspect=12, pad=0.02), "[m]")
    for ax, (name, found) in zip(axes[1:], maps.items(), strict=True):
        known = np.where(np.isfinite(found.score), 0.0, np.nan)
        _panel(ax, ground, known, WORKSPACE_GREY, name.replace("_", " "))
        good = np.where(found.verdict == Verdict.FEASIBLE, found.score, np.nan)
        good[found.score == 0.0] = np.nan
        mesh = _panel(ax, ground, good, COLOUR_MAP, name.replace("_", " "), (0.0, 1.0))
        if feet is not None and name in feet:
            x, y, _ = as_array("foot", feet[name], 3)
            ax.plot(x, y, "o", markersize=3.5, markerfacecolor="white", markeredgecolor="black")
        finish_bar(figure.colorbar(mesh, ax=ax, aspect=12, pad=0.02), "score")
    axes[-1].set(xlim=_around(ground, maps))
    axes[-1].set_xlabel("$x$ [m]", fontsize=FONT_SIZE)
    return titled(figure, title)


def _around(ground: Survey, maps: Mapping[str, FootholdMap]) -> tuple[float, float]:
    """Return the range of x that legs reach and a margin, or all if none reaches anything [m]."""
    x = ground.points[0, :, 0]
    near = np.zeros(ground.score.shape, dtype=bool)
    for found in maps.values():
        near |= np.isfinite(found.verdict) & (found.verdict != Verdict.REACH)
    columns = np.flatnonzero(near.any(axis=0))
    if not len(columns):
        return float(x[0]), float(x[-1])
    return max(float(x[columns[0]]) - MARGIN, x[0]), min(float(x[columns[-1]]) + MARGIN, x[-1])


def _panel(
    ax: Axes,
    ground: Survey,
    values: FloatArray,
    colours: str,
    name: str,
    limits: tuple[float | None, float | None] = (None, None),
) -> QuadMesh:
    """Draw values over the cells; a grey of one shade is given as a number."""
    x, y = ground.points[0, :, 0], ground.points[:, 0, 1]
    low, high = limits
    if colours == WORKSPACE_GREY:
        colours, low, high = "gray", -float(WORKSPACE_GREY), 1.0 - float(WORKSPACE_GREY)
    mesh = ax.pcolormesh(
        x, y, values, shading="nearest", cmap=colours, vmin=low, vmax=high, rasterized=True
    )
    plain(ax)
    ax.set_title(name, fontsize=FONT_SIZE, pad=3)
    ax.set(aspect="equal")
    ax.set_ylabel("$y$ [m]", fontsize=FONT_SIZE)
    return mesh
