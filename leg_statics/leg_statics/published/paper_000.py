# SPDX-License-Identifier: Apache-2.0
"""Zhang, Jin, Zhang 2017: the parallel-driving leg (doi 10.11975/j.issn.1002-6819.2017.21.007)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from leg_kinematics import Leg, ParallelDrive
from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanisms.walking_axes import leg_vectors
from leg_statics.design.designs import STEP_LENGTH, Conditions, Evaluation, evaluate_design
from leg_statics.design.search.workers import LocalWorkers
from leg_statics.footholds import Contact
from leg_statics.indices import INDICES, evaluate_indices
from leg_statics.published.comparison import Comparison, compare_claim, compare_number
from leg_statics.published.grid_means import PROTOCOL_GRID, grid_means
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
# What the optimisation is said to change the means by [%].
CHANGES = {"condition_number": -5.46, "unit_effort_capacity": 18.02, "unit_moment_effort": -6.33}
# Heights h of the foot between which the workspace is widest [m].
PLANES = {"initial": (-0.84, -0.62), "optimised": (-0.72, -0.52)}

# Static friction of the foot's rubber on the ground, section 3.3.
GROUNDS = {"ice": (0.08, 0.4), "wood": (0.6, 0.9), "cement": (0.4, 0.7)}
# Dimensions that section 4 varies: c, l6, l7 [m]; 847 designs.
SEARCH_GRID: dict[str, Sequence[float]] = {
    "drive_lever": tuple(np.linspace(0.100, 0.160, 7)),
    "parallelogram_link": tuple(np.linspace(0.250, 0.350, 11)),
    "shank_length": tuple(np.linspace(0.320, 0.520, 11)),
}
STEP = 0.300  # m, the step the robot is required to make
# The search asks for means to 1 % and for the step by the paper's own criterion, mu >= mu_e.
SEARCH_CONDITIONS = Conditions(
    friction=GROUNDS["cement"][0],
    criterion=Criterion.RATED_FRICTION,
    tolerance=0.01,
    most_points=2**13,
)


def legs(**changes: float) -> dict[str, ParallelDrive]:
    """Return the leg before and after the paper's optimisation."""
    initial = ParallelDrive(**changes)  # type: ignore[arg-type]
    return {"initial": initial, "optimised": replace(initial, **OPTIMISED_LENGTHS)}  # type: ignore[arg-type]


class Slices(NamedTuple):
    """Indices over the workspace in planes of equal height, in the paper's axes.

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
    posture = leg.inverse(leg_vectors(np.stack([x_grid, y_grid, h_grid], axis=-1)))
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


class Search(NamedTuple):
    """The search of section 4 over m designs.

    Attributes:
        designs: Their dimensions (m, 3) [m].
        means: k_q, eta_cFq and eta_cMq (m, 3).
        steps: Longest step on cement of those that are better by (33), else NaN (m,) [m].
        problems: What is wrong with each design, "" for nothing (m,).
        before: The means of the leg that is to be improved (3,).
        error: Largest error of the means of designs without a problem, as a share.
        points: Number of poses that were evaluated for the means.
        processes: Number of processes that worked.
        seconds: Time they took.
    """

    designs: FloatArray
    means: FloatArray
    steps: FloatArray
    problems: NDArray[np.str_]
    before: FloatArray
    error: float
    points: int
    processes: int
    seconds: float

    @property
    def known(self) -> NDArray[np.bool_]:
        """Whether a design can be built and its means exist (m,)."""
        return np.asarray(self.problems == "")

    @property
    def objective(self) -> FloatArray:
        """Equation (33) of the designs that keep the required step, 0 for the others (m,)."""
        return np.where(self.steps >= STEP, _objective(self.means, self.before), 0.0)

    def find(self, design: Sequence[float]) -> int:
        """Return the index of a design of the grid."""
        (index,) = np.flatnonzero(np.all(np.isclose(self.designs, design), axis=1))
        return int(index)

    def rank(self, design: Sequence[float]) -> int:
        """Return the place of a design of the grid by the objective, 1 for the best."""
        return 1 + int(np.sum(self.objective > self.objective[self.find(design)]))


def search(
    leg: ParallelDrive,
    grid: Mapping[str, Sequence[float]] = SEARCH_GRID,
    processes: int | None = None,
    progress: Callable[[Iterator[Evaluation]], Iterable[Evaluation]] = iter,
) -> Search:
    """Search a grid as section 4 does, with means that have converged to 1 %.

    Args:
        leg: The leg to improve.
        grid: Values of each of three dimensions to vary [m]; the paper's 847 designs by default.
        processes: Number of processes; by default one a processor core that may be used.
        progress: Wraps the evaluations to show how far it is.
    """
    start = time.perf_counter()
    designs = np.array(list(product(*grid.values())))
    names = list(MEANS["initial"])
    evaluate = partial(_evaluate, leg, tuple(grid), names)
    with LocalWorkers(processes) as workers:
        found = list(progress(workers.map(evaluate, designs)))
        means = np.array([[e.values[name] for name in names] for e in found])
        problems = np.array([e.problem for e in found])
        reference = evaluate_design(Leg.of(leg), {}, names, SEARCH_CONDITIONS)
        before = np.array([reference.values[name] for name in names])
        better = (problems == "") & (_objective(means, before) > 0.0)
        measure = partial(_evaluate, leg, tuple(grid), [STEP_LENGTH])
        steps = np.full(len(designs), np.nan)
        steps[better] = [e.values[STEP_LENGTH] for e in workers.map(measure, designs[better])]
    return Search(
        designs,
        means,
        steps,
        problems,
        before,
        error=max((e.change for e in found if not e.problem), default=math.nan),
        points=sum(e.points for e in found),
        processes=workers.count,
        seconds=time.perf_counter() - start,
    )


def _evaluate(
    leg: ParallelDrive, names: Sequence[str], metrics: Sequence[str], values: FloatArray
) -> Evaluation:
    changes = dict(zip(names, values.tolist(), strict=True))
    return evaluate_design(Leg.of(leg), changes, metrics, SEARCH_CONDITIONS)


def _objective(means: FloatArray, before: FloatArray) -> FloatArray:
    """Return f of (33): the product of the gains in k_q and eta_cFq, 0 unless both are gains (m,).

    Args:
        means: k_q, eta_cFq and eta_cMq of the designs (m, 3).
        before: The same of the leg to improve (3,).
    """
    gains = np.maximum((means - before) * [-1.0, 1.0, 0.0], 0.0)
    return gains[:, 0] * gains[:, 1]


@cache
def paper_search() -> Search:
    """Search the paper's grid for what is better than its initial dimensions."""
    return search(legs()["initial"])


def _trend(values: FloatArray) -> str:
    return f"{values[0]:.3f} to {values[-1]:.3f}"


def mean_comparisons() -> list[Comparison]:
    """Compare the six published means: fitted zeros, then the natural ones."""
    rows = []
    for label, zeros in (("fitted crank zeros", {}), ("natural crank zeros", NATURAL_ZEROS)):
        for stage, leg in legs(**zeros).items():
            means = grid_means(leg, list(MEANS[stage]))
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


def change_comparisons() -> list[Comparison]:
    """Compare what the optimisation does to the means, with means that have converged."""
    before, after = (evaluate_design(Leg.of(leg), {}, list(CHANGES)) for leg in legs().values())
    error = 100.0 * max(before.change, after.change)
    rows = []
    for name, published in CHANGES.items():
        ours = after.values[name] / before.values[name] - 1.0
        printed = MEANS["optimised"][name] / MEANS["initial"][name] - 1.0
        rows.append(
            compare_number(
                PAPER,
                f"change of the mean {INDICES[name].symbol} by the optimisation",
                published,
                100.0 * ours,
                unit="%",
                note=f"{before.values[name]:.4g} to {after.values[name]:.4g}, known to "
                f"{error:.1f} %; the paper's two means give {100.0 * printed:.2f} %",
            )
        )
    return rows


def search_comparisons(found: Search) -> list[Comparison]:
    """Compare the search by equation (33) with what the paper found."""
    objective, known = found.objective, found.known
    optimum = tuple(OPTIMISED_LENGTHS.values())
    best = found.designs[np.argmax(objective)]
    spread = np.std(found.means[known], axis=0) / np.mean(found.means[known], axis=0)
    better = np.isfinite(found.steps)
    keep = "all of them keep" if np.all(found.steps[better] >= STEP) else "not all of them keep"
    speed = (
        f"{len(known)} designs in {found.seconds:.0f} s on {found.processes} processes: "
        f"{len(known) / found.seconds:.0f} designs/s, {found.points / found.seconds:.0f} poses/s"
    )
    return [
        compare_claim(
            PAPER,
            f"the best design by (33) has c, l6, l7 = {_millimetres(optimum)} mm",
            np.allclose(best, optimum),
            f"{_millimetres(best)} mm, the paper's is number {found.rank(optimum)}",
            f"{speed}; means known to {100.0 * found.error:.1f} %",
        ),
        compare_claim(
            PAPER,
            "that design betters k_q and eta_cFq of the initial dimensions",
            found.rank(optimum) <= np.count_nonzero(objective > 0.0),
            f"{np.count_nonzero(better)} designs do",
            f"of {np.count_nonzero(known)} whose means converge; {keep} 300 mm on cement",
        ),
        compare_claim(
            PAPER,
            "eta_cMq varies little among the designs",
            spread[2] < 0.1 * min(spread[:2]),
            f"by {100.0 * spread[2]:.1f} %, k_q and eta_cFq by "
            f"{100.0 * spread[0]:.0f} and {100.0 * spread[1]:.0f} %",
            "standard deviation of the designs whose means converge",
        ),
    ]


def _millimetres(design: Sequence[float] | FloatArray) -> str:
    return ", ".join(f"{1e3 * length:.0f}" for length in design)


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
                    Leg.of(leg),  # the criterion asks for no load
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
    return [
        *mean_comparisons(),
        *change_comparisons(),
        *search_comparisons(paper_search()),
        *claim_comparisons(),
        *step_comparisons(),
    ]
