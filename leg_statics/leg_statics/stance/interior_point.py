# SPDX-License-Identifier: Apache-2.0
"""The interior-point method behind all questions about a stance, in scalar code.

A problem, see `cone_problem`, is embedded in a homogeneous, self-dual one, which always has a
solution: tau > 0 tells that the problem has an optimum, kappa > 0 that it is infeasible or
unbounded, and gives the proof. Steps are Mehrotra's, as in "ECOS: an SOCP solver for embedded
systems" (Domahidi, Chu, Boyd 2013); the linear system of a step is this problem's own, see
`newton_system`.
"""

# The compiler infers the types of the scalar code below.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math

from leg_kinematics.kernels.kernel import inlined, scalar
from leg_statics.stance.cone_problem import (
    COUNT,
    FIXED,
    HAS_CONE,
    INSIDE,
    ITERATES,
    KAPPA,
    LAMBDA,
    POINT,
    RESIDUAL,
    RIGHT,
    ROOM,
    ROW_S,
    ROW_Z,
    ROWS,
    STEP,
    TAU,
    UNIT,
    S,
    T,
    X,
    Y,
    Z,
    add,
    complementarity,
    of_data,
    of_row,
    put_balance,
    put_duals,
    reached,
)
from leg_statics.stance.newton_system import (
    inside,
    scale,
    scaled,
    solve_linear,
    solve_refined,
)

OPTIMAL, UNBOUNDED, INFEASIBLE, INACCURATE = 0, 1, 2, 3

MOST_STEPS = 50
ACCURACY = 1e-9  # of residuals and gap, relative to the data, whose magnitude is 1
ACCEPTED = 1e-7  # the same where rounding ends the progress
TO_BORDER = 0.99  # part of the way to the border of the cones that a step goes


@scalar
def solve(body, legs, limits):
    """Solve a problem: POINT is then the optimum or the proof that there is none.

    Returns:
        Status. If OPTIMAL, t, x, y and z are to be divided by tau.
    """
    degree = _start(body, legs, limits)
    status, error = _measure(body, legs, limits)
    for _ in range(MOST_STEPS):
        if error <= ACCURACY or not scale(body, legs, limits):
            break
        _solve_data(body, legs, limits)
        mean = complementarity(body, legs, limits) / degree
        _affine_step(body, legs, limits)
        centring = (1.0 - _longest(body, legs, limits, 1.0)) ** 3
        _centred_step(body, legs, limits, centring, centring * mean)
        length = _longest(body, legs, limits, TO_BORDER)
        add(body, legs, limits, POINT, STEP, length)
        before, error_before = status, error
        status, error = _measure(body, legs, limits)
        if error_before <= ACCEPTED and not error < error_before:  # rounding ends the progress
            add(body, legs, limits, POINT, STEP, -length)
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
def _measure(body, legs, limits):
    """Find the residuals of the point, what it comes nearest to proving, and how near."""
    t, tau = body[POINT + T], body[POINT + TAU]
    put_duals(body, legs, limits, POINT, RESIDUAL)
    put_balance(body, legs, POINT, RESIDUAL)
    value = of_data(body, legs, limits, POINT)
    # without objective and right sides, as a proof of infeasibility or unboundedness has to be
    dual, primal, homogeneous = 0.0, 0.0, 0.0
    for i in range(int(body[COUNT])):
        for k in range(3):
            dual = max(dual, abs(legs[i, RESIDUAL + X + k]))
            gap = legs[i, POINT + S + k] - legs[i, POINT + X + k] * legs[i, HAS_CONE]
            legs[i, RESIDUAL + S + k] = gap
            primal, homogeneous = max(primal, abs(gap)), max(homogeneous, abs(gap))
        for k in range(int(legs[i, ROWS])):
            gap = limits[i, k, of_row(POINT) + ROW_S] + reached(body, legs, limits, POINT, i, k)
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
    solve_refined(body, legs, limits, UNIT)


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
    solve_linear(body, legs, limits, RIGHT, STEP)
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
    solve_refined(body, legs, limits, STEP)
    complement = body[POINT + TAU] * body[POINT + KAPPA] - target
    _finish_step(body, legs, limits, part, complement + body[STEP + TAU] * body[STEP + KAPPA])


@scalar
def _correct_cone(legs, i, target):
    """Write W times what makes, with lambda, lambda² + (W^-1 ds)(W dz) - target, as right side s.

    Products are those of the cone's Jordan algebra.
    """
    l0, l1, l2 = legs[i, LAMBDA], legs[i, LAMBDA + 1], legs[i, LAMBDA + 2]
    a0, a1, a2 = scaled(
        legs, i, legs[i, STEP + S], legs[i, STEP + S + 1], legs[i, STEP + S + 2], -1.0
    )
    b0, b1, b2 = scaled(
        legs, i, legs[i, STEP + Z], legs[i, STEP + Z + 1], legs[i, STEP + Z + 2], 1.0
    )
    c0 = a0 * b0 + a1 * b1 + a2 * b2 - target
    c1, c2 = a0 * b1 + b0 * a1, a0 * b2 + b0 * a2
    u0 = (l0 * c0 - l1 * c1 - l2 * c2) / legs[i, INSIDE]
    u1, u2 = (c1 - u0 * l1) / l0, (c2 - u0 * l2) / l0
    legs[i, RIGHT + S], legs[i, RIGHT + S + 1], legs[i, RIGHT + S + 2] = scaled(
        legs, i, l0 + u0, l1 + u1, l2 + u2, 1.0
    )


@scalar
def _finish_step(body, legs, limits, part, complement):
    """Find tau, kappa and slacks of a step, with which its x, t, y and z are complete."""
    tau, kappa = body[POINT + TAU], body[POINT + KAPPA]
    d_tau = complement / tau - part * body[RESIDUAL + KAPPA]
    d_tau -= of_data(body, legs, limits, STEP) - body[STEP + T]
    d_tau /= of_data(body, legs, limits, UNIT) - body[UNIT + T] - kappa / tau
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
            change = limits[i, k, ROOM] * d_tau - reached(body, legs, limits, STEP, i, k)
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
    a = inside(legs[i, d], legs[i, d + 1], legs[i, d + 2])
    b = legs[i, s] * legs[i, d] - legs[i, s + 1] * legs[i, d + 1] - legs[i, s + 2] * legs[i, d + 2]
    c = inside(legs[i, s], legs[i, s + 1], legs[i, s + 2])
    if legs[i, d] >= 0.0 and a >= 0.0:
        return math.inf
    root = math.sqrt(max(b * b - a * c, 0.0))  # never less but by rounding
    if b < 0.0:
        return c / (root - b)
    return (-b - root) / a if a < 0.0 else math.inf
