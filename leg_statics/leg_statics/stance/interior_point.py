# SPDX-License-Identifier: Apache-2.0
"""The interior-point method behind all questions about a stance, in scalar code.

The problem has three unknowns x = (x_n, x_1, x_2) a leg and one for all, t:

    greatest t with   sum A_i x_i - d t = b                (six equations)
                      row x_i + growth t <= room           (limits of efforts)
                      |(x_1, x_2)| <= x_n                  (friction)

It is embedded in a homogeneous, self-dual problem, which always has a solution: tau > 0 tells that
the problem has an optimum, kappa > 0 that it is infeasible or unbounded, and gives the proof. Steps
are Mehrotra's with the scaling of Nesterov and Todd, as in "ECOS: an SOCP solver for embedded
systems" (Domahidi, Chu, Boyd 2013). The elimination is of this problem: each leg by itself is
reduced to the equations and t, so that a step costs one Cholesky decomposition 3 x 3 a leg and one
6 x 6.

All numbers stand in three arrays, made once for many problems: `body` (those of the equations),
`legs` (L, those of a leg and its cone) and `limits` (L, R, those of a row). The constants below say
where. Each has the same numbers of six iterates, which are a point, a step or right sides: of an
iterate, `body` has the multipliers y of the equations, t, tau and kappa; `legs` has x and the
cone's slacks s and multipliers z; `limits` has the slack and the multiplier of the row.
"""

# The compiler infers the types of the scalar code below.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math

import numpy as np

from leg_kinematics.kernels.kernel import inlined, scalar

OPTIMAL, UNBOUNDED, INFEASIBLE, INACCURATE = 0, 1, 2, 3

MOST_STEPS = 50
ACCURACY = 1e-9  # of residuals and gap, relative to the data, whose magnitude is 1
ACCEPTED = 1e-7  # the same where rounding ends the progress
TO_BORDER = 0.99  # part of the way to the border of the cones that a step goes
ROUNDING_MATTERS = 1e-6  # tau kappa below which linear systems are solved twice
REGULAR = 1e-15  # added to the equations, relative to the largest

# Iterates, and where their numbers begin: 9 numbers each in `body` and `legs`, 2 in `limits`.
POINT, RESIDUAL, UNIT, STEP, RIGHT, CORRECTION, ITERATES = 0, 9, 18, 27, 36, 45, 54
Y, T, TAU, KAPPA = 0, 6, 7, 8  # of body
X, S, Z = 0, 3, 6  # of legs
ROW_S, ROW_Z = 0, 1  # of limits, see `of_row`
# The problem and the scaling: of body
COUNT, FIXED, GROWING = 54, 55, 61
BORDER, PIVOT, EQUATIONS, OF_BODY = 67, 73, 74, 110
# of legs: how many rows, 1 if there is a cone, A as columns of six; scaling of the cone, factors,
# scaled slack and how far it is inside the cone
ROWS, HAS_CONE, MATRIX = 54, 55, 56
ETA, W, FACTOR, HALF, LAMBDA, INSIDE, OF_LEG = 74, 75, 78, 84, 105, 108, 109
# of limits
ROW, GROWTH, ROOM, WEIGHT, OF_LIMIT = 12, 15, 16, 17, 18


@inlined
def of_row(iterate):
    """Return where the numbers of an iterate begin in `limits`."""
    return iterate // 9 * 2


@scalar
def new_arrays(legs, rows):
    """Return body, legs and limits for problems of so many legs with so many rows, at most."""
    return np.zeros(OF_BODY), np.zeros((legs, OF_LEG)), np.zeros((legs, rows, OF_LIMIT))


@scalar
def solve(body, legs, limits):
    """Solve a problem: POINT is then the optimum or the proof that there is none.

    Returns:
        Status. If OPTIMAL, t, x, y and z are to be divided by tau.
    """
    degree = _start(body, legs, limits)
    status, error = _measure(body, legs, limits)
    for _ in range(MOST_STEPS):
        if error <= ACCURACY or not _scale(body, legs, limits):
            break
        _solve_data(body, legs, limits)
        complement = _complement(body, legs, limits) / degree
        _affine_step(body, legs, limits)
        centring = (1.0 - _longest(body, legs, limits, 1.0)) ** 3
        _centred_step(body, legs, limits, centring, centring * complement)
        length = _longest(body, legs, limits, TO_BORDER)
        _add(body, legs, limits, POINT, STEP, length)
        before, error_before = status, error
        status, error = _measure(body, legs, limits)
        if error_before <= ACCEPTED and not error < error_before:  # rounding ends the progress
            _add(body, legs, limits, POINT, STEP, -length)
            status, error = before, error_before
            break
    return status if error <= ACCEPTED else INACCURATE


@scalar
def _start(body, legs, limits):
    """Set the first point and return the degree of the cones."""
    body[POINT : POINT + 9] = 0.0
    body[POINT + TAU] = body[POINT + KAPPA] = 1.0
    degree = 1.0
    for i in range(int(body[COUNT])):
        cone = legs[i, HAS_CONE]
        degree += legs[i, ROWS] + cone
        for iterate in range(0, ITERATES, 9):
            for k in range(9):
                legs[i, iterate + k] = 0.0
        legs[i, POINT + S] = legs[i, POINT + Z] = cone
        for k in range(int(legs[i, ROWS])):
            limits[i, k, of_row(POINT) + ROW_S] = limits[i, k, of_row(POINT) + ROW_Z] = 1.0
    return degree


@scalar
def _complement(body, legs, limits):
    """Return s·z + tau kappa of the point."""
    total = body[POINT + TAU] * body[POINT + KAPPA]
    at = of_row(POINT)
    for i in range(int(body[COUNT])):
        for k in range(3):
            total += legs[i, POINT + S + k] * legs[i, POINT + Z + k]
        for k in range(int(legs[i, ROWS])):
            total += limits[i, k, at + ROW_S] * limits[i, k, at + ROW_Z]
    return total


@scalar
def _put_duals(body, legs, limits, at, to):
    """Write Aᵀ y + Gᵀ z of an iterate as x and t of another."""
    of_t = 0.0
    for e in range(6):
        of_t -= body[GROWING + e] * body[at + Y + e]
    row_at = of_row(at)
    for i in range(int(body[COUNT])):
        a, b, c = -legs[i, at + Z], -legs[i, at + Z + 1], -legs[i, at + Z + 2]
        for e in range(6):
            y = body[at + Y + e]
            a += legs[i, MATRIX + e] * y
            b += legs[i, MATRIX + 6 + e] * y
            c += legs[i, MATRIX + 12 + e] * y
        for k in range(int(legs[i, ROWS])):
            z = limits[i, k, row_at + ROW_Z]
            a += limits[i, k, ROW] * z
            b += limits[i, k, ROW + 1] * z
            c += limits[i, k, ROW + 2] * z
            of_t += limits[i, k, GROWTH] * z
        legs[i, to + X], legs[i, to + X + 1], legs[i, to + X + 2] = a, b, c
    body[to + T] = of_t


@scalar
def _put_balance(body, legs, at, to):
    """Write sum A x - d t of an iterate as y of another."""
    for e in range(6):
        total = -body[GROWING + e] * body[at + T]
        for i in range(int(body[COUNT])):
            total += legs[i, MATRIX + e] * legs[i, at + X]
            total += legs[i, MATRIX + 6 + e] * legs[i, at + X + 1]
            total += legs[i, MATRIX + 12 + e] * legs[i, at + X + 2]
        body[to + Y + e] = total


@inlined
def _reached(body, legs, limits, at, i, k):
    """Return row x + growth t of an iterate."""
    return (
        limits[i, k, ROW] * legs[i, at + X]
        + limits[i, k, ROW + 1] * legs[i, at + X + 1]
        + limits[i, k, ROW + 2] * legs[i, at + X + 2]
        + limits[i, k, GROWTH] * body[at + T]
    )


@scalar
def _of_data(body, legs, limits, at):
    """Return b·y + h·z of an iterate."""
    total = 0.0
    for e in range(6):
        total += body[FIXED + e] * body[at + Y + e]
    for i in range(int(body[COUNT])):
        for k in range(int(legs[i, ROWS])):
            total += limits[i, k, ROOM] * limits[i, k, of_row(at) + ROW_Z]
    return total


@scalar
def _measure(body, legs, limits):
    """Find the residuals of the point, what it comes nearest to proving, and how near."""
    t, tau = body[POINT + T], body[POINT + TAU]
    _put_duals(body, legs, limits, POINT, RESIDUAL)
    _put_balance(body, legs, POINT, RESIDUAL)
    value = _of_data(body, legs, limits, POINT)
    # without objective and right sides, as a proof of infeasibility or unboundedness has to be
    dual, primal, homogeneous = 0.0, 0.0, 0.0
    for i in range(int(body[COUNT])):
        for k in range(3):
            dual = max(dual, abs(legs[i, RESIDUAL + X + k]))
            gap = legs[i, POINT + S + k] - legs[i, POINT + X + k] * legs[i, HAS_CONE]
            legs[i, RESIDUAL + S + k] = gap
            primal, homogeneous = max(primal, abs(gap)), max(homogeneous, abs(gap))
        for k in range(int(legs[i, ROWS])):
            gap = limits[i, k, of_row(POINT) + ROW_S] + _reached(body, legs, limits, POINT, i, k)
            homogeneous = max(homogeneous, abs(gap))
            gap -= limits[i, k, ROOM] * tau
            limits[i, k, of_row(RESIDUAL) + ROW_S] = gap
            primal = max(primal, abs(gap))
    for e in range(6):
        homogeneous = max(homogeneous, abs(body[RESIDUAL + Y + e]))
        body[RESIDUAL + Y + e] -= body[FIXED + e] * tau
        primal = max(primal, abs(body[RESIDUAL + Y + e]))
    dual_t = abs(body[RESIDUAL + T])
    body[RESIDUAL + T] -= tau
    body[RESIDUAL + KAPPA] = body[POINT + KAPPA] - t + value
    optimal = max(primal / tau, dual / tau, abs(body[RESIDUAL + T]) / tau)
    optimal = max(optimal, abs(t - value) / max(tau, abs(t)))
    infeasible = max(dual, dual_t) / -value if value < 0.0 else math.inf
    unbounded = homogeneous / t if t > 0.0 else math.inf
    if optimal <= min(infeasible, unbounded):
        return OPTIMAL, optimal
    if infeasible <= unbounded:
        return INFEASIBLE, infeasible
    return UNBOUNDED, unbounded


@scalar
def _scale(body, legs, limits):
    """Find the scaling at the point and factorise; return whether rounding lets it."""
    for e in range(6):
        body[BORDER + e] = -body[GROWING + e]
        for f in range(e + 1):
            body[EQUATIONS + 6 * e + f] = 0.0
    pivot = 0.0
    at = of_row(POINT)
    for i in range(int(body[COUNT])):
        a, b, c, d, e_, f_ = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        h0, h1, h2 = 0.0, 0.0, 0.0
        if legs[i, HAS_CONE] == 1.0:
            a, b, c, d, e_, f_ = _scale_cone(legs, i)
        for k in range(int(legs[i, ROWS])):
            weight = limits[i, k, at + ROW_Z] / limits[i, k, at + ROW_S]
            limits[i, k, WEIGHT] = weight
            r0, r1, r2 = limits[i, k, ROW], limits[i, k, ROW + 1], limits[i, k, ROW + 2]
            w0, w1, w2, wt = weight * r0, weight * r1, weight * r2, limits[i, k, GROWTH]
            a += w0 * r0
            b += w0 * r1
            c += w0 * r2
            d += w1 * r1
            e_ += w1 * r2
            f_ += w2 * r2
            h0 += w0 * wt
            h1 += w1 * wt
            h2 += w2 * wt
            pivot += weight * wt * wt
        pivot -= _factorise_leg(body, legs, i, (a, b, c, d, e_, f_), (h0, h1, h2))
    return _factorise_equations(body, max(pivot, 0.0))


@scalar
def _factorise_leg(body, legs, i, matrix, coupling):
    """Factorise the matrix of a leg, and reduce the leg to the equations and t."""
    a, b, c, d, e_, f_ = matrix
    tiny = 1e-15 * (a + d + f_) * (1.0 - legs[i, HAS_CONE])  # without cone it may be singular
    p0 = 1.0 / math.sqrt(a + tiny)
    l1, l2 = b * p0, c * p0
    p1 = 1.0 / math.sqrt(max(d + tiny - l1 * l1, 1e-16 * d))
    l3 = (e_ - l2 * l1) * p1
    p2 = 1.0 / math.sqrt(max(f_ + tiny - l2 * l2 - l3 * l3, 1e-16 * f_))
    for k, number in enumerate((p0, p1, p2, l1, l2, l3)):
        legs[i, FACTOR + k] = number
    for e in range(6):
        u0 = legs[i, MATRIX + e] * p0
        u1 = (legs[i, MATRIX + 6 + e] - l1 * u0) * p1
        u2 = (legs[i, MATRIX + 12 + e] - l2 * u0 - l3 * u1) * p2
        legs[i, HALF + e], legs[i, HALF + 7 + e], legs[i, HALF + 14 + e] = u0, u1, u2
        for f in range(e + 1):
            body[EQUATIONS + 6 * e + f] += (
                u0 * legs[i, HALF + f] + u1 * legs[i, HALF + 7 + f] + u2 * legs[i, HALF + 14 + f]
            )
    u0 = coupling[0] * p0
    u1 = (coupling[1] - l1 * u0) * p1
    u2 = (coupling[2] - l2 * u0 - l3 * u1) * p2
    legs[i, HALF + 6], legs[i, HALF + 13], legs[i, HALF + 20] = u0, u1, u2
    for e in range(6):
        body[BORDER + e] -= (
            u0 * legs[i, HALF + e] + u1 * legs[i, HALF + 7 + e] + u2 * legs[i, HALF + 14 + e]
        )
    return u0 * u0 + u1 * u1 + u2 * u2


@scalar
def _factorise_equations(body, pivot):
    """Factorise the equations and t; where they depend on each other, REGULAR stands in."""
    largest = 0.0
    for e in range(6):
        largest = max(largest, body[EQUATIONS + 7 * e])
    for e in range(6):
        row = EQUATIONS + 6 * e
        for f in range(e):
            rest = body[row + f]
            for k in range(f):
                rest -= body[row + k] * body[EQUATIONS + 6 * f + k]
            body[row + f] = rest * body[EQUATIONS + 7 * f]
        rest, border = body[row + e] + REGULAR * largest, body[BORDER + e]
        for k in range(e):
            rest -= body[row + k] * body[row + k]
            border -= body[row + k] * body[BORDER + k]
        inverse = 1.0 / math.sqrt(max(rest, REGULAR * largest))
        body[row + e], body[BORDER + e] = inverse, border * inverse
        pivot += body[BORDER + e] * body[BORDER + e]
    body[PIVOT] = 1.0 / pivot
    return (largest > 0.0) & (largest < math.inf) & (pivot > 0.0)


@scalar
def _scale_cone(legs, i):
    """Find the scaling of a cone and return W^-2, a symmetric matrix, by rows."""
    s0, s1, s2 = legs[i, POINT + S], legs[i, POINT + S + 1], legs[i, POINT + S + 2]
    z0, z1, z2 = legs[i, POINT + Z], legs[i, POINT + Z + 1], legs[i, POINT + Z + 2]
    s_size = math.sqrt(max(_inside(s0, s1, s2), 1e-300))
    z_size = math.sqrt(max(_inside(z0, z1, z2), 1e-300))
    s0, s1, s2 = s0 / s_size, s1 / s_size, s2 / s_size
    z0, z1, z2 = z0 / z_size, z1 / z_size, z2 / z_size
    middle = math.sqrt(0.5 * (1.0 + s0 * z0 + s1 * z1 + s2 * z2))
    legs[i, INSIDE] = s_size * z_size
    size = math.sqrt(s_size * z_size)
    of_s, of_z = (middle + z0) / (s0 + z0 + 2.0 * middle), (middle + s0) / (s0 + z0 + 2.0 * middle)
    legs[i, LAMBDA] = size * middle
    legs[i, LAMBDA + 1] = size * (of_s * s1 + of_z * z1)
    legs[i, LAMBDA + 2] = size * (of_s * s2 + of_z * z2)
    half = 0.5 / middle
    w1, w2 = (s1 - z1) * half, (s2 - z2) * half
    w0 = math.sqrt(1.0 + w1 * w1 + w2 * w2)
    per = z_size / s_size
    legs[i, ETA] = math.sqrt(s_size / z_size)
    legs[i, W], legs[i, W + 1], legs[i, W + 2] = w0, w1, w2
    return (
        per * (w0 * w0 + w1 * w1 + w2 * w2),
        per * (-2.0 * w0 * w1),
        per * (-2.0 * w0 * w2),
        per * (1.0 + 2.0 * w1 * w1),
        per * (2.0 * w1 * w2),
        per * (1.0 + 2.0 * w2 * w2),
    )


@inlined
def _inside(a, b, c):
    """Return how far inside the cone a vector is: a² - |(b, c)|²."""
    length = math.sqrt(b * b + c * c)
    return (a - length) * (a + length)


@inlined
def _by_inverse_square(legs, i, a, b, c):
    """Return W^-2 v."""
    w0, w1, w2 = legs[i, W], -legs[i, W + 1], -legs[i, W + 2]
    per = 1.0 / (legs[i, ETA] * legs[i, ETA])
    along = 2.0 * (w0 * a + w1 * b + w2 * c)
    return per * (along * w0 - a), per * (along * w1 + b), per * (along * w2 + c)


@inlined
def _scaled(legs, i, a, b, c, sign):
    """Return W v for sign 1, W^-1 v for sign -1."""
    w0, w1, w2 = legs[i, W], sign * legs[i, W + 1], sign * legs[i, W + 2]
    size = legs[i, ETA] if sign > 0.0 else 1.0 / legs[i, ETA]
    across = w1 * b + w2 * c
    part = a + across / (1.0 + w0)
    return size * (w0 * a + across), size * (b + part * w1), size * (c + part * w2)


@scalar
def _solve_linear(body, legs, limits, right, to):
    """Solve the linear system of a step for an iterate's x, t, y, s: another's x, t, y, z."""
    row_right, row_to = of_row(right), of_row(to)
    of_t = body[right + T]
    for e in range(6):
        body[to + Y + e] = -body[right + Y + e]
    for i in range(int(body[COUNT])):
        q0, q1, q2 = legs[i, right + X], legs[i, right + X + 1], legs[i, right + X + 2]
        if legs[i, HAS_CONE] == 1.0:
            a, b, c = _by_inverse_square(
                legs, i, legs[i, right + S], legs[i, right + S + 1], legs[i, right + S + 2]
            )
            q0, q1, q2 = q0 - a, q1 - b, q2 - c
        for k in range(int(legs[i, ROWS])):
            part = limits[i, k, WEIGHT] * limits[i, k, row_right + ROW_S]
            q0 += part * limits[i, k, ROW]
            q1 += part * limits[i, k, ROW + 1]
            q2 += part * limits[i, k, ROW + 2]
            of_t += part * limits[i, k, GROWTH]
        q0 = q0 * legs[i, FACTOR]
        q1 = (q1 - legs[i, FACTOR + 3] * q0) * legs[i, FACTOR + 1]
        q2 = (q2 - legs[i, FACTOR + 4] * q0 - legs[i, FACTOR + 5] * q1) * legs[i, FACTOR + 2]
        legs[i, to + X], legs[i, to + X + 1], legs[i, to + X + 2] = q0, q1, q2
        for e in range(6):
            body[to + Y + e] += (
                legs[i, HALF + e] * q0 + legs[i, HALF + 7 + e] * q1 + legs[i, HALF + 14 + e] * q2
            )
        of_t -= legs[i, HALF + 6] * q0 + legs[i, HALF + 13] * q1 + legs[i, HALF + 20] * q2
    for e in range(6):
        rest = body[to + Y + e]
        for k in range(e):
            rest -= body[EQUATIONS + 6 * e + k] * body[to + Y + k]
        body[to + Y + e] = rest * body[EQUATIONS + 7 * e]
        of_t -= body[BORDER + e] * body[to + Y + e]
    t = of_t * body[PIVOT]
    body[to + T] = t
    for e in range(5, -1, -1):
        rest = body[to + Y + e] + body[BORDER + e] * t
        for k in range(e + 1, 6):
            rest -= body[EQUATIONS + 6 * k + e] * body[to + Y + k]
        body[to + Y + e] = rest * body[EQUATIONS + 7 * e]
    for i in range(int(body[COUNT])):
        q0 = legs[i, to + X] - legs[i, HALF + 6] * t
        q1 = legs[i, to + X + 1] - legs[i, HALF + 13] * t
        q2 = legs[i, to + X + 2] - legs[i, HALF + 20] * t
        for e in range(6):
            y = body[to + Y + e]
            q0 -= legs[i, HALF + e] * y
            q1 -= legs[i, HALF + 7 + e] * y
            q2 -= legs[i, HALF + 14 + e] * y
        q2 = q2 * legs[i, FACTOR + 2]
        q1 = (q1 - legs[i, FACTOR + 5] * q2) * legs[i, FACTOR + 1]
        q0 = (q0 - legs[i, FACTOR + 3] * q1 - legs[i, FACTOR + 4] * q2) * legs[i, FACTOR]
        legs[i, to + X], legs[i, to + X + 1], legs[i, to + X + 2] = q0, q1, q2
        if legs[i, HAS_CONE] == 1.0:
            legs[i, to + Z], legs[i, to + Z + 1], legs[i, to + Z + 2] = _by_inverse_square(
                legs,
                i,
                -q0 - legs[i, right + S],
                -q1 - legs[i, right + S + 1],
                -q2 - legs[i, right + S + 2],
            )
        for k in range(int(legs[i, ROWS])):
            reached = _reached(body, legs, limits, to, i, k) - limits[i, k, row_right + ROW_S]
            limits[i, k, row_to + ROW_Z] = limits[i, k, WEIGHT] * reached


@scalar
def _solve_refined(body, legs, limits, to):
    """Solve the linear system for RIGHT, at last once more for what rounding left of it."""
    _solve_linear(body, legs, limits, RIGHT, to)
    if body[POINT + TAU] * body[POINT + KAPPA] > ROUNDING_MATTERS:
        return
    _put_duals(body, legs, limits, to, CORRECTION)
    _put_balance(body, legs, to, CORRECTION)
    for i in range(int(body[COUNT])):
        for k in range(3):
            legs[i, CORRECTION + X + k] = legs[i, RIGHT + X + k] - legs[i, CORRECTION + X + k]
            legs[i, CORRECTION + S + k] = 0.0
        for k in range(int(legs[i, ROWS])):
            limits[i, k, of_row(CORRECTION) + ROW_S] = 0.0
    body[CORRECTION + T] = body[RIGHT + T] - body[CORRECTION + T]
    for e in range(6):
        body[CORRECTION + Y + e] = body[RIGHT + Y + e] - body[CORRECTION + Y + e]
    _solve_linear(body, legs, limits, CORRECTION, CORRECTION)
    body[CORRECTION + TAU] = body[CORRECTION + KAPPA] = 0.0
    _add(body, legs, limits, to, CORRECTION, 1.0)


@scalar
def _add(body, legs, limits, to, iterate, factor):
    """Add an iterate times a factor to another."""
    for k in range(9):
        body[to + k] += factor * body[iterate + k]
    row_to, row_at = of_row(to), of_row(iterate)
    for i in range(int(body[COUNT])):
        for k in range(9):
            legs[i, to + k] += factor * legs[i, iterate + k]
        for k in range(int(legs[i, ROWS])):
            limits[i, k, row_to] += factor * limits[i, k, row_at]
            limits[i, k, row_to + 1] += factor * limits[i, k, row_at + 1]


@scalar
def _solve_data(body, legs, limits):
    """Solve the linear system for the data of the problem: UNIT."""
    for i in range(int(body[COUNT])):
        for k in range(6):
            legs[i, RIGHT + k] = 0.0
        for k in range(int(legs[i, ROWS])):
            limits[i, k, of_row(RIGHT) + ROW_S] = limits[i, k, ROOM]
    for e in range(6):
        body[RIGHT + Y + e] = body[FIXED + e]
    body[RIGHT + T] = 1.0
    _solve_refined(body, legs, limits, UNIT)


@scalar
def _affine_step(body, legs, limits):
    """Find the step towards the optimum itself."""
    at, residual, right = of_row(POINT), of_row(RESIDUAL), of_row(RIGHT)
    for i in range(int(body[COUNT])):
        for k in range(3):
            legs[i, RIGHT + X + k] = -legs[i, RESIDUAL + X + k]
            legs[i, RIGHT + S + k] = legs[i, POINT + S + k] - legs[i, RESIDUAL + S + k]
        for k in range(int(legs[i, ROWS])):
            limits[i, k, right + ROW_S] = limits[i, k, at + ROW_S] - limits[i, k, residual + ROW_S]
    for e in range(7):
        body[RIGHT + e] = -body[RESIDUAL + e]
    _solve_linear(body, legs, limits, RIGHT, STEP)
    _finish_step(body, legs, limits, 1.0, body[POINT + TAU] * body[POINT + KAPPA])


@scalar
def _centred_step(body, legs, limits, centring, target):
    """Find the step that corrects the affine one and keeps off the border of the cones."""
    part = 1.0 - centring
    at, step, residual, right = of_row(POINT), of_row(STEP), of_row(RESIDUAL), of_row(RIGHT)
    for i in range(int(body[COUNT])):
        for k in range(3):
            legs[i, RIGHT + X + k] = -part * legs[i, RESIDUAL + X + k]
        if legs[i, HAS_CONE] == 1.0:
            _correct_cone(legs, i, target)
            for k in range(3):
                legs[i, RIGHT + S + k] -= part * legs[i, RESIDUAL + S + k]
        for k in range(int(legs[i, ROWS])):
            change = limits[i, k, step + ROW_S] * limits[i, k, step + ROW_Z] - target
            change = limits[i, k, at + ROW_S] + change / limits[i, k, at + ROW_Z]
            limits[i, k, right + ROW_S] = change - part * limits[i, k, residual + ROW_S]
    for e in range(7):
        body[RIGHT + e] = -part * body[RESIDUAL + e]
    _solve_refined(body, legs, limits, STEP)
    complement = body[POINT + TAU] * body[POINT + KAPPA] - target
    _finish_step(body, legs, limits, part, complement + body[STEP + TAU] * body[STEP + KAPPA])


@scalar
def _correct_cone(legs, i, target):
    """Write W times what makes, with lambda, lambda² + (W^-1 ds)(W dz) - target, as right side s.

    Products are those of the cone's Jordan algebra.
    """
    l0, l1, l2 = legs[i, LAMBDA], legs[i, LAMBDA + 1], legs[i, LAMBDA + 2]
    a0, a1, a2 = _scaled(
        legs, i, legs[i, STEP + S], legs[i, STEP + S + 1], legs[i, STEP + S + 2], -1.0
    )
    b0, b1, b2 = _scaled(
        legs, i, legs[i, STEP + Z], legs[i, STEP + Z + 1], legs[i, STEP + Z + 2], 1.0
    )
    c0 = a0 * b0 + a1 * b1 + a2 * b2 - target
    c1, c2 = a0 * b1 + b0 * a1, a0 * b2 + b0 * a2
    u0 = (l0 * c0 - l1 * c1 - l2 * c2) / legs[i, INSIDE]
    u1, u2 = (c1 - u0 * l1) / l0, (c2 - u0 * l2) / l0
    legs[i, RIGHT + S], legs[i, RIGHT + S + 1], legs[i, RIGHT + S + 2] = _scaled(
        legs, i, l0 + u0, l1 + u1, l2 + u2, 1.0
    )


@scalar
def _finish_step(body, legs, limits, part, complement):
    """Find tau, kappa and slacks of a step, with which its x, t, y and z are complete."""
    tau, kappa = body[POINT + TAU], body[POINT + KAPPA]
    d_tau = complement / tau - part * body[RESIDUAL + KAPPA]
    d_tau -= _of_data(body, legs, limits, STEP) - body[STEP + T]
    d_tau /= _of_data(body, legs, limits, UNIT) - body[UNIT + T] - kappa / tau
    for e in range(7):
        body[STEP + e] += d_tau * body[UNIT + e]
    body[STEP + TAU] = d_tau
    body[STEP + KAPPA] = -(complement + kappa * d_tau) / tau
    step, unit, residual = of_row(STEP), of_row(UNIT), of_row(RESIDUAL)
    for i in range(int(body[COUNT])):
        for k in range(3):
            legs[i, STEP + X + k] += d_tau * legs[i, UNIT + X + k]
            legs[i, STEP + Z + k] += d_tau * legs[i, UNIT + Z + k]
            change = legs[i, STEP + X + k] - part * legs[i, RESIDUAL + S + k]
            legs[i, STEP + S + k] = change * legs[i, HAS_CONE]
        for k in range(int(legs[i, ROWS])):
            limits[i, k, step + ROW_Z] += d_tau * limits[i, k, unit + ROW_Z]
            change = limits[i, k, ROOM] * d_tau - _reached(body, legs, limits, STEP, i, k)
            limits[i, k, step + ROW_S] = change - part * limits[i, k, residual + ROW_S]


@scalar
def _longest(body, legs, limits, part):
    """Return how far the step may go, at most all of it, as a part of the way to the border."""
    most = 1.0 / part
    at, step = of_row(POINT), of_row(STEP)
    for k in (TAU, KAPPA):
        most = _nearer(most, body[POINT + k], body[STEP + k])
    for i in range(int(body[COUNT])):
        for k in range(int(legs[i, ROWS])):
            most = _nearer(most, limits[i, k, at], limits[i, k, step])
            most = _nearer(most, limits[i, k, at + 1], limits[i, k, step + 1])
        if legs[i, HAS_CONE] == 1.0:
            most = min(most, _to_border(legs, i, S), _to_border(legs, i, Z))
    return part * most


@inlined
def _nearer(most, at, along):
    """Return the least of a length and that at which a positive number becomes 0."""
    return min(most, -at / along) if along < 0.0 else most


@scalar
def _to_border(legs, i, which):
    """Return the length at which slack or multiplier of a cone leaves it."""
    s, d = POINT + which, STEP + which
    a = _inside(legs[i, d], legs[i, d + 1], legs[i, d + 2])
    b = legs[i, s] * legs[i, d] - legs[i, s + 1] * legs[i, d + 1] - legs[i, s + 2] * legs[i, d + 2]
    c = _inside(legs[i, s], legs[i, s + 1], legs[i, s + 2])
    if legs[i, d] >= 0.0 and a >= 0.0:
        return math.inf
    root = math.sqrt(max(b * b - a * c, 0.0))  # never less but by rounding
    if b < 0.0:
        return c / (root - b)
    return (-b - root) / a if a < 0.0 else math.inf
