# SPDX-License-Identifier: Apache-2.0
"""Pictures of stances from above: support region, feet, centre of mass, forces of the ground."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array
from leg_statics.drawing.style import FONT_SIZE, GREY, SMALL_FONT_SIZE, new_figure, plain, titled
from leg_statics.stance.region import SupportRegion

LONGEST_ARROW = 0.35  # of the largest force [m]


def plot_support_region(
    region: SupportRegion,
    feet: ArrayLike,
    center_of_mass: ArrayLike,
    *,
    names: Sequence[str] = (),
    force: ArrayLike | None = None,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw a support region from above, x up and y to the left, as who walks behind sees it.

    The dark polygon is inside the region, the line around it outside: the border is between.

    Args:
        region: The region of one stance.
        feet: Positions of the feet that stand (L, 3) [m].
        center_of_mass: The centre of mass (3,) [m].
        names: Names of the feet (L).
        force: Forces of the ground (L, 3) [N]; their horizontal parts are drawn as arrows, and the
            vertical ones written.
        title: Title of the figure.
        figure: Figure to draw into.
    """
    at, center = as_array("feet", feet, 3), as_array("center_of_mass", center_of_mass, 3)
    figure = new_figure(figure, 92.0)
    ax = figure.subplots()
    _draw_polygon(ax, region.tangent_corners, color=GREY, linestyle="--", linewidth=0.8)
    ax.fill(region.vertices[:, 1], region.vertices[:, 0], color="#7fb3d5", alpha=0.7, linewidth=0)
    ax.plot(center[1], center[0], "k+", markersize=9)
    ax.annotate(
        f"centre of mass,\nmargin {region.margin:.2f} m",
        (center[1], center[0]),
        xytext=(0, 6),
        textcoords="offset points",
        ha="center",
        fontsize=SMALL_FONT_SIZE,
    )
    ax.plot(at[:, 1], at[:, 0], "o", color="black", markersize=4)
    labels = [name.replace("_", " ") for name in names] or [""] * len(at)
    if force is not None:
        forces = as_array("force", force, 3)
        _draw_forces(ax, at, forces)
        labels = [
            f"{label}\n↑ {f[2]:.0f} N, → {np.hypot(f[0], f[1]):.0f} N"
            for label, f in zip(labels, forces, strict=True)
        ]
    for foot, label in zip(at, labels, strict=True):
        left = foot[1] > at[:, 1].mean()
        ax.annotate(
            label,
            (foot[1], foot[0]),
            xytext=(-6 if left else 6, 0),
            textcoords="offset points",
            ha="right" if left else "left",
            va="center",
            fontsize=SMALL_FONT_SIZE,
        )
    ax.set_aspect("equal", adjustable="datalim")
    ax.invert_xaxis()
    ax.margins(0.7, 0.12)  # the names stand beside the feet
    ax.set_xlabel("$y$, to the left [m]", fontsize=FONT_SIZE)
    ax.set_ylabel("$x$, forward [m]", fontsize=FONT_SIZE)
    plain(ax)
    return titled(figure, title)


def plot_margins(
    time: ArrayLike,
    margins: Mapping[str, ArrayLike],
    *,
    label: str = "margin [m]",
    time_label: str = "phase of the gait",
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw margins, or load factors, over a gait, one curve each.

    Args:
        time: Phase or time (m,).
        margins: Values (m,) by the names of the curves.
        label: What they are, and their unit.
        time_label: What the time is, and its unit.
        title: Title of the figure.
        figure: Figure to draw into.
    """
    figure = new_figure(figure, 60.0)
    ax = figure.subplots()
    for (name, values), style in zip(margins.items(), ("-", "--", "-.", ":"), strict=False):
        ax.plot(time, values, style, label=name, linewidth=1.3)
    ax.axhline(0.0, color="black", linewidth=0.5)
    ax.set_xlabel(time_label, fontsize=FONT_SIZE)
    ax.set_ylabel(label, fontsize=FONT_SIZE)
    ax.grid(color="0.9", linewidth=0.5)
    if len(margins) > 1:
        ax.legend(fontsize=SMALL_FONT_SIZE, frameon=False)
    plain(ax)
    return titled(figure, title)


def _draw_polygon(ax: Axes, points: FloatArray, **style: object) -> None:
    closed = np.concatenate([points, points[:1]])
    ax.plot(closed[:, 1], closed[:, 0], **style)  # type: ignore[arg-type]


def _draw_forces(ax: Axes, feet: FloatArray, force: FloatArray) -> None:
    """Draw the horizontal parts of forces as arrows."""
    horizontal = np.linalg.norm(force[:, :2], axis=-1)
    scale = LONGEST_ARROW / max(float(horizontal.max()), 1e-9)
    tips = feet[:, :2] + scale * force[:, :2]
    ax.update_datalim(tips[:, ::-1])  # an arrow that ends outside would not be drawn
    for foot, tip in zip(feet, tips, strict=True):
        ax.annotate(
            "",
            (tip[1], tip[0]),
            xytext=(foot[1], foot[0]),
            arrowprops={"arrowstyle": "-|>", "color": "firebrick", "linewidth": 1.0},
        )
