# SPDX-License-Identifier: Apache-2.0
"""Load capacity: the largest force the ground may exert on a foot within the limits of its leg.

What loads a leg. Without load the actuators exert the efforts that the pose needs anyway: the bias,
and what a moment of the ground takes. A moment of unknown direction, any that is horizontal, keeps
a part of the limits in reserve. The force F of the ground adds -Jᵀ F (equations (5)-(7), (27) of
paper 000), so the limits leave it the room `-down_i <= (Jᵀ F)_i <= up_i`:

    effort = bias - J_omegaᵀ M        up = effort - (lower + reserve)
                                      down = (upper - reserve) - effort

Friction keeps F in a circular cone about the normal of the ground. Load capacity is the largest
normal component of F: a second-order cone programme in three variables.

It is solved exactly, by its geometry. Every force of the cone is F = (x, y, 1) / s in axes whose
third is the normal, with (x, y) in the disc of radius mu and s = 1 / F_n. The limits become planes
a·(x, y, 1) <= b s, and the smallest s over the disc is sought: it lies where three planes meet,
where two planes meet above the disc's rim, or on a single plane at the rim. `three_joint_capacity`
does so quickly where it can, `plane_capacity` in all other cases. That divides nowhere by the
determinant of J, so singular poses need no exception: s = 0 means that the structure carries any
load. Paper 000, eqs (15)-(21), is the same question for unit efforts without friction.

Kernels pose and solve their problems in blocks (see `leg_kinematics.kernels.blocks`), whose rows
stand below: they load what is given, call `bear_moments`, `leave_room` and `solve_three` or
`solve_any`, and read what is found. `load_capacity` is such a kernel for given Jacobians. Each is
made twice, quick and thorough, of which the thorough one, whose code takes long to compile, is
called only for legs and points that need it.
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
    normal: ArrayLike = UP,
    bias_efforts: ArrayLike = 0.0,
) -> LoadCapacity:
    """Return the largest normal force the ground may exert on the foot, and what limits it.

    Maximises F·normal subject to `effort_lower <= bias_efforts - Jᵀ F <= effort_upper` and
    `|F - (F·normal) normal| <= friction * (F·normal)`. All arguments broadcast over their leading
    axes.

    Args:
        jacobian: Jacobian J of v = J q' (..., 3, n) [m/rad or m/m], n >= 1.
        effort_lower: Smallest actuator efforts (..., n) [N·m or N]; -inf never limits.
        effort_upper: Largest actuator efforts (..., n) [N·m or N]; inf never limits.
        friction: Friction coefficient mu of the ground (...), 0 to inf.
        normal: Normal of the ground, out of the ground, of any length (..., 3).
        bias_efforts: Efforts the pose needs without load (..., n) or one for all [N·m or N].

    Raises:
        ShapeError: If a shape is wrong or shapes do not broadcast.
        ValueRangeError: If limits are NaN or reversed, friction is negative or NaN, or a normal is
            zero or not finite.
    """
    matrix = as_array("jacobian", jacobian)
    if matrix.ndim < 2 or matrix.shape[-2] != 3 or matrix.shape[-1] < 1:
        raise ShapeError(f"jacobian must have shape (..., 3, n) with n >= 1, got {matrix.shape}")
    n = matrix.shape[-1]
    lower = as_array("effort_lower", effort_lower, n)
    upper = as_array("effort_upper", effort_upper, n)
    mu, direction = as_array("friction", friction), as_array("normal", normal, 3)
    idle = as_vectors("bias_efforts", bias_efforts, n)
    try:
        result = LoadCapacity(*_load_capacity(matrix, lower, upper, idle, mu, direction))
    except ValueError:
        shapes = {"jacobian": matrix.shape[:-2], "friction": mu.shape}
        others = {
            "effort_lower": lower,
            "effort_upper": upper,
            "bias_efforts": idle,
            "normal": direction,
        }
        shapes |= {name: array.shape[:-1] for name, array in others.items()}
        raise broadcast_error(shapes) from None
    if not result.status.size or has_code(result.status, INVALID_INPUT):
        check_effort_limits(lower, upper)
        as_non_negative("friction", mu)
        check_normals("normal", direction)
    return result


def _load_capacity(
    jacobian: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    bias: FloatArray,
    friction: FloatArray,
    normal: FloatArray,
) -> Any:
    """Return the fields of `LoadCapacity`."""
    arguments = (jacobian, lower, upper, bias, friction, normal)
    if jacobian.shape[-1] != 3:
        return _thorough_capacity(*arguments)
    results = _quick_capacity(*arguments)
    if not has_code(results[-1], UNCERTAIN):
        return results
    inputs = zip(arguments, (2, 1, 1, 1, 0, 1), strict=True)
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


def check_normals(name: str, vectors: FloatArray) -> None:
    """Raise a ValueRangeError unless every vector has a direction."""
    largest = np.abs(vectors).max(axis=-1, initial=0.0)
    bad = ~((largest > 0.0) & (largest < np.inf))
    if np.any(bad):
        raise ValueRangeError(f"{name} must be finite and not zero, got {vectors[bad][0].tolist()}")


# --------------------------------------------------------------------------- the problem

# Rows of a block. What a contact gives, in its order (see `Contact`): friction, normal, the load
# and the moments that must be borne;
MU, NORMAL, LOAD, MOMENT, ANY_MOMENT, OF_CONTACT = 0, 1, 4, 5, 8, 9
# whether a solution is wanted, and what is found besides capacity and force: capacity without
# friction limit, limiting joint, force on the cone, status;
WANTED, ROUGH, JOINT, ON_CONE, OUTCOME = 9, 10, 11, 12, 13
# eight rows are the caller's;
OF_CALLER = 14
CAPACITY, FORCE, OF_POINT = 22, 23, 26
# then what n joints have, each row n times: efforts without load, limits, bias, reserve, room;
# columns of both Jacobians (3 n).
EFFORT, LOWER, UPPER, BIAS, RESERVE, ROOM_UP, ROOM_DOWN = range(7)
J, OMEGA, OF_JOINT = 7, 10, 13


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
    moment = get3(block, MOMENT, i)
    for k in range(n):
        omega = get3(block, row_of(OMEGA, n, k), i)
        reserve = worst_moment_effort(omega[0], omega[1]) * block[ANY_MOMENT, i]
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
def solve_three(block, jacobian, start, end, n):
    """Solve problems start to end, of three joints, quickly; UNCERTAIN is what remains open."""
    for i in range(end - start):
        columns = (
            get3(block, row_of(J, 3, 0), i),
            get3(block, row_of(J, 3, 1), i),
            get3(block, row_of(J, 3, 2), i),
        )
        up, down = get3(block, row_of(ROOM_UP, 3, 0), i), get3(block, row_of(ROOM_DOWN, 3, 0), i)
        axes = load_axes(get3(block, NORMAL, i))
        found = three_joint_capacity(columns, up, down, block[MU, i], axes)
        block[CAPACITY, i] = found.capacity
        put(block, FORCE, i, found.force)
        block[ROUGH, i] = found.rough
        block[JOINT, i] = found.limiting_joint
        block[ON_CONE, i] = 1.0 if found.friction_limited else 0.0
        block[OUTCOME, i] = BOUNDED if found.certain else UNCERTAIN


@inlined
def solve_any(block, jacobian, start, end, n):
    """Solve problems start to end, of any number of joints, by all planes."""
    for i in range(end - start):
        if block[WANTED, i] == 1.0:
            _solve_any(block, i, n, jacobian[start + i])


@scalar
def _solve_any(block, i, n, jacobian):
    """Solve a problem with any number of joints; of any roughness only if the load is too heavy."""
    capacity, force, joint, on_cone, outcome = _all_planes(block, i, n, jacobian, block[MU, i])
    block[CAPACITY, i] = block[ROUGH, i] = capacity
    if capacity < block[LOAD, i]:
        block[ROUGH, i] = _all_planes(block, i, n, jacobian, math.inf)[0]
    put(block, FORCE, i, force)
    block[JOINT, i] = joint
    block[ON_CONE, i] = 1.0 if on_cone else 0.0
    block[OUTCOME, i] = outcome


@scalar
def _all_planes(block, i, n, jacobian, friction):
    up, down = row_of(ROOM_UP, n, 0), row_of(ROOM_DOWN, n, 0)
    axes = load_axes(get3(block, NORMAL, i))
    return plane_capacity(
        jacobian, block[up : up + n, i], block[down : down + n, i], friction, axes
    )


@inlined
def load_axes(normal):
    """Return the axes in which a force of the cone is (x, y, 1) / s, where 1 / s is the load.

    The direction in which a load counts enters here and nowhere else. It is the normal of the
    ground, whose plane F·n = 1 cuts the cone in a circle. Of another direction u, less than
    90° - atan(mu) from the normal, the plane F·u = 1 cuts an ellipse: its centre would stand in the
    place of the normal, its semi-axes, divided by mu, in those of the tangents.

    Args:
        normal: Normal of the ground, of any length.
    """
    direction = unit(normal)
    across, along = tangents(direction)
    return across, along, direction


# --------------------------------------------------------------------------- given Jacobians


def _capacity_kernel(solve: Callable[..., None], joints: int) -> Callable[..., Any]:
    """Return a kernel that solves problems of so many joints, a constant, or of any if 0."""
    joint = f"(points,{joints or 'n'})"

    @points_kernel(
        f"(points,3,{joints or 'n'}),{joint},{joint},{joint},(points),(points,3)"
        "->(points),(points,3),(points),(points),(points)",
        "f8 f8 f8 f8 f8 f8 f8 f8 i8 b1 u1",
    )
    def capacity(
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
        n = joints or jacobian.shape[2]
        block = new_block(n, len(jacobian))
        for i in range(min(BLOCK, len(jacobian))):
            for k in range(n):
                block[row_of(RESERVE, n, k), i] = 0.0
        for start in range(0, len(jacobian), BLOCK):
            end = min(start + BLOCK, len(jacobian))
            load_numbers(block, MU, friction, start, end)
            load(block, NORMAL, normal, start, end, 3)
            load(block, row_of(LOWER, n, 0), lower, start, end, n)
            load(block, row_of(UPPER, n, 0), upper, start, end, n)
            load(block, row_of(EFFORT, n, 0), bias, start, end, n)
            load_columns(block, row_of(J, n, 0), jacobian, start, end, n)
            for i in range(end - start):
                leave_room(block, i, n)
            solve(block, jacobian, start, end, n)
            for i in range(end - start):
                k = start + i
                capacity[k] = block[CAPACITY, i]
                force[k, 0], force[k, 1], force[k, 2] = get3(block, FORCE, i)
                limiting_joint[k] = int(block[JOINT, i])
                friction_limited[k] = block[ON_CONE, i] == 1.0
                status[k] = int(block[OUTCOME, i])

    return capacity


_quick_capacity = _capacity_kernel(solve_three, 3)
_thorough_capacity = _capacity_kernel(solve_any, 0)
