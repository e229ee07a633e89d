# SPDX-License-Identifier: Apache-2.0
"""The linear system of a step of the interior-point method, scaled, reduced and solved.

The scaling is that of Nesterov and Todd. Each leg by itself is reduced to the equations and t, so
that a step costs one Cholesky decomposition 3 x 3 a leg and one 6 x 6.
"""

# The compiler infers the types of the scalar code below.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math

from leg_kinematics.kernels.kernel import inlined, scalar
from leg_statics.stance.cone_problem import (
    BORDER,
    CORRECTION,
    COUNT,
    EQUATIONS,
    ETA,
    FACTOR,
    GROWING,
    GROWTH,
    HALF,
    HAS_CONE,
    INSIDE,
    KAPPA,
    LAMBDA,
    MATRIX,
    PIVOT,
    POINT,
    RIGHT,
    ROW,
    ROW_S,
    ROW_Z,
    ROWS,
    TAU,
    WEIGHT,
    S,
    T,
    W,
    X,
    Y,
    Z,
    add,
    of_row,
    put_balance,
    put_duals,
    reached,
)

ROUNDING_MATTERS = 1e-6  # tau kappa below which linear systems are solved twice
REGULAR = 1e-15  # added to the equations, relative to the largest


@scalar
def scale(body, legs, limits):
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
    s_size = math.sqrt(max(inside(s0, s1, s2), 1e-300))
    z_size = math.sqrt(max(inside(z0, z1, z2), 1e-300))
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
def inside(a, b, c):
    """Return how far inside the cone a vector is: a² - |(b, c)|²."""
    length = math.sqrt(b * b + c * c)
    return (a - length) * (a + length)


@inlined
def by_inverse_square(legs, i, a, b, c):
    """Return W^-2 v."""
    w0, w1, w2 = legs[i, W], -legs[i, W + 1], -legs[i, W + 2]
    per = 1.0 / (legs[i, ETA] * legs[i, ETA])
    along = 2.0 * (w0 * a + w1 * b + w2 * c)
    return per * (along * w0 - a), per * (along * w1 + b), per * (along * w2 + c)


@inlined
def scaled(legs, i, a, b, c, sign):
    """Return W v for sign 1, W^-1 v for sign -1."""
    w0, w1, w2 = legs[i, W], sign * legs[i, W + 1], sign * legs[i, W + 2]
    size = legs[i, ETA] if sign > 0.0 else 1.0 / legs[i, ETA]
    across = w1 * b + w2 * c
    part = a + across / (1.0 + w0)
    return size * (w0 * a + across), size * (b + part * w1), size * (c + part * w2)


@scalar
def solve_linear(body, legs, limits, right, to):
    """Solve the linear system of a step for an iterate's x, t, y, s: another's x, t, y, z."""
    row_right, row_to = of_row(right), of_row(to)
    of_t = body[right + T]
    for e in range(6):
        body[to + Y + e] = -body[right + Y + e]
    for i in range(int(body[COUNT])):
        q0, q1, q2 = legs[i, right + X], legs[i, right + X + 1], legs[i, right + X + 2]
        if legs[i, HAS_CONE] == 1.0:
            a, b, c = by_inverse_square(
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
            legs[i, to + Z], legs[i, to + Z + 1], legs[i, to + Z + 2] = by_inverse_square(
                legs,
                i,
                -q0 - legs[i, right + S],
                -q1 - legs[i, right + S + 1],
                -q2 - legs[i, right + S + 2],
            )
        for k in range(int(legs[i, ROWS])):
            beyond = reached(body, legs, limits, to, i, k) - limits[i, k, row_right + ROW_S]
            limits[i, k, row_to + ROW_Z] = limits[i, k, WEIGHT] * beyond


@scalar
def solve_refined(body, legs, limits, to):
    """Solve the linear system for RIGHT, at last once more for what rounding left of it."""
    solve_linear(body, legs, limits, RIGHT, to)
    if body[POINT + TAU] * body[POINT + KAPPA] > ROUNDING_MATTERS:
        return
    put_duals(body, legs, limits, to, CORRECTION)
    put_balance(body, legs, to, CORRECTION)
    for i in range(int(body[COUNT])):
        for k in range(3):
            legs[i, CORRECTION + X + k] = legs[i, RIGHT + X + k] - legs[i, CORRECTION + X + k]
            legs[i, CORRECTION + S + k] = 0.0
        for k in range(int(legs[i, ROWS])):
            limits[i, k, of_row(CORRECTION) + ROW_S] = 0.0
    body[CORRECTION + T] = body[RIGHT + T] - body[CORRECTION + T]
    for e in range(6):
        body[CORRECTION + Y + e] = body[RIGHT + Y + e] - body[CORRECTION + Y + e]
    solve_linear(body, legs, limits, CORRECTION, CORRECTION)
    body[CORRECTION + TAU] = body[CORRECTION + KAPPA] = 0.0
    add(body, legs, limits, to, CORRECTION, 1.0)
