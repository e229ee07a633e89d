# SPDX-License-Identifier: Apache-2.0
"""Means on a grid against an independent foot-space grid and the paper's printed values."""

from __future__ import annotations

import numpy as np
import pytest

from leg_kinematics import Status
from leg_kinematics.mirrored import Mirrored
from leg_statics.indices import evaluate_indices
from leg_statics.published import paper_000
from leg_statics.published.grid_means import grid_means
from leg_statics.workspace import sample_workspace

STAGES = paper_000.legs()
THREE = ["condition_number", "unit_effort_capacity", "unit_moment_effort"]


@pytest.mark.parametrize("stage", STAGES)
def test_the_published_means_are_reproduced_within_three_percent(stage):
    means = grid_means(STAGES[stage], THREE)
    for name, ours in zip(means.names, means.values, strict=True):
        assert ours == pytest.approx(paper_000.MEANS[stage][name], rel=0.03), name


@pytest.mark.parametrize(
    ("stage", "expected"),
    [("initial", (6.537, 3.516, 1.938)), ("optimised", (6.154, 4.025, 1.894))],
)
def test_the_means_of_the_protocol_are_the_documented_ones(stage, expected):
    means = grid_means(STAGES[stage], THREE)
    np.testing.assert_allclose(means.values, expected, atol=6e-4)


def test_the_natural_crank_zeros_stay_within_five_percent():
    for stage, leg in paper_000.legs(**paper_000.NATURAL_ZEROS).items():
        means = grid_means(leg, THREE)
        published = [paper_000.MEANS[stage][name] for name in means.names]
        np.testing.assert_allclose(means.values, published, rtol=0.0495)


@pytest.mark.parametrize("stage", STAGES)
def test_actuator_grid_equals_a_uniform_grid_over_the_foots_workspace(stage):
    leg = STAGES[stage]
    by_actuators = grid_means(leg, THREE, 33)
    reach = sample_workspace(leg, 33).posture.foot_position
    axes = [np.arange(lo, hi, 0.015) for lo, hi in zip(reach.min(0), reach.max(0), strict=True)]
    posture = leg.inverse(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
    _, values = evaluate_indices(leg, posture, THREE)
    ok = posture.status == Status.OK
    np.testing.assert_allclose(by_actuators.values, values[ok].mean(axis=0), rtol=0.005)
    assert by_actuators.volume == pytest.approx(ok.sum() * 0.015**3, rel=0.01)


def test_means_of_a_mirrored_leg_are_the_same():
    a = grid_means(STAGES["initial"], (), 7)
    b = grid_means(Mirrored(STAGES["initial"]), (), 7)
    np.testing.assert_allclose(a.values, b.values, rtol=1e-12)
    assert a.volume == pytest.approx(b.volume)


def test_the_published_search_has_847_designs():
    assert np.prod([len(values) for values in paper_000.SEARCH_GRID.values()]) == 847


CLAIMS = paper_000.claim_comparisons()
CONTRADICTED = (
    "eta_cM falls with h",
    "k_cm falls with h",
    "mu_e varies little with h",
    "k is smaller for y > 0",
    "eta_cM rises, then falls with |x|",
)


@pytest.mark.parametrize("row", CLAIMS, ids=[row.item for row in CLAIMS])
def test_the_papers_claims_hold_but_for_those_that_are_documented_not_to(row):
    assert row.holds != row.item.startswith(CONTRADICTED), row
