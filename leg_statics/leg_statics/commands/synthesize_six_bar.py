# SPDX-License-Identifier: Apache-2.0
"""Command `synthesize_six_bar`: find a six-bar leg that follows Theo Jansen's and draw it.

Draws figures 2, 5, 7, 8, 9 and 12 of paper 003. Lengths are in cranks, or in mm with
`--crank-length`.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from tqdm import tqdm

from leg_kinematics.errors import LegError, ValueRangeError
from leg_statics.commands.command_line import print_on_any_terminal
from leg_statics.commands.six_bar_pictures import gait_curves, six_bar_pictures
from leg_statics.design.synthesis import (
    PAPER_PHI_MAX,
    SAMPLES,
    Design,
    SearchProgress,
    fit,
    search,
    synthesize,
)
from leg_statics.drawing.crank_legs import Scale
from leg_statics.drawing.style import write_figure


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    options = _parser().parse_args(arguments)
    print_on_any_terminal()
    try:
        return _run(options)
    except (LegError, OSError) as error:
        print(f"synthesize_six_bar: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="synthesize_six_bar", description="Find a six-bar leg that follows Theo Jansen's."
    )
    parser.add_argument(
        "--phi-max",
        type=float,
        default=math.degrees(PAPER_PHI_MAX),
        help="largest angle phi [deg] (default: %(default)g)",
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
    if not 0 <= options.seed < 2**32:
        raise ValueRangeError(f"--seed must be from 0 to {2**32 - 1}, got {options.seed}")
    if options.generations < 1:
        raise ValueRangeError(f"--generations must be >= 1, got {options.generations}")
    if options.figures:
        options.figures.mkdir(parents=True, exist_ok=True)  # before the work, not after it
    optimum = synthesize(math.radians(options.phi_max))
    with tqdm(total=options.generations, desc="direct search", unit="generation") as bar:

        def report(progress: SearchProgress) -> None:
            bar.set_postfix_str(f"rms {math.degrees(progress.rms):.3f}°", refresh=False)
            bar.update(progress.generation - bar.n)

        found = search(options.seed, options.generations, callback=report)
    synthesized = f"six-bar, φmax = {options.phi_max:g}°", optimum
    direct = "six-bar, direct search", found
    scale = (
        Scale(options.crank_length, "mm") if options.crank_length else Scale(1.0, "crank lengths")
    )
    _print_table(dict((synthesized, direct)), scale, options.samples)
    if options.figures:
        options.figures.mkdir(parents=True, exist_ok=True)
        pictures = six_bar_pictures(synthesized, direct, scale, options.samples)
        for name, draw in tqdm(pictures.items(), desc="figures", unit="figure"):
            print(write_figure(draw(), options.figures / f"{name}.png"))
    return 0


def _print_table(designs: Mapping[str, Design], scale: Scale, samples: int) -> None:
    """Print dimensions and qualities of Jansen's leg and of the designs."""
    curves = gait_curves(designs)
    fits = [fit(design, samples) for design in designs.values()]
    rows: list[tuple[str, list[str]]] = []
    for label, name in (
        *(("l_BE", "pin_spacing"), ("l_EF", "rod"), ("l_CF", "foot_lever")),
        *(("l_AE", "rod_crank"), ("l_FG", "foot_brace")),
    ):
        lengths = [scale.factor * float(getattr(design, name)) for design in designs.values()]
        rows.append((scale.label(label), ["-", *(f"{length:.4f}" for length in lengths)]))
    rows += [
        ("rms of φ5 - φ5' [°]", ["-", *(f"{math.degrees(f.rms):.3f}" for f in fits)]),
        (
            scale.label("largest foot deviation"),
            ["-", *(f"{scale.factor * f.largest_deviation:.4f}" for f in fits)],
        ),
    ]
    for label, name in (
        ("step height", "step_height"),
        ("stride", "stride"),
        ("flatness (rms)", "flatness"),
        ("body fluctuation", "body_fluctuation"),
    ):
        cells = [f"{scale.factor * getattr(curve, name):.4f}" for curve in curves.values()]
        rows.append((scale.label(label), cells))
    width = max(len(label) for label, _ in rows)
    columns = [max(12, len(label)) for label in curves]
    for label, cells in [("", list(curves)), *rows]:
        padded = (f"{cell:>{w}}" for cell, w in zip(cells, columns, strict=True))
        print(f"{label:<{width}}  {'  '.join(padded)}")


if __name__ == "__main__":
    raise SystemExit(main())
