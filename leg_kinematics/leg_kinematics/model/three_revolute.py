# SPDX-License-Identifier: Apache-2.0
"""Legs of three revolute joints in a row: foot, Jacobians, and the inverse in closed form.

With u × v for the cross product and R_k = Rot(a_k, q_k), the foot is

    d = R1 (r2 + R2 (r3 + R3 f))

where r2, r3 and f are the offsets of joint 2, joint 3 and foot. Let g = r3 + R3 f and G the part of
R2 g across a2. The length of d and its component along a1 say (Pieper 1968)

    r2·G = E1 = (|d|² - |r2|² - |g|²) / 2 - (g·a2)(r2·a2)
    a1·G = E2 = a1·(d - r2) - (g·a2)(a1·a2)

If axes 1 and 2 meet or are parallel, the parts of r2 and a1 across a2 are along one direction w,
mu w and nu w. Then nu E1 = mu E2, which is linear in cos q3 and sin q3: two solutions. G is known
along w and in length: two solutions. q1 turns r2 + R2 g to d. If axes 2 and 3 meet or are parallel,
the same holds of the chain taken from its other end, with -a3, -a2, -a1, -r3, -r2 and f and d
exchanged. Legs whose hip rolls, hip pitches and knee bends are both.

Each leg so has four assembly modes, by the signs of two levers that vanish at its singularities.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from typing import Any

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.bodies import LegTree
from leg_kinematics.kernels.kernel import inlined, scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.scalars import arctan2, direction, within
from leg_kinematics.kernels.vectors import cross, inner
from leg_kinematics.status import Status

OK, UNREACHABLE, JOINT_LIMIT, _, SINGULAR, INVALID_INPUT = map(int, Status)

COPLANAR = 1e-9  # triple product of two axes and what is between them, by its length [1]
DEAD_CENTRE = 1e-9  # least lever, relative to its arm
# Rows of a leg's numbers (9, 3): axes, offsets, then w, (mu, nu, whether taken from the other end)
# and the middles of the joints' ranges.
A1, A2, A3, R2, R3, FOOT, W, PLAN, MIDDLE = range(9)


def three_revolute_numbers(tree: LegTree) -> FloatArray | None:
    """Return the numbers of a leg (9, 3) that the kernels take; None if it has no closed form."""
    joints = tree.joints
    if not tree.is_serial or [joint.type for joint in joints] != ["revolute"] * 3:
        return None
    a1, a2, a3 = (np.array(joint.axis) for joint in joints)
    r2, r3 = (np.array(joint.offset) for joint in joints[1:])
    middles = [
        0.5 * sum(joint.limits) if np.isfinite(joint.limits).all() else 0.0 for joint in joints
    ]
    for first, second, offset, from_foot in ((a1, a2, r2, 0.0), (-a3, -a2, -r3, 1.0)):
        size = float(np.linalg.norm(offset))
        if abs(float(np.dot(np.cross(first, second), offset))) > COPLANAR * size:
            continue
        parts = [v - second * np.dot(second, v) for v in (offset, first)]
        lengths = [float(np.linalg.norm(part)) for part in parts]
        if lengths[0] <= COPLANAR * size and lengths[1] <= COPLANAR:
            continue  # one axis twice
        w = parts[1] / lengths[1] if lengths[1] > COPLANAR else parts[0] / lengths[0]
        mu, nu = (float(np.dot(part, w)) for part in parts)
        plan = (mu, nu if lengths[1] > COPLANAR else 0.0, from_foot)
        return np.array([a1, a2, a3, r2, r3, tree.foot_point, w, plan, middles])
    return None


@inlined
def turned(vector, axis, cosine, sine):
    """Return Rot(axis, angle) vector."""
    across = cross(axis, vector)
    along = (1.0 - cosine) * inner(axis, vector)
    return (
        cosine * vector[0] + sine * across[0] + along * axis[0],
        cosine * vector[1] + sine * across[1] + along * axis[1],
        cosine * vector[2] + sine * across[2] + along * axis[2],
    )


@inlined
def plus(a, b):
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def minus(a):
    """Return -a."""
    return -a[0], -a[1], -a[2]


@inlined
def vector_of(row):
    """Return a row as a tuple."""
    return row[0], row[1], row[2]


@inlined
def ends(g, foot):
    """Return axes, offsets and ends in the order in which the equations are solved."""
    a1, a2, a3 = vector_of(g[A1]), vector_of(g[A2]), vector_of(g[A3])
    r2, r3, f = vector_of(g[R2]), vector_of(g[R3]), vector_of(g[FOOT])
    if g[PLAN, 2] == 1.0:
        return minus(a3), minus(a2), minus(a1), minus(r3), minus(r2), foot, f
    return a1, a2, a3, r2, r3, f, foot


@inlined
def last_joint(g, a1, a2, a3, r2, r3, f, d):
    """Return A, B, C of A cos q3 + B sin q3 = C, which is nu E1 = mu E2."""
    mu, nu = g[PLAN, 0], g[PLAN, 1]
    side = cross(a3, f)
    along = inner(a3, f)
    k0, l0 = along * inner(a3, r3), along * inner(a3, a2)
    m = nu * inner(r2, a2) - mu * inner(a1, a2)
    a = nu * (inner(r3, f) - k0) + m * (inner(a2, f) - l0)
    b = nu * inner(r3, side) + m * inner(a2, side)
    difference = inner(d, d) - inner(r2, r2) - inner(r3, r3) - inner(f, f)
    lift = m * (l0 + inner(r3, a2))
    c = nu * (0.5 * difference - k0) - lift - mu * (inner(a1, d) - inner(a1, r2))
    return a, b, c


@scalar
def angles_of_foot(g, last_sign, middle_sign, foot):
    """Return the joint positions of a mode that reach a foot, NaN out of reach, and the levers."""
    a1, a2, a3, r2, r3, f, d = ends(g, foot)
    a, b, c = last_joint(g, a1, a2, a3, r2, r3, f, d)
    mu, nu, w = g[PLAN, 0], g[PLAN, 1], vector_of(g[W])
    square = a * a + b * b
    root = last_sign * math.sqrt(square - c * c)  # NaN out of reach
    c3, s3 = (a * c - b * root) / square, (b * c + a * root) / square
    reached = plus(r3, turned(f, a3, c3, s3))
    t = cross(a2, w)
    along = inner(reached, a2)
    e1 = 0.5 * (inner(d, d) - inner(r2, r2) - inner(reached, reached)) - along * inner(r2, a2)
    e2 = inner(a1, d) - inner(a1, r2) - along * inner(a1, a2)
    g_w, g_t = inner(reached, w), inner(reached, t)
    to_w = (mu * e1 + nu * e2) / (mu * mu + nu * nu)
    across = math.sqrt(g_w * g_w + g_t * g_t)
    to_t = middle_sign * math.sqrt(across * across - to_w * to_w)
    q2 = arctan2(g_w * to_t - g_t * to_w, g_w * to_w + g_t * to_t)
    h = (
        r2[0] + along * a2[0] + to_w * w[0] + to_t * t[0],
        r2[1] + along * a2[1] + to_w * w[1] + to_t * t[1],
        r2[2] + along * a2[2] + to_w * w[2] + to_t * t[2],
    )
    q1 = arctan2(inner(cross(a1, h), d), inner(h, d) - inner(a1, h) * inner(a1, d))
    q3 = arctan2(s3, c3)
    last, middle = root / math.sqrt(square), to_t / across
    if g[PLAN, 2] == 1.0:
        return (q3, q2, q1), last, middle
    return (q1, q2, q3), last, middle


@scalar
def levers_of_angles(g, q, foot):
    """Return the two levers (last, middle) whose signs are the mode, relative to their arms."""
    a1, a2, a3, r2, r3, f, d = ends(g, foot)
    a, b, _ = last_joint(g, a1, a2, a3, r2, r3, f, d)
    c2, s2 = direction(q[1])
    c3, s3 = direction(q[0] if g[PLAN, 2] == 1.0 else q[2])
    reached = plus(r3, turned(f, a3, c3, s3))
    w = vector_of(g[W])
    t = cross(a2, w)
    g_w, g_t = inner(reached, w), inner(reached, t)
    last = (a * s3 - b * c3) / math.sqrt(a * a + b * b)
    return last, (c2 * g_t + s2 * g_w) / math.sqrt(g_w * g_w + g_t * g_t)


@inlined
def foot_of_angles(g, q):
    """Return the foot, and the axes and origins of joints 2 and 3."""
    a1, a2, a3 = vector_of(g[A1]), vector_of(g[A2]), vector_of(g[A3])
    c1, s1 = direction(q[0])
    c2, s2 = direction(q[1])
    c3, s3 = direction(q[2])
    z2, o2 = turned(a2, a1, c1, s1), turned(vector_of(g[R2]), a1, c1, s1)
    z3 = turned(turned(a3, a2, c2, s2), a1, c1, s1)
    o3 = plus(o2, turned(turned(vector_of(g[R3]), a2, c2, s2), a1, c1, s1))
    shin = turned(vector_of(g[FOOT]), a3, c3, s3)
    foot = plus(o3, turned(turned(shin, a2, c2, s2), a1, c1, s1))
    return foot, z2, o2, z3, o3


@inlined
def fill_twist(g, q, twist):
    """Fill J above J_omega (6, 3)."""
    foot, z2, o2, z3, o3 = foot_of_angles(g, q)
    z1 = vector_of(g[A1])
    v1 = cross(z1, foot)
    v2 = cross(z2, (foot[0] - o2[0], foot[1] - o2[1], foot[2] - o2[2]))
    v3 = cross(z3, (foot[0] - o3[0], foot[1] - o3[1], foot[2] - o3[2]))
    for k in range(3):
        twist[k, 0], twist[k, 1], twist[k, 2] = v1[k], v2[k], v3[k]
        twist[3 + k, 0], twist[3 + k, 1], twist[3 + k, 2] = z1[k], z2[k], z3[k]


@inlined
def at_limits(q, limits):
    """Return the status of a posture on its branch; a whole turn of range bounds nothing."""
    status = OK
    for k in range(3):
        endless = limits[k, 1] - limits[k, 0] >= 2.0 * math.pi - 1e-9
        if not (endless or within(q[k], limits[k])):
            status = JOINT_LIMIT
    return status


@points_kernel("(g,3),(2),(3,2),(points,3)->(points,3),(points)", "f8 f8 f8 f8 f8 u1")
def inverse(g: Any, signs: Any, limits: Any, foot: Any, q: Any, status: Any) -> None:
    """Foot position to joint positions."""
    for i in range(len(foot)):
        status[i] = solve_point(g, signs, limits, foot[i], q[i])


@points_kernel(
    "(g,3),(2),(3,2),(points,3)->(points,3),(points),(points,6,3)", "f8 f8 f8 f8 f8 u1 f8"
)
def inverse_with_twist(
    g: Any, signs: Any, limits: Any, foot: Any, q: Any, status: Any, twist: Any
) -> None:
    """Foot position to joint positions, J and J_omega."""
    for i in range(len(foot)):
        status[i] = solve_point(g, signs, limits, foot[i], q[i])
        fill_twist(g, q[i], twist[i])


@scalar
def solve_point(g, signs, limits, foot, q):
    """Fill the joint positions of a foot and return its status."""
    q[0] = q[1] = q[2] = math.nan
    if not math.isfinite(foot[0] + foot[1] + foot[2]):
        return INVALID_INPUT
    angles, last, middle = angles_of_foot(g, signs[0], signs[1], (foot[0], foot[1], foot[2]))
    if not math.isfinite(angles[0] + angles[1] + angles[2]):
        return UNREACHABLE
    for k in range(3):  # the turn of each that its range holds
        turns = math.floor((angles[k] - g[MIDDLE, k]) / (2.0 * math.pi) + 0.5)
        q[k] = angles[k] - 2.0 * math.pi * turns
    if not (last * signs[0] > DEAD_CENTRE and middle * signs[1] > DEAD_CENTRE):
        return SINGULAR
    return at_limits(q, limits)


@points_kernel("(g,3),(2),(3,2),(points,3)->(points,3),(points)", "f8 f8 f8 f8 f8 u1")
def forward(g: Any, signs: Any, limits: Any, q: Any, foot: Any, status: Any) -> None:
    """Joint positions to foot position."""
    for i in range(len(q)):
        foot[i, 0] = foot[i, 1] = foot[i, 2] = math.nan
        if not math.isfinite(q[i, 0] + q[i, 1] + q[i, 2]):
            status[i] = INVALID_INPUT
            continue
        place, _, _, _, _ = foot_of_angles(g, q[i])
        foot[i, 0], foot[i, 1], foot[i, 2] = place
        last, middle = levers_of_angles(g, q[i], place)
        on_branch = last * signs[0] > DEAD_CENTRE and middle * signs[1] > DEAD_CENTRE
        status[i] = at_limits(q[i], limits) if on_branch else SINGULAR


@points_kernel("(g,3),(points,3),(points,3)->(points,2)", "f8 f8 f8 f8")
def levers(g: Any, q: Any, foot: Any, levers: Any) -> None:
    """The levers whose signs are the mode."""
    for i in range(len(q)):
        place = (foot[i, 0], foot[i, 1], foot[i, 2])
        levers[i, 0], levers[i, 1] = levers_of_angles(g, q[i], place)


@points_kernel("(g,3),(points,3)->(points,6,3)", "f8 f8 f8")
def twist_jacobian(g: Any, q: Any, twist: Any) -> None:
    """J above J_omega."""
    for i in range(len(q)):
        fill_twist(g, q[i], twist[i])
