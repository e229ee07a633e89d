"""Pictures of what a leg can carry: index maps, friction along a step, step lengths, the linkage.

Every function returns a `Figure` made for print at 100 mm width; it draws into the one it is given,
for example `plt.figure()` in a notebook, or else into a new one. Pictures do not rely on colour
alone: maps have contour lines, curves have line styles. Lengths are in m, forces in N.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike
from scipy.spatial import HalfspaceIntersection

from leg_kinematics.arrays import FloatArray, as_array, as_non_negative
from leg_kinematics.errors import NotSupportedError, ShapeError, ValueRangeError
from leg_kinematics.mechanism import Linkage, Mechanism, Posture
from leg_kinematics.status import Status
from leg_statics.footholds import Contact
from leg_statics.global_means import sample_workspace
from leg_statics.grounds import Ground
from leg_statics.indices import evaluate_indices, find_index
from leg_statics.maps import CAPACITY_LAYER, IndexMap, find_layer, plane_map, workspace_bounds
from leg_statics.step_length import Criterion, longest_step

MILLIMETRE = 1.0 / 25.4  # in
WIDTH = 100.0  # mm, of every figure
FONT_SIZE = 7.5  # pt
SMALL_FONT_SIZE = 6.5  # pt
COLOUR_MAP = "viridis"
LINE_STYLES = ("-", "--", "-.", ":")
GREEK = ("eta", "mu")
GREY = "0.45"
WORKSPACE_GREY = "0.88"
MOST_FRICTION = 2.0  # of diagrams: no ground offers more
USUAL = 95.0  # %, of the points of a map that the colour scale holds if the others lie far off

DESIGN_MEANS = ("condition_number", "unit_effort_capacity", "unit_moment_effort")
CRITERION_TITLES = {
    Criterion.CAPACITY: "load capacity ≥ load",
    Criterion.RATED_FRICTION: r"$\mu_\mathrm{e}$ ≤ friction of the ground",
}


# --------------------------------------------------------------------------- labels


def symbol_text(symbol: str) -> str:
    """Return the mathtext of a symbol of the index registry, such as "eta_cF"."""
    base, _, subscript = symbol.partition("_")
    letter = rf"\{base}" if base in GREEK else base
    return rf"${letter}_\mathrm{{{subscript}}}$" if subscript else f"${letter}$"


def layer_label(layer: str) -> str:
    """Return name, symbol and unit of a layer of an index map."""
    symbol, unit, _ = find_layer(layer)
    return f"{layer.replace('_', ' ')} {symbol_text(symbol)} [{_unit_text(unit)}]"


def height_title(height: float) -> str:
    """Return the title of the plane z = height."""
    return f"$h$ = {_number(height, 3)} m"


def _unit_text(unit: str) -> str:
    return unit.replace("N.m", "N·m")


def _number(value: float, digits: int) -> str:
    """Return a number without trailing zeros (two decimals stay) and with a true minus sign."""
    text = f"{value:.{digits}f}"
    while text.endswith("0") and len(text.partition(".")[2]) > 2:
        text = text[:-1]
    return text.replace("-", "−")


# --------------------------------------------------------------------------- heights


def typical_heights(mechanism: Mechanism, count: int = 6) -> FloatArray:
    """Heights of the foot that span the middle 80 % of the workspace's volume (count,) [m].

    They are rounded to 1 cm where that keeps them apart.
    """
    sample = sample_workspace(mechanism, 15)
    z = sample.posture.foot_position[:, 2]
    order = np.argsort(z)
    share = np.cumsum(sample.volume[order]) / np.sum(sample.volume)
    lowest, highest = np.interp([0.1, 0.9], share, z[order])
    heights = np.linspace(lowest, highest, count)
    rounded = np.round(heights, 2)
    return rounded if len(np.unique(rounded)) == count else heights


def initial_height(mechanism: Mechanism) -> float:
    """Height of the foot in the initial posture [m]."""
    return float(mechanism.initial_posture.foot_position[2])


def is_spatial_leg(mechanism: Mechanism) -> bool:
    """Tell whether a mechanism moves a point foot in space, so that maps of it have areas."""
    return len(mechanism.task_coordinates) == 3 <= len(mechanism.joints)


def _check_spatial(mechanism: Mechanism) -> None:
    if not is_spatial_leg(mechanism):
        raise NotSupportedError(
            f"mechanism {mechanism.name!r} does not move a point foot in space: "
            "only its linkage can be drawn"
        )


# --------------------------------------------------------------------------- maps


def plot_index(
    mechanism: Mechanism,
    index: str,
    heights: Sequence[float] = (),
    resolution: float = 0.005,
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw an index over x and y at several heights: figures 2, 5 and 6 of paper 000.

    Args:
        mechanism: The leg's mechanism.
        index: Name of an index.
        heights: Heights of the planes in the leg frame [m]; none for `typical_heights`.
        resolution: Grid spacing [m].
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        UnknownNameError: If there is no such index.
        NotSupportedError: If the mechanism does not have it.
        ValueRangeError: If a plane does not meet the workspace.
    """
    find_index(index)
    _check_spatial(mechanism)
    chosen = np.sort(heights if len(heights) else typical_heights(mechanism))
    maps = {
        height_title(height): plane_map(mechanism, height, resolution, layers=[index])
        for height in chosen
    }
    return plot_maps(maps, index, title=title, figure=figure)


def plot_load_capacity(
    mechanism: Mechanism,
    effort_limits: ArrayLike,
    frictions: Mapping[str, float],
    height: float | None = None,
    resolution: float = 0.005,
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw the load capacity over x and y on level grounds of different friction.

    Args:
        mechanism: The leg's mechanism.
        effort_limits: Lower and upper effort of each actuator (n, 2) [N.m or N].
        frictions: Friction coefficient of each ground, by its name.
        height: Height of the plane in the leg frame [m]; by default that of the initial posture.
        resolution: Grid spacing [m].
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        ValueRangeError: If the plane does not meet the workspace.
    """
    _check_spatial(mechanism)
    plane = initial_height(mechanism) if height is None else height
    maps = {
        f"{name}, $\\mu$ = {friction:g}": plane_map(
            mechanism,
            plane,
            resolution,
            layers=[CAPACITY_LAYER],
            effort_limits=effort_limits,
            contact=Contact(friction),
        )
        for name, friction in frictions.items()
    }
    where = ", ".join(filter(None, [title, height_title(plane)]))
    return plot_maps(maps, CAPACITY_LAYER, title=where, figure=figure)


def plot_maps(
    maps: Mapping[str, IndexMap], layer: str, *, title: str = "", figure: Figure | None = None
) -> Figure:
    """Draw one layer of several plane maps as small multiples with one colour scale.

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
    panel_height = (WIDTH - 12.0 - 3.0 * columns) / columns * np.ptp(box[1]) / np.ptp(box[0])
    gaps = 8.0 if len(maps) % columns else 0.0  # a panel over an empty place has its own x axis
    norm, levels, extend = _colour_scale(finite)
    height = rows * (panel_height + 5.0) + gaps + (22.0 if len(levels) else 15.0)
    figure = _figure(figure, height + (5.0 if title else 0.0))
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for ax, (name, m), v in zip(axes, maps.items(), values, strict=False):
        mesh = ax.pcolormesh(
            m.x, m.y, v, shading="nearest", cmap=COLOUR_MAP, norm=norm, rasterized=True
        )
        if len(levels):
            _contours(ax, m, v, levels, norm, labelled=columns < 3)
        ax.set_title(name, fontsize=FONT_SIZE, pad=3)
        ax.set(xlim=box[0], ylim=box[1], aspect="equal")
    _tidy_grid(axes, len(maps), columns)
    if len(levels):
        bar = figure.colorbar(
            mesh, ax=axes[: len(maps)], location="bottom", extend=extend, aspect=40, pad=0.02
        )
        _finish_bar(bar, f"{layer_label(layer)}, {find_layer(layer).better} is better")
        bar.set_ticks(levels.tolist())
        bar.ax.vlines(levels, 0, 1, colors=_line_colours(levels, norm), linewidth=0.5)
    else:
        everywhere = f"{layer_label(layer)} equals {finite[0]:.4g} everywhere".replace("-", "−")
        figure.supxlabel(everywhere, fontsize=FONT_SIZE)
    return _titled(figure, title)


def _plane(values: FloatArray) -> FloatArray:
    if len(values) != 1:
        raise ShapeError(f"a map to draw must have one plane, got {len(values)}")
    return values[0]


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
        m.x, m.y, values, levels=inside, colors=_line_colours(inside, norm), linewidths=0.5
    )
    if labelled:
        texts = ax.clabel(lines, fontsize=SMALL_FONT_SIZE, fmt=lambda v: f"{v:g}")
        for text in texts:
            text.set_rotation(0.0)  # a 6 on its head is a 9


def _tidy_grid(axes: Any, used: int, columns: int) -> None:
    """Label the outer panels only, and hide those that are not used."""
    for k, ax in enumerate(axes):
        _plain(ax)
        ax.set_visible(k < used)
        ticks = {1: 6, 2: 4}.get(columns, 3)
        ax.xaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 4, 5, 10]))
        ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        if k + columns >= used:
            ax.set_xlabel("$x$ [m]", fontsize=FONT_SIZE)
            ax.tick_params(labelbottom=True)
        if k % columns == 0:
            ax.set_ylabel("$y$ [m]", fontsize=FONT_SIZE)


# --------------------------------------------------------------------------- friction along y


def plot_rated_friction(
    mechanisms: Mapping[str, Mechanism],
    grounds: Sequence[Ground],
    heights: Sequence[float] = (),
    *,
    x: float = 0.0,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw the rated friction mu_e along the walking direction: figure 8 of paper 000.

    Beside the curves stand the friction ranges of grounds; their low ends, on which one may count,
    run through the diagram. Where a curve lies under such a line the foot does not slip.

    Args:
        mechanisms: Mechanisms by the name of their curve, such as before and after optimisation.
        grounds: Grounds to compare with.
        heights: Height of the foot for each mechanism, or one for all [m]; by default that of
            each one's initial posture.
        x: x of the line in the leg frame [m].
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        ShapeError: If the number of heights is neither one nor that of the mechanisms.
        ValueRangeError: If a line does not meet the workspace.
    """
    chosen = list(heights) or [initial_height(m) for m in mechanisms.values()]
    if len(chosen) == 1:
        chosen *= len(mechanisms)
    if len(chosen) != len(mechanisms):
        raise ShapeError(f"{len(mechanisms)} mechanisms need as many heights, got {len(chosen)}")
    figure = _figure(figure, 72.0)
    ax = figure.subplots()
    highest = max((ground.friction_high for ground in grounds), default=0.0)
    curves = zip(mechanisms.items(), chosen, _styles(len(mechanisms)), strict=True)
    for (name, mechanism), height, style in curves:
        y, friction = _friction_along_y(mechanism, x, height)
        ax.plot(y, friction, label=f"{name}, {height_title(height)}", **style)
        highest = max(highest, float(np.max(friction)))
    ax.set_ylim(0.0, 1.05 * min(highest, MOST_FRICTION))
    ax.set_xlabel(f"$y$ [m], at $x$ = {x:g} m".replace("-", "−"), fontsize=FONT_SIZE)
    ax.set_ylabel(layer_label("rated_friction"), fontsize=FONT_SIZE)
    _plain(ax)
    _ground_ranges(ax, grounds)
    return _with_legend(figure, ax, title, 2)


def _friction_along_y(
    mechanism: Mechanism, x: float, height: float
) -> tuple[FloatArray, FloatArray]:
    """Return y and mu_e where the line at x and height is inside the workspace; gaps are NaN."""
    _check_spatial(mechanism)
    lower, upper = workspace_bounds(mechanism)[1]
    y = np.arange(np.floor(1e3 * lower), np.ceil(1e3 * upper) + 1.0) / 1e3
    foot = np.stack(np.broadcast_arrays(x, y, height), axis=-1)
    friction = evaluate_indices(mechanism, mechanism.inverse(foot), ["rated_friction"])[1][:, 0]
    inside = np.flatnonzero(np.isfinite(friction))
    if not len(inside):
        raise ValueRangeError(f"no point of the workspace at x = {x:g} m, height {height:g} m")
    return y[inside[0] : inside[-1] + 1], friction[inside[0] : inside[-1] + 1]


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


# --------------------------------------------------------------------------- designs


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
    figure = _figure(figure, 82.0)
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
    _finish_bar(bar, _mean_label(names[2]))
    _plain(ax)
    return _with_legend(figure, ax, title, 3)


def _mean_label(name: str) -> str:
    """Return the label of a global mean; its symbol is the index's with a q appended."""
    index = find_index(name)
    symbol = index.symbol + ("q" if "_" in index.symbol else "_q")
    unit = _unit_text(index.unit)
    return (
        f"mean {name.replace('_', ' ')}\n{symbol_text(symbol)} [{unit}], {index.better} is better"
    )


# --------------------------------------------------------------------------- step length


def plot_step_lengths(
    mechanism: Mechanism,
    effort_limits: ArrayLike,
    frictions: Mapping[str, float],
    load: float,
    heights: ArrayLike | None = None,
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw the longest step against the height of the leg frame over the ground.

    One panel for each `Criterion`, one curve for each ground.

    Args:
        mechanism: The leg's mechanism.
        effort_limits: Lower and upper effort of each actuator (n, 2) [N.m or N].
        frictions: Friction coefficient of each ground, by its name.
        load: Required normal load [N].
        heights: Heights of the foot in the leg frame (m,) [m]; by default all of the workspace.
        title: Title of the figure.
        figure: Figure to draw into.
    """
    _check_spatial(mechanism)
    if heights is None:
        lowest, highest = workspace_bounds(mechanism)[2]
        heights = np.linspace(lowest, highest, 61)
    z = np.sort(as_array("heights", heights))
    figure = _figure(figure, 68.0)
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    for ax, criterion in zip(axes, Criterion, strict=True):
        curves = zip(frictions.items(), _styles(len(frictions), widest=2.2), strict=True)
        for (name, friction), style in curves:
            contact = Contact(friction, load=load)
            step = longest_step(mechanism, effort_limits, z, contact, criterion=criterion)
            label = f"{name}, $\\mu$ = {friction:g}"
            ax.plot(-z, step.length, label=label, **style)
        ax.set_title(CRITERION_TITLES[criterion], fontsize=FONT_SIZE, pad=3)
        ax.set_xlabel("height of the leg frame −$h$ [m]", fontsize=FONT_SIZE)
        _plain(ax)
        ax.grid(color="0.9", linewidth=0.5)
    axes[0].set_ylim(bottom=0.0)
    axes[0].set_ylabel("longest step [m]", fontsize=FONT_SIZE)
    axes[0].set_title(f"load capacity ≥ {load:g} N", fontsize=FONT_SIZE, pad=3)
    return _with_legend(figure, axes[0], title, 3)


# --------------------------------------------------------------------------- linkage


def plot_linkage(
    mechanism: Mechanism,
    effort_limits: ArrayLike | None = None,
    friction: float | None = None,
    posture: Posture | None = None,
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw a leg from the side (y, z) and from the front (x, z) with its workspace.

    Workspace, forces and friction cone are sections with the vertical plane through the foot.

    Args:
        mechanism: The leg's mechanism.
        effort_limits: Lower and upper effort of each actuator (n, 2) [N.m or N]; if given, the
            ground reactions which the actuators can hold are drawn at the foot. That needs three
            actuators: with fewer the structure alone holds forces of any size.
        friction: Friction coefficient of the ground; if given, the friction cone is drawn.
        posture: A single posture; by default the initial one.
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        NotSupportedError: If forces are asked for and there are fewer than three actuators.
        ValueRangeError: If the posture is not OK, or friction is negative or NaN.
    """
    leg = mechanism.initial_posture if posture is None else posture
    if np.ndim(leg.status) or leg.status != Status.OK:
        raise ValueRangeError("a leg can be drawn in one posture, with the status OK, only")
    cone = None if friction is None else float(as_non_negative("friction", friction))
    linkage = mechanism.linkage(leg)
    bounds = workspace_bounds(mechanism)[:3]
    corners = np.concatenate([linkage.points, bounds.T])
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 0.04 * np.max(high - low)
    low, high = low - margin, high + margin
    least = 0.4 * (high - low)[2]  # of the width: a planar leg has none from the front
    wider = np.maximum(0.0, 0.5 * (least - (high - low))) * [1.0, 1.0, 0.0]
    low, high = low - wider, high + wider
    if cone is not None or effort_limits is not None:
        high[2] = max(high[2], float(leg.foot_position[2] + 0.3 * (high - low)[2]))
    widths, tall = (high - low)[[1, 0]], float((high - low)[2])
    height = (WIDTH - 22.0) * tall / np.sum(widths) + (33.0 if title else 28.0)
    figure = _figure(figure, height)
    axes = figure.subplots(1, 2, sharey=True, width_ratios=widths)
    views = [[1, 2], [0, 2]]
    for ax, view, name in zip(axes, views, ("side view", "front view"), strict=True):
        _draw_workspace(ax, mechanism, leg.foot_position, bounds, view[0])
        if cone is not None:
            _draw_cone(ax, leg.foot_position[view], cone, 0.25 * tall)
        _draw_bars(ax, linkage, view)
        ax.set_title(name, fontsize=FONT_SIZE, pad=3)
        ax.set(xlim=(low[view[0]], high[view[0]]), ylim=(low[2], high[2]), aspect="equal")
        _plain(ax)
        ax.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 4, 5, 10]))
    if effort_limits is not None:
        limits = as_array("effort_limits", effort_limits, len(mechanism.joints), 2)
        if len(limits) < 3:
            raise NotSupportedError(
                f"mechanism {mechanism.name!r} has too few actuators for forces"
            )
        jacobian = mechanism.jacobian(leg)
        polygons = [force_polygon(jacobian[view], limits) for view in views]
        _draw_forces(axes, leg.foot_position, views, polygons, 0.25 * tall)
    walking = ", walking to the right" if len(mechanism.task_coordinates) == 3 else ""
    axes[0].set_xlabel(f"$y$ [m]{walking}", fontsize=FONT_SIZE)
    axes[1].set_xlabel("$x$ [m]", fontsize=FONT_SIZE)
    axes[0].set_ylabel("$z$ [m]", fontsize=FONT_SIZE)
    return _with_legend(figure, axes[0], title, 2)


def _draw_workspace(
    ax: Axes, mechanism: Mechanism, foot: FloatArray, bounds: FloatArray, across: int
) -> None:
    """Shade the section of the workspace with the plane through the foot, `across` and z."""
    horizontal, z = (np.linspace(low, high, 240) for low, high in bounds[[across, 2]])
    points = np.empty((len(z), len(horizontal), len(foot)))
    points[...] = foot
    points[..., across], points[..., 2] = horizontal, z[:, None]
    inside = np.asarray(mechanism.inverse(points).status) == Status.OK
    if inside.any():
        ax.contourf(horizontal, z, inside, levels=[0.5, 1.5], colors=[WORKSPACE_GREY], zorder=0)
        ax.fill([], [], color=WORKSPACE_GREY, label="workspace")


def _draw_bars(ax: Axes, linkage: Linkage, view: list[int]) -> None:
    points = linkage.points[:, view]
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
    views: Sequence[list[int]],
    polygons: Sequence[FloatArray],
    length: float,
) -> None:
    """Draw the force polygon of each view at the foot, all in one scale of round numbers."""
    needed = max(float(np.max(np.abs(polygon))) for polygon in polygons) / length  # [N/m]
    decade = 10.0 ** np.floor(np.log10(needed))
    scale = decade * min(step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if step * decade >= needed)
    label = f"forces it can hold (0.1 m = {0.1 * scale:g} N)"
    for ax, view, polygon in zip(axes, views, polygons, strict=True):
        ax.fill(*(foot[view] + polygon / scale).T, color="C1", alpha=0.35, zorder=1, lw=0)
        ax.fill([], [], color="C1", alpha=0.35, lw=0, label=label)


def force_polygon(jacobian: FloatArray, effort_limits: FloatArray) -> FloatArray:
    """Corners of the plane ground reactions that the actuators can hold (k, 2) [N], in order.

    Only those count that push the foot up. A force beyond any use, along which the structure alone
    carries the load, is cut off.

    Args:
        jacobian: The two rows of J of the plane's directions, the vertical one last (2, n).
        effort_limits: Lower (< 0) and upper (> 0) effort of each actuator (n, 2) [N.m or N].

    Raises:
        ValueRangeError: If an actuator can exert nothing in one direction.
    """
    lower, upper = effort_limits.T
    if not np.all((lower < 0.0) & (upper > 0.0)):
        raise ValueRangeError("drawing forces needs effort limits with lower < 0 < upper")
    normals = np.concatenate([-jacobian.T, jacobian.T])  # the efforts are -J^T F
    room = np.concatenate([upper, -lower])
    largest = 1e3 * np.max(room) / np.max(np.abs(jacobian))
    frame = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    distances = np.concatenate([room, [largest, largest, largest, 0.0]])
    inside = 0.5 * np.min(room) / (np.max(np.abs(jacobian)) + np.finfo(float).tiny)
    halfspaces = np.column_stack([np.concatenate([normals, frame]), -distances])
    corners = HalfspaceIntersection(halfspaces, np.array([0.0, inside])).intersections
    centre = corners.mean(axis=0)
    return corners[np.argsort(np.arctan2(*(corners - centre).T[::-1]))]


# --------------------------------------------------------------------------- figures


def _figure(figure: Figure | None, height: float) -> Figure:
    """Return a figure of the standard width and a height [mm], ready to draw into."""
    size = (WIDTH * MILLIMETRE, height * MILLIMETRE)
    if figure is None:
        return Figure(figsize=size, layout="constrained")
    figure.clear()
    figure.set_size_inches(*size)
    figure.set_layout_engine("constrained")
    return figure


def _plain(ax: Axes) -> None:
    """Set small ticks and thin lines."""
    ax.tick_params(labelsize=SMALL_FONT_SIZE, width=0.5, length=2, pad=2)
    for spine in ax.spines.values():
        spine.set_linewidth(0.5)


def _with_legend(figure: Figure, ax: Axes, title: str, columns: int) -> Figure:
    """Put title and legend above the diagrams; a title of its own would lie on the legend."""
    handles, labels = ax.get_legend_handles_labels()
    if not handles:
        return _titled(figure, title)
    figure.legend(
        handles,
        labels,
        loc="outside upper center",
        ncols=min(columns, len(handles)),
        fontsize=FONT_SIZE,
        title=title or None,
        title_fontsize=FONT_SIZE + 1.0,
        frameon=False,
    )
    return figure


def _finish_bar(bar: Colorbar, label: str) -> None:
    bar.set_label(label, fontsize=FONT_SIZE)
    bar.ax.tick_params(labelsize=SMALL_FONT_SIZE, width=0.5, length=2)
    bar.outline.set_linewidth(0.5)  # type: ignore[operator]


def _titled(figure: Figure, title: str) -> Figure:
    if title:
        figure.suptitle(title, fontsize=FONT_SIZE + 1.0)
    return figure


def _styles(count: int, widest: float = 1.2) -> Iterator[dict[str, Any]]:
    """Yield colour, line style and width of each curve.

    If the widest is wide, each is thinner than those under it: curves that coincide all show.
    """
    colours = mpl.colormaps[COLOUR_MAP](np.linspace(0.0, 0.7, max(count, 2)))
    widths = np.linspace(widest, 1.2, count)
    for k in range(count):
        style = LINE_STYLES[k % len(LINE_STYLES)]
        yield {"color": colours[k], "linestyle": style, "linewidth": widths[k]}
