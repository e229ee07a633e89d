# SPDX-License-Identifier: Apache-2.0
"""Pictures of index maps: small multiples in one colour scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import ShapeError, ValueRangeError
from leg_statics.drawing.style import (
    COLOUR_MAP,
    FONT_SIZE,
    SMALL_FONT_SIZE,
    WIDTH,
    finish_bar,
    layer_label,
    new_figure,
    plain,
    titled,
)
from leg_statics.maps import IndexMap, find_layer

USUAL = 95.0  # %, of the points of a map that the colour scale holds if the others lie far off


def plot_maps(
    maps: Mapping[str, IndexMap], layer: str, *, title: str = "", figure: Figure | None = None
) -> Figure:
    """Draw one layer of several plane maps as small multiples with one colour scale.

    The maps are seen from above, the walking direction x upwards and y to the left.

    Args:
        maps: Maps of one plane each, by the title of their panel.
        layer: Name of the layer.
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        UnknownNameError: If a map does not have the layer.
        ShapeError: If a map has several planes.
        ValueRangeError: If there is no map, or one without a value.
    """
    values = [_plane(m.layer(layer)) for m in maps.values()]
    empty = [name for name, v in zip(maps, values, strict=True) if not np.isfinite(v).any()]
    if empty or not maps:
        where = ", ".join(empty).replace("$", "") or "a figure without maps"
        raise ValueRangeError(f"{layer} has no value in the workspace at {where}")
    finite = np.concatenate([v[np.isfinite(v)] for v in values])
    box = _common_box([(m.x, m.y, v) for m, v in zip(maps.values(), values, strict=True)])
    columns = {1: 1, 2: 2, 4: 2}.get(len(maps), 3)
    rows = -(-len(maps) // columns)
    panel_height = (WIDTH - 12.0 - 3.0 * columns) / columns * np.ptp(box[0]) / np.ptp(box[1])
    gaps = 8.0 if len(maps) % columns else 0.0  # a panel over an empty place has its own x axis
    norm, levels, extend = _colour_scale(finite)
    height = rows * (panel_height + 5.0) + gaps + (22.0 if len(levels) else 15.0)
    figure = new_figure(figure, height + (5.0 if title else 0.0))
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for ax, (name, m), v in zip(axes, maps.items(), values, strict=False):
        mesh = ax.pcolormesh(
            m.y, m.x, v.T, shading="nearest", cmap=COLOUR_MAP, norm=norm, rasterized=True
        )
        if len(levels):
            _contours(ax, m, v, levels, norm, labelled=columns < 3)
        ax.set_title(name, fontsize=FONT_SIZE, pad=3)
        ax.set(xlim=box[1][::-1], ylim=box[0], aspect="equal")
    _tidy_grid(axes, len(maps), columns)
    if len(levels):
        bar = figure.colorbar(
            mesh, ax=axes[: len(maps)], location="bottom", extend=extend, aspect=40, pad=0.02
        )
        finish_bar(bar, f"{layer_label(layer)}, {find_layer(layer).better} is better")
        bar.set_ticks(levels.tolist())
        bar.ax.vlines(levels, 0, 1, colors=_line_colours(levels, norm), linewidth=0.5)
    else:
        everywhere = f"{layer_label(layer)} equals {finite[0]:.4g} everywhere".replace("-", "−")
        figure.supxlabel(everywhere, fontsize=FONT_SIZE)
    return titled(figure, title)


def _plane(values: FloatArray) -> FloatArray:
    if values.ndim != 2:
        raise ShapeError(f"a map to draw must have one plane, got planes {values.shape[:-2]}")
    return values


def _common_box(panels: Sequence[tuple[FloatArray, FloatArray, FloatArray]]) -> FloatArray:
    """Return the ranges of x and y that hold every value, with a margin (2, 2) [m]."""
    ranges = []
    for x, y, values in panels:
        rows, columns = np.nonzero(np.isfinite(values))
        if len(rows):
            ranges.append([[x[columns].min(), x[columns].max()], [y[rows].min(), y[rows].max()]])
    stacked = np.array(ranges)
    box = np.stack([stacked[..., 0].min(axis=0), stacked[..., 1].max(axis=0)], axis=-1)
    margin = 0.04 * np.max(np.ptp(box, axis=1)) + 1e-6
    return box + np.array([-margin, margin])


def _colour_scale(finite: FloatArray) -> tuple[Normalize, FloatArray, str]:
    """Return the scale, the levels of contours and ticks, and whether values lie beyond it.

    A few huge values near singular poses do not get to flatten all others.
    """
    low, high = float(finite.min()), float(finite.max())
    if high - low <= 1e-6 * max(abs(high), abs(low)):  # one value: neither contours nor ticks
        return Normalize(low - 0.5, low + 0.5), np.array([]), "neither"
    usual = float(np.percentile(finite, USUAL))
    cut = high - low > 2.0 * (usual - low) > 0.0
    top = usual if cut else high
    levels = np.asarray(MaxNLocator(7, steps=[1, 2, 2.5, 5, 10]).tick_values(low, top))
    inside = levels[(levels >= low) & (levels <= top)]
    return Normalize(low, top), inside, "max" if cut else "neither"


def _line_colours(levels: FloatArray, norm: Normalize) -> list[str]:
    """White lines on the dark half of the colour map, black ones on the bright half."""
    return ["white" if norm(level) < 0.55 else "black" for level in levels]


def _contours(
    ax: Axes, m: IndexMap, values: FloatArray, levels: FloatArray, norm: Normalize, labelled: bool
) -> None:
    if np.count_nonzero(np.isfinite(values)) < 4 or min(values.shape) < 2:
        return
    inside = levels[(levels > np.nanmin(values)) & (levels < np.nanmax(values))]
    if not len(inside):
        return
    lines = ax.contour(
        m.y, m.x, values.T, levels=inside, colors=_line_colours(inside, norm), linewidths=0.5
    )
    if labelled:
        texts = ax.clabel(lines, fontsize=SMALL_FONT_SIZE, fmt=lambda v: f"{v:g}")
        for text in texts:
            text.set_rotation(0.0)  # a 6 on its head is a 9


def _tidy_grid(axes: Any, used: int, columns: int) -> None:
    """Label the outer panels only, and hide those that are not used."""
    for k, ax in enumerate(axes):
        plain(ax)
        ax.set_visible(k < used)
        ticks = {1: 6, 2: 4}.get(columns, 3)
        ax.xaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 4, 5, 10]))
        ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        if k + columns >= used:
            ax.set_xlabel("$y$ [m], left", fontsize=FONT_SIZE)
            ax.tick_params(labelbottom=True)
        if k % columns == 0:
            ax.set_ylabel("$x$ [m], forward", fontsize=FONT_SIZE)
