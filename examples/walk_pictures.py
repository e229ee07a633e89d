# SPDX-License-Identifier: Apache-2.0
"""Pictures of a walk: terrain and footholds from above, and what limits each step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch as Swatch
from matplotlib.patches import Rectangle
from terrain import Patch, Terrain
from tripod_gait import COLOURS, TRIPODS, HalfStep

from leg_statics.drawing.style import outside_legend

MARKERS = {
    "left_front": "^",
    "left_middle": "o",
    "left_rear": "v",
    "right_front": "^",
    "right_middle": "o",
    "right_rear": "v",
}
GROUNDS = {  # face colour and hatch
    "cement": ("#f2f2f2", ""),
    "wood": ("#ecdcb8", "||"),
    "ice": ("#cfe6f5", "//"),
}
OTHER_GROUND = ("#e0e0e0", "..")
UNEVEN = {True: ("#a0a0a0", "xxx"), False: ("#cccccc", "+++")}  # pits and steps, by height < 0
LEVEL = 0.1  # patches farther from the base than this look like pits and steps [m]
SMALL = 7.0  # pt
DODGE = {"front": -0.22, "middle": 0.0, "rear": 0.22}  # of markers at the same half step
MILLIMETRE = 1.0 / 25.4


def plot_terrain(terrain: Terrain, half_steps: Sequence[HalfStep]) -> Figure:
    """Draw the terrain from above with footholds, rejected candidates and the body's path."""
    figure = Figure(figsize=(240 * MILLIMETRE, 98 * MILLIMETRE), layout="constrained")
    ax = figure.subplots()
    feet = np.array([f.position for step in half_steps for f in step.footholds])
    ax.set_xlim(feet[:, 0].min() - 0.25, feet[:, 0].max() + 0.25)
    ax.set_ylim(-0.72, 0.72)
    base = terrain.patches[0]
    ax.set_facecolor(_look(base, base.height)[0])
    for patch in terrain.patches[1:]:
        _draw_patch(ax, patch, base.height)
    rejected = [points for step in half_steps for points in step.rejected_at.values()]
    if rejected:
        x, y = np.unique(np.round(np.concatenate(rejected), 3), axis=0).T
        ax.plot(x, y, ".", color="0.35", markersize=1.2, mew=0, zorder=2)
    body = np.array([half_steps[0].body_start, *(step.body_end for step in half_steps)])
    ax.plot(body[:, 0], body[:, 1], "-", color="black", linewidth=1.0, zorder=3)
    ax.plot(body[:, 0], body[:, 1], "|", color="black", markersize=5, zorder=3)
    for leg, colour in COLOURS.items():
        places = np.array(
            [f.position for step in half_steps for f in step.footholds if f.leg == leg]
        )
        if len(places):
            style: dict[str, Any] = {
                "marker": MARKERS[leg],
                "color": colour,
                "mec": "black",
                "mew": 0.4,
            }
            ax.plot(*places[:, :2].T, linestyle=":", linewidth=0.8, markersize=6, zorder=4, **style)
    ax.set_aspect("equal")
    ax.set_xlabel("x [m], forward", fontsize=SMALL + 1)
    ax.set_ylabel("y [m], left", fontsize=SMALL + 1)
    ax.tick_params(labelsize=SMALL)
    _legend_outside(figure, _legend(), 5)
    return figure


def plot_steps(half_steps: Sequence[HalfStep], reserve: float) -> Figure:
    """Draw step length, load factor, margin and friction of every half step."""
    figure = Figure(figsize=(160 * MILLIMETRE, 160 * MILLIMETRE), layout="constrained")
    steps, factor, margin, friction = figure.subplots(4, 1, sharex=True)
    number = np.arange(1, len(half_steps) + 1)
    grounds = [min(step.footholds, key=lambda f: f.friction).ground for step in half_steps]
    for step, ground, n in zip(half_steps, grounds, number, strict=True):
        face, hatch = GROUNDS.get(ground, OTHER_GROUND)
        steps.bar(n, step.step_length, color=face, hatch=hatch, edgecolor="0.35", lw=0.6, width=0.7)
    steps.set_ylabel("step length [m]", fontsize=SMALL)
    factor.plot(number, [step.load_factor for step in half_steps], "k.-", lw=0.8)
    factor.axhline(reserve, color="black", linestyle="--", linewidth=1.0)
    factor.annotate(
        f"reserve {reserve:g}",
        (number[-1], reserve),
        xytext=(0, -3),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=SMALL,
    )
    factor.set_ylabel("load factor of the\nstance, at worst", fontsize=SMALL)
    margin.plot(number, [step.margin for step in half_steps], "k.-", lw=0.8)
    margin.set_ylabel("margin of the centre\nof mass, at worst [m]", fontsize=SMALL)
    for leg in (leg for tripod in TRIPODS for leg in tripod):
        found = [(n, f) for n, s in zip(number, half_steps, strict=True) for f in s.footholds]
        mine = [(n, f) for n, f in found if f.leg == leg]
        style = {"color": COLOURS[leg], "marker": MARKERS[leg], "mec": "black", "mew": 0.3}
        at = [n + DODGE[leg.split("_")[1]] for n, _ in mine]
        friction.plot(at, [f.friction_used for _, f in mine], ls="", markersize=4.5, **style)
        friction.plot(at, [f.friction for _, f in mine], "k_", markersize=5)
    friction.set_ylabel("friction: used (markers)\nand offered (bars)", fontsize=SMALL)
    friction.set_xlabel("half step", fontsize=SMALL)
    for ax in (steps, factor, margin, friction):
        ax.set_ylim(0.0, 1.1 * ax.dataLim.ymax)
        ax.tick_params(labelsize=SMALL)
        ax.set_xticks(number)
        ax.grid(axis="y", color="0.9", linewidth=0.5)
        ax.set_axisbelow(True)
    steps.legend(
        handles=[
            _swatch(f"a foot on {g}", *GROUNDS.get(g, OTHER_GROUND)) for g in sorted({*grounds})
        ],
        fontsize=SMALL,
        frameon=False,
        ncols=4,
        loc="lower left",
        bbox_to_anchor=(0, 1),
    )
    _legend_outside(figure, [_leg_handle(leg) for leg in COLOURS], 6, below=True)
    return figure


def _legend_outside(
    figure: Figure, handles: Sequence[Artist], columns: int, *, below: bool = False
) -> None:
    labels = [str(handle.get_label()) for handle in handles]
    outside_legend(figure, handles, labels, columns, fontsize=SMALL, below=below)


def _look(patch: Patch, level: float) -> tuple[str, str]:
    """Return face colour and hatch of a patch."""
    if abs(patch.height - level) > LEVEL:
        return UNEVEN[patch.height < level]
    return GROUNDS.get(patch.ground, OTHER_GROUND)


def _draw_patch(ax: Axes, patch: Patch, level: float) -> None:
    face, hatch = _look(patch, level)
    corner = (patch.x[0], patch.y[0])
    size = (patch.x[1] - patch.x[0], patch.y[1] - patch.y[0])
    ax.add_patch(
        Rectangle(corner, *size, facecolor=face, edgecolor="0.35", hatch=hatch, lw=0.6, zorder=1)
    )
    height = "" if patch.height == 0 else f"\n{1e3 * patch.height:+.0f} mm".replace("-", "−")
    above = sum(patch.y) >= 0.0
    ax.annotate(
        f"{patch.name.replace('_', ' ')}{height}",
        (sum(patch.x) / 2.0, patch.y[1] if above else patch.y[0]),
        xytext=(0, 3 if above else -3),
        textcoords="offset points",
        ha="center",
        va="bottom" if above else "top",
        fontsize=SMALL,
    )


def _leg_handle(leg: str) -> Line2D:
    style: dict[str, Any] = {
        "marker": MARKERS[leg],
        "color": COLOURS[leg],
        "mec": "black",
        "mew": 0.4,
    }
    return Line2D([], [], linestyle="", markersize=5, label=leg.replace("_", " "), **style)


def _swatch(name: str, face: str, hatch: str) -> Swatch:
    return Swatch(facecolor=face, hatch=hatch, edgecolor="0.35", linewidth=0.6, label=name)


def _legend() -> list[Line2D | Swatch]:
    looks = {**GROUNDS, "far below": UNEVEN[True], "far above": UNEVEN[False]}
    grounds = [_swatch(name, *look) for name, look in looks.items()]
    legs = [_leg_handle(leg) for leg in COLOURS]
    path = Line2D([], [], color="black", marker="|", label="body")
    dots = Line2D([], [], color="0.6", marker=".", ls="", markersize=3, label="rejected candidates")
    return [*legs, *grounds, path, dots]
