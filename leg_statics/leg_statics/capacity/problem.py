# SPDX-License-Identifier: Apache-2.0
"""Load capacity: the largest load the ground may put on a foot within the limits of its leg.

What loads a leg. Without load the actuators exert the efforts that the pose needs anyway: the bias,
and what a moment of the ground takes. A moment of unknown direction, any that is horizontal, keeps
a part of the limits in reserve. The force F of the ground adds -Jᵀ F (equations (5)-(7), (27) of
paper 000), so the limits leave it the room `-down_i <= (Jᵀ F)_i <= up_i`:

    effort = bias - J_omegaᵀ M        up = effort - (lower + reserve)
                                      down = (upper - reserve) - effort

Friction keeps F in a circular cone about the normal of the ground. The load is the vertical
component of F, F·u with u against gravity; the normal is less than 90° from u. Load capacity is the
largest load: a second-order cone programme in three variables.

It is solved exactly, by its geometry. Every force of the cone with a load is F = (x, y, 1) / s in
the axes of `load_axes`, with (x, y) in the disc of radius mu and s = 1 / F·u. The limits become
planes a·(x, y, 1) <= b s, and the smallest s over the disc is sought: it lies where three planes
meet, where two planes meet above the disc's rim, or on a single plane at the rim.
`three_joint_capacity` does so quickly where it can, `plane_capacity` in all other cases. That
divides nowhere by the determinant of J, so singular poses need no exception: s = 0 means that the
structure carries any load. Paper 000, eqs (15)-(21), is the same question for unit efforts without
friction.

Utilisation is the least share of a limit that the most used joint needs for a load L: least over
all forces of the cone with F·u = L. It is the same problem once more. On these forces the effort
without load is (effort / L) u·F, so it grows with the force like Jᵀ F, and scaling a force scales
every share: if columns J_k - (effort_k / L) u carry the load C within the limits themselves, the
utilisation is L / C. A joint that keeps a reserve r has two columns, with effort_k + r for its
upper limit and effort_k - r for the lower one.

Kernels pose and solve their problems in blocks (see `leg_kinematics.kernels.blocks`), whose rows
stand below: they load what is given, call `bear_moments`, `leave_room` and `solve_three` or
`solve_any`, then `relieve_three` or `relieve_any` for the utilisation, and read what is found.
`load_capacity` is such a kernel for given Jacobians. Each is made twice, quick and thorough, of
which the thorough one, whose code takes long to compile, is called only for legs and points that
need it.
"""

# The compiler infers the types of the scalar code below; only what Python calls is annotated.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arrays import (
    FloatArray,
    StatusArray,
    as_array,
    as_non_negative,
    as_vectors,
    broadcast_error,
    has_code,
)
from leg_kinematics.errors import ShapeError, ValueRangeError
from leg_kinematics.kernels.blocks import BLOCK, get3, load, load_columns, load_numbers, put
from leg_kinematics.kernels.kernel import inlined, scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.settled import UNCERTAIN, settled
from leg_kinematics.kernels.vectors import inner, tangents, unit
from leg_statics.capacity.planes import BOUNDED, INVALID_INPUT, plane_capacity
from leg_statics.capacity.planes import CapacityStatus as CapacityStatus
from leg_statics.capacity.three_joint import three_joint_capacity
from leg_statics.efforts import worst_moment_effort

UP = np.array([0.0, 0.0, 1.0])
UP.flags.writeable = False


class LoadCapacity(NamedTuple):
    """Load capacity of every point.

    Attributes:
        capacity: Largest vertical component of the ground's force (...) [N]; infinite if UNBOUNDED,
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
    normal: ArrayLike = UP,
    vertical: ArrayLike = UP,
    bias_efforts: ArrayLike = 0.0,
) -> LoadCapacity:
    """Return the largest vertical force the ground may exert on the foot, and what limits it.

    Maximises F·vertical subject to `effort_lower <= bias_efforts - Jᵀ F <= effort_upper` and
    `|F - (F·normal) normal| <= friction * (F·normal)`, vertical and normal being of length 1. All
    arguments broadcast over their leading axes.

    Args:
        jacobian: Jacobian J of v = J q' (..., 3, n) [m/rad or m/m], n >= 1.
        effort_lower: Smallest actuator efforts (..., n) [N·m or N]; -inf never limits.
        effort_upper: Largest actuator efforts (..., n) [N·m or N]; inf never limits.
        friction: Friction coefficient mu of the ground (...), 0 to inf.
        normal: Normal of the ground, out of the ground, of any length (..., 3), less than 90° from
            `vertical`.
        vertical: Direction in which a load counts, against gravity, of any length (..., 3).
        bias_efforts: Efforts the pose needs without load (..., n) or one for all [N·m or N].

    Raises:
        ShapeError: If a shape is wrong or shapes do not broadcast.
        ValueRangeError: If limits are NaN or reversed, friction is negative or NaN, or a direction
            is zero or not finite, or a normal points into the ground.
    """
    matrix = as_array("jacobian", jacobian)
    if matrix.ndim < 2 or matrix.shape[-2] != 3 or matrix.shape[-1] < 1:
        raise ShapeError(f"jacobian must have shape (..., 3, n) with n >= 1, got {matrix.shape}")
    n = matrix.shape[-1]
    lower = as_array("effort_lower", effort_lower, n)
    upper = as_array("effort_upper", effort_upper, n)
    mu, direction = as_array("friction", friction), as_array("normal", normal, 3)
    up = as_array("vertical", vertical, 3)
    idle = as_vectors("bias_efforts", bias_efforts, n)
    try:
        result = LoadCapacity(*_load_capacity(matrix, lower, upper, idle, mu, direction, up))
    except ValueError:
        shapes = {"jacobian": matrix.shape[:-2], "friction": mu.shape}
        others = {
            "effort_lower": lower,
            "effort_upper": upper,
            "bias_efforts": idle,
            "normal": direction,
            "vertical": up,
        }
        shapes |= {name: array.shape[:-1] for name, array in others.items()}
        raise broadcast_error(shapes) from None
    if not result.status.size or has_code(result.status, INVALID_INPUT):
        check_effort_limits(lower, upper)
        as_non_negative("friction", mu)
        check_normals(direction, up)
    return result


def _load_capacity(
    jacobian: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    bias: FloatArray,
    friction: FloatArray,
    normal: FloatArray,
    vertical: FloatArray,
) -> Any:
    """Return the fields of `LoadCapacity`."""
    arguments = (jacobian, lower, upper, bias, friction, normal, vertical)
    if jacobian.shape[-1] != 3:
        return _thorough_capacity(*arguments)
    results = _quick_capacity(*arguments)
    if not has_code(results[-1], UNCERTAIN):
        return results
    inputs = zip(arguments, (2, 1, 1, 1, 0, 1, 1), strict=True)
    return settled(results, results[-1] == UNCERTAIN, _thorough_capacity, *inputs)


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


def check_normals(normal: FloatArray, vertical: FloatArray) -> None:
    """Raise a ValueRangeError unless vectors are directions and normals point out of the ground."""
    check_directions("vertical", vertical)
    check_directions("normal", normal)
    inward = ~(np.sum(_scaled(normal) * _scaled(vertical), axis=-1) > 0.0)
    if np.any(inward):
        first = [np.broadcast_to(v, (*inward.shape, 3))[inward][0] for v in (normal, vertical)]
        raise ValueRangeError(
            f"normal must point out of the ground, less than 90° from the vertical "
            f"{first[1].tolist()}, got {first[0].tolist()}"
        )


def check_directions(name: str, vectors: FloatArray) -> None:
    """Raise a ValueRangeError unless every vector has a direction."""
    largest = np.abs(vectors).max(axis=-1, initial=0.0)
    bad = ~((largest > 0.0) & (largest < np.inf))
    if np.any(bad):
        raise ValueRangeError(f"{name} must be finite and not zero, got {vectors[bad][0].tolist()}")


def _scaled(vectors: FloatArray) -> FloatArray:
    """Return vectors whose largest component is 1 or -1."""
    return np.asarray(vectors / np.abs(vectors).max(axis=-1, keepdims=True, initial=0.0))


# --------------------------------------------------------------------------- the problem

# Rows of a block. What a contact gives, in its order (see `Contact`): friction, normal, vertical,
# load and moments that must be borne;
MU, NORMAL, VERTICAL, LOAD, MOMENT, ANY_MOMENT, OF_CONTACT = 0, 1, 4, 7, 8, 11, 12
# whether a solution is wanted, and what is found: capacity, capacity if the ground gave any force,
# limiting joint, force on the cone, status;
WANTED, CAPACITY, ROUGH, JOINT, ON_CONE, OUTCOME = range(OF_CONTACT, 18)
# eleven rows are the caller's; the force is that of a load of 1.
OF_CALLER, FORCE, OF_POINT = 18, 29, 32
# Then what n joints have, each row n times: efforts without load, limits, bias, reserve, room;
# columns of both Jacobians (3 n).
EFFORT, LOWER, UPPER, BIAS, RESERVE, ROOM_UP, ROOM_DOWN = range(7)
J, OMEGA, OF_JOINT = 7, 10, 13

GRIP = 1e8  # friction of a slope beyond it counts as infinite
ALMOST_OPEN = 1e-6  # D of `load_axes` relative to cos² alpha, below which the ellipse is too long


@inlined
def row_of(joint_row, n, joint):
    """Return the row of a number of a joint."""
    width = 3 if joint_row >= J else 1
    return OF_POINT + joint_row * n + width * joint


@inlined
def new_block(n, points):
    """Return a block for problems with n joints, of which so many are to be solved: no load yet."""
    block = np.empty((OF_POINT + OF_JOINT * n, BLOCK))
    for i in range(min(BLOCK, points)):
        block[LOAD, i], block[WANTED, i] = 0.0, 1.0
    return block


@inlined
def bear_moments(block, i, n):
    """Find what the actuators bear before any load: the moments and, as a bias, the leg itself."""
    moment, vertical = get3(block, MOMENT, i), unit(get3(block, VERTICAL, i))
    for k in range(n):
        omega = get3(block, row_of(OMEGA, n, k), i)
        reserve = worst_moment_effort(omega, vertical) * block[ANY_MOMENT, i]
        block[row_of(RESERVE, n, k), i] = reserve
        block[row_of(EFFORT, n, k), i] = block[row_of(BIAS, n, k), i] - inner(omega, moment)


@inlined
def effort_room(lower: Any, upper: Any, effort: Any, reserve: Any) -> tuple[Any, Any]:
    """Return how far the part Jᵀ F of a joint may go up and down.

    Args:
        lower: Smallest effort, or those of joints.
        upper: Largest effort.
        effort: Effort without load.
        reserve: By how much it may vary.
    """
    return effort - (lower + reserve), (upper - reserve) - effort


@inlined
def leave_room(block, i, n):
    """Find what the limits leave to the load, and return whether the leg is held without one."""
    holds = True
    for k in range(n):
        up, down = effort_room(
            block[row_of(LOWER, n, k), i],
            block[row_of(UPPER, n, k), i],
            block[row_of(EFFORT, n, k), i],
            block[row_of(RESERVE, n, k), i],
        )
        holds &= (up >= 0.0) & (down >= 0.0)
        block[row_of(ROOM_UP, n, k), i] = up
        block[row_of(ROOM_DOWN, n, k), i] = down
    return holds


@inlined
def solve_three(block, count, n):
    """Solve so many problems of three joints quickly; UNCERTAIN is what remains open."""
    for i in range(count):
        columns = (
            get3(block, row_of(J, 3, 0), i),
            get3(block, row_of(J, 3, 1), i),
            get3(block, row_of(J, 3, 2), i),
        )
        up, down = get3(block, row_of(ROOM_UP, 3, 0), i), get3(block, row_of(ROOM_DOWN, 3, 0), i)
        axes = load_axes(get3(block, NORMAL, i), get3(block, VERTICAL, i), block[MU, i])
        found = three_joint_capacity(columns, up, down, block[MU, i], axes)
        block[CAPACITY, i] = found.capacity
        put(block, FORCE, i, found.force)
        block[ROUGH, i] = found.rough
        block[JOINT, i] = found.limiting_joint
        block[ON_CONE, i] = 1.0 if found.friction_limited else 0.0
        block[OUTCOME, i] = BOUNDED if found.certain else UNCERTAIN


@inlined
def relieve_three(block, count, n):
    """Find the load that the limits carry if all efforts grow with it, and the force, quickly.

    The load over it is the utilisation. It is the capacity already found where nothing but the load
    is borne.
    """
    bearing = False
    for i in range(count):
        for k in range(3):
            bearing |= (block[row_of(EFFORT, 3, k), i] != 0.0) & (block[LOAD, i] > 0.0)
    if bearing:
        for i in range(count):
            per_load = 1.0 / block[LOAD, i] if block[LOAD, i] > 0.0 else 0.0
            vertical = unit(get3(block, VERTICAL, i))
            columns = (
                _column_with(block, i, 3, 0, 0.0, vertical, per_load),
                _column_with(block, i, 3, 1, 0.0, vertical, per_load),
                _column_with(block, i, 3, 2, 0.0, vertical, per_load),
            )
            lower, upper = get3(block, row_of(LOWER, 3, 0), i), get3(block, row_of(UPPER, 3, 0), i)
            up = abs(lower[0]), abs(lower[1]), abs(lower[2])
            down = abs(upper[0]), abs(upper[1]), abs(upper[2])
            axes = load_axes(get3(block, NORMAL, i), get3(block, VERTICAL, i), block[MU, i])
            found = three_joint_capacity(columns, up, down, block[MU, i], axes)
            block[CAPACITY, i] = found.capacity
            put(block, FORCE, i, found.force)
            block[OUTCOME, i] = BOUNDED if found.certain else UNCERTAIN
    for i in range(count):
        varies = (block[ANY_MOMENT, i] > 0.0) & (block[LOAD, i] > 0.0)  # two columns a joint
        block[OUTCOME, i] = UNCERTAIN if varies else block[OUTCOME, i]


@inlined
def _column_with(block, i, n, joint, reserve, vertical, per_load):
    """Return a column of J from which the effort without load is taken, as one of the load."""
    column = get3(block, row_of(J, n, joint), i)
    effort = (block[row_of(EFFORT, n, joint), i] + reserve) * per_load
    return (
        column[0] - effort * vertical[0],
        column[1] - effort * vertical[1],
        column[2] - effort * vertical[2],
    )


@inlined
def solve_any(block, count, n):
    """Solve so many problems with any number of joints, by all planes."""
    for i in range(count):
        if block[WANTED, i] == 1.0:
            _solve_any(block, i, n)


@scalar
def _solve_any(block, i, n):
    """Solve a problem with any number of joints; without a cone only if the load is too heavy."""
    columns, up, down = np.empty((3, n)), np.empty(n), np.empty(n)
    for k in range(n):
        columns[0, k], columns[1, k], columns[2, k] = get3(block, row_of(J, n, k), i)
        up[k], down[k] = block[row_of(ROOM_UP, n, k), i], block[row_of(ROOM_DOWN, n, k), i]
    capacity, force, joint, on_cone, outcome = _all_planes(block, i, columns, up, down)
    block[CAPACITY, i] = block[ROUGH, i] = capacity
    if capacity < block[LOAD, i]:
        vertical = unit(get3(block, VERTICAL, i))
        axes = (*tangents(vertical), vertical)
        upright = 0.0, 0.0, 1.0
        block[ROUGH, i] = plane_capacity(columns, up, down, math.inf, axes, upright)[0]
    put(block, FORCE, i, force)
    block[JOINT, i] = joint
    block[ON_CONE, i] = 1.0 if on_cone else 0.0
    block[OUTCOME, i] = outcome


@inlined
def relieve_any(block, count, n):
    """Find the load that the limits carry if all efforts grow with it, by all planes."""
    for i in range(count):
        bearing = block[WANTED, i] == 0.0
        for k in range(n):
            bearing |= block[row_of(EFFORT, n, k), i] != 0.0
            bearing |= block[row_of(RESERVE, n, k), i] != 0.0
        if bearing and block[LOAD, i] > 0.0:
            _relieve_any(block, i, n)


@scalar
def _relieve_any(block, i, n):
    columns, up, down = np.empty((3, 2 * n)), np.full(2 * n, math.inf), np.full(2 * n, math.inf)
    vertical, per_load = unit(get3(block, VERTICAL, i)), 1.0 / block[LOAD, i]
    for k in range(n):
        reserve = block[row_of(RESERVE, n, k), i]
        for side, sign in ((k, -1.0), (n + k, 1.0)):
            column = _column_with(block, i, n, k, sign * reserve, vertical, per_load)
            columns[0, side], columns[1, side], columns[2, side] = column
        up[k], down[n + k] = abs(block[row_of(LOWER, n, k), i]), abs(block[row_of(UPPER, n, k), i])
    block[CAPACITY, i], force, _, _, block[OUTCOME, i] = _all_planes(block, i, columns, up, down)
    put(block, FORCE, i, force)


@scalar
def _all_planes(block, i, columns, up, down):
    """Solve with the cone and the direction of the load, each along the axes of the normal."""
    normal, vertical = unit(get3(block, NORMAL, i)), unit(get3(block, VERTICAL, i))
    across, along = tangents(normal)
    load = inner(vertical, across), inner(vertical, along), inner(vertical, normal)
    slanted = load[0] != 0.0 or load[1] != 0.0
    friction = min(block[MU, i], GRIP) if slanted else block[MU, i]
    return plane_capacity(columns, up, down, friction, (across, along, normal), load)


@inlined
def load_axes(normal, vertical, friction):
    """Return the axes in which a force of the cone is F = (x, y, 1) / s, where 1 / s is the load.

    The load F·u of a direction u, at an angle alpha to the normal n, is 1 on a plane that cuts the
    cone in an ellipse, as long as D = cos² alpha - mu² sin² alpha > 0. With unit tangents e1, the
    slope's, and e2 the ellipse is the disc of radius mu in the axes

        a = (cos alpha e1 - sin alpha n) / D,    b = e2 / sqrt D,
        c = (cos alpha n - mu² sin alpha e1) / D.

    Turned about n, so that u = n is no exception, they are what is returned. Otherwise the cone
    holds forces without load, and NaN is returned: `plane_capacity` takes the normal's axes.

    Args:
        normal: Normal of the ground, of any length.
        vertical: Direction of the load, of any length.
        friction: Friction coefficient mu.
    """
    n, u = unit(normal), unit(vertical)
    e, f = tangents(n)
    x, y, cosine = inner(u, e), inner(u, f), inner(u, n)
    square = friction * friction if (x != 0.0) | (y != 0.0) else 0.0  # it may be infinite
    d = cosine * cosine - square * (x * x + y * y)
    usual = (cosine > 0.0) & (d > ALMOST_OPEN * cosine * cosine)
    root = math.sqrt(d) if usual else math.nan
    stretch = square / (d * (cosine + root))
    slope = x * e[0] + y * f[0], x * e[1] + y * f[1], x * e[2] + y * f[2]
    a = _sum3(1.0 / root, e, stretch * x, slope, -x / d, n)
    b = _sum3(1.0 / root, f, stretch * y, slope, -y / d, n)
    c = _sum3(0.0, e, -square / d, slope, cosine / d, n)
    return a, b, c


@inlined
def _sum3(p, a, q, b, r, c):
    """Return p a + q b + r c."""
    return (
        p * a[0] + q * b[0] + r * c[0],
        p * a[1] + q * b[1] + r * c[1],
        p * a[2] + q * b[2] + r * c[2],
    )


# --------------------------------------------------------------------------- given Jacobians


def _capacity_kernel(solve: Callable[..., None], joints: int) -> Callable[..., Any]:
    """Return a kernel that solves problems of so many joints, a constant, or of any if 0."""
    joint = f"(points,{joints or 'n'})"

    @points_kernel(
        f"(points,3,{joints or 'n'}),{joint},{joint},{joint},(points),(points,3),(points,3)"
        "->(points),(points,3),(points),(points),(points)",
        "f8 f8 f8 f8 f8 f8 f8 f8 f8 i8 b1 u1",
    )
    def capacity(
        jacobian: Any,
        lower: Any,
        upper: Any,
        bias: Any,
        friction: Any,
        normal: Any,
        vertical: Any,
        capacity: Any,
        force: Any,
        limiting_joint: Any,
        friction_limited: Any,
        status: Any,
    ) -> None:
        n = joints or jacobian.shape[2]
        block = new_block(n, len(jacobian))
        for i in range(min(BLOCK, len(jacobian))):
            for k in range(n):
                block[row_of(RESERVE, n, k), i] = 0.0
        for start in range(0, len(jacobian), BLOCK):
            end = min(start + BLOCK, len(jacobian))
            load_numbers(block, MU, friction, start, end)
            load(block, NORMAL, normal, start, end, 3)
            load(block, VERTICAL, vertical, start, end, 3)
            load(block, row_of(LOWER, n, 0), lower, start, end, n)
            load(block, row_of(UPPER, n, 0), upper, start, end, n)
            load(block, row_of(EFFORT, n, 0), bias, start, end, n)
            load_columns(block, row_of(J, n, 0), jacobian, start, end, n)
            for i in range(end - start):
                leave_room(block, i, n)
            solve(block, end - start, n)
            for i in range(end - start):
                k = start + i
                capacity[k] = block[CAPACITY, i]
                size = block[CAPACITY, i] if block[OUTCOME, i] == BOUNDED else math.nan
                for r in range(3):
                    force[k, r] = size * block[FORCE + r, i]
                limiting_joint[k] = int(block[JOINT, i])
                friction_limited[k] = block[ON_CONE, i] == 1.0
                status[k] = int(block[OUTCOME, i])

    return capacity


_quick_capacity = _capacity_kernel(solve_three, 3)
_thorough_capacity = _capacity_kernel(solve_any, 0)
