# SPDX-License-Identifier: Apache-2.0
"""Picture of the rated friction along the walking direction, beside that of grounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import ShapeError, ValueRangeError
from leg_statics.drawing.style import (
    FONT_SIZE,
    GREY,
    WORKSPACE_GREY,
    curve_styles,
    height_title,
    layer_label,
    new_figure,
    number_text,
    plain,
    with_legend,
)
from leg_statics.grounds import Ground
from leg_statics.maps import IndexMap

RATED_FRICTION = "rated_friction"
MOST_FRICTION = 2.0  # of the diagram: no ground offers more


def plot_rated_friction(
    curves: Mapping[str, IndexMap],
    grounds: Sequence[Ground],
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw the rated friction mu_e along the walking direction: figure 8 of paper 000.

    Beside the curves stand the friction ranges of grounds; their low ends, on which one may count,
    run through the diagram. Where a curve lies under such a line the foot does not slip.

    Args:
        curves: Maps of one line each with the layer "rated_friction", by the name of their curve,
            such as before and after an optimisation.
        grounds: Grounds to compare with.
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        UnknownNameError: If a map does not have the layer.
        ShapeError: If a map has several lines.
        ValueRangeError: If there is no curve, or a line does not meet the workspace.
    """
    if not curves:
        raise ValueRangeError("there is no curve to draw")
    figure = new_figure(figure, 72.0)
    ax = figure.subplots()
    highest = max((ground.friction_high for ground in grounds), default=0.0)
    for (name, line), style in zip(curves.items(), curve_styles(len(curves)), strict=True):
        x, friction = _inside(line)
        ax.plot(x, friction, label=f"{name}, {height_title(float(line.height))}", **style)
        highest = max(highest, float(np.max(friction)))
    ax.set_ylim(0.0, 1.05 * min(highest, MOST_FRICTION))
    places = ", ".join(sorted({number_text(line.y[0], 2) for line in curves.values()}))
    ax.set_xlabel(f"$x$ [m], forward, at $y$ = {places} m", fontsize=FONT_SIZE)
    ax.set_ylabel(layer_label(RATED_FRICTION), fontsize=FONT_SIZE)
    plain(ax)
    if grounds:
        _ground_ranges(ax, grounds)
    return with_legend(figure, ax, title, 2)


def _inside(line: IndexMap) -> tuple[FloatArray, FloatArray]:
    """Return x and mu_e where the line is inside the workspace; gaps are NaN."""
    values = line.layer(RATED_FRICTION)
    if values.shape != (1, len(line.x)):
        raise ShapeError(f"a map to draw as a curve must be one line, got {values.shape}")
    friction = values[0]
    inside = np.flatnonzero(np.isfinite(friction))
    if not len(inside):
        raise ValueRangeError(
            f"no point of the workspace at y = {line.y[0]:g} m, height {float(line.height):g} m"
        )
    stretch = slice(inside[0], inside[-1] + 1)
    return line.x[stretch], friction[stretch]


def _ground_ranges(ax: Axes, grounds: Sequence[Ground]) -> None:
    """Draw the friction range of each ground as a bar beside `ax`, its low end as a line."""
    side = ax.inset_axes((1.0, 0.0, 0.1 * len(grounds), 1.0), sharey=ax)
    for k, ground in enumerate(sorted(grounds, key=lambda g: g.friction_low)):
        ax.axhline(ground.friction_low, color=GREY, linewidth=0.6, zorder=0)
        side.bar(
            k,
            ground.friction_high - ground.friction_low,
            bottom=ground.friction_low,
            width=0.55,
            color=WORKSPACE_GREY,
            edgecolor=GREY,
            linewidth=0.6,
            zorder=2,
        )
        side.text(
            k,
            0.5 * (ground.friction_low + ground.friction_high),
            ground.name,
            rotation=90,
            ha="center",
            va="center",
            fontsize=FONT_SIZE,
        )
        side.plot([-0.6, k], [ground.friction_low] * 2, color=GREY, linewidth=0.6, zorder=1)
    side.set_xlim(-0.6, len(grounds) - 0.6)
    side.axis("off")
