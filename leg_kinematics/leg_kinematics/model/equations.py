# SPDX-License-Identifier: Apache-2.0
"""The equations of a chain with loops at one posture, and the passive joints eliminated from them.

Unknown are all joint positions, actuated a and passive p. Equations are the coincidences that close
the loops, c(a, p) = 0, and the foot, f(a, p). The Jacobians of the leg come from

    C_p X = C_a,   C_p y = c        (elimination with pivots)
    J = F_a - F_p X                 foot by actuated joints, the loops closed

Each coincidence is three equations in axes of its first body. Where loops are plane some are always
fulfilled; `rows` are those that are independent.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.kernels.kernel import scalar
from leg_kinematics.model.chain import (
    PARENT,
    fill_foot_columns,
    joint_moves,
    place_bodies,
    point_of,
)

DEAD_CENTRE = 1e-9  # pivots of C_p and det J relative to their sizes


class Equations(NamedTuple):
    """What is solved for a leg.

    Attributes:
        chain: One row a joint (N, 8), see `LegTree.chain`.
        loops: One row a coincidence (L, 8), see `LegTree.loops`.
        foot: Body and point of the foot (4,).
        rows: Equations of the coincidences that are independent (m,).
        actuated: Numbers of the actuated joints (n,).
        passive: Numbers of the passive joints (m,).
        rest: Actuated joints of the initial posture (n,).
        normal: Of a leg with two actuated joints, v_1 x v_2 of the foot in the initial posture, of
            length 1 and in axes of the foot's body (3,); else it means nothing.
        signs: Signs that det C_p and det J keep (2,); 0 for one that may have either.
    """

    chain: FloatArray
    loops: FloatArray
    foot: FloatArray
    rows: FloatArray
    actuated: FloatArray
    passive: FloatArray
    rest: FloatArray
    normal: FloatArray
    signs: FloatArray


class Found(NamedTuple):
    """Room for what is found of one posture.

    Attributes:
        rotations: Of the bodies (N + 1, 3, 3).
        origins: Of the bodies (N + 1, 3).
        axes: Of the joints (N, 3).
        values: The equations of all coincidences (3 L,).
        columns: Their derivatives (3 L, N).
        work: C_p (m, m), and beside it X (m, n) and y (m, 1).
        foot: Twist of the foot's body by all joints (6, N).
        twist: J above J_omega (6, n).
        step: Of the actuated joints (n,).
        away: From the initial posture (n,).
        error: Of the foot (3,).
    """

    rotations: FloatArray
    origins: FloatArray
    axes: FloatArray
    values: FloatArray
    columns: FloatArray
    work: FloatArray
    foot: FloatArray
    twist: FloatArray
    step: FloatArray
    away: FloatArray
    error: FloatArray


@scalar
def new_room(joints, coincidences, n):
    """Return room for a leg with so many joints, coincidences and actuators."""
    m = joints - n
    return Found(
        np.empty((joints + 1, 3, 3)),
        np.empty((joints + 1, 3)),
        np.empty((joints, 3)),
        np.empty(3 * coincidences),
        np.empty((3 * coincidences, joints)),
        np.empty((m, m + n + 1)),
        np.empty((6, joints)),
        np.empty((6, n)),
        np.empty(n),
        np.empty(n),
        np.empty(3),
    )


@scalar
def fill_loops(chain, loops, room):
    """Fill the equations of all coincidences (3 L,) and their derivatives (3 L, N)."""
    rotations, origins, axes = room.rotations, room.origins, room.axes
    values, columns = room.values, room.columns
    columns[:, :] = 0.0
    for i in range(len(loops)):
        first, second = int(loops[i, 0]), int(loops[i, 4])
        a = point_of(rotations, origins, first, loops[i, 1], loops[i, 2], loops[i, 3])
        b = point_of(rotations, origins, second, loops[i, 5], loops[i, 6], loops[i, 7])
        frame = rotations[first]
        for r in range(3):
            values[3 * i + r] = (
                frame[0, r] * (b[0] - a[0])
                + frame[1, r] * (b[1] - a[1])
                + frame[2, r] * (b[2] - a[2])
            )
        for side in range(2):
            body, sign = (first, -1.0) if side == 0 else (second, 1.0)
            x, y, z = a if side == 0 else b
            while body > 0:
                k = body - 1
                vx, vy, vz = joint_moves(chain, k, origins, axes, x, y, z)
                for r in range(3):
                    columns[3 * i + r, k] += sign * (
                        frame[0, r] * vx + frame[1, r] * vy + frame[2, r] * vz
                    )
                body = int(chain[k, PARENT])


@scalar
def eliminate(rows, actuated, passive, room):
    """Solve C_p (X, y) = (C_a, c) into the right of `work` (m, m + n + 1).

    Returns:
        The sign of det C_p, 0 where the passive joints are not determined.
    """
    values, columns, work = room.values, room.columns, room.work
    m, n = len(passive), len(actuated)
    sign = 1.0
    for r in range(m):
        row = int(rows[r])
        for c in range(m):
            work[r, c] = columns[row, int(passive[c])]
        for c in range(n):
            work[r, m + c] = columns[row, int(actuated[c])]
        work[r, m + n] = values[row]
    for c in range(m):
        best, size = c, abs(work[c, c])
        for r in range(c + 1, m):
            if abs(work[r, c]) > size:
                best, size = r, abs(work[r, c])
        if not size > DEAD_CENTRE:
            return 0.0
        if best != c:
            sign = -sign
            for k in range(c, m + n + 1):
                work[c, k], work[best, k] = work[best, k], work[c, k]
        if work[c, c] < 0.0:
            sign = -sign
        inverse = 1.0 / work[c, c]
        for r in range(c + 1, m):
            factor = work[r, c] * inverse
            if factor != 0.0:
                for k in range(c + 1, m + n + 1):
                    work[r, k] -= factor * work[c, k]
    for c in range(m - 1, -1, -1):
        inverse = 1.0 / work[c, c]
        for k in range(m, m + n + 1):
            total = work[c, k]
            for j in range(c + 1, m):
                total -= work[c, j] * work[j, k]
            work[c, k] = total * inverse
    return sign


@scalar
def evaluate(leg, q, room):
    """Find what there is to know at joint positions: loops, foot, both Jacobians.

    Returns:
        The foot, the largest remainder of a loop and the sign of det C_p.
    """
    place_bodies(leg.chain, q, room.rotations, room.origins, room.axes)
    m, n = len(leg.passive), len(leg.actuated)
    sign, open_by = 1.0, 0.0
    if m:
        fill_loops(leg.chain, leg.loops, room)
        for r in range(len(room.values)):
            open_by = max(open_by, abs(room.values[r]))
        sign = eliminate(leg.rows, leg.actuated, leg.passive, room)
    x, y, z = fill_foot_columns(
        leg.chain, leg.foot, room.rotations, room.origins, room.axes, room.foot
    )
    for r in range(6):
        for c in range(n):
            total = room.foot[r, int(leg.actuated[c])]
            for k in range(m):
                total -= room.foot[r, int(leg.passive[k])] * room.work[k, m + c]
            room.twist[r, c] = total if sign != 0.0 else math.nan
    return (x, y, z), open_by, sign
