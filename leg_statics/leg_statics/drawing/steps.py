# SPDX-License-Identifier: Apache-2.0
"""Picture of the longest step against the height of the leg frame over the ground."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from leg_kinematics.arrays import as_array
from leg_kinematics.errors import ValueRangeError
from leg_statics.drawing.style import FONT_SIZE, curve_styles, new_figure, plain, with_legend
from leg_statics.step_length import Criterion

WIDEST_LINE = 2.2  # pt


def plot_step_lengths(
    heights: ArrayLike,
    lengths: Mapping[Criterion, Mapping[str, ArrayLike]],
    load: float,
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw step lengths against the height, one panel a `Criterion`, one curve a ground.

    Args:
        heights: Heights of the foot in the leg frame (m,) [m], in order.
        lengths: Longest step at each height (m,) [m], by criterion and by the name of the ground.
        load: Normal load that is required [N].
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        ValueRangeError: If there is no criterion.
    """
    if not lengths:
        raise ValueRangeError("there is no step length to draw")
    above_ground = -as_array("heights", heights)
    panel_titles = {
        Criterion.CAPACITY: f"load capacity ≥ {load:g} N",
        Criterion.RATED_FRICTION: r"$\mu_\mathrm{e}$ ≤ friction of the ground",
    }
    figure = new_figure(figure, 68.0)
    axes = figure.subplots(1, len(lengths), sharex=True, sharey=True, squeeze=False)[0]
    for ax, (criterion, curves) in zip(axes, lengths.items(), strict=True):
        styles = curve_styles(len(curves), widest=WIDEST_LINE)
        for (name, length), style in zip(curves.items(), styles, strict=True):
            ax.plot(above_ground, length, label=name, **style)
        ax.set_title(panel_titles[criterion], fontsize=FONT_SIZE, pad=3)
        ax.set_xlabel("height of the leg frame −$h$ [m]", fontsize=FONT_SIZE)
        plain(ax)
        ax.grid(color="0.9", linewidth=0.5)
    axes[0].set_ylim(bottom=0.0)
    axes[0].set_ylabel("longest step [m]", fontsize=FONT_SIZE)
    return with_legend(figure, axes[0], title, 3)
