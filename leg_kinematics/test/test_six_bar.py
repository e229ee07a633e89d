# SPDX-License-Identifier: Apache-2.0
"""`SixBar`: equation (5) of the paper, its numbers, and the walker made of it."""

from __future__ import annotations

import numpy as np
import pytest

from leg_kinematics import load_robot
from leg_kinematics.gait_curve import gait_curve
from leg_kinematics.mechanisms.six_bar import SixBar
from leg_kinematics.mechanisms.theo_jansen import TheoJansen

LEG = SixBar(crank_length=1.0)
M = np.array([[0.0, -1.0], [1.0, 0.0]])


def foot_by_equation_5(leg, angle):
    """Foot by the matrices A, B, C of equation (5), as printed."""

    def dyad(p, q, first, second):
        """Coefficients of the joint to the right of p -> q."""
        d = np.linalg.norm(q - p)
        along = (d**2 + first**2 - second**2) / (2 * d**2)
        return along, -np.sqrt(first**2 / d**2 - along**2)

    def tip(base, first, second):
        along = (base**2 + first**2 - second**2) / (2 * base**2)
        return along, -np.sqrt(first**2 / base**2 - along**2)

    r_b = np.array([np.cos(angle), np.sin(angle)])
    along, across = tip(1.0, leg.rod_crank, leg.pin_spacing)
    r_e = along * r_b + across * M @ r_b
    r_d = leg.frame_length * np.array([np.cos(leg.frame_angle), np.sin(leg.frame_angle)])
    q3, q4 = dyad(r_b, r_d, leg.coupler, leg.rocker)
    r_c = r_b + q3 * (r_d - r_b) + q4 * M @ (r_d - r_b)
    q5, q6 = dyad(r_c, r_e, leg.foot_lever, leg.rod)
    q1, q2 = tip(leg.foot_lever, leg.foot_bar, leg.foot_brace)
    # (5): r_G = A r_B + B r_E + C r_D with polynomials in M
    a = q3 * q6 * q1 + q3 * q5 * q2 + q4 * q5 * q1 - q4 - q6 * q1 - q5 * q2
    b = q3 * q6 * q2 + q4 * q6 * q1 + q4 * q5 * q2 - q6 * q2
    c = q4 - q3 * q6 * q1 - q3 * q5 * q2 - q4 * q5 * q1
    d = q3 * q6 * q2 + q4 * q6 * q1 + q4 * q5 * q2
    one, m2, m3 = np.eye(2), M @ M, M @ M @ M
    matrix_a = (1 - q3 - q5 * q1 + q3 * q5 * q1) * one + a * M + b * m2 + q4 * q6 * q2 * m3
    matrix_b = q5 * q1 * one + (q6 * q1 + q5 * q2) * M + q6 * q2 * m2
    matrix_c = (q3 - q3 * q5 * q1) * one + c * M - d * m2 - q4 * q6 * q2 * m3
    return matrix_a @ r_b + matrix_b @ r_e + matrix_c @ r_d


def test_foot_agrees_with_equation_5_as_printed():
    for angle in np.linspace(0.0, 6.0, 13):
        x, y = foot_by_equation_5(LEG, angle)
        foot = LEG.forward([angle]).foot_position
        np.testing.assert_allclose(foot, [-x, 0.0, y], rtol=0, atol=1e-12)


def test_default_is_the_optimum_at_168_degrees():
    jansen, curve = gait_curve(TheoJansen(crank_length=1.0)), gait_curve(LEG)
    assert curve.deviation(jansen).max() == pytest.approx(0.2444, abs=5e-5)
    assert curve.step_height == pytest.approx(1.4942, abs=5e-5)
    assert curve.body_fluctuation == pytest.approx(0.0795, abs=5e-5)


def test_walker_has_four_units_of_two_legs_half_a_turn_apart():
    robot = load_robot("walker")
    assert len(robot.legs) == 8
    for unit in ("left_front", "left_rear", "right_front", "right_rear"):
        inner = gait_curve(robot.leg(f"{unit}_inner").mechanism)
        outer = gait_curve(robot.leg(f"{unit}_outer").mechanism)
        half = len(inner.foot) // 2
        np.testing.assert_allclose(np.roll(outer.foot, half, axis=0), inner.foot, atol=1e-12)


def test_walker_has_the_default_leg():
    leg = load_robot("walker").leg("left_front_inner").mechanism
    np.testing.assert_allclose(gait_curve(leg).foot, gait_curve(SixBar()).foot, atol=1e-8)


def test_all_feet_of_the_walker_move_backwards_on_the_ground():
    robot = load_robot("walker")
    for leg in robot.legs.values():
        curve = gait_curve(leg.mechanism)
        path = leg.mount.to_base(curve.support)
        assert (np.diff(path[:, 0]) < 0.0).all()
        np.testing.assert_allclose(path[:, 1], leg.mount.position[1], atol=1e-12)
