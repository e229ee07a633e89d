# SPDX-License-Identifier: Apache-2.0
"""Averages against fine grids and closed forms: the error that is stated is kept."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from leg_kinematics import ParallelDrive, ValueRangeError
from leg_kinematics.mechanisms import GantryHybrid, TheoJansen
from leg_kinematics.mirrored import Mirrored
from leg_statics.design.averages import FEWEST_POINTS, average, heights_by_volume
from leg_statics.indices import evaluate_indices
from leg_statics.published import paper_000
from leg_statics.published.grid_means import grid_means
from leg_statics.workspace import sample_workspace

STAGES = paper_000.legs()
THREE = ["condition_number", "unit_effort_capacity", "unit_moment_effort"]


def indices(leg, names=THREE):
    return lambda posture: evaluate_indices(leg, posture, names)[1]


def nothing(posture):
    return np.empty((*np.shape(posture.status), 0))


@cache
def truth(stage):
    """Means, volume and usable share on a fine grid; they are known to better than 0.1 %."""
    fine = grid_means(STAGES[stage], THREE, 56)
    return np.array([*fine.values, fine.volume, fine.usable])


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("tolerance", [0.02, 0.01, 0.005])
def test_the_stated_error_holds_against_a_fine_grid(stage, tolerance):
    leg = STAGES[stage]
    found = average(leg, indices(leg), tolerance)
    assert found.error <= tolerance
    deviations = np.abs([*found.values, found.volume, found.usable] / truth(stage) - 1.0)
    stated = np.array([*found.errors, found.volume_error, found.usable_error])
    assert np.all(deviations <= stated + 0.001)


def test_the_interval_holds_the_truth_as_often_as_it_says():
    leg = STAGES["optimised"]
    runs = [average(leg, indices(leg), 0.05, seed=seed) for seed in range(40)]
    held = np.array(
        [np.abs(run.values / truth("optimised")[:3] - 1.0) <= run.errors for run in runs]
    )
    assert held.mean() >= 0.9  # 95 % are expected, 120 intervals are looked at
    assert len({run.values[0] for run in runs}) == len(runs)


def test_a_smaller_tolerance_takes_more_poses():
    leg = STAGES["initial"]
    points = [average(leg, indices(leg), tolerance).points for tolerance in (0.05, 0.01, 0.005)]
    assert FEWEST_POINTS == points[0] < points[1] < points[2]


def test_the_workspace_of_a_crank_is_as_long_as_the_foot_curve():
    leg = TheoJansen()
    q = np.linspace(*leg.joint_limits[0], 20_001)[:, None]
    foot = leg.forward(q).foot_position
    pieces = np.linalg.norm(np.diff(foot, axis=0), axis=-1)
    found = average(leg, lambda posture: posture.foot_position[..., 2:], 1e-3)
    assert found.volume == pytest.approx(pieces.sum(), rel=found.volume_error + 1e-6)
    middle = 0.5 * (foot[1:, 2] + foot[:-1, 2])
    assert found.values[0] == pytest.approx(
        np.average(middle, weights=pieces), rel=found.errors[0] + 1e-6
    )


def test_four_actuators_are_averaged_as_on_a_grid():
    leg = GantryHybrid()
    fine = grid_means(leg, ["condition_number"], 18)
    found = average(leg, indices(leg, ["condition_number"]), 0.02)
    assert found.error <= 0.02
    np.testing.assert_allclose(found.values, fine.values, rtol=0.02)
    assert found.volume == pytest.approx(fine.volume, rel=0.02)


def test_averages_of_the_mirror_image_and_of_the_same_question_are_the_same():
    leg = STAGES["initial"]
    first, again = (average(leg, indices(leg), 0.02) for _ in range(2))
    mirrored = average(Mirrored(leg), indices(Mirrored(leg)), 0.02)
    np.testing.assert_array_equal(first.values, again.values)
    np.testing.assert_allclose(first.values, mirrored.values, rtol=1e-12)
    assert first.volume == pytest.approx(mirrored.volume, rel=1e-12)


def test_designs_are_compared_more_closely_than_each_is_known():
    exact = [truth(stage)[:3] for stage in STAGES]
    coarse = [average(leg, indices(leg), 0.03).values for leg in STAGES.values()]
    errors = [np.abs(c / t - 1.0) for c, t in zip(coarse, exact, strict=True)]
    of_ratio = np.abs((coarse[1] / coarse[0]) / (exact[1] / exact[0]) - 1.0)
    assert np.max(of_ratio) < np.max(errors)


def test_a_constant_is_known_exactly():
    found = average(STAGES["initial"], lambda p: np.full((*p.status.shape, 1), 7.0), 0.05)
    np.testing.assert_allclose(found.values, 7.0)
    assert found.errors[0] == pytest.approx(0.0, abs=1e-12)


def test_an_integral_that_does_not_exist_is_given_up_early():
    # its loops fold within the actuator ranges, where the foot's velocity is not bounded
    leg = replace(ParallelDrive(), drive_lever=0.100)
    found = average(leg, indices(leg), 0.01)
    assert found.error > 0.01
    assert found.points < 2**15
    infinite = average(leg, lambda p: np.full((*p.status.shape, 1), np.inf), 0.01)
    assert infinite.values[0] == np.inf == infinite.error
    assert infinite.points == FEWEST_POINTS


def test_a_workspace_without_a_pose_is_empty():
    leg = replace(ParallelDrive(), passive_joint_ranges=((0.0, 0.0),) * 9)
    found = average(leg, indices(leg), 0.01)
    assert (found.usable, found.volume, found.points) == (0.0, 0.0, FEWEST_POINTS)
    assert np.isnan(found.values).all()
    assert found.error == np.inf
    assert not len(heights_by_volume(leg, 5))


def test_too_few_poses_are_refused():
    with pytest.raises(ValueRangeError, match=f"most_points must be >= {FEWEST_POINTS}, got 511"):
        average(STAGES["initial"], nothing, most_points=511)


def test_heights_part_the_volume_equally():
    leg = STAGES["initial"]
    sample = sample_workspace(leg, 33)
    heights = heights_by_volume(leg, 6)
    below = [
        np.sum(sample.volume[sample.posture.foot_position[:, 2] < h]) / np.sum(sample.volume)
        for h in heights
    ]
    np.testing.assert_allclose(below, (np.arange(6) + 0.5) / 6, atol=0.03)
