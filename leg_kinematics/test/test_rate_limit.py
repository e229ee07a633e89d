# SPDX-License-Identifier: Apache-2.0
"""A limit of a rate is kept on average, and met by what comes at that rate."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leg_kinematics.nodes.rate_limit import RateLimit

rates = st.floats(0.01, 1000.0)


def passed(limit, times):
    """Return how many messages at these times pass."""
    return sum(limit.allows(time) for time in np.asarray(times).tolist())


@given(rates, st.lists(st.floats(0.0, 0.45), min_size=50, max_size=50))
def test_a_stream_of_the_rate_that_is_allowed_passes_whole_whenever_its_messages_arrive(rate, late):
    arrivals = (np.arange(50) + late) / rate
    assert passed(RateLimit(rate), arrivals) >= 49  # one may come before its turn


@given(rates, rates)
def test_of_a_faster_stream_passes_what_is_allowed(rate, greatest):
    count = 200
    arrivals = np.arange(count) / rate
    allowed = min(count, count / rate * greatest)
    assert passed(RateLimit(greatest), arrivals) == pytest.approx(allowed, abs=2)


@given(rates, st.lists(st.floats(0.0, 1.0), min_size=1, max_size=200))
def test_more_than_allowed_never_passes(rate, pauses):
    arrivals = np.cumsum(pauses)
    span = arrivals[-1] - arrivals[0]
    assert passed(RateLimit(rate), arrivals) <= span * rate * (1.0 + 1e-9) + 2


def test_without_a_limit_everything_passes_and_a_new_limit_counts_from_the_last_one():
    limit = RateLimit(0.0)
    assert passed(limit, [5.0, 5.0, 5.0]) == 3
    limit.rate = 0.1
    assert passed(limit, [14.9]) == 0
    assert passed(limit, [15.1]) == 1


def test_streams_do_not_take_each_others_turns_and_are_forgotten_beyond_a_number():
    limit = RateLimit(1.0, most_streams=2)
    assert [limit.allows(0.0, stream) for stream in "aaab"] == [True, True, False, True]
    assert limit.allows(0.0, "c")
    assert limit.allows(0.0, "a")  # forgotten
