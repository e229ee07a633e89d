# SPDX-License-Identifier: Apache-2.0
"""How a geometry search draws its designs: a grid, samples, or an optimiser.

Every method works in the unit cube, one axis a parameter, and has its points evaluated by a
function that yields a `Trial` for each, in order. What a method draws follows from its study and
from the trials before, so a study always draws the same designs, however they are evaluated.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray

SAMPLES_AT_ONCE = 1024  # Sobol points fill the cube evenly in powers of two
INFEASIBLE = 1e6  # a cost that no feasible design has


class Trial(NamedTuple):
    """What a method learns of a design.

    Attributes:
        costs: The objectives, less is better (K,); zeros if the design cannot be evaluated.
        score: All objectives as one number, more is better.
        violation: 0 for a feasible design, else by how much it violates the constraints, at most
            `INFEASIBLE`, which is for a design that cannot be evaluated.
    """

    costs: FloatArray
    score: float
    violation: float


class Draw(NamedTuple):
    """What a method has to go by.

    Attributes:
        cells: Number of values of each parameter; None for a continuous range.
        objectives: Number of objectives.
        designs: Number of designs to evaluate.
        population: Designs in a generation of an optimiser; 1 without one.
        seed: Seed of all that is random.
    """

    cells: Sequence[int | None]
    objectives: int
    designs: int
    population: int
    seed: int

    @property
    def generations(self) -> int:
        """Number of whole generations, the first population included."""
        return self.designs // self.population


Evaluate = Callable[[Iterable[FloatArray]], Iterator[Trial]]


def snap(points: FloatArray, cells: Sequence[int | None]) -> FloatArray:
    """Move points (..., P) to the middle of their cells on every axis that has cells."""
    snapped = np.array(points)
    for axis, count in enumerate(cells):
        if count is not None:
            snapped[..., axis] = (
                np.minimum(np.floor(points[..., axis] * count), count - 1) + 0.5
            ) / count
    return snapped


def search_grid(draw: Draw, evaluate: Evaluate) -> None:
    """Evaluate every combination of the parameters' values, the last parameter fastest."""
    axes = [(np.arange(count) + 0.5) / count for count in draw.cells if count is not None]
    _exhaust(evaluate(np.array(point) for point in itertools.product(*axes)))


def search_samples(draw: Draw, evaluate: Evaluate) -> None:
    """Evaluate scrambled Sobol points, which fill the ranges evenly."""
    _exhaust(evaluate(_sobol_points(draw)))


def search_differential_evolution(draw: Draw, evaluate: Evaluate) -> None:
    """Maximise the score by scipy's differential evolution.

    It only compares costs, so a cost of `INFEASIBLE` and more makes Deb's rules: a feasible design
    beats one that is not, and of two of those the lesser violation wins.
    """
    from scipy.optimize import differential_evolution  # slow to import

    def cost(points: FloatArray) -> FloatArray:
        trials = evaluate(np.clip(points.T, 0.0, 1.0))
        return np.array([INFEASIBLE + t.violation if t.violation else -t.score for t in trials])

    differential_evolution(
        cost,
        [(0.0, 1.0)] * len(draw.cells),
        init=_first_population(draw),
        maxiter=draw.generations - 1,
        atol=-math.inf,  # goes on to the end of the budget
        polish=False,
        seed=np.random.default_rng(draw.seed),
        updating="deferred",
        vectorized=True,
    )


def search_nsga2(draw: Draw, evaluate: Evaluate) -> None:
    """Approach the Pareto front by pymoo's NSGA-II."""
    from pymoo.algorithms.moo.nsga2 import NSGA2  # slow to import
    from pymoo.core.problem import Problem
    from pymoo.core.repair import Repair
    from pymoo.optimize import minimize

    class Designs(Problem):
        def _evaluate(self, x: FloatArray, out: dict[str, Any], *_: Any, **__: Any) -> None:
            trials = list(evaluate(x))
            out["F"] = np.array([trial.costs for trial in trials])
            out["G"] = np.array([[trial.violation] for trial in trials])

    class ToCells(Repair):
        def _do(self, problem: Any, x: FloatArray, **_: Any) -> FloatArray:
            return snap(x, draw.cells)

    minimize(
        Designs(n_var=len(draw.cells), n_obj=draw.objectives, n_ieq_constr=1, xl=0.0, xu=1.0),
        NSGA2(draw.population, sampling=_first_population(draw), repair=ToCells()),
        ("n_gen", draw.generations),
        seed=draw.seed,
    )


def _sobol_points(draw: Draw) -> Iterator[FloatArray]:
    from scipy.stats import qmc  # slow to import

    sampler = qmc.Sobol(len(draw.cells), seed=np.random.default_rng(draw.seed))
    blocks = math.ceil(draw.designs / SAMPLES_AT_ONCE)
    points = (point for _ in range(blocks) for point in sampler.random(SAMPLES_AT_ONCE))
    return itertools.islice(points, draw.designs)


def _first_population(draw: Draw) -> FloatArray:
    """Return a Latin hypercube, moved to the cells."""
    from scipy.stats import qmc  # slow to import

    sampler = qmc.LatinHypercube(len(draw.cells), seed=np.random.default_rng(draw.seed))
    return snap(sampler.random(draw.population), draw.cells)


def _exhaust(trials: Iterator[Trial]) -> None:
    for _ in trials:
        pass


class Method(NamedTuple):
    """A way to search.

    Attributes:
        search: Draws designs and has them evaluated.
        keys: What a study tells it, of "designs" and "population".
    """

    search: Callable[[Draw, Evaluate], None]
    keys: tuple[str, ...]


METHODS: dict[str, Method] = {
    "grid": Method(search_grid, ()),
    "samples": Method(search_samples, ("designs",)),
    "differential_evolution": Method(search_differential_evolution, ("designs", "population")),
    "nsga2": Method(search_nsga2, ("designs", "population")),
}
