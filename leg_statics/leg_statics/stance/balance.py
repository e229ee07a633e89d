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
from leg_statics.stance.cone_problem import (
    COUNT,
    FIXED,
    GROWING,
    GROWTH,
    HAS_CONE,
    MATRIX,
    POINT,
    ROOM,
    ROW,
    ROW_Z,
    ROWS,
    TAU,
    T,
    X,
    Z,
    new_arrays,
    of_row,
)
from leg_statics.stance.interior_point import INFEASIBLE, OPTIMAL, UNBOUNDED, solve

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
        force[p] = joint_share[p] = pull_gain[p] = multiple[p] = math.nan
        count = _put_standing(stands[p], leg_of)
        body[COUNT] = count
        middle, arm = _middle(position[p], leg_of, count)
        load, growth = _about(fixed[p], middle, arm), _about(growing[p], middle, arm)
        strength = _strength(jacobian[p], lower[p], upper[p], bias[p], parts[p, 0], leg_of, count)
        newton, unit_of_t = _units(_size(load), _size(growth), strength)
        turning = _moment_axes(free[p])
        _put_load(body, FIXED, load, turning, -1.0 / newton)
        _put_load(body, GROWING, growth, turning, -unit_of_t / newton)
        check = newton + unit_of_t + _size(load)
        valid = True
        for k in range(count):
            i = leg_of[k]
            mu = friction[p, i]
            if mu == math.inf and not _is_limited(lower[p, i], upper[p, i]):
                mu = ROUGHEST
            valid &= mu >= 0.0
            columns[k, HAS_CONE] = 1.0 if mu < math.inf else 0.0
            offset = _offset(position[p, i], middle, arm)
            check += _put_matrix(columns, axes, k, normal[p, i], mu, offset, turning)
            used, tried = _put_limits(
                limits,
                joint_of,
                axes,
                k,
                jacobian[p, i],
                lower[p, i],
                upper[p, i],
                bias[p, i],
                parts[p],
                newton,
                unit_of_t,
            )
            check += tried
            if columns[k, HAS_CONE] == 0.0:
                _put_push(limits, joint_of, k, used, n)
                used += 1
            columns[k, ROWS] = used
        if not (valid & math.isfinite(check)):
            status[p] = INVALID_INPUT
            continue
        if count == 0:
            status[p] = OPTIMAL if _size(load) == 0.0 else INFEASIBLE
            multiple[p] = 0.0 if _size(load) == 0.0 else math.nan
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
        force[p] = joint_share[p] = pull_gain[p] = 0.0
        for k in range(count):
            i = leg_of[k]
            _put_force(columns, axes, k, per * newton, force[p, i])
            pull_gain[p, i] = _put_shares(
                columns, limits, joint_of, k, per * unit_of_t, newton, joint_share[p, i]
            )


@scalar
def _put_standing(stands, leg_of):
    """Write the indices of the legs that stand and return how many they are."""
    count = 0
    for i in range(len(stands)):
        if stands[i]:
            leg_of[count] = i
            count += 1
    return count


@scalar
def _units(load, growth, strength):
    """Return the unit of force, and that of t, with which the growing load has length 1."""
    newton = load if load > 0.0 else (strength if strength > 0.0 else growth)
    newton = newton if newton > 0.0 else 1.0
    return newton, (newton / growth if growth > 0.0 else 1.0)


@scalar
def _offset(position, middle, arm):
    """Return where a foot is from the middle of the feet."""
    return (
        (position[0] - middle[0]) / arm,
        (position[1] - middle[1]) / arm,
        (position[2] - middle[2]) / arm,
    )


@scalar
def _put_matrix(columns, axes, k, normal, mu, offset, turning):
    """Write what forces of a foot balance; return a number that is finite if all of it is."""
    direction = unit(normal)
    first, second = tangents(direction)
    slope = mu if mu < math.inf else 1.0
    check = 0.0
    for c in range(3):
        vector = direction if c == 0 else (first if c == 1 else second)
        part = 1.0 if c == 0 else slope
        column = (part * vector[0], part * vector[1], part * vector[2])
        moment = cross(offset, column)
        for e in range(3):
            axes[k, e, c] = column[e]
            columns[k, MATRIX + 6 * c + e] = column[e]
            columns[k, MATRIX + 6 * c + 3 + e] = inner(turning[e], moment)
            check += moment[e]
    return check


@scalar
def _put_limits(limits, joint_of, axes, k, jacobian, lower, upper, bias, parts, newton, unit_of_t):
    """Write the limits of a leg's efforts.

    Returns:
        How many they are, and a number that is finite if all of it is valid.
    """
    used = 0
    check = parts[0] + parts[1]
    for j in range(jacobian.shape[1]):
        column = (jacobian[0, j], jacobian[1, j], jacobian[2, j])
        size = length(column) * newton
        idle, idle_growth = bias[j] * parts[0], bias[j] * parts[1] * unit_of_t
        check += size + idle
        if not (lower[j] <= upper[j] and lower[j] < math.inf and upper[j] > -math.inf):
            check = math.nan
        for side in range(2):
            sign = 1.0 - 2.0 * side
            room = idle - lower[j] if side == 0 else upper[j] - idle
            per = max(size, abs(room), abs(idle_growth))
            if per == math.inf or per == 0.0:
                continue
            for c in range(3):
                along = (axes[k, 0, c], axes[k, 1, c], axes[k, 2, c])
                limits[k, used, ROW + c] = sign * newton / per * inner(column, along)
            limits[k, used, GROWTH] = -sign * idle_growth / per
            limits[k, used, ROOM] = room / per
            joint_of[k, used] = j
            used += 1
    return used, check


@scalar
def _put_push(limits, joint_of, k, row, n):
    """Write that a foot without a cone pushes at the ground."""
    limits[k, row, ROW] = -1.0
    limits[k, row, ROW + 1] = limits[k, row, ROW + 2] = 0.0
    limits[k, row, GROWTH] = limits[k, row, ROOM] = 0.0
    joint_of[k, row] = n


@scalar
def _put_force(columns, axes, k, per, force):
    """Write the force of the ground on a foot."""
    for e in range(3):
        for c in range(3):
            force[e] += axes[k, e, c] * columns[k, POINT + X + c] * per


@scalar
def _put_shares(columns, limits, joint_of, k, per, newton, shares):
    """Write by how much the multiple grows if each limit of effort is doubled.

    Returns:
        By how much it grows for each newton with which the foot may pull.
    """
    gain = columns[k, POINT + Z] * per / newton
    for r in range(int(columns[k, ROWS])):
        z = limits[k, r, of_row(POINT) + ROW_Z] * per
        if joint_of[k, r] == len(shares):
            gain = z / newton
        else:
            shares[joint_of[k, r]] += z * limits[k, r, ROOM]
    return gain


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
def _strength(jacobian, lower, upper, bias, part, leg_of, count):
    """Return a force of the magnitude that the strongest leg bears, 0 if none limits.

    That is the geometric mean of what its joints bear, since one may be powerless or idle.
    """
    strength = 0.0
    for k in range(count):
        i = leg_of[k]
        total, joints = 0.0, 0
        for j in range(jacobian.shape[2]):
            size = length((jacobian[i, 0, j], jacobian[i, 1, j], jacobian[i, 2, j]))
            idle = bias[i, j] * part
            room = max(upper[i, j] - idle, idle - lower[i, j])
            if size > 0.0 and 0.0 < room < math.inf:
                total += math.log(room / size)
                joints += 1
        if joints > 0:
            strength = max(strength, math.exp(total / joints))
    return strength


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
    """Return the axes of the equations of moments; none for that about which any is borne."""
    if free[0] == 0.0 and free[1] == 0.0 and free[2] == 0.0:
        return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    first, second = tangents(unit(free))
    return first, second, (0.0, 0.0, 0.0)


@scalar
def _put_load(body, at, load, turning, factor):
    """Write a load as right sides of the equations."""
    moment = (load[3], load[4], load[5])
    for e in range(3):
        body[at + e] = factor * load[e]
        body[at + 3 + e] = factor * inner(turning[e], moment)
