# SPDX-License-Identifier: Apache-2.0
"""Newton's method along paths from known postures, for legs of any chain.

With the equations and the elimination of `equations`, a step is

    J da = (foot - f) + F_p y,      dp = -y - X da

A posture is followed from a known one along a straight line, of the foot or of the actuated joints,
in steps that are halved until Newton's method settles from each to the next and neither det C_p nor
det J has changed its sign, that is, no singularity was passed. So an answer depends on nothing but
its point, and stays on its branch. At the end all coincidences must hold.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from typing import Any

import numpy as np

from leg_kinematics.kernels.kernel import scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.model.chain import point_of
from leg_kinematics.model.equations import DEAD_CENTRE, Equations, evaluate, new_room
from leg_kinematics.status import Status

UNREACHABLE, INVALID_INPUT = int(Status.UNREACHABLE), int(Status.INVALID_INPUT)

CLOSED = 1e-12  # what may remain of an equation, relative to a leg of 1 m
REACHED = 1e-6  # m, how far a foot with fewer than three actuators may be from what it can reach
SETTLED = 1e-12  # last step of such a leg
JOINTS, FOOT = 0, 1  # what a posture is followed by
SMALLEST_STEP = 1.0 / 256.0  # of a path
LONGEST_TURN = 0.6  # rad or m, of a joint in one step of Newton's method
MOST_ITERATIONS = 16
# A step of Newton's method shrinks by this factor to the next one, or it left its basin. Close to a
# singularity steps are only halved; they may be, when they are short.
SHRINKS, SHRINKS_LATE, SHORT = 0.5, 0.7, 0.05  # [1, 1, rad or m]
WEAKEST_PULL = 1.0 / 32.0  # towards the initial posture, in a step of a redundant leg


@scalar
def solve_actuated(twist, error, away, step):
    """Fill the step of the actuated joints that moves the foot by `error`.

    With fewer than three joints it is the least-squares step; with more, of those that move the
    foot so, the one nearest to `away`.

    Returns:
        det J for three joints, relative to its size, and for others a number >= 0 that vanishes
        where J loses rank.
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
def regularity(leg, det, room):
    """Return what vanishes where the actuated joints lose hold of the foot.

    It is det J for three joints, relative to its size. Of two it is the component of v_1 x v_2
    along the normal that turns with the foot's body: so it has two signs for the two bends of a
    knee, and of a leg that only turns about a point. For other numbers it has no sign.
    """
    if len(leg.actuated) != 2:
        return det
    turn, n = room.rotations[int(leg.foot[0])], leg.normal
    total = 0.0
    a, b, c = room.twist[0, 0], room.twist[1, 0], room.twist[2, 0]
    d, e, f = room.twist[0, 1], room.twist[1, 1], room.twist[2, 1]
    across = (b * f - c * e, c * d - a * f, a * e - b * d)
    for r in range(3):
        total += across[r] * (turn[r, 0] * n[0] + turn[r, 1] * n[1] + turn[r, 2] * n[2])
    size = math.sqrt((a * a + b * b + c * c) * (d * d + e * e + f * f))
    return total / size if size > 0.0 else 0.0


@scalar
def step_to_foot(leg, q, goal, foot, pull, room):
    """Fill the step of the actuated joints towards a foot.

    That of more than three joints also goes the part `pull` of the way to the initial posture.

    Returns:
        How far the foot is, and its `regularity`.
    """
    m, n = len(leg.passive), len(leg.actuated)
    far = 0.0
    for r in range(3):
        room.error[r] = goal[r] - foot[r]
        far = max(far, abs(room.error[r]))
        for k in range(m):
            room.error[r] += room.foot[r, int(leg.passive[k])] * room.work[k, m + n]
    for k in range(n):
        room.away[k] = pull * (leg.rest[k] - q[int(leg.actuated[k])])
    det = solve_actuated(room.twist, room.error, room.away, room.step)
    return far, regularity(leg, det, room)


@scalar
def step_to_joints(leg, q, goal, room):
    """Fill the step of the actuated joints towards given ones.

    Returns:
        How far they are, and the `regularity` of the foot.
    """
    for k in range(len(leg.actuated)):
        room.away[k] = 0.0
    room.error[:] = 0.0
    det = solve_actuated(room.twist, room.error, room.away, room.step)
    far = 0.0
    for k in range(len(leg.actuated)):
        room.step[k] = goal[k] - q[int(leg.actuated[k])]
        far = max(far, abs(room.step[k]))
    return far, regularity(leg, det, room)


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
def contracts(before, move):
    """Tell whether a step of Newton's method after another one stays in its basin."""
    late = before < SHORT and move <= SHRINKS_LATE * before
    return move <= SHRINKS * before or late or move < 1e-10


@scalar
def settle(leg, goal, aim, q, room):
    """Bring joint positions to a goal close by: of the foot (3,) or of the actuated joints (n,).

    A foot with fewer than three actuators settles where it is nearest to the goal.

    Returns:
        Whether Newton's method settled, how far the goal is, the sign of det C_p, and `regularity`.
    """
    square = aim == JOINTS or len(leg.actuated) == 3  # equations determine the step
    before, pull = math.inf, 1.0
    for _ in range(MOST_ITERATIONS if len(leg.actuated) <= 3 else 10 * MOST_ITERATIONS):
        foot, open_by, sign = evaluate(leg, q, room)
        if sign == 0.0 or not math.isfinite(foot[0] + foot[1] + foot[2] + open_by):
            return False, math.inf, 0.0, 0.0
        if aim == FOOT:
            far, det = step_to_foot(leg, q, goal, foot, pull, room)
            if not abs(det) > DEAD_CENTRE:
                return False, far, sign, 0.0
        else:
            far, det = step_to_joints(leg, q, goal, room)
        if square and max(open_by, far) <= CLOSED:
            return True, far, sign, det
        move = take_step(leg, q, room)
        if not square and move <= SETTLED and open_by <= CLOSED:
            return True, far, sign, det
        if len(leg.actuated) > 3:
            pull = pull if move <= SHRINKS_LATE * before else max(0.5 * pull, WEAKEST_PULL)
        elif not contracts(before, move):
            return False, far, sign, det
        if not move <= LONGEST_TURN:
            return False, far, sign, det
        before = move
    return False, math.inf, 0.0, 0.0


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
        settled, far, sign, det = settle(leg, goal, aim, q, room)
        if settled and sign * leg.signs[0] >= 0.0 and det * leg.signs[1] >= 0.0:
            done, part = to, 2.0 * part
            if done == 1.0 and far > REACHED:
                return False, 0.0, 0.0
            continue
        q[:] = last
        part *= 0.5
        if part < SMALLEST_STEP:
            return False, 0.0, 0.0
    return True, sign, det


@points_kernel(
    "(n,8),(l,8),(4),(r),(a),(p),(a),(3),(2),(points,n),(points,w),(points,w),(points)"
    "->(points,n),(points,3),(points,6,a),(points,2),(points)",
    "f8 f8 f8 f8 f8 f8 f8 f8 f8 f8 f8 f8 u1 f8 f8 f8 f8 u1",
)
def follow_postures(
    chain: Any, loops: Any, foot: Any, rows: Any, actuated: Any, passive: Any, rest: Any,
    normal: Any, signs: Any, start: Any, begin: Any, end: Any, aim: Any,
    q: Any, place: Any, twist: Any, kept: Any, status: Any,
) -> None:  # fmt: skip
    """Follow postures `start` (n,) to where feet or actuated joints end (w,), as `aim` tells.

    What is found: all joint positions, the foot, J above J_omega, the signs of det C_p and det J,
    and a status, of which limits are not a part; NaN where there is no such posture.
    """
    leg = Equations(chain, loops, foot, rows, actuated, passive, rest, normal, signs)
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
