# SPDX-License-Identifier: Apache-2.0
"""The textbook's linkage parts: lengths, sides and rates."""

from __future__ import annotations

import math

import numba
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leg_kinematics.mechanisms.dyads import (
    Point,
    crank_pin,
    dyad,
    dyad_coefficients,
    fixed,
    rigid_point,
    transmission,
    triangle_coefficients,
    turning_rate,
)

STEP = 1e-5


def moving(t: float) -> tuple[Point, Point]:
    """Two points of known motion: a pin on an accelerated crank and one on a slow one."""
    p = crank_pin(fixed(0.3, -0.2), 0.7, 0.4 + 1.3 * t + 0.25 * t * t, 1.3 + 0.5 * t, 0.5)
    q = crank_pin(fixed(3.0, 0.5), 0.4, 2.0 - 0.8 * t, -0.8, 0.0)
    return p, q


def joint_of(t: float, side: float) -> Point:
    p, q = moving(t)
    return dyad(p, q, *dyad_coefficients(p, q, 2.0, 2.5, side))


def tip_of(t: float) -> Point:
    p, _ = moving(t)
    return rigid_point(p, joint_of(t, 1.0), *triangle_coefficients(2.0, 1.5, 1.1, -1.0))


@numba.njit(error_model="numpy")
def assembled(p: Point, q: Point, first: float, second: float, brace: float) -> Point:
    """A joint and a point beside it, compiled: to Python itself a negative number has no root."""
    joint = dyad(p, q, *dyad_coefficients(p, q, first, second, 1.0))
    return rigid_point(p, joint, *triangle_coefficients(first, second, brace, -1.0))


def distance(p: Point, q: Point) -> float:
    return math.hypot(q.x - p.x, q.y - p.y)


def assert_rates_are_derivatives(point_of, t: float) -> None:
    before, here, after = (point_of(t + k * STEP) for k in (-1, 0, 1))
    for value, rate in (("x", "vx"), ("y", "vy"), ("vx", "ax"), ("vy", "ay")):
        slope = (getattr(after, value) - getattr(before, value)) / (2.0 * STEP)
        assert getattr(here, rate) == pytest.approx(slope, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("t", [-0.5, 0.0, 0.7])
def test_rates_of_crank_pin_are_derivatives(t):
    assert_rates_are_derivatives(lambda s: moving(s)[0], t)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("t", [-0.5, 0.0, 0.7])
def test_rates_of_dyad_are_derivatives(t, side):
    assert_rates_are_derivatives(lambda s: joint_of(s, side), t)


@pytest.mark.parametrize("t", [-0.5, 0.0, 0.7])
def test_rates_of_rigid_point_are_derivatives(t):
    assert_rates_are_derivatives(tip_of, t)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_dyad_keeps_lengths_and_lies_on_its_side(side):
    p, q = moving(0.3)
    joint = joint_of(0.3, side)
    assert distance(p, joint) == pytest.approx(2.0, abs=1e-14)
    assert distance(q, joint) == pytest.approx(2.5, abs=1e-14)
    left = (q.x - p.x) * (joint.y - p.y) - (q.y - p.y) * (joint.x - p.x)
    assert math.copysign(1.0, left) == side


def test_triangle_keeps_its_sides():
    p, _ = moving(0.3)
    joint, tip = joint_of(0.3, 1.0), tip_of(0.3)
    assert distance(p, tip) == pytest.approx(1.5, abs=1e-14)
    assert distance(joint, tip) == pytest.approx(1.1, abs=1e-14)


def test_turning_rate_is_that_of_the_crank():
    p, _ = moving(0.3)
    assert turning_rate(fixed(0.3, -0.2), p) == pytest.approx(1.45, abs=1e-14)


def test_transmission_is_the_sine_between_the_bars():
    p, q = fixed(0.0, 0.0), fixed(5.0, 0.0)
    _, across = dyad_coefficients(p, q, 3.0, 4.0, 1.0)
    assert transmission(p, q, across, 3.0, 4.0) == pytest.approx(1.0, abs=1e-15)
    _, across = dyad_coefficients(p, q, 2.0, 3.0, 1.0)
    assert transmission(p, q, across, 2.0, 3.0) == pytest.approx(0.0, abs=1e-6)


def test_stretched_dyad_closes_and_an_open_one_is_nan():
    p, q = fixed(0.1, 0.2), fixed(0.1 + 0.3 * math.cos(0.4), 0.2 + 0.3 * math.sin(0.4))
    assert all(map(math.isfinite, assembled(p, q, 0.1, 0.2, 0.1)[:2]))
    assert all(map(math.isnan, assembled(p, q, 0.1, 0.19, 0.1)))
    assert all(map(math.isnan, assembled(p, q, 0.1, 0.41, 0.1)))


@given(*[st.floats(allow_nan=True, allow_infinity=True)] * 6)
def test_arbitrary_numbers_never_raise(px, py, qx, qy, first, second):
    assert len(assembled(fixed(px, py), fixed(qx, qy), first, second, px)) == 6
