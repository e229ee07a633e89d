# SPDX-License-Identifier: Apache-2.0
"""Shapes of forces, checked against the load capacity."""

import numpy as np
import pytest

from leg_kinematics import NotSupportedError, ParallelDrive, ValueRangeError
from leg_statics.capacity.problem import load_capacity
from leg_statics.force_shapes import EDGES, force_polygon, force_polytope, friction_cone

JACOBIAN = np.array([[0.3, -0.1, 0.05], [0.02, 0.25, -0.2], [-0.1, 0.05, 0.4]])
LIMITS = np.array([[-100.0, 150.0], [-80.0, 80.0], [-60.0, 120.0]])
BIAS = np.array([20.0, -15.0, 40.0])
any_bias = pytest.mark.parametrize("bias", [np.zeros(3), BIAS], ids=["light", "weighted"])


@any_bias
def test_every_corner_of_the_polytope_uses_every_joint_to_a_limit(bias):
    efforts = bias - force_polytope(JACOBIAN, LIMITS, bias) @ JACOBIAN
    assert np.isclose(efforts[..., None], LIMITS).any(axis=-1).all()
    assert len(np.unique(np.round(efforts, 6), axis=0)) == 8


@any_bias
def test_the_highest_corner_is_the_capacity_without_friction_limit(bias):
    capacity = load_capacity(JACOBIAN, *LIMITS.T, np.inf, bias_efforts=bias).capacity
    np.testing.assert_allclose(force_polytope(JACOBIAN, LIMITS, bias)[:, 2].max(), capacity)


def test_twelve_edges_join_eight_corners():
    assert len(EDGES) == 12
    assert np.bincount(np.ravel(EDGES)).tolist() == [3] * 8


def test_there_is_no_polytope_at_a_singularity():
    assert np.isnan(force_polytope(np.diag([1.0, 1.0, 0.0]), LIMITS)).all()


def test_the_rim_of_the_cone_is_where_the_foot_begins_to_slip():
    normal = np.array([0.3, -0.4, 2.0])
    n = normal / np.linalg.norm(normal)
    rim = friction_cone(0.6, normal)
    np.testing.assert_allclose(rim @ n, 1.0)
    np.testing.assert_allclose(np.linalg.norm(rim - n, axis=-1), 0.6)
    np.testing.assert_allclose(rim.mean(axis=0), n)


@any_bias
def test_the_corners_of_the_force_polygon_use_an_actuator_fully(bias):
    leg = ParallelDrive()
    jacobian = leg.jacobian(leg.initial_posture)[[1, 2]]
    limits = np.array([[-150.0, 100.0], [-120.0, 150.0], [-90.0, 60.0]])
    corners = force_polygon(jacobian, limits, bias)
    efforts = bias - corners @ jacobian
    share = np.where(efforts > 0, efforts / limits[:, 1], efforts / limits[:, 0]).max(axis=1)
    assert np.all(corners[:, 1] >= -1e-6)
    np.testing.assert_allclose(share, 1.0, rtol=1e-6)


def test_a_polygon_of_forces_needs_three_actuators_that_push_both_ways():
    with pytest.raises(ValueRangeError, match="lower < bias < upper"):
        force_polygon(JACOBIAN[1:], np.array([[0.0, 1.0]] * 3))
    with pytest.raises(NotSupportedError, match="fewer than three actuators"):
        force_polygon(JACOBIAN[1:, :1], LIMITS[:1])
