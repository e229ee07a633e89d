# SPDX-License-Identifier: Apache-2.0
"""Load capacity with the true friction cone against conic and linear solvers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from harness import Goal, Row, Settings, measure, measure_beside, missing_row, ratio_row, timed_row
from peers.solvers import PYRAMID_EXCESS, Clarabel, ForcePolytope, Highs, Linprog
from workload import BATCH, FRICTION, hexapod_leg, reachable_positions

from leg_kinematics.arrays import FloatArray
from leg_statics.capacity.problem import load_capacity

GOALS = {"clarabel": Goal(500.0, at_least=True)}
NOTES = {
    "clarabel": "same cone; set up once, values updated; equal within 1e-6",
    "highspy": "32-sided pyramid, hot start; within the pyramid's error",
    "scipy linprog": "32-sided pyramid; within the pyramid's error",
    "pycapacity": "no friction, so against mu = inf; equal within 1e-9",
}


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the time of the suite, then of each peer and how many times longer it takes."""
    leg = hexapod_leg()
    mechanism = leg.mechanism
    lower, upper = leg.effort_limits.T
    jacobians = mechanism.jacobian(mechanism.inverse(reachable_positions(mechanism)))

    def capacity(friction: float, points: FloatArray = jacobians) -> FloatArray:
        return load_capacity(points, lower, upper, friction).capacity

    ours = measure(lambda: capacity(FRICTION), settings, BATCH)
    yield timed_row(f"load_capacity, mu {FRICTION}", ours, Goal(80e-9), f"batch of {BATCH:,}")
    rough = measure(lambda: capacity(np.inf), settings, BATCH)
    yield timed_row("load_capacity, mu inf", rough, note=f"batch of {BATCH:,}")

    few = jacobians[: settings.peer_points]
    exact = capacity(FRICTION, few)
    looser = capacity(FRICTION * PYRAMID_EXCESS, few)
    no_friction = capacity(np.inf, few)
    peers: dict[str, tuple[Callable[[], Any], Callable[[FloatArray], None]]] = {
        "clarabel": (
            lambda: Clarabel(lower, upper, FRICTION),
            lambda found: np.testing.assert_allclose(found, exact, rtol=1e-6),
        ),
        "highspy": (
            lambda: Highs(lower, upper, FRICTION),
            lambda found: assert_between(found, exact, looser),
        ),
        "scipy linprog": (
            lambda: Linprog(lower, upper, FRICTION),
            lambda found: assert_between(found, exact, looser),
        ),
        "pycapacity": (
            lambda: ForcePolytope(lower, upper),
            lambda found: np.testing.assert_allclose(found, no_friction, rtol=1e-9),
        ),
    }
    for name, (make, check) in peers.items():
        try:
            solver = make()
        except ImportError as error:
            yield missing_row(name, error)
            continue
        settings.show(f"checking {name}")
        check(np.array([solver.capacity(jacobian) for jacobian in few]))
        friction = np.inf if name == "pycapacity" else FRICTION
        times = measure_beside(solver.capacity, few, partial(capacity, friction), BATCH, settings)
        yield timed_row(name, times[0], note=NOTES[name])
        yield ratio_row(f"{name} / load_capacity", times, GOALS.get(name))


def assert_between(found: FloatArray, least: FloatArray, greatest: FloatArray) -> None:
    """Check that values lie in a range, up to a solver's tolerance."""
    slack = 1e-6 * greatest
    assert (least - slack <= found).all(), "a capacity is below that of the cone"
    assert (found <= greatest + slack).all(), "a capacity is above that of the wider cone"
