# SPDX-License-Identifier: Apache-2.0
"""The paper's search on a part of its grid."""

from __future__ import annotations

import numpy as np
import pytest

from leg_statics.published import paper_000
from leg_statics.published.grid_means import grid_means

BEFORE, AFTER = paper_000.legs().values()
THREE = list(paper_000.MEANS["initial"])
OPTIMUM = tuple(paper_000.OPTIMISED_LENGTHS.values())


@pytest.fixture(scope="module")
def found():
    grid = {
        "drive_lever": [0.100, 0.140, 0.150],
        "parallelogram_link": [0.330, 0.350],
        "shank_length": [0.320, 0.520],
    }
    seen = []
    result = paper_000.search(
        BEFORE, grid, processes=1, progress=lambda all_: (seen.append(e) or e for e in all_)
    )
    assert len(seen) == 12
    return result


def test_the_means_of_the_search_are_known_to_one_percent(found):
    assert found.error <= 0.01
    for means, leg in ((found.before, BEFORE), (found.means[found.find(OPTIMUM)], AFTER)):
        np.testing.assert_allclose(means, grid_means(leg, THREE, 33).values, rtol=0.01)


def test_designs_without_means_are_told(found):
    np.testing.assert_array_equal(found.known, found.designs[:, 0] > 0.105)
    assert all("unit_moment_effort to" in problem for problem in found.problems[~found.known])
    assert not np.any(found.objective[~found.known])


def test_the_objective_is_the_product_of_two_gains(found):
    gain_k = found.before[0] - found.means[:, 0]
    gain_force = found.means[:, 1] - found.before[1]
    better = (gain_k > 0.0) & (gain_force > 0.0) & found.known
    expected = np.where(better, gain_k * gain_force, 0.0)
    np.testing.assert_array_equal(found.objective, expected)
    assert 0 < np.count_nonzero(better) < np.count_nonzero(found.known)
    np.testing.assert_array_equal(np.isfinite(found.steps), better)
    assert np.all(found.steps[better] > paper_000.STEP)


def test_a_design_with_a_shorter_step_than_required_does_not_count(found):
    assert not np.any(found._replace(steps=np.full_like(found.steps, 0.29)).objective)


def test_another_design_than_the_papers_is_the_best(found):
    best = found.designs[np.argmax(found.objective)]
    np.testing.assert_allclose(best, [0.150, 0.350, 0.320])
    assert found.rank(best) == 1 < found.rank(OPTIMUM)
    claim, betters, *_ = paper_000.search_comparisons(found)
    assert not claim.holds
    assert claim.ours.startswith("150, 350, 320 mm")
    assert "12 designs in" in claim.note
    assert betters.holds


def test_the_optimisation_changes_the_means_as_the_table_says():
    for row in paper_000.change_comparisons():
        assert row.published.endswith("%")
        assert np.sign(float(row.ours.split()[0])) == np.sign(float(row.published.split()[0]))
