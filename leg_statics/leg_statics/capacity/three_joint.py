# SPDX-License-Identifier: Apache-2.0
"""Load capacity of a leg with three actuators whose limits admit the unloaded pose, quickly.

That is the common case; `problem` explains the problem and handles all others. There is no branch
in this module, so that loops over points are compiled to instructions for several points at once:
every candidate for the optimum is computed, then the right one is picked.

A joint is the tuple (ax, ay, az, ratio, index) with a = column / up and ratio = up / down, where
column is that of the Jacobian along the axes of `problem.load_axes`. The force (x, y, 1) uses the
part s = max(a·(x, y, 1), -ratio a·(x, y, 1)) of its limits.
"""

# The compiler infers the types of this code; only what Python reads is annotated.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from typing import NamedTuple

from leg_kinematics.kernels.kernel import inlined
from leg_kinematics.kernels.vectors import cross, inner

SAME = 1e-11  # two values of s differ by rounding only
ILL_CONDITIONED = 1e-8  # s relative to that of a unit force, below which rounding needs care
LARGE = 1e50  # products of four such numbers are far from overflow


class ThreeJointCapacity(NamedTuple):
    """Load capacity of one point.

    Attributes:
        capacity: Largest load.
        force: A force that attains it, divided by it (3,).
        limiting_joint: Index of the joint that limits it, as a float.
        friction_limited: Whether the force is on the friction cone.
        rough: Largest load if the ground gave any force.
        certain: Whether all this is certain; if not, nothing of it counts.
    """

    capacity: float
    force: tuple[float, float, float]
    limiting_joint: float
    friction_limited: bool
    rough: float
    certain: bool


@inlined
def three_joint_capacity(columns, up, down, mu, axes):
    """Return the load capacity of a leg with three actuators.

    Args:
        columns: The columns of the Jacobian, 3 tuples (3,).
        up: Room for efforts Jᵀ F > 0 (3,).
        down: Room for efforts Jᵀ F < 0 (3,).
        mu: Friction coefficient.
        axes: The three vectors of F = (x, y, 1) / s, see `problem.load_axes`.
    """
    p = _joint(columns[0], up[0], down[0], axes, 0.0)
    q = _joint(columns[1], up[1], down[1], axes, 1.0)
    r = _joint(columns[2], up[2], down[2], axes, 2.0)
    s, x, y, index, on_rim, rough, certain = _solve(p, q, r, mu)
    capacity = 1.0 / s
    force = force_along(axes, 1.0, x, y)
    certain &= _is_ordinary(p) & _is_ordinary(q) & _is_ordinary(r) & (mu >= 0.0)
    certain &= math.isfinite(capacity * (force[0] + force[1] + force[2]))
    return ThreeJointCapacity(capacity, force, index, on_rim | (mu == 0.0), 1.0 / rough, certain)


@inlined
def force_along(axes, size, x, y):
    """Return the force size (x, y, 1) in the given axes."""
    a, b, c = axes
    return (
        size * (x * a[0] + y * b[0] + c[0]),
        size * (x * a[1] + y * b[1] + c[1]),
        size * (x * a[2] + y * b[2] + c[2]),
    )


@inlined
def dot(a, x, y):
    """Return a·(x, y, 1)."""
    return a[0] * x + a[1] * y + a[2]


@inlined
def _joint(column, up, down, axes, index):
    """Return a joint; its ratio is NaN if a limit leaves nothing or is of no ordinary size."""
    per_up = 1.0 / up
    ordinary = (up > 1.0 / LARGE) & (up < LARGE) & (down > 1.0 / LARGE) & (down < LARGE)
    ratio = up / down if ordinary else math.nan
    across, along, normal = axes
    return (
        per_up * inner(column, across),
        per_up * inner(column, along),
        per_up * inner(column, normal),
        ratio,
        index,
    )


@inlined
def _is_ordinary(joint):
    """Return whether the zero force is inside both limits and all numbers are far from overflow."""
    return (_size(joint) < LARGE) & (joint[3] < LARGE)


@inlined
def _size(joint):
    """Return the sum of the absolute components of a."""
    return abs(joint[0]) + abs(joint[1]) + abs(joint[2])


@inlined
def _pick(condition, a, b):
    """Return joint a if `condition` else b, item by item."""
    return (
        a[0] if condition else b[0],
        a[1] if condition else b[1],
        a[2] if condition else b[2],
        a[3] if condition else b[3],
        a[4] if condition else b[4],
    )


@inlined
def _use(joint, x, y):
    """Return the part of a joint's limits that the force (x, y, 1) uses."""
    effort = dot(joint, x, y)
    opposite = -joint[3] * effort
    return effort if effort > opposite else opposite


@inlined
def _most_used(p, q, r, x, y):
    """Return the joint of which the force (x, y, 1) uses most, and that use."""
    use_p, use_q, use_r = _use(p, x, y), _use(q, x, y), _use(r, x, y)
    joint = _pick(use_q > use_p, q, p)
    most = use_q if use_q > use_p else use_p
    return _pick(use_r > most, r, joint), use_r if use_r > most else most


@inlined
def _solve(p, q, r, mu):
    """Return the optimum (s, x, y, joint, on_rim), s for mu = inf, and whether it is certain.

    s(x, y) is the largest use of the three joints, convex, so its least value over the disc is
    that of one joint alone if the others use less there, else it is where all three are equal if
    that lies in the disc, else it is where two are equal on the rim.
    """
    lead, least = _hardest(p, q, r, mu)
    x_one, y_one = _easiest_on_rim(lead, mu)
    second, s_one = _most_used(p, q, r, x_one, y_one)
    one = (s_one > 0.0) & (s_one <= least * (1.0 + SAME))

    s_three, x_three, y_three, index_three = _meeting_of_three(p, q, r)
    three = x_three * x_three + y_three * y_three <= mu * mu

    a, b = _binding(lead, 0.0, 0.0), _binding(second, x_one, y_one)
    s_two, x_two, y_two, index_two, rim_two, two = _meeting_on_rim(a, b, p, q, r, mu)

    s = s_one if one else (s_three if three else s_two)
    x = x_one if one else (x_three if three else x_two)
    y = y_one if one else (y_three if three else y_two)
    index = lead[4] if one else (index_three if three else index_two)
    on_rim = one | (rim_two & (not three))
    _, centre = _most_used(p, q, r, 0.0, 0.0)
    upright = centre <= s * (1.0 + SAME)  # as good, with less tangential force
    x = 0.0 if upright else x
    y = 0.0 if upright else y
    size = _size(p) * max(1.0, p[3]) + _size(q) * max(1.0, q[3]) + _size(r) * max(1.0, r[3])
    certain = (one | three | two) & (s > ILL_CONDITIONED * size * (1.0 + abs(x) + abs(y)))
    return s, x, y, index, on_rim & (not upright), s_three, certain & (s_three > 0.0)


@inlined
def _binding(joint, x, y):
    """Return the limit that the force (x, y, 1) approaches as a plane s >= a·(x, y, 1)."""
    factor = 1.0 if dot(joint, x, y) > 0.0 else -joint[3]
    return factor * joint[0], factor * joint[1], factor * joint[2], joint[4]


@inlined
def _hardest(p, q, r, mu):
    """Return the joint whose least use over the disc is largest, and that use (or less if <= 0)."""
    least_p, least_q, least_r = _least_use(p, mu), _least_use(q, mu), _least_use(r, mu)
    joint = _pick(least_q > least_p, q, p)
    most = least_q if least_q > least_p else least_p
    return _pick(least_r > most, r, joint), least_r if least_r > most else most


@inlined
def _least_use(joint, mu):
    """Return a joint's least use over the disc; zero or less if it can be unloaded there."""
    least = abs(joint[2]) - mu * math.sqrt(joint[0] * joint[0] + joint[1] * joint[1])
    return least if joint[2] > 0.0 else least * joint[3]


@inlined
def _easiest_on_rim(joint, mu):
    """Return the point of the rim at which a joint's use is least, or the centre if all are."""
    slope = math.sqrt(joint[0] * joint[0] + joint[1] * joint[1])
    reach = math.copysign(mu / slope, -joint[2])
    reach = reach if slope > 0.0 else 0.0
    return reach * joint[0], reach * joint[1]


@inlined
def _meeting_of_three(p, q, r):
    """Return where three joints are used alike: the optimum without friction.

    Duality: the multipliers of e = Jᵀ F are J^-1 (0, 0, 1), i.e. (w_p, w_q, w_r)_z / det J with
    w_p = q × r; their signs tell which limit of each joint binds. If rounding blurs the
    determinant, s = 0 is returned, which is not certain.
    """
    wp, wq, wr = cross(q, r), cross(r, p), cross(p, q)
    det = p[0] * wp[0] + p[1] * wp[1] + p[2] * wp[2]
    ep, eq, er = _bound(p, wp[2], det), _bound(q, wq[2], det), _bound(r, wr[2], det)
    share_p, share_q, share_r = ep * wp[2], eq * wq[2], er * wr[2]
    per_total = 1.0 / (share_p + share_q + share_r)
    x = (ep * wp[0] + eq * wq[0] + er * wr[0]) * per_total
    y = (ep * wp[1] + eq * wq[1] + er * wr[1]) * per_total
    most = share_q if share_q > share_p else share_p
    index = q[4] if share_q > share_p else p[4]
    index = r[4] if share_r > most else index
    clear = abs(det) >= ILL_CONDITIONED * _size(p) * _size(q) * _size(r)
    return abs(det) * per_total if clear else 0.0, x, y, index


@inlined
def _bound(joint, cofactor, det):
    """Return the limit that a multiplier selects, with the sign of its cofactor.

    A joint without multiplier is left unloaded: the optimum is not unique then, and this one has
    less tangential force.
    """
    down = 1.0 / joint[3]
    above = 1.0 if det > 0.0 else down
    below = -down if det > 0.0 else -1.0
    bound = above if cofactor > 0.0 else below
    return 0.0 if cofactor == 0.0 else bound


@inlined
def _meeting_on_rim(a, b, p, q, r, mu):
    """Return where two planes meet on the rim, and whether that is an optimum.

    Tried are a and b, then each of them with the plane that rises above their meeting.
    """
    s_ab, x_ab, y_ab, index_ab, rim_ab, ab, above = _lowest_meeting(a, b, p, q, r, mu)
    c = _binding(above, x_ab, y_ab)
    s_ac, x_ac, y_ac, index_ac, rim_ac, ac, _ = _lowest_meeting(a, c, p, q, r, mu)
    s_bc, x_bc, y_bc, index_bc, rim_bc, bc, _ = _lowest_meeting(b, c, p, q, r, mu)
    return (
        s_ab if ab else (s_ac if ac else s_bc),
        x_ab if ab else (x_ac if ac else x_bc),
        y_ab if ab else (y_ac if ac else y_bc),
        index_ab if ab else (index_ac if ac else index_bc),
        (rim_ab & ab) | (rim_ac & ac & (not ab)) | (rim_bc & (not ab) & (not ac)),
        ab | ac | bc,
    )


@inlined
def _lowest_meeting(a, b, p, q, r, mu):
    """Return the lower end of the chord above which planes a and b meet, whether it is the optimum.

    It is the optimum if no other plane rises above it and if a and b fall towards opposite sides
    of it along the rim. A level chord is represented by its middle. Also returned is the joint
    that rises highest there.
    """
    ex, ey, ez = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    square = ex * ex + ey * ey
    per_square = 1.0 / square
    half = math.sqrt(mu * mu * square - ez * ez) * per_square  # NaN if they meet outside the disc
    middle = -ez * per_square
    x, y = middle * ex, middle * ey
    rise = a[1] * ex - a[0] * ey
    on_rim = abs(rise) * half > SAME * dot(a, x, y)
    step = -math.copysign(half, rise) if on_rim else 0.0
    x, y = x - step * ey, y + step * ex
    s = dot(a, x, y)
    turn_a, turn_b = x * a[1] - y * a[0], x * b[1] - y * b[0]
    index = a[3] if abs(turn_b) >= abs(turn_a) else b[3]
    above, most = _most_used(p, q, r, x, y)
    found = (turn_a * turn_b <= 0.0) & (most <= s * (1.0 + SAME))
    return s, x, y, index, on_rim, found, above
