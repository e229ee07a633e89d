# SPDX-License-Identifier: Apache-2.0
"""Legs of any chain, by Newton's method along paths from known postures.

Unknown are all joint positions, actuated a and passive p. Equations are the coincidences that close
the loops, c(a, p) = 0, and the foot, f(a, p). A step of Newton's method eliminates the passive
joints, by which the Jacobians of the leg come along:

    C_p X = C_a,   C_p y = c        (elimination with pivots)
    J = F_a - F_p X                 foot by actuated joints, the loops closed
    J da = (foot - f) + F_p y,      dp = -y - X da

A posture is followed from a known one along a straight line, of the foot or of the actuated joints,
in steps that are halved until Newton's method settles from each to the next and neither det C_p nor
det J has changed its sign, that is, no singularity was passed. So an answer depends on nothing but
its point, and stays on its branch.

Each coincidence is three equations in axes of its first body. Where loops are plane some are always
fulfilled; `rows` are those that are independent. At the end all must hold.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.kernels.kernel import scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.model.chain import (
    PARENT,
    fill_foot_columns,
    fill_weights,
    joint_moves,
    place_bodies,
    point_of,
)
from leg_kinematics.status import Status

UNREACHABLE, INVALID_INPUT = int(Status.UNREACHABLE), int(Status.INVALID_INPUT)

CLOSED = 1e-11  # what may remain of an equation, relative to a leg of 1 m
REACHED = 1e-6  # m, how far a foot with fewer than three actuators may be from what it can reach
SETTLED = 1e-12  # last step of such a leg
JOINTS, FOOT = 0, 1  # what a posture is followed by
SMALLEST_STEP = 1.0 / 256.0  # of a path
LONGEST_TURN = 0.6  # rad or m, of a joint in one step of Newton's method
MOST_ITERATIONS = 12
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
        signs: Signs that det C_p and det J keep (2,); 0 for one that may have either.
    """

    chain: FloatArray
    loops: FloatArray
    foot: FloatArray
    rows: FloatArray
    actuated: FloatArray
    passive: FloatArray
    rest: FloatArray
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
def solve_actuated(twist, error, away, step):
    """Fill the step of the actuated joints that moves the foot by `error`.

    With fewer than three joints it is the least-squares step; with more, of those that move the
    foot so, the one nearest to `away`.

    Returns:
        det J for three joints, and for others a number that vanishes where J loses rank.
    """
    n = len(step)
    if n == 3:
        a, b, c = twist[0, 0], twist[1, 0], twist[2, 0]
        d, e, f = twist[0, 1], twist[1, 1], twist[2, 1]
        g, h, i = twist[0, 2], twist[1, 2], twist[2, 2]
        x, y, z = e * i - f * h, f * g - d * i, d * h - e * g
        det = a * x + b * y + c * z
        u, v, w = error[0], error[1], error[2]
        step[0] = (x * u + y * v + z * w) / det
        step[1] = ((c * h - b * i) * u + (a * i - c * g) * v + (b * g - a * h) * w) / det
        step[2] = ((b * f - c * e) * u + (c * d - a * f) * v + (a * e - b * d) * w) / det
        size = math.sqrt(
            (a * a + b * b + c * c) * (d * d + e * e + f * f) * (g * g + h * h + i * i)
        )
        return det / size if size > 0.0 else 0.0
    k = min(n, 3)
    gram = np.zeros((k, k + 1))
    for r in range(k):
        for c in range(k):
            for j in range(max(n, 3)):
                gram[r, c] += twist[j, r] * twist[j, c] if n < 3 else twist[r, j] * twist[c, j]
        if n < 3:
            for j in range(3):
                gram[r, k] += twist[j, r] * error[j]
        else:
            gram[r, k] = error[r]
            for j in range(n):
                gram[r, k] -= twist[r, j] * away[j]
    largest = 0.0
    for r in range(k):
        largest = max(largest, gram[r, r])
    smallest = 1.0
    for c in range(k):  # symmetric and definite: pivots on the diagonal
        pivot = gram[c, c]
        smallest = min(smallest, pivot / largest if largest > 0.0 else 0.0)
        if not pivot > 0.0:
            return 0.0
        for r in range(k):
            if r != c:
                factor = gram[r, c] / pivot
                for j in range(c, k + 1):
                    gram[r, j] -= factor * gram[c, j]
    for j in range(n):
        step[j] = away[j] if n > 3 else 0.0
        if n < 3:
            step[j] = gram[j, k] / gram[j, j]
        else:
            for r in range(3):
                step[j] += twist[r, j] * gram[r, k] / gram[r, r]
    return smallest


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


@scalar
def step_to_foot(leg, q, goal, foot, room):
    """Fill the step of the actuated joints towards a foot.

    Returns:
        How far the foot is, and det J; see `solve_actuated`.
    """
    m, n = len(leg.passive), len(leg.actuated)
    far = 0.0
    for r in range(3):
        room.error[r] = goal[r] - foot[r]
        far = max(far, abs(room.error[r]))
        for k in range(m):
            room.error[r] += room.foot[r, int(leg.passive[k])] * room.work[k, m + n]
    for k in range(n):
        room.away[k] = leg.rest[k] - q[int(leg.actuated[k])]
    return far, solve_actuated(room.twist, room.error, room.away, room.step)


@scalar
def step_to_joints(leg, q, goal, room):
    """Fill the step of the actuated joints towards given ones.

    Returns:
        How far they are, and det J; see `solve_actuated`.
    """
    for k in range(len(leg.actuated)):
        room.away[k] = 0.0
    room.error[:] = 0.0
    det = solve_actuated(room.twist, room.error, room.away, room.step)
    far = 0.0
    for k in range(len(leg.actuated)):
        room.step[k] = goal[k] - q[int(leg.actuated[k])]
        far = max(far, abs(room.step[k]))
    return far, det


@scalar
def take_step(leg, q, room):
    """Move all joints by a step of the actuated ones; return the largest move."""
    m, n = len(leg.passive), len(leg.actuated)
    largest = 0.0
    for k in range(n):
        largest = max(largest, abs(room.step[k]))
        q[int(leg.actuated[k])] += room.step[k]
    for k in range(m):
        move = -room.work[k, m + n]
        for c in range(n):
            move -= room.work[k, m + c] * room.step[c]
        largest = max(largest, abs(move))
        q[int(leg.passive[k])] += move
    return largest


@scalar
def settle(leg, goal, aim, q, room):
    """Bring joint positions to a goal close by: of the foot (3,) or of the actuated joints (n,).

    Returns:
        Whether Newton's method settled, the sign of det C_p, and det J; see `solve_actuated`.
    """
    square = aim == JOINTS or len(leg.actuated) == 3  # equations determine the step
    before = math.inf
    for _ in range(MOST_ITERATIONS if len(leg.actuated) <= 3 else 10 * MOST_ITERATIONS):
        foot, open_by, sign = evaluate(leg, q, room)
        if sign == 0.0 or not math.isfinite(foot[0] + foot[1] + foot[2] + open_by):
            return False, 0.0, 0.0
        if aim == FOOT:
            far, det = step_to_foot(leg, q, goal, foot, room)
            if not abs(det) > DEAD_CENTRE:
                return False, sign, 0.0
        else:
            far, det = step_to_joints(leg, q, goal, room)
        if square and max(open_by, far) <= CLOSED:
            return True, sign, det
        move = take_step(leg, q, room)
        if not square and move <= SETTLED and open_by <= CLOSED:
            return far <= REACHED, sign, det
        shrinks = move <= 0.5 * before or move < 1e-10 or len(leg.actuated) > 3
        if not (move <= LONGEST_TURN and shrinks):
            return False, sign, det
        before = move
    return False, 0.0, 0.0


@scalar
def follow(leg, start, begin, end, aim, q, room):
    """Follow a posture along a straight line of the foot or of the actuated joints.

    Args:
        leg: Its `Equations`.
        start: All joint positions at the begin of the line (N,).
        begin: Where the line begins (3,) or (n,).
        end: Where it ends.
        aim: FOOT or JOINTS.
        q: Filled with all joint positions at the end.
        room: Filled with what is found there.

    Returns:
        Whether the end was reached without passing a singularity, and the signs there.
    """
    done, part, sign, det = 0.0, 1.0, 0.0, 0.0
    goal, last = np.empty(len(end)), np.empty(len(q))
    q[:] = start
    while done < 1.0:
        to = min(1.0, done + part)
        last[:] = q
        for k in range(len(end)):
            goal[k] = begin[k] + to * (end[k] - begin[k]) if to < 1.0 else end[k]
        settled, sign, det = settle(leg, goal, aim, q, room)
        if settled and sign * leg.signs[0] >= 0.0 and det * leg.signs[1] >= 0.0:
            done, part = to, 2.0 * part
            continue
        q[:] = last
        part *= 0.5
        if part < SMALLEST_STEP:
            return False, 0.0, 0.0
    return True, sign, det


@points_kernel(
    "(n,8),(l,8),(4),(r),(a),(p),(a),(2),(points,n),(points,w),(points,w),(points)"
    "->(points,n),(points,3),(points,6,a),(points,2),(points)",
    "f8 f8 f8 f8 f8 f8 f8 f8 f8 f8 f8 u1 f8 f8 f8 f8 u1",
)
def follow_postures(
    chain: Any, loops: Any, foot: Any, rows: Any, actuated: Any, passive: Any, rest: Any,
    signs: Any, start: Any, begin: Any, end: Any, aim: Any,
    q: Any, place: Any, twist: Any, kept: Any, status: Any,
) -> None:  # fmt: skip
    """Follow postures `start` (n,) to where feet or actuated joints end (w,), as `aim` tells.

    What is found: all joint positions, the foot, J above J_omega, the signs of det C_p and det J,
    and a status, of which limits are not a part; NaN where there is no such posture.
    """
    leg = Equations(chain, loops, foot, rows, actuated, passive, rest, signs)
    room = new_room(len(chain), len(loops), len(actuated))
    for i in range(len(start)):
        finite = 0.0
        for k in range(end.shape[1]):
            finite += end[i, k]
        status[i] = UNREACHABLE if math.isfinite(finite) else INVALID_INPUT
        if math.isfinite(finite):
            reached, sign, det = follow(leg, start[i], begin[i], end[i], aim[i], q[i], room)
            if reached:
                status[i] = 0
                kept[i, 0], kept[i, 1] = sign, det
                place[i, 0], place[i, 1], place[i, 2] = point_of(
                    room.rotations, room.origins, int(foot[0]), foot[1], foot[2], foot[3]
                )
                twist[i] = room.twist
                continue
        q[i, :], place[i, :], twist[i, :, :], kept[i, :] = math.nan, math.nan, math.nan, math.nan


@points_kernel(
    "(n,8),(l,8),(4),(r),(a),(p),(a),(2),(points,n)->(points,6,a)", "f8 f8 f8 f8 f8 f8 f8 f8 f8 f8"
)
def twist_jacobian(
    chain: Any, loops: Any, foot: Any, rows: Any, actuated: Any, passive: Any, rest: Any,
    signs: Any, q: Any, twist: Any,
) -> None:  # fmt: skip
    """J above J_omega of postures (n,)."""
    leg = Equations(chain, loops, foot, rows, actuated, passive, rest, signs)
    room = new_room(len(chain), len(loops), len(actuated))
    for i in range(len(q)):
        evaluate(leg, q[i], room)
        twist[i] = room.twist


@points_kernel(
    "(n,8),(l,8),(n,4),(r),(a),(p),(points,n),(points,3)->(points,a)",
    "f8 f8 f8 f8 f8 f8 f8 f8 f8",
)
def holding_efforts(
    chain: Any, loops: Any, masses: Any, rows: Any, actuated: Any, passive: Any, q: Any,
    gravity: Any, efforts: Any,
) -> None:  # fmt: skip
    """Efforts of the actuators that hold the links' weight in postures (n,).

    A passive joint bears nothing, so what gravity does to it reaches the actuators: Xᵀ of it.
    """
    n, m = len(actuated), len(passive)
    room, weights = new_room(len(chain), len(loops), n), np.empty(len(chain))
    for i in range(len(q)):
        place_bodies(chain, q[i], room.rotations, room.origins, room.axes)
        fill_weights(chain, masses, gravity[i], room.rotations, room.origins, room.axes, weights)
        sign = 1.0
        if m:
            fill_loops(chain, loops, room)
            sign = eliminate(rows, actuated, passive, room)
        for c in range(n):
            total = -weights[int(actuated[c])]
            for k in range(m):
                total += weights[int(passive[k])] * room.work[k, m + c]
            efforts[i, c] = total if sign != 0.0 else math.nan


@points_kernel("(n,8),(points,n)->(points,n,3)", "f8 f8 f8")
def joint_places(chain: Any, q: Any, places: Any) -> None:
    """Origins of the joints in the leg frame."""
    n = len(chain)
    rotations, origins, axes = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3)), np.empty((n, 3))
    for i in range(len(q)):
        place_bodies(chain, q[i], rotations, origins, axes)
        places[i] = origins[1:]
