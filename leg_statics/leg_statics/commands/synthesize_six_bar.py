"""Command `synthesize_six_bar`: find a six-bar leg that follows Theo Jansen's and draw it.

Draws figures 2, 5, 7, 8, 9 and 12 of paper 003. Lengths are in cranks, or in mm with
`--crank-length`.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from tqdm import tqdm

from leg_kinematics.errors import LegError, ValueRangeError
from leg_kinematics.gait_curve import GaitCurve, gait_curve
from leg_kinematics.mechanisms.six_bar import SixBar
from leg_statics.design.synthesis import (
    JANSEN,
    SAMPLES,
    Design,
    SearchProgress,
    angle_deviations,
    fit,
    jansen_phi,
    jansen_points,
    limit_positions,
    search,
    sweep,
    synthesize,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, told apart by colour-blind readers too; every line has its own dashes.
JANSEN_STYLE: dict[str, Any] = {"color": "#000000", "linestyle": "-"}
OPTIMUM_STYLE: dict[str, Any] = {"color": "#0072B2", "linestyle": "--"}
DIRECT_STYLE: dict[str, Any] = {"color": "#D55E00", "linestyle": "-."}
MINOR_COLOR = "#999999"


class Leg(NamedTuple):
    """One leg of the comparison, with how it is drawn."""

    label: str
    style: dict[str, Any]
    curve: GaitCurve
    design: Design | None
    mechanism: Any
    assembly_mode: str


class Scale(NamedTuple):
    """Unit of the drawn lengths."""

    factor: float
    unit: str

    def label(self, quantity: str) -> str:
        """Return an axis label."""
        return f"{quantity} [{self.unit}]"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except LegError as error:
        print(f"synthesize_six_bar: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="synthesize_six_bar", description="Find a six-bar leg that follows Theo Jansen's."
    )
    parser.add_argument(
        "--phi-max", type=float, default=168.0, help="largest angle phi [deg] (default: 168)"
    )
    parser.add_argument("--samples", type=int, default=SAMPLES, help="crank angles of equation (8)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the direct search")
    parser.add_argument(
        "--generations", type=int, default=300, help="largest number of generations of the search"
    )
    parser.add_argument(
        "--crank-length", type=float, help="crank length [mm]; without it lengths are in cranks"
    )
    parser.add_argument("--figures", type=Path, help="folder for the figures; without it, none")
    return parser


def _run(options: argparse.Namespace) -> int:
    if options.crank_length is not None and not 0.0 < options.crank_length < math.inf:
        raise ValueRangeError(f"--crank-length must be > 0 mm, got {options.crank_length}")
    if options.samples < 2:
        raise ValueRangeError(f"--samples must be >= 2, got {options.samples}")
    optimum = synthesize(math.radians(options.phi_max))
    with tqdm(total=options.generations, desc="direct search", unit="generation") as bar:

        def report(progress: SearchProgress) -> None:
            bar.set_postfix_str(f"rms {math.degrees(progress.rms):.3f}°", refresh=False)
            bar.update(progress.generation - bar.n)

        direct = search(options.seed, options.generations, callback=report)
    legs = [
        Leg("Theo Jansen", JANSEN_STYLE, gait_curve(JANSEN), None, JANSEN, ""),
        _leg(f"six-bar, φmax = {options.phi_max:g}°", OPTIMUM_STYLE, optimum),
        _leg("six-bar, direct search", DIRECT_STYLE, direct),
    ]
    scale = (
        Scale(options.crank_length, "mm") if options.crank_length else Scale(1.0, "crank lengths")
    )
    _print_table(legs, scale, options.samples)
    if options.figures:
        for path in draw_figures(options.figures, legs, scale, options.samples):
            print(path)
    return 0


def _leg(label: str, style: dict[str, Any], design: Design) -> Leg:
    mode = design.assembly_mode
    mechanism = design.mechanism()
    return Leg(label, style, gait_curve(mechanism, assembly_mode=mode), design, mechanism, mode)


def _print_table(legs: Sequence[Leg], scale: Scale, samples: int) -> None:
    """Print dimensions and qualities of the legs."""
    rows: list[tuple[str, list[str]]] = []
    for label, name in (
        *(("l_BE", "pin_spacing"), ("l_EF", "rod"), ("l_CF", "foot_lever")),
        *(("l_AE", "rod_crank"), ("l_FG", "foot_brace")),
    ):
        cells = [
            f"{scale.factor * float(getattr(leg.design, name)):.4f}" if leg.design else "-"
            for leg in legs
        ]
        rows.append((scale.label(label), cells))
    fits = [fit(leg.design, samples) if leg.design else None for leg in legs]
    rows += [
        ("rms of φ5 - φ5' [°]", [f"{math.degrees(f.rms):.3f}" if f else "-" for f in fits]),
        (
            scale.label("largest foot deviation"),
            [f"{scale.factor * f.largest_deviation:.4f}" if f else "-" for f in fits],
        ),
    ]
    for label, name in (
        ("step height", "step_height"),
        ("stride", "stride"),
        ("flatness (rms)", "flatness"),
        ("body fluctuation", "body_fluctuation"),
    ):
        cells = [f"{scale.factor * getattr(leg.curve, name):.4f}" for leg in legs]
        rows.append((scale.label(label), cells))
    width = max(len(label) for label, _ in rows)
    columns = [max(12, len(leg.label)) for leg in legs]
    heads = [leg.label for leg in legs]
    for label, cells in [("", heads), *rows]:
        padded = (f"{cell:>{w}}" for cell, w in zip(cells, columns, strict=True))
        print(f"{label:<{width}}  {'  '.join(padded)}")


# --------------------------------------------------------------------------- figures


def draw_figures(folder: Path, legs: Sequence[Leg], scale: Scale, samples: int) -> list[Path]:
    """Draw the paper's figures into a folder.

    Args:
        folder: Made if it does not exist.
        legs: Jansen's leg, the paper's optimum, the direct search's.
        scale: Unit of lengths.
        samples: Number of crank angles of equation (8).

    Returns:
        Paths of the pictures.
    """
    folder.mkdir(parents=True, exist_ok=True)
    figures: dict[str, Callable[[], Figure]] = {
        "figure_2_postures": lambda: _postures(legs[1], scale),
        "figure_5_jansen_phi": _phi,
        "figure_7_sweep": lambda: _sweep(legs[2], samples),
        "figure_8_angles": lambda: _angles(legs),
        "figure_9_foot_curves": lambda: _foot_curves(legs, scale),
        "figure_12_body_paths": lambda: _body_paths(legs, scale),
    }
    paths = []
    for name, draw in tqdm(figures.items(), desc="figures", unit="figure"):
        paths.append(folder / f"{name}.png")
        draw().savefig(paths[-1], dpi=150)
    return paths


def _new_figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
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


def _in_plane(points: Any, scale: Scale) -> tuple[Any, Any]:
    """Return points of the leg frame as the paper draws them: the leg walks to the left."""
    return -scale.factor * points[..., 1], scale.factor * points[..., 2]


def _postures(leg: Leg, scale: Scale) -> Figure:
    figure, axes = _new_figure(2, 5, (13.0, 5.8))
    mechanism: SixBar = leg.mechanism
    for ax, degrees in zip(axes.flat, range(0, 360, 36), strict=True):
        linkage = mechanism.linkage(mechanism.forward([math.radians(degrees)], leg.assembly_mode))
        x, y = _in_plane(linkage.points, scale)
        ax.plot(*_in_plane(leg.curve.foot, scale), color=MINOR_COLOR, linewidth=1.0)
        for bar in linkage.bars:
            corners = list(bar)
            if len(bar) > 2:
                ax.fill(x[corners], y[corners], color=OPTIMUM_STYLE["color"], alpha=0.2)
            ax.plot(x[corners], y[corners], color=OPTIMUM_STYLE["color"], linewidth=1.8)
        ax.plot(x[:-1], y[:-1], "o", color="white", markeredgecolor="black", markersize=4.5)
        ax.plot(x[-1], y[-1], "o", color=DIRECT_STYLE["color"], markersize=6)
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
    figure.suptitle(f"Postures of the leg ({leg.label})")
    return figure


def _phi() -> Figure:
    figure, axes = _new_figure(1, 1, (7.0, 4.2))
    ax = axes[0, 0]
    angles = np.arange(0.0, 360.5, 0.5)
    ax.plot(angles, np.degrees(jansen_phi(np.radians(angles))), **JANSEN_STYLE)
    limits = limit_positions()
    for angle, phi, above in zip(
        np.degrees(limits.crank_angles), np.degrees(limits.phi), (True, False), strict=True
    ):
        ax.plot(angle, phi, "o", color=DIRECT_STYLE["color"])
        ax.annotate(
            f"{phi:.2f}° at {angle:.2f}°",
            (angle, phi),
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


def _sweep(direct: Leg, samples: int) -> Figure:
    figure, axes = _new_figure(1, 2, (11.0, 4.4))
    curve = sweep(np.radians(np.arange(78.0, 180.25, 0.25)), samples)
    degrees = np.degrees(curve.phi_max)
    left, right = axes[0]
    panels = (
        (left, np.degrees(curve.fits.rms), "root mean square", OPTIMUM_STYLE),
        (left, np.degrees(curve.fits.mean_absolute), "mean of |φ5 - φ5'|", DIRECT_STYLE),
        (right, curve.fits.largest_deviation, "largest foot deviation", OPTIMUM_STYLE),
    )
    for ax, values, label, style in panels:
        best = int(np.nanargmin(values))
        ax.plot(degrees, values, label=f"{label}: least at {degrees[best]:.1f}°", **style)
        ax.plot(degrees[best], values[best], "o", color=style["color"])
    if direct.design is not None:
        best_fit = fit(direct.design, samples)
        for ax, value in (
            (left, math.degrees(best_fit.rms)),
            (right, float(best_fit.largest_deviation)),
        ):
            label = "direct search" + (" (rms)" if ax is left else "")
            ax.axhline(value, color="black", linestyle=":", label=label)
    for ax in (left, right):
        ax.axvline(168.0, color=MINOR_COLOR, linewidth=1.2, label="the paper's choice, 168°")
        ax.set_xlabel("φmax [°]")
        ax.set_xlim(78, 180)
        ax.legend()
    left.set_ylim(0, 8)
    right.set_ylim(0, 1)
    left.set_ylabel("η, deviation of φ5 [°]")
    right.set_ylabel("foot deviation [crank lengths]")
    figure.suptitle("How well the leg follows Theo Jansen's, by φmax")
    return figure


def _angles(legs: Sequence[Leg]) -> Figure:
    figure, axes = _new_figure(1, 2, (11.0, 4.4))
    left, right = axes[0]
    angles = np.arange(0, 361)
    points = jansen_points(np.radians(angles[:-1]))
    # phi_5 lies between the rocker CD and the foot bar CG
    phi = np.degrees(np.angle((points["G"] - points["C"]) / (points["D"] - points["C"]))) % 360.0
    left.plot(angles, np.append(phi, phi[0]), label=legs[0].label, **legs[0].style)
    for leg in legs[1:]:
        if leg.design is not None:
            deviation = np.degrees(angle_deviations(leg.design, 360))
            total = phi + deviation
            left.plot(angles, np.append(total, total[0]), label=leg.label, **leg.style)
            right.plot(angles, np.append(deviation, deviation[0]), label=leg.label, **leg.style)
    right.axhline(0.0, color="black", linewidth=0.8)
    for ax, label in ((left, "φ5 from CD to CG [°]"), (right, "φ5 - φ5' [°]")):
        _crank_axis(ax)
        ax.set_ylabel(label)
        ax.legend()
    figure.suptitle("Angle of the foot link")
    return figure


def _foot_curves(legs: Sequence[Leg], scale: Scale) -> Figure:
    figure, axes = _new_figure(1, 2, (11.0, 4.4))
    left, right = axes[0]
    degrees = np.degrees(legs[0].curve.crank_angles)
    for leg in legs:
        left.plot(*_in_plane(leg.curve.foot, scale), label=leg.label, **leg.style)
    for leg in legs[1:]:
        deviation = scale.factor * leg.curve.deviation(legs[0].curve)
        right.plot(degrees, deviation, label=f"{leg.label}: ≤ {deviation.max():.3g}", **leg.style)
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


def _body_paths(legs: Sequence[Leg], scale: Scale) -> Figure:
    figure, axes = _new_figure(1, 1, (9.0, 4.6))
    ax = axes[0, 0]
    for leg in legs:
        path = scale.factor * leg.curve.body_path
        steps = [path + np.array([k * path[-1, 0], 0.0]) for k in range(3)]
        y, z = np.concatenate(steps).T
        wave = scale.factor * leg.curve.body_fluctuation
        ax.plot(y, z, label=f"{leg.label}: fluctuation {wave:.3g}", **leg.style)
    ax.set_xlabel(scale.label("walked"))
    ax.set_ylabel(scale.label("height of the crank axis"))
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.45 * (high - low))
    ax.legend(loc="upper center", ncols=1)
    ax.set_title("Body of a two-leg unit over three steps")
    return figure


if __name__ == "__main__":
    raise SystemExit(main())
