# SPDX-License-Identifier: Apache-2.0
"""Efforts: power conservation, signs and utilisation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from leg_kinematics import ParallelDrive, ShapeError, Status
from leg_kinematics.mirrored import Mirrored
from leg_statics.efforts import joint_efforts, utilisation, worst_moment_efforts

LEG = ParallelDrive()


@pytest.fixture(scope="module")
def postures():
    q = np.random.default_rng(1).uniform(-0.36, 0.36, (4000, 3))
    posture = LEG.forward(q)
    return LEG.forward(q[posture.status == Status.OK])


@pytest.mark.parametrize("leg", [LEG, Mirrored(LEG)], ids=["leg", "mirrored"])
def test_power_is_conserved(leg, postures):
    """What the actuators put in and the ground puts in adds up to nothing."""
    rng = np.random.default_rng(2)
    n = len(postures.status)
    rates, force, moment = rng.normal(size=(3, n, 3))
    posture = leg.forward(postures.joint_positions)
    j, j_omega = leg.jacobian(posture), leg.angular_jacobian(posture)
    tau = joint_efforts(j, j_omega, force, moment)
    v = np.einsum("nij,nj->ni", j, rates)
    omega = np.einsum("nij,nj->ni", j_omega, rates)
    power = np.sum(tau * rates, axis=1) + np.sum(force * v, axis=1) + np.sum(moment * omega, axis=1)
    scale = np.abs(tau * rates).sum(axis=1) + 1.0
    np.testing.assert_allclose(power / scale, 0.0, atol=1e-13)


def test_a_standing_leg_must_push_the_body_up(postures):
    """For small virtual motion the actuators' work lifts the load: tau' dq = -F' dx."""
    posture = LEG.initial_posture
    j = LEG.jacobian(posture)
    tau = joint_efforts(j, LEG.angular_jacobian(posture), [0.0, 0.0, 300.0])
    lowering = np.linalg.solve(j, [0.0, 0.0, -1.0])  # foot goes down relative to the body
    assert tau @ lowering == pytest.approx(300.0)


def test_hard_ground_is_soft_ground_without_moment(postures):
    j, j_omega = LEG.jacobian(postures), LEG.angular_jacobian(postures)
    force = [30.0, -20.0, 400.0]
    np.testing.assert_array_equal(
        joint_efforts(j, j_omega, force), joint_efforts(j, j_omega, force, np.zeros(3))
    )
    both = joint_efforts(j, j_omega, force, [5.0, -3.0, 0.0])
    moment_only = joint_efforts(j, j_omega, [0, 0, 0], [5.0, -3.0, 0.0])
    np.testing.assert_allclose(both, joint_efforts(j, j_omega, force) + moment_only, atol=1e-9)


def test_no_horizontal_unit_moment_needs_more_than_the_worst_case(postures):
    j_omega = LEG.angular_jacobian(postures)
    worst = worst_moment_efforts(j_omega)
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    moments = np.stack([np.sin(angle), np.cos(angle), 0.0 * angle], axis=-1)
    tau = np.abs(joint_efforts(0.0 * j_omega[:, None], j_omega[:, None], np.zeros(3), moments))
    assert np.all(tau <= worst[:, None] + 1e-12)
    np.testing.assert_allclose(tau.max(axis=1), worst, rtol=1e-5)


def test_utilisation_names_the_worst_joint():
    limits = [[-10.0, 20.0], [-5.0, 5.0], [-100.0, 100.0]]
    worst, joint = utilisation([[15.0, 3.0, 50.0], [-9.0, 3.0, 0.0], [0.0, 0.0, 0.0]], limits)
    np.testing.assert_allclose(worst, [0.75, 0.9, 0.0])
    np.testing.assert_array_equal(joint, [0, 0, -1])


def test_limits_may_differ_from_pose_to_pose():
    efforts = np.array([[3.0, -4.0], [3.0, -4.0]])
    limits = np.array([[[-5.0, 5.0], [-5.0, 5.0]], [[-5.0, 4.0], [-8.0, 5.0]]])
    worst, joint = utilisation(efforts, limits)
    np.testing.assert_allclose(worst, [0.8, 0.75])
    np.testing.assert_array_equal(joint, [1, 0])


def test_a_joint_without_power_makes_any_effort_infinite():
    worst, joint = utilisation([[0.0, 1e-9], [2.0, 0.0]], [[-1.0, 1.0], [0.0, 0.0]])
    np.testing.assert_array_equal(worst, [np.inf, 2.0])
    np.testing.assert_array_equal(joint, [1, 0])


@settings(max_examples=200, deadline=None)
@given(hnp.arrays(np.float64, (5, 3), elements=st.floats()))
def test_utilisation_takes_any_floats(efforts):
    worst, joint = utilisation(efforts, [[-10.0, 20.0], [-5.0, 5.0], [0.0, 0.0]])
    nan = np.isnan(efforts).any(axis=1)
    np.testing.assert_array_equal(np.isnan(worst), nan)
    assert np.all(joint[nan] == -1)
    assert np.all(worst[~nan] >= 0.0)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"force": [1.0, 2.0]}, "force"),
        ({"force": np.zeros((5, 3))}, "force"),
        ({"moment": "x"}, "moment"),
    ],
)
def test_wrong_shapes_name_the_argument(arguments, named):
    j = np.ones((4, 3, 3))
    with pytest.raises(ShapeError, match=named):
        joint_efforts(j, j, **({"force": [0.0, 0.0, 1.0]} | arguments))


def test_limits_must_fit_the_joints():
    with pytest.raises(ShapeError, match="effort_limits"):
        utilisation([1.0, 2.0], [[-1.0, 1.0]])
    with pytest.raises(ShapeError, match="efforts"):
        utilisation(1.0, [[-1.0, 1.0]])


def test_any_effort_against_a_limit_of_zero_is_infinitely_much():
    limits = [[0.0, 100.0], [-100.0, 0.0], [-100.0, 100.0]]
    used, joint = utilisation([[-1.0, 0.0, 50.0], [1.0, 1.0, 50.0], [0.0, 0.0, 0.0]], limits)
    np.testing.assert_array_equal(used, [np.inf, np.inf, 0.0])
    np.testing.assert_array_equal(joint, [0, 1, -1])
