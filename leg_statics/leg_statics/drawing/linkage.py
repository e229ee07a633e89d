# SPDX-License-Identifier: Apache-2.0
"""Picture of a leg from the side and from the front, in its workspace, with forces at its foot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array, as_non_negative
from leg_kinematics.errors import ShapeError
from leg_kinematics.mechanism import Linkage
from leg_statics.drawing.style import (
    FONT_SIZE,
    WIDTH,
    WORKSPACE_GREY,
    new_figure,
    plain,
    with_legend,
)
from leg_statics.workspace import Section

LEAST_WIDTH = 0.4  # of a view, as a share of its height: a planar leg has none from the front
ROOM_FOR_FORCES = 0.3  # above the foot, as a share of the height
FORCE_SIZE = 0.25  # of cone and forces, as a share of the height


class View(NamedTuple):
    """What one view shows, in the vertical plane through the foot.

    Attributes:
        workspace: Section of the workspace.
        forces: Corners of the plane ground reactions that the actuators can hold (k, 2) [N], the
            vertical component last; None draws none.
    """

    workspace: Section
    forces: FloatArray | None = None


def plot_linkage(
    linkage: Linkage,
    foot: ArrayLike,
    side: View,
    front: View,
    friction: float | None = None,
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw a leg from its right side (x, z) and from the front (y, z) with its workspace.

    Args:
        linkage: Points (p, 3) and bars of the leg in one posture.
        foot: The foot position (t,) [m]; t = 3 for a leg that walks.
        side: What to show in the plane of x and z.
        front: What to show in the plane of y and z.
        friction: Friction coefficient of the ground; if given, the friction cone is drawn.
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        ShapeError: If the linkage is not that of one posture.
        ValueRangeError: If friction is negative or NaN.
    """
    if linkage.points.ndim != 2:
        raise ShapeError("a leg can be drawn in one posture only")
    task_position = as_array("foot", foot)
    place = task_position[:3]
    cone = None if friction is None else float(as_non_negative("friction", friction))
    views = {"side view": (side, [0, 2]), "front view": (front, [1, 2])}
    has_forces = cone is not None or any(view.forces is not None for view, _ in views.values())
    low, high = _box(linkage.points, place, side, front, has_forces)
    widths, tall = (high - low)[:2], float((high - low)[2])
    height = (WIDTH - 22.0) * tall / np.sum(widths) + (33.0 if title else 28.0)
    figure = new_figure(figure, height)
    axes = figure.subplots(1, 2, sharey=True, width_ratios=widths.tolist())
    for ax, (name, (view, plane)) in zip(axes, views.items(), strict=True):
        _draw_workspace(ax, view.workspace)
        if cone is not None:
            _draw_cone(ax, place[plane], cone, FORCE_SIZE * tall)
        _draw_bars(ax, linkage, plane)
        ax.set_title(name, fontsize=FONT_SIZE, pad=3)
        ax.set(xlim=(low[plane[0]], high[plane[0]]), ylim=(low[2], high[2]), aspect="equal")
        plain(ax)
        ax.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 4, 5, 10]))
    _draw_forces(axes, place, list(views.values()), FORCE_SIZE * tall)
    walks = len(task_position) == 3
    axes[0].set_xlabel("$x$ [m], forward" if walks else "$x$ [m]", fontsize=FONT_SIZE)
    axes[1].set_xlabel("$y$ [m], left" if walks else "$y$ [m]", fontsize=FONT_SIZE)
    axes[0].set_ylabel("$z$ [m]", fontsize=FONT_SIZE)
    return with_legend(figure, axes[0], title, 2)


def _box(
    points: FloatArray, foot: FloatArray, side: View, front: View, has_forces: bool
) -> tuple[FloatArray, FloatArray]:
    """Return the corners of a box that holds linkage, workspace and forces (3,) [m]."""
    ranges = side.workspace.across, front.workspace.across, side.workspace.z
    bounds = np.array([[values[0], values[-1]] for values in ranges])
    corners = np.concatenate([points, bounds.T])
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 0.04 * np.max(high - low)
    low, high = low - margin, high + margin
    least = LEAST_WIDTH * (high - low)[2]
    wider = np.maximum(0.0, 0.5 * (least - (high - low))) * [1.0, 1.0, 0.0]
    low, high = low - wider, high + wider
    if has_forces:
        high[2] = max(high[2], float(foot[2] + ROOM_FOR_FORCES * (high - low)[2]))
    return low, high


def _draw_workspace(ax: Axes, section: Section) -> None:
    """Shade the section of the workspace."""
    if section.inside.any():
        ax.contourf(
            section.across,
            section.z,
            section.inside,
            levels=[0.5, 1.5],
            colors=[WORKSPACE_GREY],
            zorder=0,
        )
        ax.fill([], [], color=WORKSPACE_GREY, label="workspace")


def _draw_bars(ax: Axes, linkage: Linkage, plane: list[int]) -> None:
    points = linkage.points[:, plane]
    for bar in linkage.bars:
        ax.plot(*points[list(bar)].T, color="0.15", linewidth=1.0, zorder=3)
    ax.plot(*points.T, "o", color="white", mec="0.15", mew=0.7, markersize=2.6, zorder=4)


def _draw_cone(ax: Axes, foot: FloatArray, friction: float, length: float) -> None:
    """Draw the edges of the friction cone, from the foot upwards."""
    edge = length * np.array([friction, 1.0]) / np.hypot(friction, 1.0)
    x, z = np.stack([foot - edge * [1, -1], foot, foot + edge]).T
    label = f"friction cone, $\\mu$ = {friction:g}"
    ax.plot(x, z, "--", color="C0", linewidth=1.0, label=label)


def _draw_forces(
    axes: Sequence[Axes],
    foot: FloatArray,
    views: Sequence[tuple[View, list[int]]],
    length: float,
) -> None:
    """Draw the forces of the views at the foot, all in one scale of round numbers."""
    shown = [
        (ax, foot[plane], view.forces)
        for ax, (view, plane) in zip(axes, views, strict=True)
        if view.forces is not None
    ]
    if not shown:
        return
    needed = max(float(np.max(np.abs(forces))) for *_, forces in shown) / length  # [N/m]
    decade = 10.0 ** np.floor(np.log10(needed))
    scale = decade * min(step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if step * decade >= needed)
    label = f"forces it can hold (0.1 m = {0.1 * scale:g} N)"
    for ax, place, forces in shown:
        ax.fill(*(place + forces / scale).T, color="C1", alpha=0.35, zorder=1, lw=0)
        ax.fill([], [], color="C1", alpha=0.35, lw=0, label=label)
