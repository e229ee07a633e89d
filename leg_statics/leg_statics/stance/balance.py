# SPDX-License-Identifier: Apache-2.0
"""The one question behind all others about a stance: how many times is a load borne?

The ground exerts a force F_i on each foot that stands. They balance the wrench of all other forces
on the robot, which is a fixed part and t times a growing one:

    sum F_i = -(fixed + t growing)_force       sum p_i x F_i = -(fixed + t growing)_moment
    lower <= (parts_0 + parts_1 t) bias - Jᵀ F <= upper       |F_tangential| <= mu F_n

and the greatest t is sought. Load factor, payload, margins and the best distribution of forces are
this question for other loads; one kernel answers it.
"""

# The compiler infers the types of the scalar code below; only what Python calls is annotated.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math

import numpy as np

from leg_kinematics.kernels.kernel import scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.vectors import cross, inner, length, tangents, unit
from leg_statics.stance.interior_point import (
    COUNT,
    FIXED,
    GROWING,
    GROWTH,
    HAS_CONE,
    INFEASIBLE,
    MATRIX,
    OPTIMAL,
    POINT,
    ROOM,
    ROW,
    ROW_Z,
    ROWS,
    TAU,
    UNBOUNDED,
    T,
    X,
    Z,
    new_arrays,
    of_row,
    solve,
)

ROUGHEST = 1e3  # friction instead of infinity where efforts do not bound the force of a foot
INVALID_INPUT = 4  # besides the statuses of `solve`


@points_kernel(
    "(points,legs),(points,legs,3),(points,legs,3),(points,legs),"
    "(points,legs,3,n),(points,legs,n),(points,legs,n),(points,legs,n),"
    "(points,6),(points,6),(points,2),(points,3)"
    "->(points),(points),(points,legs,3),(points,legs,n),(points,legs)",
    "b1 f8 f8 f8 f8 f8 f8 f8 f8 f8 f8 f8 u1 f8 f8 f8 f8",
)
def greatest_multiple(
    stands,
    position,
    normal,
    friction,
    jacobian,
    lower,
    upper,
    bias,
    fixed,
    growing,
    parts,
    free,
    status,
    multiple,
    force,
    joint_share,
    pull_gain,
):
    """Find the greatest multiple of every stance, forces that attain it, and what limits it.

    If any multiple is borne, the forces are those of each further one. A limit of effort has as its
    share by how much the multiple grows when it is doubled; the pull gain is by how much it grows
    for each newton with which a foot may pull.

    Forces are divided by a unit of force, moments are about the middle of the feet and divided by a
    unit of length besides, and t by a unit such that the growing load has length 1.
    """
    legs, n = jacobian.shape[1], jacobian.shape[3]
    body, columns, limits = new_arrays(legs, 2 * n + 1)
    axes = np.zeros((legs, 3, 3))  # columns: what a unit of g_n, g_1, g_2 is as a force
    leg_of = np.zeros(legs, np.int64)
    joint_of = np.zeros((legs, 2 * n + 1), np.int64)
    for p in range(len(stands)):
        count = 0
        for i in range(legs):
            if stands[p, i]:
                leg_of[count] = i
                count += 1
        body[COUNT] = count
        force[p] = joint_share[p] = pull_gain[p] = multiple[p] = math.nan
        middle, arm = _middle(position[p], leg_of, count)
        strength = 0.0
        for k in range(count):
            i = leg_of[k]
            room = _strength(jacobian[p, i], lower[p, i], upper[p, i], bias[p, i] * parts[p, 0])
            strength = max(strength, room)
        load, growth = _about(fixed[p], middle, arm), _about(growing[p], middle, arm)
        load_size, growth_size = _size(load), _size(growth)
        newton = load_size if load_size > 0.0 else (strength if strength > 0.0 else growth_size)
        newton = newton if newton > 0.0 else 1.0
        unit_of_t = newton / growth_size if growth_size > 0.0 else 1.0
        rows = _moment_axes(free[p])
        fewer = free[p, 0] != 0.0 or free[p, 1] != 0.0 or free[p, 2] != 0.0
        _put_load(body, FIXED, load, rows, fewer, -1.0 / newton)
        _put_load(body, GROWING, growth, rows, fewer, -unit_of_t / newton)
        valid = True
        check = newton + unit_of_t + parts[p, 0] + parts[p, 1] + load_size + growth_size
        for k in range(count):
            i = leg_of[k]
            mu = friction[p, i]
            if mu == math.inf and not _is_limited(lower[p, i], upper[p, i]):
                mu = ROUGHEST
            columns[k, HAS_CONE] = 1.0 if mu < math.inf else 0.0
            direction = unit(normal[p, i])
            first, second = tangents(direction)
            slope = mu if mu < math.inf else 1.0
            offset = (
                (position[p, i, 0] - middle[0]) / arm,
                (position[p, i, 1] - middle[1]) / arm,
                (position[p, i, 2] - middle[2]) / arm,
            )
            for c in range(3):
                vector = direction if c == 0 else (first if c == 1 else second)
                part = 1.0 if c == 0 else slope
                column = (part * vector[0], part * vector[1], part * vector[2])
                moment = cross(offset, column)
                for e in range(3):
                    axes[k, e, c] = column[e]
                    columns[k, MATRIX + 6 * c + e] = column[e]
                    left_out = fewer and e == 2
                    turning = 0.0 if left_out else inner(rows[e], moment)
                    columns[k, MATRIX + 6 * c + 3 + e] = turning
                    check += moment[e]
            valid &= mu >= 0.0
            used = 0
            for j in range(n):
                column = (jacobian[p, i, 0, j], jacobian[p, i, 1, j], jacobian[p, i, 2, j])
                size = length(column) * newton
                idle, idle_growth = bias[p, i, j] * parts[p, 0], bias[p, i, j] * parts[p, 1]
                idle_growth *= unit_of_t
                check += size + idle
                valid &= lower[p, i, j] <= upper[p, i, j]
                valid &= (lower[p, i, j] < math.inf) & (upper[p, i, j] > -math.inf)
                for sign, room in ((1.0, idle - lower[p, i, j]), (-1.0, upper[p, i, j] - idle)):
                    per = max(size, abs(room), abs(idle_growth))
                    if per == math.inf or per == 0.0:
                        continue
                    for c in range(3):
                        limits[k, used, ROW + c] = (
                            sign
                            * newton
                            / per
                            * (
                                column[0] * axes[k, 0, c]
                                + column[1] * axes[k, 1, c]
                                + column[2] * axes[k, 2, c]
                            )
                        )
                    limits[k, used, GROWTH] = -sign * idle_growth / per
                    limits[k, used, ROOM] = room / per
                    joint_of[k, used] = j
                    used += 1
            if columns[k, HAS_CONE] == 0.0:
                limits[k, used, ROW] = -1.0
                limits[k, used, ROW + 1] = limits[k, used, ROW + 2] = 0.0
                limits[k, used, GROWTH] = limits[k, used, ROOM] = 0.0
                joint_of[k, used] = n
                used += 1
            columns[k, ROWS] = used
        if not (valid & math.isfinite(check)):
            status[p] = INVALID_INPUT
            continue
        if count == 0:
            status[p] = OPTIMAL if load_size == 0.0 else INFEASIBLE
            multiple[p] = 0.0 if load_size == 0.0 else math.nan
            continue
        outcome = solve(body, columns, limits)
        status[p] = outcome
        if outcome == OPTIMAL:
            per = 1.0 / body[POINT + TAU]
            multiple[p] = body[POINT + T] * per * unit_of_t
        elif outcome == UNBOUNDED:
            per = 1.0 / (body[POINT + T] * unit_of_t)
            multiple[p] = math.inf
        else:
            continue
        for i in range(legs):
            for c in range(3):
                force[p, i, c] = 0.0
            for j in range(n):
                joint_share[p, i, j] = 0.0
            pull_gain[p, i] = 0.0
        per_gain = per * unit_of_t
        for k in range(count):
            i = leg_of[k]
            for e in range(3):
                for c in range(3):
                    force[p, i, e] += axes[k, e, c] * columns[k, POINT + X + c] * per * newton
            pull_gain[p, i] = columns[k, POINT + Z] * per_gain / newton
            for r in range(int(columns[k, ROWS])):
                z = limits[k, r, of_row(POINT) + ROW_Z] * per_gain
                if joint_of[k, r] == n:
                    pull_gain[p, i] = z / newton
                else:
                    joint_share[p, i, joint_of[k, r]] += z * limits[k, r, ROOM]


@scalar
def _middle(position, leg_of, count):
    """Return the middle of the feet that stand, and the greatest distance from it, or 1 m."""
    x, y, z = 0.0, 0.0, 0.0
    for k in range(count):
        i = leg_of[k]
        x += position[i, 0] / count
        y += position[i, 1] / count
        z += position[i, 2] / count
    arm = 0.0
    for k in range(count):
        i = leg_of[k]
        arm = max(arm, length((position[i, 0] - x, position[i, 1] - y, position[i, 2] - z)))
    return (x, y, z), (arm if arm > 0.0 else 1.0)


@scalar
def _is_limited(lower, upper):
    """Return whether every effort of a leg has limits."""
    limited = True
    for j in range(len(lower)):
        limited &= lower[j] > -math.inf and upper[j] < math.inf
    return limited


@scalar
def _strength(jacobian, lower, upper, idle):
    """Return the force that the weakest joint of a leg bears, 0 if none limits."""
    least = math.inf
    for j in range(jacobian.shape[1]):
        size = length((jacobian[0, j], jacobian[1, j], jacobian[2, j]))
        room = max(upper[j] - idle[j], idle[j] - lower[j])
        if size > 0.0:
            least = min(least, room / size)
    return least if least < math.inf else 0.0


@scalar
def _about(wrench, middle, arm):
    """Return a wrench about the middle of the feet, its moment divided by their distance."""
    force = (wrench[0], wrench[1], wrench[2])
    turned = cross(middle, force)
    return (
        *force,
        (wrench[3] - turned[0]) / arm,
        (wrench[4] - turned[1]) / arm,
        (wrench[5] - turned[2]) / arm,
    )


@scalar
def _size(wrench):
    return math.hypot(
        length((wrench[0], wrench[1], wrench[2])), length((wrench[3], wrench[4], wrench[5]))
    )


@scalar
def _moment_axes(free):
    """Return the axes of the equations of moments; the last is that about which any is borne."""
    if free[0] == 0.0 and free[1] == 0.0 and free[2] == 0.0:
        return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    last = unit(free)
    first, second = tangents(last)
    return first, second, last


@scalar
def _put_load(body, at, load, axes, fewer, factor):
    """Write a load as right sides of the equations."""
    moment = (load[3], load[4], load[5])
    for e in range(3):
        body[at + e] = factor * load[e]
        left_out = fewer and e == 2
        body[at + 3 + e] = 0.0 if left_out else factor * inner(axes[e], moment)
