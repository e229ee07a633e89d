# SPDX-License-Identifier: Apache-2.0
"""Load capacity with any number of joints, any limits and any friction: all candidates are tried.

`problem` explains the problem; `three_joint_capacity` solves the common case quickly.

A force of the cone is F = (x, y, 1) / t in axes whose third is the normal. The limits that may bind
are the planes a·(x, y, 1) <= b t as rows (a, b, joint) of an array; row 0 is t >= 0, of joint -1.
The vectors a have length 1 and the largest |b| is 1. The load F·u is g(x, y) / t, g = u·(x, y, 1),
so that s = t / g is to be smallest. It is where t itself would be if u were the normal, since both
are monotonous along any line: where planes meet, or where one touches the rim.
"""

# The compiler infers the types of this code; only what Python reads is annotated.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any

import numpy as np

from leg_kinematics.kernels.kernel import scalar
from leg_kinematics.kernels.vectors import cross, inner, length
from leg_statics.capacity.three_joint import SAME, dot, force_along


class CapacityStatus(IntEnum):
    """Outcome of one point.

    Attributes:
        BOUNDED: The capacity is finite.
        UNBOUNDED: The structure alone carries a force of the cone; the capacity is infinite.
        INFEASIBLE: No admissible force exists, because the bias is beyond the limits and no load
            brings it back; the capacity is NaN.
        INVALID_INPUT: The Jacobian or the bias of this point is not finite; the capacity is NaN.
    """

    BOUNDED = 0
    UNBOUNDED = 1
    INFEASIBLE = 2
    INVALID_INPUT = 3


BOUNDED = int(CapacityStatus.BOUNDED)
UNBOUNDED = int(CapacityStatus.UNBOUNDED)
INFEASIBLE = int(CapacityStatus.INFEASIBLE)
INVALID_INPUT = int(CapacityStatus.INVALID_INPUT)

ROUNDING = 1e-15  # of a·(x, y, 1) relative to its factors
POWERLESS = 1e-6  # b below which rounding of (x, y) blurs the t at which a plane is met
VAST = 1e100  # limits beyond it are no limits, and none below its reciprocal is left


@scalar
def plane_capacity(
    columns: Any, up: Any, down: Any, friction: float, axes: Any, load: tuple[float, float, float]
) -> tuple[float, tuple[float, float, float], int, bool, int]:
    """Return the load capacity of one point.

    Args:
        columns: Jacobian (3, n).
        up: Room for efforts Jᵀ F > 0 (n,); negative where only a load brings a joint within limits.
        down: Room for efforts Jᵀ F < 0 (n,).
        friction: Friction coefficient.
        axes: Unit vectors, of which the third is the normal.
        load: Direction in which the load counts, along these axes; infinite friction is for one
            along the normal.

    Returns:
        The fields of `LoadCapacity`: capacity, force (a tuple of three), limiting joint, whether
        friction limits, status; the force is that of a load of 1.
    """
    nothing = (math.nan, math.nan, math.nan)
    if not _is_valid(columns, up, down, friction, axes[2], load):
        return math.nan, nothing, -1, False, INVALID_INPUT
    planes, scale = _planes(columns, up, down, axes)
    s, x, y, joint, on_rim, status = _solve_planes(planes, friction, load)
    if status == INFEASIBLE:
        return math.nan, nothing, -1, False, INFEASIBLE
    capacity = scale / s
    force = force_along(axes, 1.0 / dot(load, x, y), x, y)
    total = capacity * (abs(force[0]) + abs(force[1]) + abs(force[2]))
    if status == UNBOUNDED or not total < math.inf:  # or beyond the range of floating point
        return math.inf, force, -1, False, UNBOUNDED
    return capacity, force, int(joint), on_rim or friction == 0.0, BOUNDED


@scalar
def _is_valid(columns, up, down, friction, normal, load):
    """Return whether all numbers are finite but room and friction, and those are in range.

    The limits are in order if some effort is between them, the normal if it points upwards.
    """
    valid = friction >= 0.0 and load[2] > 0.0
    for i in range(3):
        valid &= math.isfinite(normal[i])
    for i in range(columns.shape[1]):
        valid &= up[i] > -math.inf and down[i] > -math.inf and up[i] + down[i] >= 0.0
        for k in range(3):
            valid &= math.isfinite(columns[k, i])
    return valid


@scalar
def _column(columns, i, axes):
    """Return column i of the Jacobian along the axes."""
    column = columns[0, i], columns[1, i], columns[2, i]
    return inner(column, axes[0]), inner(column, axes[1]), inner(column, axes[2])


@scalar
def _planes(columns, up, down, axes):
    """Return the planes of the limits that may bind, and the unit of 1/t."""
    n = columns.shape[1]
    planes = np.zeros((2 * n + 1, 5))
    planes[0, 3], planes[0, 4] = 1.0, -1.0
    filled, scale = 1, 0.0
    for i in range(n):
        column = _column(columns, i, axes)
        size = length(column)
        for sign, room in ((1.0, up[i]), (-1.0, down[i])):
            b = _room_per_length(room, size)
            if b == math.inf:
                continue
            planes[filled, 3], planes[filled, 4] = b, i
            if b > -math.inf:
                scale = max(scale, abs(b))
                for k in range(3):
                    planes[filled, k] = sign * (column[k] / size)
            filled += 1
    if scale == 0.0:
        scale = 1.0
    for row in range(1, filled):
        planes[row, 3] /= scale
    return planes[:filled], scale


@scalar
def _room_per_length(room, size):
    """Return b of a plane: infinite if it never binds, minus infinity if it always forbids."""
    b = room / size if size > 0.0 else (math.inf if room >= 0.0 else -math.inf)
    if abs(b) > VAST:
        return math.copysign(math.inf, b)
    return b if abs(b) > 1.0 / VAST else 0.0


@scalar
def _solve_planes(planes, mu, load):
    """Return the optimum (s, x, y, joint, on_rim) among all candidates, and its status.

    Planes with b < 0 forbid small forces: where the least s is 0, a force is admissible only if a
    positive t is, too.
    """
    s, x, y, joint, on_rim, largest = _search(planes, mu, load)
    if largest == 0.0 and s == 0.0:
        # A force along (x, y, 1), however large, may be added to any, whatever its load: if any
        # force is admissible, one within a wider cone is. In a cone a largest t exists, where g = 1
        # finds it.
        wide = 2.0 + 2.0 * math.hypot(x, y) if mu == math.inf else mu
        largest = _search(planes, wide, (0.0, 0.0, 1.0))[5]
    status = UNBOUNDED if s == 0.0 else BOUNDED
    return s, x, y, joint, on_rim, status if largest > 0.0 else INFEASIBLE


@scalar
def _search(planes, mu, load):
    """Return the optimum (s, x, y, joint, on_rim) among all candidates, and the largest t seen."""
    forbids = False
    for row in range(planes.shape[0]):
        forbids |= planes[row, 3] < 0.0
    largest = 0.0 if forbids else math.inf
    candidates = _candidates(planes, mu, load)
    best, s, cause, square = -1, math.inf, 0, math.inf
    for c in range(candidates.shape[0]):
        x, y, own = candidates[c, 0], candidates[c, 1], candidates[c, 2]
        share = dot(load, x, y)
        if not share > 0.0 or own < 0.0 or (own > s * share * (1.0 + SAME) and not forbids):
            continue
        lowest, highest, lowest_row = _range_above(planes, x, y)
        if lowest == math.inf:
            continue
        largest = max(largest, highest)
        away, least = x * x + y * y, lowest / share
        nearer = least <= s * (1.0 + SAME) and away < square * (1.0 - SAME)
        if least < s * (1.0 - SAME) or nearer:
            best, s, square = c, least, away
            meets = abs(own - lowest) <= SAME * lowest
            cause = 0 if meets else lowest_row
    if best < 0:  # no direction is open to a force: only the zero force is left, if admissible
        return math.inf, 0.0, 0.0, _powerless(planes), mu < math.inf, largest
    joint = planes[cause, 4] if cause > 0 else _heaviest(planes, candidates[best], mu, load)
    x, y, on_rim = candidates[best, 0], candidates[best, 1], candidates[best, 6] > 0.0
    return s, x, y, joint, on_rim, largest


@scalar
def _candidates(planes, mu, load):
    """Return the points that may be optimal as rows (x, y, t, i, j, k, on_rim).

    Planes i, j and k (0 if fewer) meet there at t. Points where they do not are NaN.
    """
    count = planes.shape[0]
    pairs = count * (count - 1) // 2
    candidates = np.zeros((1 + 2 * count + 3 * pairs + pairs * (count - 2) // 3, 7))
    filled = 1  # the first is the centre
    if mu == 0.0:
        return candidates[:filled]
    for i in range(1, count):
        for side in (1.0, -1.0):
            x, y = _touching_on_rim(planes[i], mu, load, side)
            _put(candidates, filled, x, y, dot(planes[i], x, y) / planes[i, 3], i, 0, 0, 1.0)
            filled += 1
        for j in range(i):
            if planes[i, 4] == planes[j, 4]:
                continue
            middle_x, middle_y, half_x, half_y = _chord(planes, i, j, mu)
            teller = i if j > 0 and abs(planes[i, 3]) >= abs(planes[j, 3]) else j
            for step in (0.0, 1.0, -1.0):
                x, y = middle_x, middle_y
                if step != 0.0:
                    x, y = x + step * half_x, y + step * half_y
                t = dot(planes[teller], x, y) / planes[teller, 3]
                _put(candidates, filled, x, y, t, i, j, 0, abs(step))
                filled += 1
            for k in range(j):
                if planes[j, 4] != planes[k, 4]:
                    x, y, t = _vertex(planes, i, j, k, mu)
                    _put(candidates, filled, x, y, t, i, j, k, 0.0)
                    filled += 1
    return candidates[:filled]


@scalar
def _put(candidates, position, x, y, t, i, j, k, on_rim):
    """Write a candidate."""
    candidates[position, 0] = x
    candidates[position, 1] = y
    candidates[position, 2] = t
    candidates[position, 3] = i
    candidates[position, 4] = j
    candidates[position, 5] = k
    candidates[position, 6] = on_rim


@scalar
def _touching_on_rim(plane, mu, load, side):
    """Return where on the rim a·(x, y, 1) / g is least or largest.

    There the line (a - ratio g)·(x, y, 1) = 0 touches the circle. The ratio is a root of the
    quadratic D ratio² - 2 m ratio + c = 0, one for each side. If g is the same everywhere, they are
    the points of the rim in and against the direction of a.
    """
    if mu == math.inf:
        return math.nan, math.nan
    square = mu * mu
    d = load[2] * load[2] - square * (load[0] * load[0] + load[1] * load[1])
    m = plane[2] * load[2] - square * (plane[0] * load[0] + plane[1] * load[1])
    c = plane[2] * plane[2] - square * (plane[0] * plane[0] + plane[1] * plane[1])
    tilt_x = load[2] * plane[0] - plane[2] * load[0]
    tilt_y = load[2] * plane[1] - plane[2] * load[1]
    turn = plane[0] * load[1] - plane[1] * load[0]
    root = mu * math.sqrt(tilt_x * tilt_x + tilt_y * tilt_y - square * turn * turn)
    total = m + math.copysign(root, m)  # m² - D c = root², without cancellation
    ratio = total / d if side == math.copysign(1.0, m) else c / total
    x, y = plane[0] - ratio * load[0], plane[1] - ratio * load[1]
    slope = math.hypot(x, y)
    if not 0.0 < slope < math.inf:
        return math.nan, math.nan
    # ratio g_z - a_z tells on which side of the centre, again without cancellation
    above = square * (tilt_x * -load[0] + tilt_y * -load[1]) + side * root * load[2]
    reach = math.copysign(mu / slope, above / d)
    return reach * x, reach * y


@scalar
def _chord(planes, i, j, mu):
    """Return the middle of the chord above which planes i and j meet, and half of the chord."""
    bi, bj = planes[i, 3], planes[j, 3]
    ex = bj * planes[i, 0] - bi * planes[j, 0]
    ey = bj * planes[i, 1] - bi * planes[j, 1]
    ez = bj * planes[i, 2] - bi * planes[j, 2]
    square = ex * ex + ey * ey
    reach = mu * math.sqrt(square)
    chord = (reach - ez) * (reach + ez)
    if square == 0.0 or not chord >= -SAME * ez * ez:
        return math.nan, math.nan, math.nan, math.nan
    half = math.sqrt(max(chord, 0.0)) / square if mu < math.inf else math.nan
    return -ez / square * ex, -ez / square * ey, -half * ey, half * ex


@scalar
def _vertex(planes, i, j, k, mu):
    """Return the point (x, y, t) where planes i, j and k meet if it lies above the disc.

    Built from perpendicular directions one by one: cofactors would square the condition of nearly
    parallel planes.
    """
    a, third = planes[i], planes[k]
    rest, along = _without(planes[j], a)
    size = length(rest)
    b, _ = _without((rest[0] / size, rest[1] / size, rest[2] / size), a)  # again, for rounding
    c = cross(a, b)
    if k == 0:
        x, y, t = c[0] / c[2], c[1] / c[2], 0.0
    else:
        on_a, on_b = a[3], (planes[j, 3] - along * a[3]) / size
        on_c = (third[3] - inner(third, a) * on_a - inner(third, b) * on_b) / inner(third, c)
        z = on_a * a[2] + on_b * b[2] + on_c * c[2]
        x = (on_a * a[0] + on_b * b[0] + on_c * c[0]) / z
        y = (on_a * a[1] + on_b * b[1] + on_c * c[1]) / z
        t = 1.0 / z
    if not math.hypot(x, y) <= mu:
        return math.nan, math.nan, math.nan
    return x, y, t


@scalar
def _without(b, a):
    """Return b without its component along the unit vector a, and this component."""
    along = inner(b, a)
    return (b[0] - along * a[0], b[1] - along * a[1], b[2] - along * a[2]), along


@scalar
def _range_above(planes, x, y):
    """Return the least and the largest admissible t at a point, and the plane that bounds it below.

    The least is infinite if planes with b <= 0 forbid every t. What exceeds a plane by rounding
    only does not exceed it.
    """
    rounding = ROUNDING * math.sqrt(1.0 + x * x + y * y)
    lowest, highest, lowest_row = 0.0, math.inf, 0
    for row in range(1, planes.shape[0]):
        value, b = dot(planes[row], x, y), planes[row, 3]
        if b > 0.0:
            # the t at which a plane of little power is met is blurred by the rounding of (x, y)
            t = (value - rounding if b < POWERLESS else value) / b
            if value > rounding and t > lowest:
                lowest, lowest_row = t, row
        elif value > rounding:
            return math.inf, 0.0, row
        elif b < 0.0:
            highest = min(highest, (value - rounding) / b if value < -rounding else 0.0)
    if lowest > highest * (1.0 + SAME):
        return math.inf, 0.0, lowest_row
    return lowest, highest, lowest_row


@scalar
def _heaviest(planes, candidate, mu, load):
    """Return the joint whose limit has the largest part b * multiplier of the optimum.

    The multipliers of the limits, and of the cone at its rim, add their vectors up to the load's.
    """
    x, y = candidate[0], candidate[1]
    i, j, k = int(candidate[3]), int(candidate[4]), int(candidate[5])
    a, b = _vector(planes, i), _vector(planes, j)
    on_rim = candidate[6] > 0.0
    if k > 0 or on_rim:
        c = (x, y, -mu * mu) if on_rim else _vector(planes, k)
        pull_a, pull_b = abs(inner(load, cross(b, c))), abs(inner(load, cross(c, a)))
        pull_c = 0.0 if on_rim else abs(inner(load, cross(a, b)))
    else:
        pull_a, pull_b, pull_c = length(cross(load, b)), length(cross(load, a)), 0.0
    joint, most = planes[i, 4], planes[i, 3] * pull_a
    if j > 0 and planes[j, 3] * pull_b > most:
        joint, most = planes[j, 4], planes[j, 3] * pull_b
    if k > 0 and planes[k, 3] * pull_c > most:
        joint = planes[k, 4]
    return joint


@scalar
def _vector(planes, row):
    """Return the vector a of a plane."""
    return planes[row, 0], planes[row, 1], planes[row, 2]


@scalar
def _powerless(planes):
    """Return the joint without power that opposes a normal force most."""
    joint, most = -1.0, -math.inf
    for row in range(1, planes.shape[0]):
        if planes[row, 3] == 0.0 and planes[row, 2] > most:
            joint, most = planes[row, 4], planes[row, 2]
    return joint
