# SPDX-License-Identifier: Apache-2.0
"""Kernels of the parallel-driving leg: `parallel_drive_equations` over blocks of points."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from leg_kinematics.arrays import FloatArray
from leg_kinematics.kernels.blocks import BLOCK, get3, load, put, store, store_columns
from leg_kinematics.kernels.kernel import inlined, scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.scalars import LARGEST_ANGLE, cosine_sine, direction
from leg_kinematics.kernels.settled import UNCERTAIN
from leg_kinematics.mechanisms.parallel_drive_equations import (
    BRANCH_SIZE,
    GEOMETRY_SIZE,
    INVALID_INPUT,
    NEWTON_TOLERANCE,
    OK,
    REST_SIZE,
    UNREACHABLE,
    Branch,
    Cranks,
    Geometry,
    Numbers,
    Pose,
    closure_angles,
    crank_angles,
    foot_of_pose,
    gradients,
    jacobian_columns,
    pantograph_of_drive,
    passive_measures,
    platform_on_branch,
    platform_step,
    pose_of_angles,
    pose_of_directions,
    pose_of_foot,
    solve_platform,
    status_of_pose,
    symmetric_elevation,
    turned,
)
from leg_kinematics.mechanisms.walking_axes import in_leg_frame, in_walking_axes

LIMITS_SIZE = 24  # lower and upper limits of 3 cranks and 9 passive joints
BLOCK_STEPS = 5  # of Newton's method; within the default ranges rounding is left after them

# Kernels run over blocks of points, with these rows: what is given, foot or cranks, and what is
# found, cranks or foot and below them the closure;
GIVEN, FOUND, CLOSURE, STATUS, J, OMEGA = 0, 3, 6, 11, 12, 21
# and, of known cranks, (cos, sin) of them and of a and b, and whether those are found.
CRANKS, PLATFORM, OUTCOME, ROWS = 30, 36, 40, 41
# An array of results costs a call as much as several points do. What is found therefore shares one,
# as do both Jacobians.


@inlined
def solve_foot(
    g: Geometry, branch: Branch, rest: Numbers, limits: Numbers, block: FloatArray, i: int
) -> Pose:
    """Solve point i of a block: fill crank angles, closure and status, return the pose."""
    x, y, z = in_walking_axes(*get3(block, GIVEN, i))
    pose = pose_of_foot(g, branch, x, y, z)
    q = crank_angles(g, pose)
    status = status_of_pose(g, branch, rest, limits, q, pose)
    status = status if math.isfinite(x) & math.isfinite(y) & math.isfinite(z) else INVALID_INPUT
    solved = (status != UNREACHABLE) & (status != INVALID_INPUT)
    known = 1.0 if solved else math.nan
    block[STATUS, i] = status
    closure = closure_angles(pose)
    for k in range(3):
        block[FOUND + k, i] = q[k] * known
    for k in range(5):
        block[CLOSURE + k, i] = closure[k] * known
    return pose


@inlined
def put_twist(g: Geometry, p: Pose, block: FloatArray, i: int) -> None:
    """Fill both Jacobians of point i of a block."""
    f1, f2 = gradients(g, p)
    for crank in range(3):
        v, omega = jacobian_columns(g, p, f1, f2, crank)
        put(block, J + 3 * crank, i, v)
        put(block, OMEGA + 3 * crank, i, omega)


@inlined
def store_twist(block: FloatArray, twist: FloatArray, start: int, end: int) -> None:
    """Copy both Jacobians of a block below each other."""
    store_columns(block, J, twist[:, :3], start, end, 3)
    store_columns(block, OMEGA, twist[:, 3:], start, end, 3)


@inlined
def unpacked(parameters: FloatArray) -> tuple[Geometry, Branch, Numbers, Numbers]:
    """Return dimensions, branch, rest and limits, which `ParallelDrive._parameters` joins."""
    end = GEOMETRY_SIZE + BRANCH_SIZE + REST_SIZE
    return (
        Geometry(*to_fixed_tuple(parameters, GEOMETRY_SIZE)),
        Branch(*to_fixed_tuple(parameters[GEOMETRY_SIZE:], BRANCH_SIZE)),
        to_fixed_tuple(parameters[GEOMETRY_SIZE + BRANCH_SIZE :], REST_SIZE),
        to_fixed_tuple(parameters[end:], LIMITS_SIZE),
    )


@points_kernel("(p),(points,3)->(points,8),(points)", "f8 f8 f8 u1")
def inverse(parameters, foot, coordinates, status):
    """Foot positions to crank angles and closure."""
    g, branch, rest, limits = unpacked(parameters)
    block = np.empty((ROWS, BLOCK))
    for start in range(0, len(foot), BLOCK):
        end = min(start + BLOCK, len(foot))
        load(block, GIVEN, foot, start, end, 3)
        for i in range(end - start):
            solve_foot(g, branch, rest, limits, block, i)
        store(block, FOUND, coordinates, start, end, 8)
        for i in range(end - start):
            status[start + i] = int(block[STATUS, i])


@points_kernel("(p),(points,3)->(points,8),(points),(points,6,3)", "f8 f8 f8 u1 f8")
def inverse_with_twist(parameters, foot, coordinates, status, twist):
    """`inverse` and, below each other, both Jacobians of the solved pose in one pass."""
    g, branch, rest, limits = unpacked(parameters)
    block = np.empty((ROWS, BLOCK))
    for start in range(0, len(foot), BLOCK):
        end = min(start + BLOCK, len(foot))
        load(block, GIVEN, foot, start, end, 3)
        for i in range(end - start):
            put_twist(g, solve_foot(g, branch, rest, limits, block, i), block, i)
        store(block, FOUND, coordinates, start, end, 8)
        store_twist(block, twist, start, end)
        for i in range(end - start):
            status[start + i] = int(block[STATUS, i])


@inlined
def load_cranks(g: Geometry, block: FloatArray, i: int) -> None:
    """Fill (cos, sin) of the cranks of point i of a block, and those of the symmetric pose."""
    q1, q2, q3 = get3(block, GIVEN, i)
    center = cosine_sine(g.phi3 + q3)
    put(block, CRANKS, i, (*cosine_sine(g.phi1 + q1), *cosine_sine(g.phi1 + q2), *center))
    symmetric = symmetric_elevation(g, cosine_sine(g.phi1 + 0.5 * (q1 + q2)), center)
    put(block, PLATFORM, i, (*symmetric, 1.0, 0.0))


@inlined
def cranks_of(block: FloatArray, i: int) -> Cranks:
    """Return (cos, sin) of the cranks of point i."""
    return (*get3(block, CRANKS, i), *get3(block, CRANKS + 3, i))


@inlined
def platform_of(block: FloatArray, i: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return (cos, sin) of a and b of point i."""
    a = block[PLATFORM, i], block[PLATFORM + 1, i]
    return a, (block[PLATFORM + 2, i], block[PLATFORM + 3, i])


@inlined
def find_platforms(g: Geometry, branch: Branch, block: FloatArray, count: int) -> None:
    """Find the platform poses of a block by some steps from the symmetric pose.

    They suffice within the default ranges; UNCERTAIN is what remains open.
    """
    for i in range(count):
        load_cranks(g, block, i)
    for _ in range(BLOCK_STEPS):
        for i in range(count):
            a, b = platform_of(block, i)
            step_a, step_b, _ = platform_step(g, cranks_of(block, i), a, b)
            put(block, PLATFORM, i, (*turned(a, step_a), *turned(b, step_b)))
    for i in range(count):
        a, b = platform_of(block, i)
        step_a, step_b, _ = platform_step(g, cranks_of(block, i), a, b)
        q1, q2, q3 = get3(block, GIVEN, i)
        found = platform_on_branch(g, branch, cranks_of(block, i), a, b)
        found &= abs(step_a) + abs(step_b) < NEWTON_TOLERANCE
        found &= abs(q1) + abs(q2) + abs(q3) < LARGEST_ANGLE
        outcome = OK if found else UNCERTAIN
        block[OUTCOME, i] = outcome if math.isfinite(q1 + q2 + q3) else INVALID_INPUT


@inlined
def search_platforms(g: Geometry, branch: Branch, block: FloatArray, count: int) -> None:
    """Find the platform poses of a block one by one, wherever they are."""
    for i in range(count):
        q1, q2, q3 = get3(block, GIVEN, i)
        crank_1, crank_2 = direction(g.phi1 + q1), direction(g.phi1 + q2)
        center, middle = direction(g.phi3 + q3), direction(g.phi1 + 0.5 * (q1 + q2))
        put(block, CRANKS, i, (*crank_1, *crank_2, *center))
        symmetric = symmetric_elevation(g, middle, center)
        block[OUTCOME, i], a, b = solve_platform(g, branch, cranks_of(block, i), symmetric)
        put(block, PLATFORM, i, (*direction(a), *direction(b)))


@inlined
def solve_cranks(
    g: Geometry, branch: Branch, rest: Numbers, limits: Numbers, block: FloatArray, i: int
) -> Pose:
    """Solve point i of a block, whose platform is found: fill foot, closure and status.

    Returns:
        The pose; NaN if there is none.
    """
    cranks, (a, b) = cranks_of(block, i), platform_of(block, i)
    pantograph = pantograph_of_drive(g, branch.knee, cranks[4:6], a, b)
    pose = pose_of_directions(g, cranks, a, b, pantograph)
    status = status_of_pose(g, branch, rest, limits, get3(block, GIVEN, i), pose)
    outcome = block[OUTCOME, i]
    solved = (outcome == OK) & (status != UNREACHABLE)
    known = 1.0 if solved else math.nan
    block[STATUS, i] = status if outcome == OK else outcome
    foot, closure = in_leg_frame(*foot_of_pose(g, pose)), closure_angles(pose)
    for k in range(3):
        block[FOUND + k, i] = foot[k] * known
    for k in range(5):
        block[CLOSURE + k, i] = closure[k] * known
    return pose_of_directions(g, cranks, (a[0] * known, a[1] * known), b, pantograph)


def forward_kernels(find: Callable[..., None]) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return the kernels of the forward problem, given how the platforms of a block are found.

    Crank angles (..., 3) to foot and closure (..., 8) and status (...); the second kernel also
    gives, below each other, both Jacobians of the solved pose (..., 6, 3).
    """

    @points_kernel("(p),(points,3)->(points,8),(points)", "f8 f8 f8 u1")
    def forward(parameters, q, coordinates, status):
        g, branch, rest, limits = unpacked(parameters)
        block = np.empty((ROWS, BLOCK))
        for start in range(0, len(q), BLOCK):
            end = min(start + BLOCK, len(q))
            load(block, GIVEN, q, start, end, 3)
            find(g, branch, block, end - start)
            for i in range(end - start):
                solve_cranks(g, branch, rest, limits, block, i)
            store(block, FOUND, coordinates, start, end, 8)
            for i in range(end - start):
                status[start + i] = int(block[STATUS, i])

    @points_kernel("(p),(points,3)->(points,8),(points),(points,6,3)", "f8 f8 f8 u1 f8")
    def forward_with_twist(parameters, q, coordinates, status, twist):
        g, branch, rest, limits = unpacked(parameters)
        block = np.empty((ROWS, BLOCK))
        for start in range(0, len(q), BLOCK):
            end = min(start + BLOCK, len(q))
            load(block, GIVEN, q, start, end, 3)
            find(g, branch, block, end - start)
            for i in range(end - start):
                put_twist(g, solve_cranks(g, branch, rest, limits, block, i), block, i)
            store(block, FOUND, coordinates, start, end, 8)
            store_twist(block, twist, start, end)
            for i in range(end - start):
                status[start + i] = int(block[STATUS, i])

    return forward, forward_with_twist


forward, forward_with_twist = forward_kernels(find_platforms)
forward_search, forward_search_with_twist = forward_kernels(search_platforms)


@scalar
def fill_twist(g: Geometry, p: Pose, twist: FloatArray) -> None:
    """Fill J of equation (1), foot velocity, above J_omega of (2), angular velocity of R2C."""
    f1, f2 = gradients(g, p)
    for crank in range(3):
        v, omega = jacobian_columns(g, p, f1, f2, crank)
        for k in range(3):
            twist[k, crank], twist[3 + k, crank] = v[k], omega[k]


@points_kernel("(g),(points,3),(points,5)->(points,6,3)", "f8 f8 f8 f8")
def twist(geometry, q, closure, jacobians):
    """Both Jacobians of solved poses, below each other."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    for i in range(len(q)):
        fill_twist(g, pose_of_angles(g, q[i], closure[i]), jacobians[i])


@points_kernel("(g),(points,3),(points,5)->(points,3,6)", "f8 f8 f8 f8")
def constraint_jacobian(geometry, q, closure, jacobian):
    """Constraint wrenches in the paper's axes."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    for i in range(len(q)):
        p = pose_of_angles(g, q[i], closure[i])
        # U3 seen from G is -l3 w; the moments are its cross products with s_q2 and n2
        wx, wy, wz = -g.l3 * p.sb, -g.l3 * p.cb * p.ca, -g.l3 * p.cb * p.sa
        wrenches = jacobian[i]
        wrenches[:] = 0.0
        wrenches[0, 4], wrenches[0, 5] = p.ca, p.sa  # n1
        wrenches[1, 0] = 1.0  # s_q2
        wrenches[1, 4], wrenches[1, 5] = wz, -wy
        wrenches[2, 1], wrenches[2, 2] = p.cp3, p.sp3  # n2
        wrenches[2, 3] = wy * p.sp3 - wz * p.cp3
        wrenches[2, 4], wrenches[2, 5] = -wx * p.sp3, wx * p.cp3


@points_kernel("(g),(r),(points,3),(points,5)->(points,9)", "f8 f8 f8 f8 f8")
def passive(geometry, rest, q, closure, measures):
    """`passive_measures` of solved poses."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    numbers = to_fixed_tuple(rest, REST_SIZE)
    for i in range(len(q)):
        found = passive_measures(g, pose_of_angles(g, q[i], closure[i]), numbers)
        for joint in range(9):
            measures[i, joint] = found[joint]
