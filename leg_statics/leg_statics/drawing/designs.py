# SPDX-License-Identifier: Apache-2.0
"""Pictures of designs: their means over the workspace, and what a search among them found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.errors import ShapeError, ValueRangeError
from leg_statics.drawing.style import (
    COLOUR_MAP,
    FONT_SIZE,
    GREY,
    SMALL_FONT_SIZE,
    finish_bar,
    new_figure,
    plain,
    symbol_text,
    unit_text,
    with_legend,
)
from leg_statics.indices import find_index

DESIGN_MEANS = ("condition_number", "unit_effort_capacity", "unit_moment_effort")
LEGEND_COLUMNS = 4


def plot_designs(
    means: ArrayLike,
    marked: Mapping[str, ArrayLike] | None = None,
    *,
    before: ArrayLike | None = None,
    names: Sequence[str] = DESIGN_MEANS,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw the global means of sampled designs: figure 7 of paper 000.

    The first mean runs along x, the second along y, the third is the colour.

    Args:
        means: Means of each design (m, 3).
        marked: Means (3,) of designs to mark, by their name.
        before: Means (3,) that are to be bettered; lines through them bound the designs that do.
        names: Names of the three indices.
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        ShapeError: If there are not three means a design.
        ValueRangeError: If there is no design.
    """
    points = as_array("means", means, 3)
    if points.ndim != 2 or len(names) != 3:
        raise ShapeError(f"means must have shape (m, 3) with 3 names, got {points.shape}")
    if not len(points):
        raise ValueRangeError("there is no design to draw")
    figure = new_figure(figure, 82.0)
    ax = figure.subplots()
    x, y, colour = points.T
    dots = ax.scatter(x, y, c=colour, cmap=COLOUR_MAP, s=9, linewidths=0)
    markers = cycle("osD^v")
    for (name, value), marker in zip((marked or {}).items(), markers, strict=False):
        k, force, _ = as_array(f"marked[{name!r}]", value, 3)
        ax.plot(
            k, force, marker, markersize=6, mfc="none", mec="black", mew=1.1, label=name, ls="none"
        )
    if before is not None:
        k, force, _ = as_array("before", before, 3)
        ax.axvline(k, color=GREY, linewidth=0.6, linestyle="--", zorder=0)
        ax.axhline(force, color=GREY, linewidth=0.6, linestyle="--", zorder=0)
    ax.set_xlabel(_mean_label(names[0]), fontsize=FONT_SIZE)
    ax.set_ylabel(_mean_label(names[1]), fontsize=FONT_SIZE)
    bar = figure.colorbar(dots, ax=ax, aspect=30, pad=0.02)
    finish_bar(bar, _mean_label(names[2]))
    plain(ax)
    return with_legend(figure, ax, title, 3)


def _mean_label(name: str) -> str:
    """Return the label of a global mean; its symbol is the index's with a q appended."""
    index = find_index(name)
    symbol = index.symbol + ("q" if "_" in index.symbol else "_q")
    unit = unit_text(index.unit)
    return (
        f"mean {name.replace('_', ' ')}\n{symbol_text(symbol)} [{unit}], {index.better} is better"
    )


def plot_front(
    designs: FloatArray,
    front: FloatArray,
    marked: Mapping[str, FloatArray],
    labels: Sequence[str],
) -> Figure:
    """Draw designs and their Pareto front over two objectives, a third one as colour.

    Args:
        designs: Objectives of a sample of the designs (m, k), k >= 2.
        front: Objectives of those on the front (f, k), in the order of the line through them.
        marked: Objectives (k,) of designs to mark, by their name.
        labels: What the objectives are (k).
    """
    figure, ax = _diagram(82.0)
    ax.plot(designs[:, 0], designs[:, 1], ".", color=GREY, alpha=0.4, markersize=2, label="designs")
    if len(labels) > 2:
        dots = ax.scatter(
            front[:, 0], front[:, 1], c=front[:, 2], cmap=COLOUR_MAP, s=14, label="Pareto front"
        )
        finish_bar(figure.colorbar(dots, ax=ax, aspect=30, pad=0.02), labels[2])
    else:
        ax.plot(front[:, 0], front[:, 1], ".-", color="black", markersize=4, label="Pareto front")
    for (name, values), marker in zip(marked.items(), cycle("s*D^v"), strict=False):
        ax.plot(*values[:2], marker, markersize=9, mfc="white", mec="black", mew=1.0, label=name)
    ax.set_xlabel(labels[0], fontsize=FONT_SIZE)
    ax.set_ylabel(labels[1], fontsize=FONT_SIZE)
    return with_legend(figure, ax, "", LEGEND_COLUMNS)


def plot_parallel_coordinates(
    designs: FloatArray, before: FloatArray, winner: FloatArray, names: Sequence[str]
) -> Figure:
    """Draw each design as a line over its dimensions and objectives.

    Args:
        designs: Coordinates of the designs (m, k).
        before: Those of the leg that was to be improved (k,).
        winner: Those of the design that was chosen (k,).
        names: What the coordinates are (k).
    """
    everything = np.vstack([designs, before])
    lowest, highest = everything.min(axis=0), everything.max(axis=0)
    span = np.where(highest > lowest, highest - lowest, 1.0)
    figure, ax = _diagram(80.0)
    x = range(len(names))
    colours = mpl.colormaps[COLOUR_MAP](np.linspace(0.0, 0.9, len(designs)))
    for line, colour in zip(designs, colours, strict=True):
        ax.plot(x, (line - lowest) / span, color=colour, alpha=0.5, linewidth=0.6)
    ax.plot(x, (before - lowest) / span, "--s", color=GREY, markersize=3, label="before")
    ax.plot(x, (winner - lowest) / span, "-*", color="black", markersize=6, label="winner")
    for position, low, high in zip(x, lowest, highest, strict=True):
        ax.axvline(position, color=GREY, linewidth=0.5, zorder=0)
        ax.text(position, -0.03, f"{low:.4g}", ha="center", va="top", fontsize=SMALL_FONT_SIZE)
        ax.text(position, 1.03, f"{high:.4g}", ha="center", va="bottom", fontsize=SMALL_FONT_SIZE)
    ax.set_xticks(x, names, rotation=45, ha="right", fontsize=FONT_SIZE)
    ax.set_yticks([])
    ax.set_ylim(-0.12, 1.12)
    return with_legend(figure, ax, "", LEGEND_COLUMNS)


def plot_convergence(evaluated: Sequence[int], scores: Sequence[float]) -> Figure:
    """Draw how the best score rose.

    Args:
        evaluated: Numbers of designs that had been evaluated (m), in order.
        scores: The best score from each of them on (m).
    """
    figure, ax = _diagram(60.0)
    ax.step(evaluated, scores, where="post", color="black", linewidth=1.0)
    ax.set_xlabel("designs evaluated", fontsize=FONT_SIZE)
    ax.set_ylabel("best score", fontsize=FONT_SIZE)
    return figure


def _diagram(height: float) -> tuple[Figure, Axes]:
    """Return a figure of a height [mm] with one diagram."""
    figure = new_figure(None, height)
    ax = figure.subplots()
    plain(ax)
    return figure, ax
