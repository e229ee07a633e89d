# SPDX-License-Identifier: Apache-2.0
"""Load capacity against exact arithmetic, where planes pass through zero or many meet in a point.

The oracle enumerates in rational and 60-digit arithmetic. It works with the force itself, not with
its direction as the suite does: the set of admissible forces has no line in it, so the greatest
normal force is at the apex of the cone, where a plane touches the cone's rim, where two planes meet
on the cone, or where three planes meet. Whether a direction is open to any force is decided in
fractions, without rounding.
"""

from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import combinations
from math import inf

import numpy as np
import pytest

from leg_statics.capacity.problem import CapacityStatus, load_capacity

DIGITS = 60
CLOSE = Decimal("1e-40")
ONE_SIDED = [(0.0, np.inf), (-np.inf, 0.0), (-0.0, np.inf), (-2.0, np.inf), (-np.inf, 1.0)]
LIMITS = [*ONE_SIDED, (-1.0, 1.0), (0.0, 1.0), (-1.0, -0.0), (-0.0, 0.0), (-np.inf, np.inf)]


@pytest.mark.parametrize("joints", [1, 2, 3, 4])
@pytest.mark.parametrize("biased", [False, True])
def test_capacity_equals_exact_arithmetic_with_small_whole_numbers(joints, biased):
    rng = np.random.default_rng(joints)
    outcomes = set()
    for _ in range(300):
        jacobian = rng.integers(-2, 3, (3, joints)).astype(float)
        lower, upper = np.array([LIMITS[k] for k in rng.integers(0, len(LIMITS), joints)]).T
        friction = rng.choice([0.0, 0.4, 0.5, 1.0, 2.0])
        bias = 0.5 * rng.integers(-2, 3, joints) if biased else np.zeros(joints)
        exact = exact_capacity(jacobian, lower, upper, friction, bias)
        found = load_capacity(jacobian, lower, upper, friction, bias_efforts=bias)
        outcomes.add(int(found.status))
        assert found.capacity == pytest.approx(exact, rel=1e-12, abs=1e-12, nan_ok=True)
        if found.status == CapacityStatus.BOUNDED:
            assert_is_admissible(found.force, jacobian, lower, upper, friction, bias)
    assert outcomes >= {CapacityStatus.BOUNDED, CapacityStatus.UNBOUNDED}
    assert not biased or CapacityStatus.INFEASIBLE in outcomes


@pytest.mark.parametrize("friction", [1e-300, 1e-160, 1e-20, 1e-8])
def test_force_stays_in_a_cone_that_is_almost_a_line(friction):
    rng = np.random.default_rng(5)
    for _ in range(200):
        jacobian = rng.integers(-2, 3, (3, 3)).astype(float)
        lower, upper = np.array([LIMITS[k] for k in rng.integers(0, len(LIMITS), 3)]).T
        exact = exact_capacity(jacobian, lower, upper, friction, np.zeros(3))
        found = load_capacity(jacobian, lower, upper, friction)
        assert found.capacity == pytest.approx(exact, rel=1e-12, abs=1e-12)
        if found.status == CapacityStatus.BOUNDED:
            assert_is_admissible(found.force, jacobian, lower, upper, friction, np.zeros(3))


def test_limits_of_negative_zero_are_those_of_zero():
    zero, negative = np.zeros(3), np.full(3, -0.0)
    jacobian = np.diag([1.0, 1.0, 0.0])  # the third joint feels no force
    for lower in (zero, negative):
        for upper in (zero, negative):
            assert load_capacity(jacobian, lower, upper, 0.5).status == CapacityStatus.UNBOUNDED


def assert_is_admissible(force, jacobian, lower, upper, friction, bias):
    efforts = bias - jacobian.T @ force
    rounding = 1e-14 * (1.0 + np.abs(force).sum() * np.abs(jacobian).max())
    assert np.all(efforts >= lower - rounding)
    assert np.all(efforts <= upper + rounding)
    assert np.hypot(force[0], force[1]) <= friction * force[2] * (1.0 + 1e-12)


# --- the oracle ---------------------------------------------------------------------------------


def exact_capacity(jacobian, lower, upper, friction, bias):
    """Return the load capacity as a float: infinite if unbounded, NaN if no force is admissible."""
    with localcontext() as context:
        context.prec = DIGITS
        mu = Fraction(float(friction))
        planes = _planes(jacobian, lower, upper, bias)
        unbounded = _any_direction_is_open(planes, mu)
        greatest = _greatest_normal_force([_decimal(*plane) for plane in planes], _number(mu))
        if greatest is None:
            return float("nan")
        return inf if unbounded else float(greatest)


def _planes(jacobian, lower, upper, bias):
    """Return the limits as pairs (a, b) of a·F <= b."""
    planes = []
    for column, least, most, effort in zip(np.transpose(jacobian), lower, upper, bias, strict=True):
        a, effort = tuple(Fraction(float(value)) for value in column), Fraction(float(effort))
        if least > -inf:
            planes.append((a, effort - Fraction(float(least))))
        if most < inf:
            planes.append((tuple(-value for value in a), Fraction(float(most)) - effort))
    return planes


def _any_direction_is_open(planes, mu):
    """Tell whether a·(x, y, 1) <= 0 for all planes at a point of the disc of radius mu.

    If there is such a point, the nearest to the centre is the centre itself, the foot of a plane's
    line or the meeting of two lines.
    """
    points = [(Fraction(0), Fraction(0))]
    lines = [a for a, _ in planes if a[0] or a[1]]
    for a in lines:
        square = a[0] ** 2 + a[1] ** 2
        points.append((-a[2] * a[0] / square, -a[2] * a[1] / square))
    for a, c in combinations(lines, 2):
        if (det := a[0] * c[1] - a[1] * c[0]) != 0:
            points.append(((a[1] * c[2] - a[2] * c[1]) / det, (a[2] * c[0] - a[0] * c[2]) / det))
    return any(
        x * x + y * y <= mu * mu and all(a[0] * x + a[1] * y + a[2] <= 0 for a, _ in planes)
        for x, y in points
    )


def _greatest_normal_force(planes, mu):
    """Return the greatest normal component among the extreme forces; None if none is admissible."""
    admissible = [f[2] for f in _extreme_forces(planes, mu) if _is_admissible(f, planes, mu)]
    return max(admissible, default=None)


def _extreme_forces(planes, mu):
    yield Decimal(0), Decimal(0), Decimal(0)
    for a, b in planes:
        slope = (a[0] * a[0] + a[1] * a[1]).sqrt()
        rim = (-mu * a[0] / slope, -mu * a[1] / slope) if slope else (Decimal(0), Decimal(0))
        direction = (*rim, Decimal(1))
        if (value := _inner(a, direction)) != 0:
            yield tuple(b / value * component for component in direction)
    for (a, b), (c, d) in combinations(planes, 2):
        yield from _meetings_on_cone(a, b, c, d, mu)
    for (a, b), (c, d), (e, f) in combinations(planes, 3):
        ce, ea, ac = _cross(c, e), _cross(e, a), _cross(a, c)
        if abs(det := _inner(a, ce)) > CLOSE:
            yield tuple((b * ce[k] + d * ea[k] + f * ac[k]) / det for k in range(3))


def _meetings_on_cone(a, b, c, d, mu):
    """Yield the points of the line a·F = b, c·F = d with x² + y² = mu² z²."""
    direction = _cross(a, c)
    square = _inner(direction, direction)
    if square < CLOSE:
        return
    foot = _cross(tuple(b * c[k] - d * a[k] for k in range(3)), direction)
    foot = tuple(value / square for value in foot)

    def form(u, v):
        return u[0] * v[0] + u[1] * v[1] - mu * mu * u[2] * v[2]

    second, first, constant = form(direction, direction), form(foot, direction), form(foot, foot)
    if abs(second) < CLOSE:
        steps = [-constant / (2 * first)] if abs(first) > CLOSE else [Decimal(0)]
    else:
        discriminant = first * first - second * constant
        root = max(discriminant, Decimal(0)).sqrt() if discriminant > -CLOSE else None
        steps = [] if root is None else [(-first + root) / second, (-first - root) / second]
    for step in steps:
        yield tuple(foot[k] + step * direction[k] for k in range(3))


def _is_admissible(force, planes, mu):
    x, y, z = force
    size = max(abs(x), abs(y), abs(z), Decimal(1))
    in_cone = z >= 0 and x * x + y * y <= mu * mu * z * z + CLOSE * size * size
    return in_cone and all(_inner(a, force) <= b + CLOSE * size for a, b in planes)


def _decimal(a, b):
    return tuple(map(_number, a)), _number(b)


def _number(fraction):
    return Decimal(fraction.numerator) / Decimal(fraction.denominator)


def _inner(a, b):
    return sum(p * q for p, q in zip(a, b, strict=True))


def _cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )
