# SPDX-License-Identifier: Apache-2.0
"""The Pareto front of a stream, against comparing every pair."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leg_statics.design.search.pareto import ParetoFront


def brute_force(costs):
    """Return the indices of the entries that no other beats; of equals the first."""
    return {
        i
        for i, a in enumerate(costs)
        if not any(np.all(b <= a) and np.any(b < a) for b in costs)
        and not any(np.array_equal(b, a) for b in costs[:i])
    }


def front_of(costs):
    front = ParetoFront(costs.shape[1])
    for i, row in enumerate(costs):
        front.add(row, i)
    return front


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_front_equals_brute_force_on_random_costs(count):
    costs = np.random.default_rng(count).random((300, count))
    front = front_of(costs)
    assert set(front.entries) == brute_force(costs)
    np.testing.assert_array_equal(front.costs, costs[front.entries])
    assert np.all(np.diff(front.costs[:, 0]) >= 0.0)


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=40))
def test_front_equals_brute_force_with_many_equal_costs(pairs):
    costs = np.array(pairs, float)
    assert set(front_of(costs).entries) == brute_force(costs)
