# SPDX-License-Identifier: Apache-2.0
"""Compiled mathematics of planar legs driven by one crank, whatever bars follow the crank.

`linkage_kernels` makes the kernels of a linkage from what is particular to it: its points and the
transmission of its dyads. They get the linkage's constants and its `sides`: numbers whose signs
tell the assembly (see `dyads`). Those that give positions run over blocks of crank angles.

Lengths are in cranks and in the linkage's plane; see `crank_linkage` for its axes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from leg_kinematics.arrays import FloatArray
from leg_kinematics.kernels.blocks import BLOCK, load, put, store
from leg_kinematics.kernels.kernel import inlined, scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.scalars import LIMIT_TOLERANCE, within
from leg_kinematics.mechanisms.dyads import Point, crank_pin, fixed, turning_rate
from leg_kinematics.status import Status

OK, UNREACHABLE, JOINT_LIMIT, PASSIVE_JOINT_LIMIT, SINGULAR, INVALID_INPUT = map(int, Status)

TURN = 2.0 * math.pi
DEAD_POINT = 1e-6  # |sin| of the angle between a dyad's bars, below which the foot is not governed
MAX_PASSES = 8  # of the foot at a point
REFINEMENTS = 60
REFINED = 1e-14  # [rad]


# --------------------------------------------------------------------------- scalar mathematics


@inlined
def side(number: float) -> float:
    """Return the sign of a number as +1 or -1; NaN for NaN."""
    return math.nan if math.isnan(number) else math.copysign(1.0, number)


@inlined
def in_leg_frame(crank: float, x: float, y: float) -> tuple[float, float, float]:
    """Return a vector of the linkage's plane, in crank lengths, in the leg frame."""
    return -crank * x, 0.0, crank * y


@inlined
def turning_pin(angle: float) -> Point:
    """Return the crank's pin B and its derivatives by the crank angle."""
    return crank_pin(fixed(0.0, 0.0), 1.0, angle, 1.0, 0.0)


@inlined
def status_of_crank(q: float, limits: tuple[float, float], foot: Point, transmission: float) -> int:
    """Return the status of one crank angle, given the worst transmission of its dyads."""
    unlimited = limits[1] - limits[0] >= TURN - LIMIT_TOLERANCE
    status = OK if unlimited | within(q, limits) else JOINT_LIMIT
    status = SINGULAR if transmission < DEAD_POINT else status
    status = status if math.isfinite(foot.x + foot.y + transmission) else UNREACHABLE
    return status if math.isfinite(q) else INVALID_INPUT


# Kernels that give positions run over blocks of crank angles with these rows; more may follow.
Q, PIN, STATUS, FOOT, CLOSURE = 0, 1, 3, 4, 7


@inlined
def load_cranks(block: FloatArray, q: FloatArray, zero: float, start: int, end: int) -> None:
    """Fill the rows of crank angles and pins of a block.

    The loop that assembles the linkages takes the pins from there, because the library's cosine
    and sine compute one angle at a time.
    """
    load(block, Q, q, start, end, 1)
    for i in range(end - start):
        pin = turning_pin(zero + block[Q, i])
        block[PIN, i], block[PIN + 1, i] = pin.x, pin.y


@inlined
def resting_pin(block: FloatArray, i: int) -> Point:
    """Return the crank's pin B where only positions are asked for."""
    return fixed(block[PIN, i], block[PIN + 1, i])


@inlined
def put_forward(
    block: FloatArray,
    i: int,
    crank: float,
    limits: tuple[float, float],
    foot: Point,
    closure: tuple[float, ...],
    transmission: float,
) -> None:
    """Write status, foot in the leg frame and closure; NaN where there is no answer."""
    status = status_of_crank(block[Q, i], limits, foot, transmission)
    known = math.nan if (status == UNREACHABLE) | (status == INVALID_INPUT) else 1.0
    block[STATUS, i] = status
    x, y, z = in_leg_frame(crank, foot.x, foot.y)
    put(block, FOOT, i, (x * known, y * known, z * known))
    for k in range(len(closure)):
        block[CLOSURE + k, i] = closure[k] * known


@inlined
def store_forward(
    block: FloatArray,
    foot: FloatArray,
    closure: FloatArray,
    status: FloatArray,
    start: int,
    end: int,
    closures: int,
) -> None:
    """Copy what `put_forward` wrote to points start to end of arrays."""
    store(block, FOOT, foot, start, end, 3)
    store(block, CLOSURE, closure, start, end, closures)
    for i in range(end - start):
        status[start + i] = int(block[STATUS, i])


@inlined
def put_points(
    block: FloatArray, row: int, i: int, crank: float, points: tuple[Point, ...]
) -> None:
    """Write points in the leg frame below each other, from `row` on."""
    for k in range(len(points)):
        put(block, row + 3 * k, i, in_leg_frame(crank, points[k].x, points[k].y))


@inlined
def store_points(
    block: FloatArray, row: int, points: FloatArray, start: int, end: int, count: int
) -> None:
    """Copy what `put_points` wrote to an array (m, count, 3)."""
    for i in range(end - start):
        for k in range(count):
            for axis in range(3):
                points[start + i, k, axis] = block[row + 3 * k + axis, i]


class Bracket(NamedTuple):
    """A root between two crank angles, the best guess of it, and the state of its search."""

    lower: float
    upper: float
    angle: float
    steps: int
    done: bool


@scalar
def bracket_between(lower: float, upper: float) -> Bracket:
    """Return a bracket; a search in a NaN bracket is over."""
    return Bracket(lower, upper, 0.5 * (lower + upper), 0, not lower <= upper)


@scalar
def narrowed(bracket: Bracket, value: float, slope: float) -> Bracket:
    """Return the bracket after a step towards the root of a rising function.

    A step of Newton's method if it stays inside, else a bisection. NaN, where the linkage does not
    close, lies beyond the root.
    """
    lower, upper, angle, steps, _ = bracket
    if value > 0.0 or (math.isnan(value) and angle > 0.5 * (lower + upper)):
        upper = angle
    else:
        lower = angle
    following = angle - value / slope
    if not (slope > 0.0 and lower <= following <= upper):
        following = 0.5 * (lower + upper)
    done = abs(following - angle) < REFINED or steps >= REFINEMENTS
    return Bracket(lower, upper, following, steps + 1, done)


@scalar
def approach(foot: Point, x: float, y: float) -> tuple[float, float]:
    """Return first and second derivative of half the foot's squared distance from (x, y)."""
    dx, dy = foot.x - x, foot.y - y
    slope = dx * foot.vx + dy * foot.vy
    return slope, foot.vx * foot.vx + foot.vy * foot.vy + dx * foot.ax + dy * foot.ay


@scalar
def squared_distance(curve: FloatArray, i: int, x: float, y: float) -> float:
    """Return the squared distance of sample i from (x, y); infinite for a separator."""
    squared = (curve[i, 1] - x) ** 2 + (curve[i, 2] - y) ** 2
    return math.inf if math.isnan(squared) else squared


@scalar
def fill_brackets(
    curve: FloatArray, x: float, y: float, lower: FloatArray, upper: FloatArray
) -> None:
    """Fill the brackets of one point."""
    samples = curve.shape[0]
    nearest = np.zeros(lower.shape[0], dtype=np.int64)
    squares = np.full(lower.shape[0], math.inf)
    before, here = squared_distance(curve, 0, x, y), squared_distance(curve, 1, x, y)
    for i in range(1, samples - 1):
        after = squared_distance(curve, i + 1, x, y)
        if here <= before and here <= after and here < squares[-1]:
            k = squares.shape[0] - 1
            while k > 0 and squares[k - 1] > here:
                nearest[k], squares[k] = nearest[k - 1], squares[k - 1]
                k -= 1
            nearest[k], squares[k] = i, here
        before, here = here, after
    for k in range(squares.shape[0]):
        if squares[k] < math.inf:
            i = nearest[k]
            lower[k] = curve[i - 1, 0] if math.isfinite(curve[i - 1, 0]) else curve[i, 0]
            upper[k] = curve[i + 1, 0] if math.isfinite(curve[i + 1, 0]) else curve[i, 0]


# --------------------------------------------------------------------------- kernels


@points_kernel(
    f"(m,4),(points),(points)->(points,{MAX_PASSES}),(points,{MAX_PASSES})", "f8 f8 f8 f8 f8"
)
def near_brackets(curve, x, y, lower, upper):  # type: ignore[no-untyped-def]
    """Brackets about the samples nearer to (X, Y) than both neighbours, nearest first, then NaN.

    The first and the last sample only serve as neighbours.
    """
    lower[:] = math.nan
    upper[:] = math.nan
    for point in range(len(x)):
        if math.isfinite(x[point] + y[point]):
            fill_brackets(curve, x[point], y[point], lower[point], upper[point])


class Kernels(NamedTuple):
    """The kernels of one linkage; all but the first take its constants and sides first.

    Attributes:
        constants: Geometries (..., g) to their constants (..., c).
        forward: Limits of the crank (2,) and crank angles (..., 1) to foot in the leg frame
            (..., 3), closure (..., s) and status (...).
        motion: Closure and crank angles to first and second derivative of the foot by the crank
            angle and the foot link's turning, in the leg frame (..., 3) each.
        points: Closure and crank angles to all points in the leg frame (..., p, 3).
        foot_in_plane: Constants (..., c), sides (..., s) and angles of the crank in the plane (...)
            to foot X, Y and dX/dalpha (..., 3).
        nearest: X, Y and a bracket (...) to the crank angle in it at which the foot is nearest to
            (X, Y), and how near (...).
        crossing: X, a bracket and whether the foot's X rises there, +1, or falls, -1 (...), to the
            crank angle at which it is X (...).
    """

    constants: Callable[..., Any]
    forward: Callable[..., Any]
    motion: Callable[..., Any]
    points: Callable[..., Any]
    foot_in_plane: Callable[..., Any]
    nearest: Callable[..., Any]
    crossing: Callable[..., Any]


def linkage_kernels(
    geometry_type: Any,
    constants_type: Any,
    points_type: Any,
    sides_size: int,
    constants_of: Callable[..., Any],
    linkage_points: Callable[..., Any],
    worst_transmission: Callable[..., Any],
) -> Kernels:
    """Return the mathematics of a linkage.

    Args:
        geometry_type: Named tuple of the dimensions, in the order of the mechanism's fields.
        constants_type: Named tuple of what `linkage_points` needs of them; it has `crank`, the
            crank's length [m], and `zero`, the crank angle at joint position zero [rad].
        points_type: Named tuple of the points; `c` and `f` are on the foot link, the last is the
            foot.
        sides_size: Number of sides.
        constants_of: Geometry to constants.
        linkage_points: Constants, sides and the crank's pin to points and closure; inlined.
        worst_transmission: Constants, points and closure to the least transmission of the dyads;
            inlined.
    """
    geometry_size, constants_size = len(geometry_type._fields), len(constants_type._fields)
    points_size = len(points_type._fields)
    foot = points_size - 1
    point_rows = CLOSURE + sides_size
    rows = point_rows + 3 * points_size

    @points_kernel(f"(points,{geometry_size})->(points,{constants_size})", "f8 f8")
    def constants(geometry, result):  # type: ignore[no-untyped-def]
        for i in range(len(geometry)):
            k = constants_of(geometry_type(*to_fixed_tuple(geometry[i], geometry_size)))
            for j in range(constants_size):
                result[i, j] = k[j]

    @points_kernel(
        f"(c),({sides_size}),(2),(points,1)->(points,3),(points,{sides_size}),(points)",
        "f8 f8 f8 f8 f8 f8 u1",
    )
    def forward(constants, sides, limits, q, feet, closure, status):  # type: ignore[no-untyped-def]
        k = constants_type(*to_fixed_tuple(constants, constants_size))
        mode, bounds = to_fixed_tuple(sides, sides_size), to_fixed_tuple(limits, 2)
        block = np.empty((rows, BLOCK))
        for start in range(0, len(q), BLOCK):
            end = min(start + BLOCK, len(q))
            load_cranks(block, q, k.zero, start, end)
            for i in range(end - start):
                p, assembly = linkage_points(k, mode, resting_pin(block, i))
                worst = worst_transmission(k, p, assembly)
                put_forward(block, i, k.crank, bounds, p[foot], assembly, worst)
            store_forward(block, feet, closure, status, start, end, sides_size)

    @points_kernel(
        f"(c),(points,{sides_size}),(points,1)->(points,3),(points,3),(points,3)",
        "f8 f8 f8 f8 f8 f8",
    )
    def motion(constants, closure, q, velocity, acceleration, turning):  # type: ignore[no-untyped-def]
        k = constants_type(*to_fixed_tuple(constants, constants_size))
        for i in range(len(q)):
            p = linkage_points(k, closure[i], turning_pin(k.zero + q[i, 0]))[0]
            g = p[foot]
            velocity[i, 0], velocity[i, 1], velocity[i, 2] = in_leg_frame(k.crank, g.vx, g.vy)
            acceleration[i, 0], acceleration[i, 1], acceleration[i, 2] = in_leg_frame(
                k.crank, g.ax, g.ay
            )
            turning[i, 0], turning[i, 1], turning[i, 2] = 0.0, turning_rate(p.c, p.f), 0.0

    @points_kernel(f"(c),(points,{sides_size}),(points,1)->(points,{points_size},3)", "f8 f8 f8 f8")
    def points(constants, closure, q, result):  # type: ignore[no-untyped-def]
        k = constants_type(*to_fixed_tuple(constants, constants_size))
        block = np.empty((rows, BLOCK))
        for start in range(0, len(q), BLOCK):
            end = min(start + BLOCK, len(q))
            load_cranks(block, q, k.zero, start, end)
            load(block, CLOSURE, closure, start, end, sides_size)
            for i in range(end - start):
                mode = to_fixed_tuple(block[CLOSURE:, i], sides_size)
                p = linkage_points(k, mode, resting_pin(block, i))[0]
                put_points(block, point_rows, i, k.crank, p)
            store_points(block, point_rows, result, start, end, points_size)

    @points_kernel(f"(points,c),(points,{sides_size}),(points)->(points,3)", "f8 f8 f8 f8")
    def foot_in_plane(constants, sides, angle, result):  # type: ignore[no-untyped-def]
        for i in range(len(angle)):
            k = constants_type(*to_fixed_tuple(constants[i], constants_size))
            g = linkage_points(k, sides[i], turning_pin(angle[i]))[0][foot]
            result[i, 0], result[i, 1], result[i, 2] = g.x, g.y, g.vx

    @points_kernel(
        f"(c),({sides_size}),(points),(points),(points),(points)->(points),(points)",
        "f8 f8 f8 f8 f8 f8 f8 f8",
    )
    def nearest(constants, sides, x, y, lower, upper, angle, distance):  # type: ignore[no-untyped-def]
        k = constants_type(*to_fixed_tuple(constants, constants_size))
        for i in range(len(x)):
            bracket = bracket_between(lower[i], upper[i])
            while not bracket.done:
                g = linkage_points(k, sides, turning_pin(bracket.angle))[0][foot]
                slope, curvature = approach(g, x[i], y[i])
                bracket = narrowed(bracket, slope, curvature)
            g = linkage_points(k, sides, turning_pin(bracket.angle))[0][foot]
            angle[i], distance[i] = bracket.angle, math.hypot(g.x - x[i], g.y - y[i])

    @points_kernel(
        f"(c),({sides_size}),(points),(points),(points),(points)->(points)",
        "f8 f8 f8 f8 f8 f8 f8",
    )
    def crossing(constants, sides, x, lower, upper, sense, angle):  # type: ignore[no-untyped-def]
        k = constants_type(*to_fixed_tuple(constants, constants_size))
        for i in range(len(x)):
            bracket = bracket_between(lower[i], upper[i])
            while not bracket.done:
                g = linkage_points(k, sides, turning_pin(bracket.angle))[0][foot]
                bracket = narrowed(bracket, sense[i] * (g.x - x[i]), sense[i] * g.vx)
            angle[i] = bracket.angle

    return Kernels(constants, forward, motion, points, foot_in_plane, nearest, crossing)
