# SPDX-License-Identifier: Apache-2.0
"""The paper's search on a part of its grid."""

from __future__ import annotations

import numpy as np
import pytest

from leg_statics.published import paper_000
from leg_statics.published.comparison import NO_VALUE
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


def test_what_the_paper_says_of_its_maps_is_checked_on_every_plane():
    rows = paper_000.claim_comparisons()
    contradicted = {row.item for row in rows if not row.holds}
    assert contradicted == {
        f"{claim} ({stage})"
        for stage in ("initial", "optimised")
        for claim in (
            "eta_cM falls with h",
            "k_cm falls with h",
            "mu_e varies little with h",
            "k is smaller for y > 0",
            "eta_cM rises, then falls with |x|",
        )
    }
    assert len(rows) == 2 * 17


def test_the_natural_zeros_have_no_mean_where_it_diverges_and_the_others_are_reproduced():
    rows = paper_000.mean_comparisons()
    without = {row.item for row in rows if row.verdict == NO_VALUE}
    assert without == {
        f"mean {symbol}, initial dimensions (natural crank zeros)" for symbol in ("k", "eta_cM")
    }
    assert all(row.holds for row in rows if row.item not in without)


def test_profiles_and_ratios_are_those_of_known_fields():
    x, y = np.linspace(-1.0, 1.0, 21), np.linspace(-2.0, 2.0, 41)
    field = 3.0 + np.abs(x)[:, None] + 0.5 * y[None, :]
    field[np.add.outer(x**2, y**2) > 3.0] = np.nan  # a round workspace
    s = paper_000.Slices(np.zeros(1), x, y, field[None, ..., None], ("f",))
    assert s.asymmetry < 1e-12
    far = s.profile("f", "x")[0]
    np.testing.assert_allclose(far, 3.0 + x[10:], rtol=1e-12)  # y cancels
    assert s.forward_ratio("f")[0] > 1.0
    reverse = s._replace(values=s.values[:, :, ::-1])
    np.testing.assert_allclose(reverse.forward_ratio("f"), 1.0 / s.forward_ratio("f"))
