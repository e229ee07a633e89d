# SPDX-License-Identifier: Apache-2.0
"""The workspace: what its grids, bounds, heights and sections hold is what the leg reaches."""

from __future__ import annotations

import numpy as np
import pytest

from leg_kinematics import Leg, NotSupportedError, ParallelDrive, Status, ValueRangeError
from leg_kinematics.mechanisms import DoubleRhombus, GantryHybrid, TheoJansen
from leg_statics.maps import plane_map
from leg_statics.workspace import (
    actuator_grid,
    initial_height,
    is_spatial_leg,
    sample_workspace,
    typical_heights,
    vertical_section,
    workspace_bounds,
)

LEG = ParallelDrive()


def test_the_grid_holds_the_mid_points_of_the_actuator_box():
    grid = actuator_grid(LEG, 3)
    assert grid.shape == (27, 3)
    np.testing.assert_allclose(np.unique(np.degrees(grid)), [-14.0, 0.0, 14.0], atol=1e-12)
    with pytest.raises(ValueRangeError, match="points_per_joint"):
        actuator_grid(LEG, 0)


def test_a_workspace_without_volume_is_refused():
    with pytest.raises(NotSupportedError, match="its workspace has no volume"):
        sample_workspace(TheoJansen(), 3)


def test_only_a_point_foot_moved_by_three_actuators_fills_a_space():
    assert is_spatial_leg(LEG)
    assert not is_spatial_leg(TheoJansen())
    assert not is_spatial_leg(GantryHybrid())


def test_bounds_hold_every_reachable_point():
    bounds = workspace_bounds(LEG)
    q = np.random.default_rng(1).uniform(*LEG.joint_limits.T, (50_000, 3))
    posture = LEG.forward(q)
    foot = posture.foot_position[posture.status == Status.OK]
    assert np.all(foot >= bounds[:, 0])
    assert np.all(foot <= bounds[:, 1])


@pytest.mark.parametrize("mechanism", [LEG, DoubleRhombus()])
def test_typical_heights_lie_in_the_workspace_and_differ(mechanism):
    heights = typical_heights(mechanism)
    assert len(np.unique(heights)) == 6
    for height in heights:
        assert np.isfinite(plane_map(Leg.of(mechanism), height, 0.05).values).any()


@pytest.mark.parametrize("axis", [0, 1])
def test_a_section_tells_what_the_leg_reaches_in_the_plane_through_the_foot(axis):
    foot = np.array([0.03, -0.05, initial_height(LEG)])
    section = vertical_section(LEG, foot, axis)
    bounds = workspace_bounds(LEG)
    assert (section.across[0], section.across[-1]) == tuple(bounds[axis])
    assert (section.z[0], section.z[-1]) == tuple(bounds[2])
    assert 0.1 < section.inside.mean() < 0.9
    for row, column in np.random.default_rng(0).integers(len(section.z), size=(50, 2)):
        point = foot.copy()
        point[axis], point[2] = section.across[column], section.z[row]
        assert section.inside[row, column] == (LEG.inverse(point).status == Status.OK)
