"""Zhang, Jin, Zhang 2017: the parallel-driving leg (doi 10.11975/j.issn.1002-6819.2017.21.007)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from leg_kinematics import GeometryError, ParallelDrive
from leg_kinematics.arrays import FloatArray
from leg_statics.footholds import Contact
from leg_statics.global_means import means_on_grid
from leg_statics.indices import INDICES, evaluate_indices
from leg_statics.published.comparison import Comparison, compare_claim, compare_number
from leg_statics.step_length import Criterion, longest_step

PAPER = "000"

# Lengths that the optimisation changes: c, l6, l7 [m].
OPTIMISED_LENGTHS = {"drive_lever": 0.140, "parallelogram_link": 0.330, "shank_length": 0.320}
# Crank zeros that put R1R2 level and C below H in the initial pose, instead of the fitted ones.
NATURAL_ZEROS = {
    "crank_zero": math.radians(-34.825),
    "center_crank_zero": math.radians(-101.176),
}

# Global means before and after the optimisation, printed in section 4.
MEANS = {
    "initial": {
        "condition_number": 6.409,
        "unit_effort_capacity": 3.458,
        "unit_moment_effort": 1.990,
    },
    "optimised": {
        "condition_number": 6.095,
        "unit_effort_capacity": 4.081,
        "unit_moment_effort": 1.864,
    },
}
# Heights h of the foot between which the workspace is widest [m].
PLANES = {"initial": (-0.84, -0.62), "optimised": (-0.72, -0.52)}
PROTOCOL_GRID = 11  # points per actuator, cell mid-points

# Static friction of the foot's rubber on the ground, section 3.3.
GROUNDS = {"ice": (0.08, 0.4), "wood": (0.6, 0.9), "cement": (0.4, 0.7)}
# Dimensions that section 4 varies: c, l6, l7 [m]; 847 designs.
SEARCH_GRID: dict[str, Sequence[float]] = {
    "drive_lever": tuple(np.linspace(0.100, 0.160, 7)),
    "parallelogram_link": tuple(np.linspace(0.250, 0.350, 11)),
    "shank_length": tuple(np.linspace(0.320, 0.520, 11)),
}
STEP = 0.300  # m, the step the robot is required to make


def legs(**changes: float) -> dict[str, ParallelDrive]:
    """Return the leg before and after the paper's optimisation."""
    initial = ParallelDrive(**changes)  # type: ignore[arg-type]
    return {"initial": initial, "optimised": replace(initial, **OPTIMISED_LENGTHS)}  # type: ignore[arg-type]


class Slices(NamedTuple):
    """Indices over the workspace in planes of equal height.

    Attributes:
        heights: h of each plane (k,) [m].
        means: Mean of every registered index over each plane (k, indices).
        names: Names of the indices.
        asymmetry: Largest relative difference between x and -x.
        on_axis: Values on the line x = 0 (k, y, indices).
        y: The line's y [m].
    """

    heights: FloatArray
    means: FloatArray
    names: tuple[str, ...]
    asymmetry: float
    on_axis: FloatArray
    y: FloatArray


def slices(leg: ParallelDrive, heights: FloatArray, spacing: float = 0.015) -> Slices:
    """Evaluate all indices on horizontal planes, as figures 2, 5 and 6 do."""
    x = spacing * np.arange(-40, 41)
    y = spacing * np.arange(-50, 51)
    h_grid, x_grid, y_grid = np.meshgrid(heights, x, y, indexing="ij")
    posture = leg.inverse(np.stack([x_grid, y_grid, h_grid], axis=-1))
    names, values = evaluate_indices(leg, posture)
    mirror = values[:, ::-1]
    with np.errstate(invalid="ignore"):
        difference = np.abs(values - mirror) / np.maximum(np.abs(values), 1e-3)
    return Slices(
        heights,
        np.nanmean(values, axis=(1, 2)),
        names,
        float(np.nanmax(difference)),
        values[:, 40],
        y,
    )


def sampled_designs(
    leg: ParallelDrive,
    grid: Mapping[str, Sequence[float]] = SEARCH_GRID,
    progress: Callable[[list[tuple[float, ...]]], Iterable[tuple[float, ...]]] = iter,
) -> tuple[FloatArray, FloatArray]:
    """Compute the three global means of every design of a grid: the samples of figure 7.

    Args:
        leg: The leg whose other dimensions the designs have.
        grid: Values of each dimension to vary [m]; the paper's 7 x 11 x 11 by default.
        progress: Wraps the list of designs to show how far it is.

    Returns:
        The designs that can be assembled (m, len(grid)) and their means (m, 3).
    """
    designs, means = [], []
    for values in progress(list(product(*grid.values()))):
        try:
            design = replace(leg, **dict(zip(grid, values, strict=True)))  # type: ignore[arg-type]
        except GeometryError:
            continue
        designs.append(values)
        means.append(means_on_grid(design, list(MEANS["initial"]), PROTOCOL_GRID).values)
    return np.array(designs).reshape(-1, len(grid)), np.array(means).reshape(-1, 3)


def _trend(values: FloatArray) -> str:
    return f"{values[0]:.3f} to {values[-1]:.3f}"


def mean_comparisons() -> list[Comparison]:
    """Compare the six published means: fitted zeros, then the natural ones."""
    rows = []
    for label, zeros in (("fitted crank zeros", {}), ("natural crank zeros", NATURAL_ZEROS)):
        for stage, leg in legs(**zeros).items():
            means = means_on_grid(leg, list(MEANS[stage]), PROTOCOL_GRID)
            for name, ours in zip(means.names, means.values, strict=True):
                rows.append(
                    compare_number(
                        PAPER,
                        f"mean {INDICES[name].symbol}, {stage} dimensions",
                        MEANS[stage][name],
                        float(ours),
                        note=f"{label}, {PROTOCOL_GRID}³ actuator grid",
                    )
                )
    return rows


def claim_comparisons() -> list[Comparison]:
    """Check the statements about how the indices are distributed."""
    rows = []
    for stage, leg in legs().items():
        h = np.linspace(*PLANES[stage], 12)
        s = slices(leg, h)
        mean = {name: s.means[:, k] for k, name in enumerate(s.names)}

        def add(claim: str, holds: bool, evidence: str, note: str, stage: str = stage) -> None:
            rows.append(compare_claim(PAPER, f"{claim} ({stage})", bool(holds), evidence, note))

        span = f"h from {h[0]:.2f} to {h[-1]:.2f} m"
        k, eta = mean["condition_number"], mean["unit_effort_capacity"]
        moment, k_cm = mean["unit_moment_effort"], mean["constraint_moment"]
        add("k grows with h", k[-1] > k[0], _trend(k), span)
        add("eta_cF falls with h", eta[-1] < eta[0], _trend(eta), span)
        add("eta_cM falls with h", moment[-1] < moment[0], _trend(moment), f"{span}: it rises")
        add("k_cm falls with h", k_cm[-1] < k_cm[0], _trend(k_cm), f"{span}: it rises")
        add("maps are symmetric in x", s.asymmetry < 1e-6, f"{s.asymmetry:.1e}", "relative")
        k_cf = s.means[:, s.names.index("constraint_force")]
        add(
            "k_cf = 1 everywhere",
            bool(np.allclose(k_cf, 1.0, atol=1e-9)),
            f"{k_cf.max():.6f}",
            span,
        )
        friction = s.on_axis[:, :, s.names.index("rated_friction")]
        lowest = float(np.nanmax(np.nanmin(friction, axis=1)))
        add(
            "mu_e along y is V-shaped with a minimum near 0",
            lowest < 0.02 and _v_shaped(friction),
            f"minimum <= {lowest:.3f}",
            f"x = 0, {span}",
        )
    return rows


def step_comparisons() -> list[Comparison]:
    """Check what section 4 says about steps, by the paper's own criterion mu >= mu_e."""
    rows = []
    for stage, leg in legs().items():
        heights = np.linspace(*PLANES[stage], 12)
        longest = {
            ground: float(
                longest_step(
                    leg,
                    np.array([[-1.0, 1.0]] * 3),  # the criterion asks for no load
                    heights,
                    Contact(friction),
                    criterion=Criterion.RATED_FRICTION,
                ).length.max()
            )
            for ground, (friction, _) in GROUNDS.items()
        }
        evidence = ", ".join(f"{ground} {1e3 * step:.0f} mm" for ground, step in longest.items())
        note = "longest step at the low end of each ground's friction"
        for ground, step in longest.items():
            rows.append(
                compare_claim(
                    PAPER,
                    f"a step of 300 mm fits on {ground} ({stage})",
                    step >= STEP,
                    f"{1e3 * step:.0f} mm",
                    note,
                )
            )
        in_order = longest["ice"] < longest["cement"] <= longest["wood"]
        claim = f"the smoother the ground, the shorter the step ({stage})"
        rows.append(compare_claim(PAPER, claim, in_order, evidence, note))
    return rows


def _v_shaped(friction: FloatArray) -> bool:
    """Tell whether every row falls to one minimum and rises after it."""
    for row in friction:
        values = row[np.isfinite(row)]
        low = int(np.argmin(values))
        if np.any(np.diff(values[: low + 1]) > 0) or np.any(np.diff(values[low:]) < 0):
            return False
    return True


def comparisons() -> list[Comparison]:
    """Return every number and claim of the paper beside ours."""
    return mean_comparisons() + claim_comparisons() + step_comparisons()
