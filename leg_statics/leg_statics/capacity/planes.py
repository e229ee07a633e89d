# SPDX-License-Identifier: Apache-2.0
"""Load capacity with any number of joints, any limits and any friction: all candidates are tried.

`problem` explains the problem; `three_joint_capacity` solves the common case quickly.

The limits are the planes a·(x, y, 1) <= b s as rows (a, b) of an array. Row 0 is s >= 0; joint i
has the rows 2 i + 1 and 2 i + 2. The vectors a have length 1 and the largest |b| is 1.
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
POWERLESS = 1e-6  # b below which rounding of (x, y) blurs the s at which a plane is met
VAST = 1e100  # limits beyond it are no limits, and none below its reciprocal is left


@scalar
def plane_capacity(
    jacobian: Any, up: Any, down: Any, friction: float, axes: Any
) -> tuple[float, tuple[float, float, float], int, bool, int]:
    """Return the load capacity of one point.

    Args:
        jacobian: Jacobian (3, n).
        up: Room for efforts Jᵀ F > 0 (n,); negative where only a load brings a joint within limits.
        down: Room for efforts Jᵀ F < 0 (n,).
        friction: Friction coefficient.
        axes: The vectors across, along, normal of F = (x, y, 1) / s, see `problem.load_axes`.

    Returns:
        The fields of `LoadCapacity`: capacity, force (a tuple of three), limiting joint, whether
        friction limits, status.
    """
    nothing = (math.nan, math.nan, math.nan)
    if not _is_valid(jacobian, up, down, friction, axes[2]):
        return math.nan, nothing, -1, False, INVALID_INPUT
    planes, scale = _planes(jacobian, up, down, axes)
    s, x, y, joint, on_rim, status = _solve_planes(planes, friction)
    if status == INFEASIBLE:
        return math.nan, nothing, -1, False, INFEASIBLE
    capacity = scale / s
    if status == UNBOUNDED or capacity == math.inf:
        return math.inf, nothing, -1, False, UNBOUNDED
    force = force_along(axes, capacity, x, y)
    if not (math.isfinite(force[0]) and math.isfinite(force[1]) and math.isfinite(force[2])):
        return math.inf, nothing, -1, False, UNBOUNDED  # beyond the range of floating point
    return capacity, force, int(joint), on_rim or friction == 0.0, BOUNDED


@scalar
def _is_valid(jacobian, up, down, friction, normal):
    """Return whether all numbers are finite but room and friction, and those are in range.

    The limits are in order if some effort is between them.
    """
    valid = friction >= 0.0
    for i in range(3):
        valid &= math.isfinite(normal[i])
    for i in range(jacobian.shape[1]):
        valid &= up[i] > -math.inf and down[i] > -math.inf and up[i] + down[i] >= 0.0
        for k in range(3):
            valid &= math.isfinite(jacobian[k, i])
    return valid


@scalar
def _column(jacobian, i, axes):
    """Return column i of the Jacobian along the axes."""
    column = jacobian[0, i], jacobian[1, i], jacobian[2, i]
    return inner(column, axes[0]), inner(column, axes[1]), inner(column, axes[2])


@scalar
def _planes(jacobian, up, down, axes):
    """Return the planes, and the unit of 1/s; a limit that cannot bind repeats row 0."""
    n = jacobian.shape[1]
    planes = np.zeros((2 * n + 1, 4))
    planes[0, 3] = math.inf
    scale = 0.0
    for i in range(n):
        column = _column(jacobian, i, axes)
        size = length(column)
        for row, sign, room in ((2 * i + 1, 1.0, up[i]), (2 * i + 2, -1.0, down[i])):
            b = _room_per_length(room, size)
            planes[row, 3] = b
            if abs(b) < math.inf:
                scale = max(scale, abs(b))
                for k in range(3):
                    planes[row, k] = sign * (column[k] / size)
    if scale == 0.0:
        scale = 1.0
    for row in range(2 * n + 1):
        planes[row, 3] = 1.0 if planes[row, 3] == math.inf else planes[row, 3] / scale
    return planes, scale


@scalar
def _room_per_length(room, size):
    """Return b of a plane: infinite if it never binds, minus infinity if it always forbids."""
    b = room / size if size > 0.0 else (math.inf if room >= 0.0 else -math.inf)
    if abs(b) > VAST:
        return math.copysign(math.inf, b)
    return b if abs(b) > 1.0 / VAST else 0.0


@scalar
def _solve_planes(planes, mu):
    """Return the optimum (s, x, y, joint, on_rim) among all candidates, and its status.

    Planes with b < 0 forbid small forces: where the least s is 0, a force is admissible only if a
    positive s is, too.
    """
    s, x, y, joint, on_rim, largest = _search(planes, mu)
    if largest == 0.0 and s == 0.0 and mu == math.inf:
        # A force along (x, y, 1), however large, may be added: if any force is admissible, one
        # within a wider cone is. In a cone, unlike in a half-space, a largest s exists.
        largest = _search(planes, 2.0 + 2.0 * math.hypot(x, y))[5]
    status = UNBOUNDED if s == 0.0 else BOUNDED
    return s, x, y, joint, on_rim, status if largest > 0.0 else INFEASIBLE


@scalar
def _search(planes, mu):
    """Return the optimum (s, x, y, joint, on_rim) among all candidates, and the largest s seen."""
    forbids = False
    for row in range(planes.shape[0]):
        forbids |= planes[row, 3] < 0.0
    largest = 0.0 if forbids else math.inf
    candidates = _candidates(planes, mu)
    best, s, cause, square = -1, math.inf, 0, math.inf
    for c in range(candidates.shape[0]):
        candidate = candidates[c]
        own = candidate[2]
        if own < 0.0 or (own > s * (1.0 + SAME) and not forbids) or math.isnan(candidate[0]):
            continue
        lowest, highest, lowest_row = _range_above(planes, candidate[0], candidate[1])
        if lowest == math.inf:
            continue
        largest = max(largest, highest)
        away = candidate[0] * candidate[0] + candidate[1] * candidate[1]
        nearer = lowest <= s * (1.0 + SAME) and away < square * (1.0 - SAME)
        if lowest < s * (1.0 - SAME) or nearer:
            best, s, square = c, lowest, away
            meets = abs(own - lowest) <= SAME * lowest
            cause = 0 if meets else lowest_row
    if best < 0:  # no direction is open to a force: only the zero force is left, if admissible
        return math.inf, 0.0, 0.0, _powerless(planes), mu < math.inf, largest
    joint = _joint_of(cause) if cause > 0 else _heaviest(planes, candidates[best])
    x, y, on_rim = candidates[best, 0], candidates[best, 1], candidates[best, 6] > 0.0
    return s, x, y, float(joint), on_rim, largest


@scalar
def _joint_of(row):
    """Return the joint of a plane, -1 for the plane s >= 0."""
    return (row + 1) // 2 - 1


@scalar
def _candidates(planes, mu):
    """Return the points that may be optimal as rows (x, y, s, i, j, k, on_rim).

    Planes i, j and k (0 if fewer) meet there at s. Points where they do not are NaN.
    """
    count = planes.shape[0]
    pairs = count * (count - 1) // 2
    candidates = np.zeros((1 + count + 3 * pairs + pairs * (count - 2) // 3, 7))
    filled = 1  # the first is the centre
    if mu == 0.0:
        return candidates[:filled]
    for i in range(1, count):
        x, y = _lowest_on_rim(planes, i, mu)
        _put(candidates, filled, x, y, dot(planes[i], x, y) / planes[i, 3], i, 0, 0, 1.0)
        filled += 1
        for j in range(i):
            if _joint_of(i) == _joint_of(j):
                continue
            middle_x, middle_y, half_x, half_y = _chord(planes, i, j, mu)
            teller = i if j > 0 and abs(planes[i, 3]) >= abs(planes[j, 3]) else j
            for step in (0.0, 1.0, -1.0):
                x, y = middle_x, middle_y
                if step != 0.0:
                    x, y = x + step * half_x, y + step * half_y
                s = dot(planes[teller], x, y) / planes[teller, 3]
                _put(candidates, filled, x, y, s, i, j, 0, abs(step))
                filled += 1
            for k in range(j):
                if _joint_of(j) != _joint_of(k):
                    x, y, s = _vertex(planes, i, j, k, mu)
                    _put(candidates, filled, x, y, s, i, j, k, 0.0)
                    filled += 1
    return candidates[:filled]


@scalar
def _put(candidates, position, x, y, s, i, j, k, on_rim):
    """Write a candidate."""
    candidates[position, 0] = x
    candidates[position, 1] = y
    candidates[position, 2] = s
    candidates[position, 3] = i
    candidates[position, 4] = j
    candidates[position, 5] = k
    candidates[position, 6] = on_rim


@scalar
def _lowest_on_rim(planes, i, mu):
    """Return the point of the rim above which plane i is lowest."""
    slope = math.hypot(planes[i, 0], planes[i, 1])
    if slope == 0.0 or mu == math.inf:
        return math.nan, math.nan
    return -mu * planes[i, 0] / slope, -mu * planes[i, 1] / slope


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
    """Return the point (x, y, s) where planes i, j and k meet if it lies above the disc.

    Built from perpendicular directions one by one: cofactors would square the condition of nearly
    parallel planes.
    """
    a, third = planes[i], planes[k]
    rest, along = _without(planes[j], a)
    size = length(rest)
    b, _ = _without((rest[0] / size, rest[1] / size, rest[2] / size), a)  # again, for rounding
    c = cross(a, b)
    if k == 0:
        x, y, s = c[0] / c[2], c[1] / c[2], 0.0
    else:
        on_a, on_b = a[3], (planes[j, 3] - along * a[3]) / size
        on_c = (third[3] - inner(third, a) * on_a - inner(third, b) * on_b) / inner(third, c)
        z = on_a * a[2] + on_b * b[2] + on_c * c[2]
        x = (on_a * a[0] + on_b * b[0] + on_c * c[0]) / z
        y = (on_a * a[1] + on_b * b[1] + on_c * c[1]) / z
        s = 1.0 / z
    if not math.hypot(x, y) <= mu:
        return math.nan, math.nan, math.nan
    return x, y, s


@scalar
def _without(b, a):
    """Return b without its component along the unit vector a, and this component."""
    along = inner(b, a)
    return (b[0] - along * a[0], b[1] - along * a[1], b[2] - along * a[2]), along


@scalar
def _range_above(planes, x, y):
    """Return the least and the largest admissible s at a point, and the plane that bounds it below.

    The least is infinite if planes with b <= 0 forbid every s. What exceeds a plane by rounding
    only does not exceed it.
    """
    rounding = ROUNDING * math.sqrt(1.0 + x * x + y * y)
    lowest, highest, lowest_row = 0.0, math.inf, 0
    for row in range(1, planes.shape[0]):
        value, b = dot(planes[row], x, y), planes[row, 3]
        if b > 0.0:
            # the s at which a plane of little power is met is blurred by the rounding of (x, y)
            s = (value - rounding if b < POWERLESS else value) / b
            if value > rounding and s > lowest:
                lowest, lowest_row = s, row
        elif value > rounding:
            return math.inf, 0.0, row
        elif b < 0.0:
            highest = min(highest, (value - rounding) / b if value < -rounding else 0.0)
    if lowest > highest * (1.0 + SAME):
        return math.inf, 0.0, lowest_row
    return lowest, highest, lowest_row


@scalar
def _heaviest(planes, candidate):
    """Return the joint whose limit has the largest part b * multiplier of the optimum."""
    x, y = candidate[0], candidate[1]
    i, j, k = int(candidate[3]), int(candidate[4]), int(candidate[5])
    a, b, c = planes[i], planes[j], planes[k]
    if i > 0 and j > 0 and k > 0:
        pull_a, pull_b, pull_c = cross(b, c)[2], cross(c, a)[2], cross(a, b)[2]
    elif candidate[6] > 0.0:
        pull_a, pull_b, pull_c = x * b[1] - y * b[0], x * a[1] - y * a[0], 0.0
    else:
        pull_a, pull_b, pull_c = math.hypot(b[0], b[1]), math.hypot(a[0], a[1]), 0.0
    joint, most = _joint_of(i), a[3] * abs(pull_a)
    if j > 0 and b[3] * abs(pull_b) > most:
        joint, most = _joint_of(j), b[3] * abs(pull_b)
    if k > 0 and c[3] * abs(pull_c) > most:
        joint = _joint_of(k)
    return joint


@scalar
def _powerless(planes):
    """Return the joint without power that opposes a normal force most."""
    joint, most = -1, -math.inf
    for row in range(1, planes.shape[0]):
        if planes[row, 3] == 0.0 and planes[row, 2] > most:
            joint, most = _joint_of(row), planes[row, 2]
    return float(joint)
