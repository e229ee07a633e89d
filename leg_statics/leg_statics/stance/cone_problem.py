# SPDX-License-Identifier: Apache-2.0
"""The cone problem of a stance, and the arrays in which its numbers and iterates stand.

The problem has three unknowns x = (x_n, x_1, x_2) a leg and one for all, t:

    greatest t with   sum A_i x_i - d t = b                (six equations)
                      row x_i + growth t <= room           (limits of efforts)
                      |(x_1, x_2)| <= x_n                  (friction)

All numbers stand in three arrays, made once for many problems: `body` (those of the equations),
`legs` (L, those of a leg and its cone) and `limits` (L, R, those of a row). The constants below say
where. Each has the same numbers of six iterates, which are a point, a step or right sides: of an
iterate, `body` has the multipliers y of the equations, t, tau and kappa; `legs` has x and the
cone's slacks s and multipliers z; `limits` has the slack and the multiplier of the row.
"""

# The compiler infers the types of the scalar code below.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from leg_kinematics.kernels.kernel import inlined, scalar

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
def put_duals(body, legs, limits, at, to):
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
def put_balance(body, legs, at, to):
    """Write sum A x - d t of an iterate as y of another."""
    for e in range(6):
        total = -body[GROWING + e] * body[at + T]
        for i in range(int(body[COUNT])):
            total += legs[i, MATRIX + e] * legs[i, at + X]
            total += legs[i, MATRIX + 6 + e] * legs[i, at + X + 1]
            total += legs[i, MATRIX + 12 + e] * legs[i, at + X + 2]
        body[to + Y + e] = total


@inlined
def reached(body, legs, limits, at, i, k):
    """Return row x + growth t of an iterate."""
    return (
        limits[i, k, ROW] * legs[i, at + X]
        + limits[i, k, ROW + 1] * legs[i, at + X + 1]
        + limits[i, k, ROW + 2] * legs[i, at + X + 2]
        + limits[i, k, GROWTH] * body[at + T]
    )


@scalar
def of_data(body, legs, limits, at):
    """Return b·y + h·z of an iterate."""
    total = 0.0
    for e in range(6):
        total += body[FIXED + e] * body[at + Y + e]
    for i in range(int(body[COUNT])):
        for k in range(int(legs[i, ROWS])):
            total += limits[i, k, ROOM] * limits[i, k, of_row(at) + ROW_Z]
    return total


@scalar
def add(body, legs, limits, to, iterate, factor):
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
def complementarity(body, legs, limits):
    """Return s·z + tau kappa of the point."""
    total = body[POINT + TAU] * body[POINT + KAPPA]
    at = of_row(POINT)
    for i in range(int(body[COUNT])):
        for k in range(3):
            total += legs[i, POINT + S + k] * legs[i, POINT + Z + k]
        for k in range(int(legs[i, ROWS])):
            total += limits[i, k, at + ROW_S] * limits[i, k, at + ROW_Z]
    return total
