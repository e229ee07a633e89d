"""Load capacity: the largest normal force the ground may exert on a foot within effort limits.

The ground's force F on the foot loads the actuators with the efforts e = Jᵀ F. Besides the efforts
`bias` that the pose needs anyway, the limits leave `-down_i <= e_i <= up_i` with
`up = bias - lower` and `down = upper - bias`. Friction keeps F in a circular cone about the normal
of the ground. Load capacity is the largest normal component of F: a second-order cone programme in
three variables.

It is solved exactly, by its geometry. Every force of the cone is F = (x, y, 1) / s in axes whose
third is the normal, with (x, y) in the disc of radius mu and s = 1 / F_n. The limits become planes
a·(x, y, 1) <= b s, and the smallest s over the disc is sought: it lies where three planes meet,
where two planes meet above the disc's rim, or on a single plane at the rim. No step divides by the
determinant of J, so singular poses need no exception: s = 0 means that the structure carries any
load. Paper 000, eqs (15)-(21), is the same question for unit efforts without friction.
"""

# The compiler infers the types of the scalar code below; only what Python calls is annotated.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arrays import FloatArray, StatusArray, as_array, as_matching, as_non_negative
from leg_kinematics.errors import ShapeError, ValueRangeError
from leg_kinematics.kernel import kernel, scalar


class CapacityStatus(IntEnum):
    """Outcome of one point.

    Attributes:
        BOUNDED: The capacity is finite.
        UNBOUNDED: The structure alone carries a force of the cone; the capacity is infinite.
        INFEASIBLE: No admissible force exists, because the bias is beyond the limits and no load
            brings it back; the capacity is NaN.
        INVALID_INPUT: The Jacobian or the bias of this point is not finite; the capacity is NaN.
    """

    BOUNDED = 0
    UNBOUNDED = 1
    INFEASIBLE = 2
    INVALID_INPUT = 3


class LoadCapacity(NamedTuple):
    """Load capacity of every point.

    Attributes:
        capacity: Largest normal component of the ground's force (...) [N]; infinite if UNBOUNDED,
            NaN if INFEASIBLE or INVALID_INPUT.
        force: A force that attains it (..., 3) [N]; NaN unless BOUNDED.
        limiting_joint: Index of the actuator whose limit carries the largest share of the capacity
            (...); -1 unless BOUNDED.
        friction_limited: Whether that force lies on the friction cone (...).
        status: A `CapacityStatus` (...).
    """

    capacity: FloatArray
    force: FloatArray
    limiting_joint: NDArray[np.int64]
    friction_limited: NDArray[np.bool_]
    status: StatusArray


def load_capacity(
    jacobian: ArrayLike,
    effort_lower: ArrayLike,
    effort_upper: ArrayLike,
    friction: ArrayLike,
    *,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    bias: ArrayLike = 0.0,
) -> LoadCapacity:
    """Return the largest normal force the ground may exert on the foot, and what limits it.

    Maximises F·normal subject to `effort_lower <= bias - Jᵀ F <= effort_upper` and
    `|F - (F·normal) normal| <= friction * (F·normal)`. All arguments broadcast over their leading
    axes.

    Args:
        jacobian: Jacobian J of v = J q' (..., 3, n) [m/rad or m/m], n >= 1.
        effort_lower: Smallest actuator efforts (..., n) [N·m or N]; -inf never limits.
        effort_upper: Largest actuator efforts (..., n) [N·m or N]; inf never limits.
        friction: Friction coefficient mu of the ground (...), 0 to inf.
        normal: Normal of the ground, out of the ground, of any length (..., 3).
        bias: Efforts the pose needs without load (..., n) or one for all [N·m or N].

    Raises:
        ShapeError: If a shape is wrong or shapes do not broadcast.
        ValueRangeError: If limits are NaN or reversed, friction is negative or NaN, or a normal is
            zero or not finite.
    """
    matrix = as_array("jacobian", jacobian)
    if matrix.ndim < 2 or matrix.shape[-2] != 3 or matrix.shape[-1] < 1:
        raise ShapeError(f"jacobian must have shape (..., 3, n) with n >= 1, got {matrix.shape}")
    n = matrix.shape[-1]
    batch = matrix.shape[:-2]
    lower = as_matching("effort_lower", effort_lower, (n,), batch)
    batch = np.broadcast_shapes(batch, lower.shape[:-1])
    upper = as_matching("effort_upper", effort_upper, (n,), batch)
    batch = np.broadcast_shapes(batch, upper.shape[:-1])
    mu = as_matching("friction", as_non_negative("friction", friction), (), batch)
    batch = np.broadcast_shapes(batch, mu.shape)
    unit_normal = unit_normals("normal", as_matching("normal", normal, (3,), batch))
    batch = np.broadcast_shapes(batch, unit_normal.shape[:-1])
    idle = np.full(n, bias, dtype=np.float64) if np.isscalar(bias) else bias
    idle = as_matching("bias", idle, (n,), batch)
    check_effort_limits(lower, upper)
    return LoadCapacity(*_load_capacity(matrix, lower, upper, idle, mu, unit_normal))


def check_effort_limits(lower: FloatArray, upper: FloatArray) -> None:
    """Raise a ValueRangeError unless every joint has an effort between its limits."""
    for name, limit, wrong in (
        ("effort_lower", lower, np.inf),
        ("effort_upper", upper, -np.inf),
    ):
        bad = np.isnan(limit) | (limit == wrong)
        if np.any(bad):
            raise ValueRangeError(f"{name} must not be NaN or {wrong}, got {limit[bad].flat[0]}")
    reversed_ = lower > upper
    if np.any(reversed_):
        first = [np.broadcast_to(limit, reversed_.shape)[reversed_][0] for limit in (lower, upper)]
        raise ValueRangeError(
            f"effort_lower must be <= effort_upper, got effort_lower {first[0]} > "
            f"effort_upper {first[1]}"
        )


def unit_normals(name: str, vectors: FloatArray) -> FloatArray:
    """Return `vectors` scaled to length 1; raise a ValueRangeError if one has no direction."""
    largest = np.abs(vectors).max(axis=-1, keepdims=True)
    bad = ~((largest > 0.0) & (largest < np.inf))
    if np.any(bad):
        worst = vectors[bad[..., 0]][0]
        raise ValueRangeError(f"{name} must be finite and not zero, got {worst.tolist()}")
    scaled = vectors / largest
    return scaled / np.linalg.norm(scaled, axis=-1, keepdims=True)


@kernel(
    "(d,n),(n),(n),(n),(),(d)->(),(d),(),(),()",
    "f8[:,:], f8[:], f8[:], f8[:], f8, f8[:], f8[:], f8[:], i8[:], b1[:], u1[:]",
)
def _load_capacity(
    jacobian: Any,
    lower: Any,
    upper: Any,
    bias: Any,
    friction: Any,
    normal: Any,
    capacity: Any,
    force: Any,
    limiting_joint: Any,
    friction_limited: Any,
    status: Any,
) -> None:
    """Apply `capacity_of_point` to every point."""
    (
        capacity[0],
        (force[0], force[1], force[2]),
        limiting_joint[0],
        friction_limited[0],
        status[0],
    ) = capacity_of_point(jacobian, lower, upper, bias, friction, normal)


# --- one point ----------------------------------------------------------------------------------

BOUNDED = int(CapacityStatus.BOUNDED)
UNBOUNDED = int(CapacityStatus.UNBOUNDED)
INFEASIBLE = int(CapacityStatus.INFEASIBLE)
INVALID_INPUT = int(CapacityStatus.INVALID_INPUT)

SAME = 1e-11  # two values of s differ by rounding only
ILL_CONDITIONED = 1e-8  # s relative to that of a unit force, below which rounding needs care
ROUNDING = 1e-15  # of a·(x, y, 1) relative to its factors
POWERLESS = 1e-6  # b below which rounding of (x, y) blurs the s at which a plane is met
SOLVED = 1e-9  # residual of planes that should meet in a point, relative to their factors
LARGE = 1e50  # products of four such numbers are far from overflow

# Calls between these short functions would cost as much as what they compute.
inlined = numba.njit(error_model="numpy", forceinline=True)


@inlined
def capacity_of_point(
    jacobian: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    bias: FloatArray,
    friction: float,
    normal: FloatArray,
) -> tuple[float, tuple[float, float, float], int, bool, int]:
    """Return the load capacity of one point, for use inside other kernels.

    Args:
        jacobian: Jacobian (3, n).
        lower: Smallest efforts (n,).
        upper: Largest efforts (n,).
        bias: Efforts without load (n,).
        friction: Friction coefficient.
        normal: Unit normal of the ground (3,).

    Returns:
        The fields of `LoadCapacity`: capacity, force (a tuple of three), limiting joint, whether
        friction limits, status.
    """
    nothing = (math.nan, math.nan, math.nan)
    across, along = _tangents(normal)
    s, x, y, joint, on_rim, solved = 0.0, 0.0, 0.0, -1.0, False, False
    if jacobian.shape[1] == 3 and friction < math.inf:
        p = _joint(jacobian, lower, upper, bias, 0, across, along, normal)
        q = _joint(jacobian, lower, upper, bias, 1, across, along, normal)
        r = _joint(jacobian, lower, upper, bias, 2, across, along, normal)
        if _is_ordinary(p) and _is_ordinary(q) and _is_ordinary(r):
            s, x, y, joint, on_rim, solved = _solve_three(p, q, r, friction)
    scale, status = 1.0, BOUNDED
    if not solved:
        if not _is_valid(jacobian, lower, upper, bias, friction, normal):
            return math.nan, nothing, -1, False, INVALID_INPUT
        planes, scale = _planes(jacobian, lower, upper, bias, across, along, normal)
        s, x, y, joint, on_rim, status = _solve_planes(planes, friction)
    if status == INFEASIBLE:
        return math.nan, nothing, -1, False, INFEASIBLE
    capacity = scale / s
    if status == UNBOUNDED or capacity == math.inf:
        return math.inf, nothing, -1, False, UNBOUNDED
    force = (
        capacity * (x * across[0] + y * along[0] + normal[0]),
        capacity * (x * across[1] + y * along[1] + normal[1]),
        capacity * (x * across[2] + y * along[2] + normal[2]),
    )
    if not (math.isfinite(force[0]) and math.isfinite(force[1]) and math.isfinite(force[2])):
        return math.inf, nothing, -1, False, UNBOUNDED  # beyond the range of floating point
    return capacity, force, int(joint), on_rim or friction == 0.0, BOUNDED


@scalar
def rough_capacity_of_point(
    jacobian: FloatArray, lower: FloatArray, upper: FloatArray, bias: FloatArray, normal: FloatArray
) -> float:
    """Return the load capacity of one point on ground of any roughness, for use inside kernels.

    With as many actuators as force components, F·n = w·e with w = J^-1 n, and the efforts e = Jᵀ F
    fill a box: every actuator works at that of its limits which helps.
    """
    if jacobian.shape[1] == 3:
        x, y, z = jacobian[0], jacobian[1], jacobian[2]
        yz, zx, xy = _cross(y, z), _cross(z, x), _cross(x, y)
        det = x[0] * yz[0] + x[1] * yz[1] + x[2] * yz[2]
        size = abs(x[0] * yz[0]) + abs(x[1] * yz[1]) + abs(x[2] * yz[2])
        if abs(det) > ILL_CONDITIONED * size:
            capacity = 0.0
            for i in range(3):
                w = (normal[0] * yz[i] + normal[1] * zx[i] + normal[2] * xy[i]) / det
                capacity += max(w * (bias[i] - lower[i]), w * (bias[i] - upper[i]))
            if math.isfinite(capacity):
                return capacity
    return capacity_of_point(jacobian, lower, upper, bias, math.inf, normal)[0]


@inlined
def _is_valid(jacobian, lower, upper, bias, friction, normal):
    """Return whether Jacobian, bias and normal are finite and limits and friction are numbers."""
    valid = friction >= 0.0
    for i in range(3):
        valid &= math.isfinite(normal[i])
    for i in range(jacobian.shape[1]):
        valid &= math.isfinite(bias[i]) and lower[i] < math.inf and upper[i] > -math.inf
        for k in range(3):
            valid &= math.isfinite(jacobian[k, i])
    return valid


@inlined
def _tangents(normal):
    """Return two unit vectors that complete `normal` to right-handed axes (Duff et al. 2017).

    For the normal (0, 0, 1) they are (1, 0, 0) and (0, 1, 0).
    """
    nx, ny, nz = normal[0], normal[1], normal[2]
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return (1.0 + sign * nx * nx * a, sign * b, -sign * nx), (b, sign + ny * ny * a, -ny)


@inlined
def _column(jacobian, i, across, along, normal):
    """Return column i of the Jacobian in the axes across, along, normal."""
    a, b, c = jacobian[0, i], jacobian[1, i], jacobian[2, i]
    return (
        a * across[0] + b * across[1] + c * across[2],
        a * along[0] + b * along[1] + c * along[2],
        a * normal[0] + b * normal[1] + c * normal[2],
    )


@inlined
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def _dot(a, x, y):
    """Return a·(x, y, 1)."""
    return a[0] * x + a[1] * y + a[2]


# --- three joints that can hold the unloaded pose: the common case, quick -----------------------
#
# A joint is the tuple (ax, ay, az, ratio, index) with a = column / up and ratio = up / down. The
# force (x, y, 1) uses the part s = max(a·(x, y, 1), -ratio a·(x, y, 1)) of its limits.


@inlined
def _joint(jacobian, lower, upper, bias, i, across, along, normal):
    """Return joint i; its ratio is NaN if a limit leaves nothing or is of no ordinary size."""
    cx, cy, cz = _column(jacobian, i, across, along, normal)
    up, down = bias[i] - lower[i], upper[i] - bias[i]
    per_up = 1.0 / up
    ordinary = 1.0 / LARGE < up < LARGE and 1.0 / LARGE < down < LARGE
    ratio = up / down if ordinary else math.nan
    return per_up * cx, per_up * cy, per_up * cz, ratio, float(i)


@inlined
def _is_ordinary(joint):
    """Return whether the zero force is inside both limits and all numbers are far from overflow."""
    return abs(joint[0]) + abs(joint[1]) + abs(joint[2]) < LARGE and joint[3] < LARGE


@inlined
def _pick(condition, a, b):
    """Return joint a if `condition` else b, item by item: no branch to be predicted wrongly."""
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
    effort = _dot(joint, x, y)
    opposite = -joint[3] * effort
    return effort if effort > opposite else opposite


@inlined
def _largest_use(p, q, r, x, y):
    """Return the largest use of the three joints."""
    use_p, use_q, use_r = _use(p, x, y), _use(q, x, y), _use(r, x, y)
    most = use_p if use_p > use_q else use_q
    return most if most > use_r else use_r


@inlined
def _most_used(p, q, r, x, y):
    """Return the joint of which the force (x, y, 1) uses most."""
    use_p, use_q, use_r = _use(p, x, y), _use(q, x, y), _use(r, x, y)
    joint = _pick(use_q > use_p, q, p)
    return _pick(use_r > (use_q if use_q > use_p else use_p), r, joint)


@inlined
def _solve_three(p, q, r, mu):
    """Return the optimum (s, x, y, joint, on_rim) of three joints, and whether it is certain.

    s(x, y) is the largest use of the three joints, convex, so its least value over the disc is
    that of one joint alone if the others use less there, else it is where all three are equal if
    that lies in the disc, else it is where two are equal on the rim.
    """
    lead, least = _hardest(p, q, r, mu)
    x, y = _easiest_on_rim(lead, mu)
    s = _largest_use(p, q, r, x, y)
    index, on_rim = lead[4], True
    found = 0.0 < s <= least * (1.0 + SAME)
    if not found:
        a, b = _binding(lead, 0.0, 0.0), _binding(_most_used(p, q, r, x, y), x, y)
        s, x, y, index, found = _meeting_of_three(p, q, r, mu)
        on_rim = False
        if not found:
            s, x, y, index, on_rim, found = _meeting_on_rim(a, b, p, q, r, mu)
    centre = _largest_use(p, q, r, 0.0, 0.0)
    if centre <= s * (1.0 + SAME):
        x, y, on_rim = 0.0, 0.0, False
    size = _size(p) * max(1.0, p[3]) + _size(q) * max(1.0, q[3]) + _size(r) * max(1.0, r[3])
    certain = found and s > ILL_CONDITIONED * size * (1.0 + abs(x) + abs(y))
    return s, x, y, index, on_rim, certain


@inlined
def _size(joint):
    """Return the sum of the absolute components of a."""
    return abs(joint[0]) + abs(joint[1]) + abs(joint[2])


@inlined
def _binding(joint, x, y):
    """Return the limit that the force (x, y, 1) approaches as a plane s >= a·(x, y, 1)."""
    if _dot(joint, x, y) > 0.0:
        return joint[0], joint[1], joint[2], joint[4]
    return -joint[3] * joint[0], -joint[3] * joint[1], -joint[3] * joint[2], joint[4]


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
    if slope == 0.0:
        return 0.0, 0.0
    reach = math.copysign(mu / slope, -joint[2])
    return reach * joint[0], reach * joint[1]


@inlined
def _meeting_of_three(p, q, r, mu):
    """Return where three joints are used alike, the optimum without friction, if in the disc.

    Duality: the multipliers of e = Jᵀ F are J^-1 (0, 0, 1), i.e. (w_p, w_q, w_r)_z / det J with
    w_p = q × r; their signs tell which limit of each joint binds. If rounding blurs the
    determinant, s = 0 is returned, which is not certain.
    """
    wp, wq, wr = _cross(q, r), _cross(r, p), _cross(p, q)
    det = p[0] * wp[0] + p[1] * wp[1] + p[2] * wp[2]
    ep, eq, er = _bound(p, wp[2], det), _bound(q, wq[2], det), _bound(r, wr[2], det)
    share_p, share_q, share_r = ep * wp[2], eq * wq[2], er * wr[2]
    total = share_p + share_q + share_r
    x = (ep * wp[0] + eq * wq[0] + er * wr[0]) / total
    y = (ep * wp[1] + eq * wq[1] + er * wr[1]) / total
    s = abs(det) / total
    joint = q[4] if share_q > share_p else p[4]
    joint = r[4] if share_r > max(share_p, share_q) else joint
    if abs(det) < ILL_CONDITIONED * _size(p) * _size(q) * _size(r):
        s = 0.0
    return s, x, y, joint, x * x + y * y <= mu * mu


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
    """Return where two planes meet on the rim, if an optimum is found there.

    Tried are a and b, then each of them with the plane that rises above their meeting.
    """
    s, x, y, joint, on_rim, found = _lowest_meeting(a, b, p, q, r, mu)
    if not found:
        c = _binding(_most_used(p, q, r, x, y), x, y)
        for plane in (a, b):
            s, x, y, joint, on_rim, found = _lowest_meeting(plane, c, p, q, r, mu)
            if found:
                break
    return s, x, y, joint, on_rim, found


@inlined
def _lowest_meeting(a, b, p, q, r, mu):
    """Return the lower end of the chord above which planes a and b meet; found if the optimum.

    It is the optimum if no other plane rises above it and if a and b fall towards opposite sides
    of it along the rim. A level chord is represented by its middle.
    """
    ex, ey, ez = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    square = ex * ex + ey * ey
    half = math.sqrt(mu * mu * square - ez * ez) / square  # NaN if they meet outside the disc
    x, y = -ez / square * ex, -ez / square * ey
    rise = a[1] * ex - a[0] * ey
    on_rim = abs(rise) * half > SAME * _dot(a, x, y)
    if on_rim:
        step = -math.copysign(half, rise)
        x, y = x - step * ey, y + step * ex
    s = _dot(a, x, y)
    turn_a, turn_b = x * a[1] - y * a[0], x * b[1] - y * b[0]
    joint = a[3] if abs(turn_b) >= abs(turn_a) else b[3]
    most = _largest_use(p, q, r, x, y)
    return s, x, y, joint, on_rim, turn_a * turn_b <= 0.0 and most <= s * (1.0 + SAME)


# --- any number of joints, any limits, any friction: all candidates -----------------------------
#
# The limits are the planes a·(x, y, 1) <= b s as rows (a, b) of an array. Row 0 is s >= 0; joint i
# has the rows 2 i + 1 and 2 i + 2. The vectors a have length 1 and the largest |b| is 1.


@scalar
def _planes(jacobian, lower, upper, bias, across, along, normal):
    """Return the planes, and the unit of 1/s; a limit that cannot bind repeats row 0."""
    n = jacobian.shape[1]
    planes = np.zeros((2 * n + 1, 4))
    planes[0, 3] = math.inf
    scale = 0.0
    for i in range(n):
        column = _column(jacobian, i, across, along, normal)
        size = _length(column)
        for row, sign, room in (
            (2 * i + 1, 1.0, bias[i] - lower[i]),
            (2 * i + 2, -1.0, upper[i] - bias[i]),
        ):
            b = _room_per_length(room, size)
            planes[row, 3] = b
            if abs(b) < math.inf:
                scale = max(scale, abs(b))
                for k in range(3):
                    planes[row, k] = sign * (column[k] / size)
    if scale == 0.0:
        scale = 1.0
    for row in range(2 * n + 1):
        planes[row, 3] = 1.0 if planes[row, 3] == math.inf else planes[row, 3] / scale
    return planes, scale


@scalar
def _length(a):
    """Return the length of a vector without overflow."""
    return math.hypot(math.hypot(a[0], a[1]), a[2])


@scalar
def _room_per_length(room, size):
    """Return b of a plane: infinite if it never binds, minus infinity if it always forbids."""
    if size == 0.0:
        return math.inf if room >= 0.0 else -math.inf
    return room / size


@scalar
def _solve_planes(planes, mu):
    """Return the optimum (s, x, y, joint, on_rim) among all candidates, and its status.

    Planes with b < 0 forbid small forces: where the least s is 0, a force is admissible only if a
    positive s is, too.
    """
    s, x, y, joint, on_rim, largest = _search(planes, mu)
    if largest == 0.0 and s == 0.0 and mu == math.inf:
        # A force along (x, y, 1), however large, may be added: if any force is admissible, one
        # within a wider cone is. In a cone, unlike in a half-space, a largest s exists.
        largest = _search(planes, 2.0 + 2.0 * math.hypot(x, y))[5]
    status = UNBOUNDED if s == 0.0 else BOUNDED
    return s, x, y, joint, on_rim, status if largest > 0.0 else INFEASIBLE


@scalar
def _search(planes, mu):
    """Return the optimum (s, x, y, joint, on_rim) among all candidates, and the largest s seen."""
    forbids = False
    for row in range(planes.shape[0]):
        forbids |= planes[row, 3] < 0.0
    largest = 0.0 if forbids else math.inf
    candidates = _candidates(planes, mu)
    best, s, cause, square = -1, math.inf, 0, math.inf
    for c in range(candidates.shape[0]):
        candidate = candidates[c]
        if candidate[2] > s * (1.0 + SAME) and not forbids:
            continue
        lowest, highest, raised_by = _range_above(planes, candidate)
        if lowest == math.inf:
            continue
        largest = max(largest, highest)
        away = candidate[0] * candidate[0] + candidate[1] * candidate[1]
        nearer = lowest <= s * (1.0 + SAME) and away < square * (1.0 - SAME)
        if lowest < s * (1.0 - SAME) or nearer:
            best, s, cause, square = c, lowest, raised_by, away
    if best < 0:  # no direction is open to a force: only the zero force is left, if admissible
        return math.inf, 0.0, 0.0, _powerless(planes), mu < math.inf, largest
    joint = _joint_of(cause) if cause > 0 else _heaviest(planes, candidates[best])
    x, y, on_rim = candidates[best, 0], candidates[best, 1], candidates[best, 6] > 0.0
    return s, x, y, float(joint), on_rim, largest


@scalar
def _joint_of(row):
    """Return the joint of a plane, -1 for the plane s >= 0."""
    return (row + 1) // 2 - 1


@scalar
def _candidates(planes, mu):
    """Return the points that may be optimal as rows (x, y, s, i, j, k, on_rim).

    Planes i, j and k (0 if fewer) meet there at s. Points where they do not are NaN.
    """
    count = planes.shape[0]
    pairs = count * (count - 1) // 2
    candidates = np.zeros((1 + count + 3 * pairs + pairs * (count - 2) // 3, 7))
    filled = 1  # the first is the centre
    if mu == 0.0:
        return candidates[:filled]
    for i in range(1, count):
        x, y = _lowest_on_rim(planes, i, mu)
        _put(candidates, filled, x, y, _dot(planes[i], x, y) / planes[i, 3], i, 0, 0, 1.0)
        filled += 1
        for j in range(i):
            if _joint_of(i) == _joint_of(j):
                continue
            middle_x, middle_y, half_x, half_y = _chord(planes, i, j, mu)
            teller = i if j > 0 and abs(planes[i, 3]) >= abs(planes[j, 3]) else j
            for step in (0.0, 1.0, -1.0):
                x, y = middle_x, middle_y
                if step != 0.0:
                    x, y = x + step * half_x, y + step * half_y
                s = _dot(planes[teller], x, y) / planes[teller, 3]
                _put(candidates, filled, x, y, s, i, j, 0, abs(step))
                filled += 1
            for k in range(j):
                if _joint_of(j) != _joint_of(k):
                    x, y, s = _vertex(planes, i, j, k, mu)
                    _put(candidates, filled, x, y, s, i, j, k, 0.0)
                    filled += 1
    return candidates[:filled]


@scalar
def _put(candidates, position, x, y, s, i, j, k, on_rim):
    """Write a candidate."""
    candidates[position, 0] = x
    candidates[position, 1] = y
    candidates[position, 2] = s
    candidates[position, 3] = i
    candidates[position, 4] = j
    candidates[position, 5] = k
    candidates[position, 6] = on_rim


@scalar
def _lowest_on_rim(planes, i, mu):
    """Return the point of the rim above which plane i is lowest."""
    slope = math.hypot(planes[i, 0], planes[i, 1])
    if slope == 0.0 or mu == math.inf:
        return math.nan, math.nan
    return -mu * planes[i, 0] / slope, -mu * planes[i, 1] / slope


@scalar
def _chord(planes, i, j, mu):
    """Return the middle of the chord above which planes i and j meet, and half of the chord."""
    bi, bj = planes[i, 3], planes[j, 3]
    ex = bj * planes[i, 0] - bi * planes[j, 0]
    ey = bj * planes[i, 1] - bi * planes[j, 1]
    ez = bj * planes[i, 2] - bi * planes[j, 2]
    square = ex * ex + ey * ey
    chord = mu * mu * square - ez * ez
    if square == 0.0 or not chord >= -SAME * ez * ez:
        return math.nan, math.nan, math.nan, math.nan
    half = math.sqrt(max(chord, 0.0)) / square if mu < math.inf else math.nan
    return -ez / square * ex, -ez / square * ey, -half * ey, half * ex


@scalar
def _vertex(planes, i, j, k, mu):
    """Return the point (x, y, s) where planes i, j and k meet if it lies above the disc.

    Built from perpendicular directions one by one: cofactors would square the condition of nearly
    parallel planes.
    """
    a, third = planes[i], planes[k]
    rest, along = _without(planes[j], a)
    size = _length(rest)
    b, _ = _without((rest[0] / size, rest[1] / size, rest[2] / size), a)  # again, for rounding
    c = _cross(a, b)
    if k == 0:
        x, y, s = c[0] / c[2], c[1] / c[2], 0.0
    else:
        on_a, on_b = a[3], (planes[j, 3] - along * a[3]) / size
        on_c = (third[3] - _inner(third, a) * on_a - _inner(third, b) * on_b) / _inner(third, c)
        z = on_a * a[2] + on_b * b[2] + on_c * c[2]
        x = (on_a * a[0] + on_b * b[0] + on_c * c[0]) / z
        y = (on_a * a[1] + on_b * b[1] + on_c * c[1]) / z
        s = 1.0 / z
    if not x * x + y * y <= mu * mu:
        return math.nan, math.nan, math.nan
    return x, y, s


@scalar
def _without(b, a):
    """Return b without its component along the unit vector a, and this component."""
    along = _inner(b, a)
    return (b[0] - along * a[0], b[1] - along * a[1], b[2] - along * a[2]), along


@scalar
def _inner(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@scalar
def _range_above(planes, candidate):
    """Return the least and the largest admissible s at a candidate, and the plane that raised it.

    Planes with b > 0 may raise s above the meeting of the candidate's own planes. It is infinite
    if planes with b <= 0 forbid it, or if the own planes do not meet there but for rounding.
    """
    x, y, own = candidate[0], candidate[1], candidate[2]
    refused = math.inf, 0.0, 0
    if not 0.0 <= own < math.inf:
        return refused
    i, j, k = int(candidate[3]), int(candidate[4]), int(candidate[5])
    size = math.sqrt(1.0 + x * x + y * y)
    lowest, highest, raised_by = own, math.inf, 0
    for row in range(1, planes.shape[0]):
        value, b = _dot(planes[row], x, y), planes[row, 3]
        if row in (i, j, k):
            if not abs(value - b * own) <= SOLVED * (size + abs(b) * own):
                return refused
            if b < POWERLESS:
                continue
        if b > 0.0 and value - ROUNDING * size > b * lowest:
            lowest, raised_by = value / b, row
    for row in range(1, planes.shape[0]):
        value, b = _dot(planes[row], x, y), planes[row, 3]
        if b < 0.0:
            highest = min(highest, (value + ROUNDING * size) / b)
        own_joint = _joint_of(row) in (_joint_of(i), _joint_of(j), _joint_of(k))
        held = own_joint and (raised_by == 0 or b == 0.0)
        fits = value - b * lowest <= 10.0 * ROUNDING * (size - b * lowest)
        if b <= 0.0 and not held and not fits:
            return refused
    return lowest, highest, raised_by


@scalar
def _heaviest(planes, candidate):
    """Return the joint whose limit has the largest part b * multiplier of the optimum."""
    x, y = candidate[0], candidate[1]
    i, j, k = int(candidate[3]), int(candidate[4]), int(candidate[5])
    a, b, c = planes[i], planes[j], planes[k]
    if i > 0 and j > 0 and k > 0:
        pull_a, pull_b, pull_c = _cross(b, c)[2], _cross(c, a)[2], _cross(a, b)[2]
    elif candidate[6] > 0.0:
        pull_a, pull_b, pull_c = x * b[1] - y * b[0], x * a[1] - y * a[0], 0.0
    else:
        pull_a, pull_b, pull_c = math.hypot(b[0], b[1]), math.hypot(a[0], a[1]), 0.0
    joint, most = _joint_of(i), a[3] * abs(pull_a)
    if j > 0 and b[3] * abs(pull_b) > most:
        joint, most = _joint_of(j), b[3] * abs(pull_b)
    if k > 0 and c[3] * abs(pull_c) > most:
        joint = _joint_of(k)
    return joint


@scalar
def _powerless(planes):
    """Return the joint without power that opposes a normal force most."""
    joint, most = -1, -math.inf
    for row in range(1, planes.shape[0]):
        if planes[row, 3] == 0.0 and planes[row, 2] > most:
            joint, most = _joint_of(row), planes[row, 2]
    return float(joint)
