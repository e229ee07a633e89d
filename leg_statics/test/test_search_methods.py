# SPDX-License-Identifier: Apache-2.0
"""How designs are drawn, on functions whose optimum is known."""

import itertools

import numpy as np
import pytest

from leg_statics.design.search.methods import INFEASIBLE, METHODS, Draw, Trial, snap

CONTINUOUS = (None, None)


class Evaluator:
    """Evaluates points by a function from a point to a trial, and remembers them."""

    def __init__(self, function):
        self.points = []
        self._function = function

    def __call__(self, points):
        for point in points:
            self.points.append(np.array(point))
            yield self._function(point)


def two_goals(point):
    """Closeness to two opposite points: the front is the straight line between them."""
    costs = np.array([np.sum((point - 0.25) ** 2), np.sum((point - 0.75) ** 2)])
    return Trial(costs, -costs.sum(), 0.0)


def search(method, draw, function=two_goals):
    evaluator = Evaluator(function)
    METHODS[method].search(draw, evaluator)
    return np.array(evaluator.points)


def test_grid_draws_every_combination_once_the_last_parameter_fastest():
    points = search("grid", Draw((2, 3), 2, 6, 1, 0))
    wanted = list(itertools.product([0.25, 0.75], [1 / 6, 0.5, 5 / 6]))
    np.testing.assert_allclose(points, wanted)


@pytest.mark.parametrize("method", ["samples", "differential_evolution", "nsga2"])
@pytest.mark.parametrize("cells", [CONTINUOUS, (None, 7)], ids=["continuous", "with cells"])
def test_the_seed_alone_decides_what_is_drawn(method, cells):
    first = search(method, Draw(cells, 2, 160, 16, 5))
    again = search(method, Draw(cells, 2, 160, 16, 5))
    other = search(method, Draw(cells, 2, 160, 16, 6))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first[: len(other)], other[: len(first)])
    assert first.min() >= 0.0
    assert first.max() <= 1.0
    assert len(first) == 160


@pytest.mark.parametrize("method", ["samples", "differential_evolution", "nsga2"])
def test_a_larger_budget_goes_on_from_a_smaller_one(method):
    small = search(method, Draw(CONTINUOUS, 2, 64, 16, 1))
    large = search(method, Draw(CONTINUOUS, 2, 128, 16, 1))
    np.testing.assert_array_equal(large[:64], small)


def test_samples_fill_the_cube_evenly():
    points = search("samples", Draw(CONTINUOUS, 2, 2048, 1, 3))
    counts, *_ = np.histogram2d(*points.T, bins=8)
    assert (counts == 32).all()  # as only a balanced sequence does


def test_nsga2_finds_the_whole_front():
    points = search("nsga2", Draw((None,) * 4, 2, 1600, 40, 1))
    samples = search("samples", Draw((None,) * 4, 2, 1600, 1, 1))
    front = np.linspace(0.25, 0.75, 11)[:, None, None] * np.ones(4)
    furthest, by_chance = (
        np.min(np.linalg.norm(drawn - front, axis=-1), axis=1).max() for drawn in (points, samples)
    )
    assert furthest < 0.8 * by_chance


def test_nsga2_stays_on_the_cells():
    points = search("nsga2", Draw((5, 6), 2, 200, 10, 1))
    np.testing.assert_array_equal(points, snap(points, (5, 6)))
    assert len(np.unique(points, axis=0)) == 30


def with_wall(point):
    """The sum grows towards (1, 1), but x + y must not exceed 1.2; x < 0.1 cannot be evaluated."""
    if point[0] < 0.1:
        return Trial(np.zeros(1), 0.0, INFEASIBLE)
    score = 2.0 * point[0] + point[1]
    return Trial(np.array([-score]), score, max(0.0, point.sum() - 1.2))


@pytest.mark.parametrize("method", ["differential_evolution", "nsga2"])
def test_optimisers_find_the_best_feasible_point(method):
    points = search(method, Draw(CONTINUOUS, 1, 3000, 30, 2), with_wall)
    trials = [with_wall(point) for point in points]
    best = max((t.score, *p) for t, p in zip(trials, points, strict=True) if not t.violation)
    assert best == pytest.approx((2.2, 1.0, 0.2), abs=0.02)


def test_points_are_moved_to_the_middle_of_their_cells():
    points = np.array([[0.0, 0.3], [0.49, 0.3], [1.0, 0.3]])
    np.testing.assert_allclose(snap(points, (2, None)), [[0.25, 0.3], [0.25, 0.3], [0.75, 0.3]])
