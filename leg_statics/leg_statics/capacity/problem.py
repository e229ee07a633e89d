"""Load capacity: the largest normal force the ground may exert on a foot within effort limits.

The ground's force F on the foot loads the actuators with the efforts e = Jᵀ F. Besides the efforts
`bias` that the pose needs anyway, the limits leave `-down_i <= e_i <= up_i` with
`up = bias - lower` and `down = upper - bias`. Friction keeps F in a circular cone about the normal
of the ground. Load capacity is the largest normal component of F: a second-order cone programme in
three variables.

It is solved exactly, by its geometry. Every force of the cone is F = (x, y, 1) / s in axes whose
third is the normal, with (x, y) in the disc of radius mu and s = 1 / F_n. The limits become planes
a·(x, y, 1) <= b s, and the smallest s over the disc is sought: it lies where three planes meet,
where two planes meet above the disc's rim, or on a single plane at the rim. `three_joint_capacity`
does so quickly where it can, `plane_capacity` in all other cases. That divides nowhere by the
determinant of J, so singular poses need no exception: s = 0 means that the structure carries any
load. Paper 000, eqs (15)-(21), is the same question for unit efforts without friction.
"""

# The compiler infers the types of the scalar code below; only what Python calls is annotated.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
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
from leg_statics.capacity.planes import BOUNDED, INVALID_INPUT, plane_capacity
from leg_statics.capacity.planes import CapacityStatus as CapacityStatus
from leg_statics.capacity.three_joint import three_joint_capacity

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
    lower = as_array("effort_lower", effort_lower, n)
    upper = as_array("effort_upper", effort_upper, n)
    mu, direction = as_array("friction", friction), as_array("normal", normal, 3)
    idle = as_vectors("bias", bias, n)
    try:
        result = LoadCapacity(*_load_capacity(matrix, lower, upper, idle, mu, direction))
    except ValueError:
        shapes = {"jacobian": matrix.shape[:-2], "friction": mu.shape}
        others = {"effort_lower": lower, "effort_upper": upper, "bias": idle, "normal": direction}
        shapes |= {name: array.shape[:-1] for name, array in others.items()}
        raise broadcast_error(shapes) from None
    if not result.status.size or has_code(result.status, INVALID_INPUT):
        check_effort_limits(lower, upper)
        as_non_negative("friction", mu)
        check_normals("normal", direction)
    return result


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


# --------------------------------------------------------------------------- kernel

# Rows of a block: the Jacobian by columns, limits, bias, friction and normal, then the results
J, LOWER, UPPER, BIAS, MU, NORMAL = 0, 9, 12, 15, 18, 19
CAPACITY, FORCE, JOINT, ON_CONE, CERTAIN, ROWS = 22, 23, 26, 27, 28, 29


@inlined
def unit(vector):
    """Return a vector of length 1 along another; NaN if that has no direction."""
    largest = max(abs(vector[0]), abs(vector[1]), abs(vector[2]))
    x, y, z = vector[0] / largest, vector[1] / largest, vector[2] / largest
    per_length = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * per_length, y * per_length, z * per_length


@inlined
def difference(a, b):
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@scalar
def capacity_of_point(
    jacobian: Any, lower: Any, upper: Any, bias: Any, friction: float, normal: Any
) -> float:
    """Return the load capacity of one point [N], for use inside other kernels.

    Args:
        jacobian: Jacobian (3, n).
        lower: Smallest efforts (n,).
        upper: Largest efforts (n,).
        bias: Efforts without load (n,).
        friction: Friction coefficient.
        normal: Unit normal of the ground (3,).
    """
    n = (normal[0], normal[1], normal[2])
    if jacobian.shape[1] == 3:
        columns = (
            (jacobian[0, 0], jacobian[1, 0], jacobian[2, 0]),
            (jacobian[0, 1], jacobian[1, 1], jacobian[2, 1]),
            (jacobian[0, 2], jacobian[1, 2], jacobian[2, 2]),
        )
        up, down = difference(bias, lower), difference(upper, bias)
        quick = three_joint_capacity(columns, up, down, friction, n)
        if quick.certain:
            return quick.capacity
    return plane_capacity(jacobian, lower, upper, bias, friction, n)[0]


@points_kernel(
    "(points,3,n),(points,n),(points,n),(points,n),(points),(points,3)->(points),(points,3),(points),(points),(points)",
    "f8 f8 f8 f8 f8 f8 f8 f8 i8 b1 u1",
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
    """Take the quick way where its answer is certain, and try all planes elsewhere."""
    three_joints = jacobian.shape[2] == 3
    block = np.empty((ROWS, BLOCK))
    for i in range(min(BLOCK, len(jacobian))):
        block[CERTAIN, i] = 0.0
    for start in range(0, len(jacobian), BLOCK):
        end = min(start + BLOCK, len(jacobian))
        if three_joints:
            load_columns(block, J, jacobian, start, end, 3)
            load(block, LOWER, lower, start, end, 3)
            load(block, UPPER, upper, start, end, 3)
            load(block, BIAS, bias, start, end, 3)
            load_numbers(block, MU, friction, start, end)
            load(block, NORMAL, normal, start, end, 3)
            for i in range(end - start):
                columns = get3(block, J, i), get3(block, J + 3, i), get3(block, J + 6, i)
                idle = get3(block, BIAS, i)
                up = difference(idle, get3(block, LOWER, i))
                down = difference(get3(block, UPPER, i), idle)
                n = unit(get3(block, NORMAL, i))
                quick = three_joint_capacity(columns, up, down, block[MU, i], n)
                block[CAPACITY, i] = quick.capacity
                put(block, FORCE, i, quick.force)
                block[JOINT, i] = quick.limiting_joint
                block[ON_CONE, i] = 1.0 if quick.friction_limited else 0.0
                block[CERTAIN, i] = 1.0 if quick.certain else 0.0
        for i in range(end - start):
            k = start + i
            if block[CERTAIN, i] == 1.0:
                capacity[k], limiting_joint[k] = block[CAPACITY, i], int(block[JOINT, i])
                force[k, 0], force[k, 1], force[k, 2] = get3(block, FORCE, i)
                friction_limited[k], status[k] = block[ON_CONE, i] == 1.0, BOUNDED
            else:
                n = unit((normal[k, 0], normal[k, 1], normal[k, 2]))
                (
                    capacity[k],
                    (force[k, 0], force[k, 1], force[k, 2]),
                    limiting_joint[k],
                    friction_limited[k],
                    status[k],
                ) = plane_capacity(jacobian[k], lower[k], upper[k], bias[k], friction[k], n)
