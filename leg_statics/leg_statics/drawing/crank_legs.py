# SPDX-License-Identifier: Apache-2.0
"""Pictures of legs that one crank drives beside Theo Jansen's, as paper 003 draws them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from leg_kinematics.arrays import FloatArray
from leg_kinematics.gait_curve import GaitCurve
from leg_kinematics.mechanism import Linkage

# Okabe and Ito's colours, told apart by colour-blind readers too; every line has its own dashes.
STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#000000", "linestyle": "-"},
    {"color": "#0072B2", "linestyle": "--"},
    {"color": "#D55E00", "linestyle": "-."},
)
BLACK, BLUE, VERMILION = STYLES
GREY = "#999999"


class Scale(NamedTuple):
    """Unit of the drawn lengths.

    Attributes:
        factor: What one crank length is in the unit.
        unit: Name of the unit.
    """

    factor: float
    unit: str

    def label(self, quantity: str) -> str:
        """Return an axis label."""
        return f"{quantity} [{self.unit}]"


class Measure(NamedTuple):
    """One measure of how well designs of several phi_max follow Jansen's leg.

    Attributes:
        name: What it is.
        values: Its value for each phi_max (k,); NaN where there is no design.
        direct: Its value for the design of a direct search.
    """

    name: str
    values: FloatArray
    direct: float


def plot_postures(
    linkages: Mapping[int, Linkage], curve: GaitCurve, label: str, scale: Scale
) -> Figure:
    """Draw a leg in ten postures with its foot curve: figure 2.

    Args:
        linkages: Its points and bars, by the crank angle [deg].
        curve: Its foot curve.
        label: Name of the leg.
        scale: Unit of lengths.
    """
    figure, axes = _new_figure(2, 5, (13.0, 5.8))
    for ax, (degrees, linkage) in zip(axes.flat, linkages.items(), strict=True):
        x, y = _in_plane(linkage.points, scale)
        ax.plot(*_in_plane(curve.foot, scale), color=GREY, linewidth=1.0)
        for bar in linkage.bars:
            corners = list(bar)
            if len(bar) > 2:
                ax.fill(x[corners], y[corners], color=BLUE["color"], alpha=0.2)
            ax.plot(x[corners], y[corners], color=BLUE["color"], linewidth=1.8)
        ax.plot(x[:-1], y[:-1], "o", color="white", markeredgecolor="black", markersize=4.5)
        ax.plot(x[-1], y[-1], "o", color=VERMILION["color"], markersize=6)
        for k in (0, 3):
            ax.plot(x[k], y[k], "^", color="black", markersize=7)
        for k, name in enumerate(linkage.names if degrees in (0, 180) else ()):
            ax.annotate(name, (x[k], y[k]), xytext=(5, 4), textcoords="offset points", fontsize=9)
        ax.set_title(f"α = {degrees}°", fontsize=11)
        ax.set_aspect("equal")
        ax.set_xlim(-2.5 * scale.factor, 7.8 * scale.factor)
        ax.set_ylim(-6.8 * scale.factor, 2.4 * scale.factor)
    for ax in axes[-1]:
        ax.set_xlabel(scale.label("X"))
    for ax in axes[:, 0]:
        ax.set_ylabel(scale.label("Y"))
    figure.suptitle(f"Postures of the leg ({label})")
    return figure


def plot_jansen_phi(
    crank_angles: FloatArray, phi: FloatArray, extreme_angles: FloatArray, extremes: FloatArray
) -> Figure:
    """Draw phi' over a turn of Jansen's crank: figure 5.

    Args:
        crank_angles: Crank angles (m,) [rad].
        phi: Angle from CF' to CB (m,) [rad].
        extreme_angles: Crank angles where phi' is largest, then smallest (2,) [rad].
        extremes: phi' there (2,) [rad].
    """
    figure, axes = _new_figure(1, 1, (7.0, 4.2))
    ax = axes[0, 0]
    ax.plot(np.degrees(crank_angles), np.degrees(phi), **BLACK)
    for angle, value, above in zip(
        np.degrees(extreme_angles), np.degrees(extremes), (True, False), strict=True
    ):
        ax.plot(angle, value, "o", color=VERMILION["color"])
        ax.annotate(
            f"{value:.2f}° at {angle:.2f}°",
            (angle, value),
            xytext=(0, 9 if above else -9),
            textcoords="offset points",
            ha="right" if above else "center",
            va="bottom" if above else "top",
        )
    _crank_axis(ax)
    ax.set_ylim(90, 200)
    ax.set_ylabel("φ' from CF' to CB [°]")
    ax.set_title("Angle φ' in Theo Jansen's linkage")
    return figure


def plot_sweep(
    phi_max: FloatArray, rms: Measure, mean_absolute: Measure, foot: Measure, chosen: float
) -> Figure:
    """Draw how well the leg follows Jansen's, by phi_max: figure 7.

    Args:
        phi_max: Largest angles phi (k,) [rad].
        rms: Root mean square of phi_5 - phi_5' [rad].
        mean_absolute: Mean of |phi_5 - phi_5'| [rad].
        foot: Largest distance of the feet [cranks].
        chosen: The paper's phi_max [rad].
    """
    figure, axes = _new_figure(1, 2, (11.0, 4.4))
    degrees = np.degrees(phi_max)
    left, right = axes[0]
    panels = (
        (left, rms.name, np.degrees(rms.values), BLUE),
        (left, mean_absolute.name, np.degrees(mean_absolute.values), VERMILION),
        (right, foot.name, foot.values, BLUE),
    )
    for ax, name, values, style in panels:
        best = int(np.nanargmin(values))
        ax.plot(degrees, values, label=f"{name}: least at {degrees[best]:.1f}°", **style)
        ax.plot(degrees[best], values[best], "o", color=style["color"])
    left.axhline(np.degrees(rms.direct), color="black", linestyle=":", label="direct search (rms)")
    right.axhline(foot.direct, color="black", linestyle=":", label="direct search")
    paper = float(np.degrees(chosen))
    for ax in (left, right):
        ax.axvline(paper, color=GREY, linewidth=1.2, label=f"the paper's choice, {paper:.0f}°")
        ax.set_xlabel("φmax [°]")
        ax.set_xlim(degrees[0], degrees[-1])
        ax.legend()
    left.set_ylim(0, 8)
    right.set_ylim(0, 1)
    left.set_ylabel("η, deviation of φ5 [°]")
    right.set_ylabel("foot deviation [crank lengths]")
    figure.suptitle("How well the leg follows Theo Jansen's, by φmax")
    return figure


def plot_foot_link(phi: tuple[str, FloatArray], deviations: Mapping[str, FloatArray]) -> Figure:
    """Draw the angle of the foot link over a turn of the crank: figure 8.

    Args:
        phi: Name of Jansen's leg and its phi_5 at evenly spaced crank angles (m,) [rad].
        deviations: phi_5 - phi_5' of the other legs there (m,) [rad], by name.
    """
    figure, axes = _new_figure(1, 2, (11.0, 4.4))
    left, right = axes[0]
    name, reference = phi
    degrees = np.linspace(0.0, 360.0, len(reference) + 1)
    left.plot(degrees, _closed(np.degrees(reference)), label=name, **BLACK)
    for (label, deviation), style in zip(deviations.items(), STYLES[1:], strict=True):
        left.plot(degrees, _closed(np.degrees(reference + deviation)), label=label, **style)
        right.plot(degrees, _closed(np.degrees(deviation)), label=label, **style)
    right.axhline(0.0, color="black", linewidth=0.8)
    for ax, label in ((left, "φ5 from CD to CG [°]"), (right, "φ5 - φ5' [°]")):
        _crank_axis(ax)
        ax.set_ylabel(label)
        ax.legend()
    figure.suptitle("Angle of the foot link")
    return figure


def plot_foot_curves(curves: Mapping[str, GaitCurve], scale: Scale) -> Figure:
    """Draw foot curves, and how far they are from the first: figure 9.

    Args:
        curves: Curves at the same crank angles, by the name of the leg, Jansen's first.
        scale: Unit of lengths.
    """
    figure, axes = _new_figure(1, 2, (11.0, 4.4))
    left, right = axes[0]
    jansen = next(iter(curves.values()))
    degrees = np.degrees(jansen.crank_angles)
    for (label, curve), style in zip(curves.items(), STYLES, strict=True):
        left.plot(*_in_plane(curve.foot, scale), label=label, **style)
        if curve is not jansen:
            deviation = scale.factor * curve.deviation(jansen)
            right.plot(degrees, deviation, label=f"{label}: ≤ {deviation.max():.3g}", **style)
    left.set_aspect("equal", adjustable="datalim")
    left.set_xlabel(scale.label("X"))
    left.set_ylabel(scale.label("Y"))
    left.set_title("Foot curves")
    left.legend(loc="upper left")
    _crank_axis(right)
    right.set_ylim(bottom=0)
    right.set_ylabel(scale.label("distance of the feet"))
    right.set_title("Deviation from Theo Jansen's foot")
    right.legend()
    return figure


def plot_body_paths(curves: Mapping[str, GaitCurve], scale: Scale) -> Figure:
    """Draw the path of a two-leg unit's body over three steps: figure 12.

    Args:
        curves: Foot curves by the name of the leg.
        scale: Unit of lengths.
    """
    figure, axes = _new_figure(1, 1, (9.0, 4.6))
    ax = axes[0, 0]
    for (label, curve), style in zip(curves.items(), STYLES, strict=True):
        path = scale.factor * curve.body_path
        steps = [path + np.array([k * path[-1, 0], 0.0]) for k in range(3)]
        y, z = np.concatenate(steps).T
        wave = scale.factor * curve.body_fluctuation
        ax.plot(y, z, label=f"{label}: fluctuation {wave:.3g}", **style)
    ax.set_xlabel(scale.label("walked"))
    ax.set_ylabel(scale.label("height of the crank axis"))
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.45 * (high - low))
    ax.legend(loc="upper center", ncols=1)
    ax.set_title("Body of a two-leg unit over three steps")
    return figure


def _new_figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, Any]:
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for ax in axes.flat:
        ax.grid(color="#dddddd", linewidth=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _crank_axis(ax: Axes) -> None:
    ax.set_xlim(0, 360)
    ax.set_xticks(range(0, 361, 60))
    ax.set_xlabel("crank angle α [°]")


def _closed(values: FloatArray) -> FloatArray:
    """Return values over a turn with the first one again at its end."""
    return np.append(values, values[0])


def _in_plane(points: FloatArray, scale: Scale) -> tuple[FloatArray, FloatArray]:
    """Return points of the leg frame as the paper draws them: the leg walks to the left."""
    return -scale.factor * points[..., 0], scale.factor * points[..., 2]
