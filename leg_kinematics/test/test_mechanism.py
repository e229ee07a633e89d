"""What every mechanism of the shipped robots has in common."""

from __future__ import annotations

import numpy as np
import pytest

from leg_kinematics import Status, load_robot

SAME = {"rtol": 1e-12, "atol": 1e-12}
LEGS = [
    pytest.param(leg.mechanism, id=f"{robot}-{name}")
    for robot in ("hexapod", "quadruped", "walker", "gantry")
    for name, leg in load_robot(robot).legs.items()
]


def assert_same_posture(one, other):
    for values, wanted in zip(one, other, strict=True):
        np.testing.assert_allclose(values, wanted, **SAME)


@pytest.fixture(params=LEGS)
def mechanism(request):
    return request.param


@pytest.fixture
def joint_positions(mechanism):
    """Positions in and beyond the ranges, one of them not finite."""
    lower, upper = np.clip(mechanism.joint_limits, -7.0, 7.0).T
    wider = 0.2 * (upper - lower)
    rng = np.random.default_rng(4)
    positions = rng.uniform(lower - wider, upper + wider, (200, len(lower)))
    positions[7] = np.nan
    return positions


def both_jacobians(mechanism, posture):
    return np.concatenate([mechanism.jacobian(posture), mechanism.angular_jacobian(posture)], -2)


def test_forward_and_jacobians_in_one_pass_equal_those_one_by_one(mechanism, joint_positions):
    posture, twist = mechanism.forward_with_twist(joint_positions)
    wanted = mechanism.forward(joint_positions)
    assert {Status.OK, Status.INVALID_INPUT} <= set(posture.status)
    assert_same_posture(posture, wanted)
    np.testing.assert_allclose(twist, both_jacobians(mechanism, wanted), **SAME)
    np.testing.assert_allclose(mechanism.twist_jacobian(wanted), twist, **SAME)


def test_inverse_and_jacobians_in_one_pass_equal_those_one_by_one(mechanism, joint_positions):
    feet = mechanism.forward(joint_positions).foot_position
    posture, twist = mechanism.inverse_with_twist(feet)
    wanted = mechanism.inverse(feet)
    assert_same_posture(posture, wanted)
    # one from the sines of a pose, the other from its angles: rounding differs near singularities
    np.testing.assert_allclose(twist, both_jacobians(mechanism, wanted), rtol=1e-9, atol=1e-12)


def test_all_modes_are_solved_in_one_pass_too(mechanism, joint_positions):
    for mode in mechanism.assembly_modes:
        posture, _ = mechanism.forward_with_twist(joint_positions[:20], mode)
        assert_same_posture(posture, mechanism.forward(joint_positions[:20], mode))
