# SPDX-License-Identifier: Apache-2.0
"""`parallel_drive`: the 2RUS+RU parallel-driving leg with a pantograph (Zhang, Jin, Zhang 2017).

Three cranks with axes across the leg move a platform: two outer cranks through rods (2RUS) and
a centre crank through a universal joint (RU). The platform's point S drives a parallelogram
(pantograph) that swings about the hip H and magnifies the motion to the foot C.

The paper leaves the assembly to a reference that is not at hand. The geometry is therefore a
reconstruction, with two fitted crank zero angles as parameters; see the README.

Symbols and axes of the code are the paper's: x to the right, y forward, z up (see `walking_axes`).
Frame {P} has its origin at the middle of the outer crank axes, {C} at the hip H; the leg frame is
{C} with the axes of REP-103. `u(t) = (0, cos t, sin t)`.

    U_i = R_Di + m_i u(phi_i)                       crank pins, i = 1, 2, 3
    w   = (sin b, cos b cos a, cos b sin a)         direction U3 -> G of the platform
    x_d = (cos b, -sin b cos a, -sin b sin a)       direction of the platform's arms
    S_1,2 = G ± a x_d,  |S_i - U_i| = l_i,          ball joints and rods
    S = G + l33 (0, -sin a, cos a)                  point that drives the pantograph
    S - H = p(th3; l4 u(th1) + c u(th2) + lg u(th2 + 90°))
    C - H = p(th3; (l4 + l5 + l7) u(th1) + l6 u(th2))
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array, has_code, wrapped_angles
from leg_kinematics.assembly_modes import flipped_modes, mode_signs
from leg_kinematics.errors import GeometryError
from leg_kinematics.geometry import Dimensioned, offset, parameter
from leg_kinematics.kernels.blocks import BLOCK, get3, load, put, store, store_columns
from leg_kinematics.kernels.kernel import inlined, kernel, scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.scalars import LARGEST_ANGLE, arctan2, cosine_sine, within, wrapped
from leg_kinematics.kernels.settled import UNCERTAIN, settled
from leg_kinematics.mechanism import Excursion, Joint, Linkage, Posture
from leg_kinematics.mechanisms.walking_axes import in_leg_frame, in_walking_axes, leg_vectors
from leg_kinematics.status import Status

REST_SIZE = 12  # of the passive joints' rest, see `_passive_rest`
LIMITS_SIZE = 24  # lower and upper limits of 3 cranks and 9 passive joints

OK, UNREACHABLE, JOINT_LIMIT, PASSIVE_JOINT_LIMIT, SINGULAR, INVALID_INPUT = map(int, Status)

NEWTON_STEPS = 20
BLOCK_STEPS = 5  # of a block of points; within the default ranges rounding is left after them
NEWTON_TOLERANCE = 1e-14  # [rad]


Numbers = Sequence[float]  # a tuple in compiled code
Cranks = tuple[float, float, float, float, float, float]  # (cos, sin) of phi_1, phi_2, phi_3


class Geometry(NamedTuple):
    """The dimensions under the paper's symbols, in the order of `ParallelDrive`'s fields."""

    d: float
    h1: float
    e: float
    m1: float
    m3: float
    l1: float
    a: float
    l3: float
    l33: float
    ly: float
    lz: float
    l4: float
    c: float
    lg: float
    l5: float
    l6: float
    l7: float
    phi1: float
    phi3: float


class Branch(NamedTuple):
    """Signs that tell the solutions of the loop equations apart; each is +1 or -1.

    Attributes:
        crank: Of d f_i / d q_i for the outer cranks i = 1, 2: the side of the rod.
        center: Of sin(a + delta3 - phi_3): the side to which centre crank and platform bend.
        knee: Of sin(th2 - th1): the side to which the pantograph bends.
        loop: Of det d(f_1, f_2)/d(a, b): which side of the forward singularity.
    """

    crank_1: float
    crank_2: float
    center: float
    knee: float
    loop: float


GEOMETRY_SIZE, BRANCH_SIZE = len(Geometry._fields), len(Branch._fields)


class Pose(NamedTuple):
    """Cosines (c) and sines (s) of every angle of a closed linkage, and its two rods.

    Attributes:
        c1: Of th1, th2 of the pantograph's bars and th3 of its swing.
        ca: Of the platform angles a and b.
        cp1: Of the crank angles phi_1, phi_2, phi_3.
        x1: Components of the rods U_1 -> S_1 and U_2 -> S_2.
    """

    c1: float
    s1: float
    c2: float
    s2: float
    c3: float
    s3: float
    ca: float
    sa: float
    cb: float
    sb: float
    cp1: float
    sp1: float
    cp2: float
    sp2: float
    cp3: float
    sp3: float
    x1: float
    y1: float
    z1: float
    x2: float
    y2: float
    z2: float


class Gradient(NamedTuple):
    """Derivatives of f_i = (|S_i - U_i|² - l_i²) / 2 by a, b, q_i and q_3."""

    a: float
    b: float
    q: float
    q3: float


# --------------------------------------------------------------------------- scalar mathematics


@inlined
def two_link(
    y: float, z: float, first: float, second: float, bend: float
) -> tuple[float, float, float, float]:
    """Return u(t1), u(t2) of first u(t1) + second u(t2) = (y, z), sign of sin(t2 - t1) given."""
    square = y * y + z * z
    along = 0.5 * (square + first * first - second * second) / first
    across = bend * math.sqrt(square - along * along)
    c1, s1 = (along * y + across * z) / square, (along * z - across * y) / square
    return c1, s1, (y - first * c1) / second, (z - first * s1) / second


@inlined
def center_pin(g: Geometry, cp3: float, sp3: float) -> tuple[float, float]:
    """Return y, z of U3, the pin of the centre crank, in {P}."""
    return g.e + g.m3 * cp3, -g.h1 + g.m3 * sp3


@inlined
def rod(
    g: Geometry,
    side: float,
    crank: tuple[float, float],
    center: tuple[float, float],
    a: tuple[float, float],
    b: tuple[float, float],
) -> tuple[float, float, float]:
    """Return U_i -> S_i from (cos, sin) of the angles; side is +1 for i = 1 and -1 for i = 2."""
    y, z = center_pin(g, *center)
    in_plane = g.l3 * b[0] - side * g.a * b[1]
    return (
        g.l3 * b[1] + side * (g.a * b[0] - 0.5 * g.d),
        y + in_plane * a[0] - g.m1 * crank[0],
        z + in_plane * a[1] - g.m1 * crank[1],
    )


@inlined
def rod_gradient(
    g: Geometry,
    side: float,
    crank: tuple[float, float],
    center: tuple[float, float],
    a: tuple[float, float],
    b: tuple[float, float],
    rod: tuple[float, float, float],
) -> Gradient:
    """Return the derivatives of f_i."""
    x, y, z = rod
    in_plane = g.l3 * b[0] - side * g.a * b[1]
    return Gradient(
        in_plane * (z * a[0] - y * a[1]),
        in_plane * x - (g.l3 * b[1] + side * g.a * b[0]) * (y * a[0] + z * a[1]),
        g.m1 * (y * crank[1] - z * crank[0]),
        g.m3 * (z * center[0] - y * center[1]),
    )


@inlined
def gradients(g: Geometry, p: Pose) -> tuple[Gradient, Gradient]:
    """Return the derivatives of f_1 and f_2."""
    center, a, b = (p.cp3, p.sp3), (p.ca, p.sa), (p.cb, p.sb)
    return (
        rod_gradient(g, 1.0, (p.cp1, p.sp1), center, a, b, (p.x1, p.y1, p.z1)),
        rod_gradient(g, -1.0, (p.cp2, p.sp2), center, a, b, (p.x2, p.y2, p.z2)),
    )


@scalar
def direction(angle: float) -> tuple[float, float]:
    """Return (cos, sin) of the library."""
    return math.cos(angle), math.sin(angle)


@inlined
def turned(direction: tuple[float, float], angle: float) -> tuple[float, float]:
    """Return a direction (cos, sin) turned by 2 atan(angle / 2): by the angle, if that is small."""
    t = 0.5 * angle
    per_square = 1.0 / (1.0 + t * t)
    c, s = (1.0 - t * t) * per_square, 2.0 * t * per_square
    return direction[0] * c - direction[1] * s, direction[1] * c + direction[0] * s


@inlined
def pose_of_directions(
    g: Geometry,
    cranks: Cranks,
    a: tuple[float, float],
    b: tuple[float, float],
    pantograph: tuple[float, float, float, float, float, float],
) -> Pose:
    """Return the pose of known angles, given by (cos, sin) of each."""
    x1, y1, z1 = rod(g, 1.0, cranks[0:2], cranks[4:6], a, b)
    x2, y2, z2 = rod(g, -1.0, cranks[2:4], cranks[4:6], a, b)
    return Pose(*pantograph, *a, *b, *cranks, x1, y1, z1, x2, y2, z2)


@scalar
def pose_of_angles(g: Geometry, q: FloatArray, closure: FloatArray) -> Pose:
    """Return the pose of known crank angles and closure."""
    return pose_of_directions(
        g,
        (*direction(g.phi1 + q[0]), *direction(g.phi1 + q[1]), *direction(g.phi3 + q[2])),
        direction(closure[0]),
        direction(closure[1]),
        (*direction(closure[2]), *direction(closure[3]), *direction(closure[4])),
    )


@inlined
def symmetric_elevation(
    g: Geometry, crank: tuple[float, float], center: tuple[float, float]
) -> tuple[float, float]:
    """Return (cos, sin) of the a that closes the loops if both outer cranks stand alike (b = 0).

    It follows from the triangle U3 G, and U3 and G to the middle of U1 U2; NaN if that is open.
    """
    y, z = center_pin(g, *center)
    y, z = g.m1 * crank[0] - y, g.m1 * crank[1] - z
    arm = 0.5 * g.d - g.a
    square = y * y + z * z
    base = math.sqrt(square)
    cosine = (g.l3 * g.l3 + square - (g.l1 * g.l1 - arm * arm)) / (2.0 * g.l3 * base)
    sine = math.sqrt(1.0 - cosine * cosine)
    return (y * cosine + z * sine) / base, (z * cosine - y * sine) / base


@inlined
def platform_step(
    g: Geometry, cranks: Cranks, a: tuple[float, float], b: tuple[float, float]
) -> tuple[float, float, float]:
    """Return the step of Newton's method to (a, b) that close the rods, and |f_1| + |f_2|.

    All angles are given by (cos, sin).
    """
    crank_1, crank_2, center = cranks[0:2], cranks[2:4], cranks[4:6]
    r1 = rod(g, 1.0, crank_1, center, a, b)
    r2 = rod(g, -1.0, crank_2, center, a, b)
    d1 = rod_gradient(g, 1.0, crank_1, center, a, b, r1)
    d2 = rod_gradient(g, -1.0, crank_2, center, a, b, r2)
    f1 = 0.5 * (r1[0] * r1[0] + r1[1] * r1[1] + r1[2] * r1[2] - g.l1 * g.l1)
    f2 = 0.5 * (r2[0] * r2[0] + r2[1] * r2[1] + r2[2] * r2[2] - g.l1 * g.l1)
    determinant = d1.a * d2.b - d1.b * d2.a
    return (
        (f2 * d1.b - f1 * d2.b) / determinant,
        (f1 * d2.a - f2 * d1.a) / determinant,
        abs(f1) + abs(f2),
    )


@scalar
def newton(g: Geometry, cranks: Cranks, a: float, b: float) -> tuple[bool, float, float]:
    """Solve the two rod equations for (a, b) from a starting point; True if converged."""
    for _ in range(NEWTON_STEPS):
        step_a, step_b, residual = platform_step(g, cranks, direction(a), direction(b))
        a += step_a
        b += step_b
        # near the singularity rounding of f keeps the steps from shrinking further
        rounding = 1e-8 if residual < 1e-20 else 0.0
        if abs(step_a) + abs(step_b) < NEWTON_TOLERANCE + rounding:
            return True, wrapped(a), wrapped(b)
    return False, a, b


@inlined
def platform_bend(g: Geometry, p: Pose) -> float:
    """Return sin(a + delta3 - phi_3), of the bend from the centre crank to U3 -> S, times U3 S."""
    along, across = g.l3 * p.cb * p.ca - g.l33 * p.sa, g.l3 * p.cb * p.sa + g.l33 * p.ca
    return across * p.cp3 - along * p.sp3


@inlined
def drive_on_branch(g: Geometry, branch: Branch, p: Pose) -> bool:
    """Tell whether the drive lies strictly inside the branch, off its singularities."""
    f1, f2 = gradients(g, p)
    return (
        (f1.q * branch.crank_1 > 0.0)
        & (f2.q * branch.crank_2 > 0.0)
        & (platform_bend(g, p) * branch.center > 0.0)
        & ((f1.a * f2.b - f1.b * f2.a) * branch.loop > 0.0)
        & (p.cb > 0.0)
    )


@inlined
def walking_on_branch(g: Geometry, branch: Branch, p: Pose) -> bool:
    """Tell whether the pantograph lies inside the branch, seen from the foot and from S.

    Both must hang below the axis of the swing, each on its own: on the axis they do not swing.
    """
    lever_y, lever_z = pantograph_lever(g, p.c2, p.s2)
    from_foot = p.s2 * p.c1 - p.c2 * p.s1
    from_drive = lever_z * p.c1 - lever_y * p.s1
    return (
        (from_foot * branch.knee > 0.0)
        & (from_drive * branch.knee > 0.0)
        & ((g.l4 + g.l5 + g.l7) * p.s1 + g.l6 * p.s2 < 0.0)
        & (g.l4 * p.s1 + lever_z < 0.0)
    )


@scalar
def solve_platform(
    g: Geometry, branch: Branch, cranks: Cranks, symmetric: tuple[float, float]
) -> tuple[int, float, float]:
    """Find the platform pose (a, b) of a branch for given cranks.

    The rod equations have up to four real solutions with b in ±90°. Newton's method from the
    symmetric pose finds the default branch almost always; its answer counts only if it lies on the
    branch, otherwise further starting points are tried.

    Returns:
        OK, or why there is none: SINGULAR if the rods close in another way, else UNREACHABLE; a
        and b.
    """
    status = UNREACHABLE
    for start in range(-1, 48):
        if start < 0:
            closes, a, b = newton(g, cranks, math.atan2(symmetric[1], symmetric[0]), 0.0)
        else:
            closes, a, b = newton(g, cranks, start // 3 * math.pi / 8.0, 0.5 * (start % 3 - 1))
        if closes and platform_on_branch(g, branch, cranks, direction(a), direction(b)):
            return OK, a, b
        status = SINGULAR if closes else status
    return status, math.nan, math.nan


@inlined
def platform_on_branch(
    g: Geometry, branch: Branch, cranks: Cranks, a: tuple[float, float], b: tuple[float, float]
) -> bool:
    """Tell whether the drive lies on the branch, whatever the pantograph does."""
    unknown = (math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)
    return drive_on_branch(g, branch, pose_of_directions(g, cranks, a, b, unknown))


@inlined
def pantograph_lever(g: Geometry, c2: float, s2: float) -> tuple[float, float]:
    """Return R1 -> S in the pantograph's plane: c u(th2) + lg u(th2 + 90°)."""
    return g.c * c2 - g.lg * s2, g.c * s2 + g.lg * c2


@inlined
def outer_crank(
    g: Geometry, side: float, bend: float, sx: float, sy: float, sz: float
) -> tuple[float, float, float, float, float]:
    """Return u(phi_i) of the outer crank whose rod ends at S_i, and the rod: a circle equation."""
    x = sx - side * 0.5 * g.d
    square = sy * sy + sz * sz
    along = 0.5 * (square + g.m1 * g.m1 - g.l1 * g.l1 + x * x) / g.m1
    across = bend * math.sqrt(square - along * along)
    c, s = (along * sy - across * sz) / square, (along * sz + across * sy) / square
    return c, s, x, sy - g.m1 * c, sz - g.m1 * s


@inlined
def pose_of_foot(g: Geometry, branch: Branch, x: float, y: float, z: float) -> Pose:
    """Return the pose that puts the foot at a point of {C}, in closed form; NaN out of reach."""
    radius = math.sqrt(x * x + z * z)
    c3, s3 = -z / radius, -x / radius
    c1, s1, c2, s2 = two_link(y, -radius, g.l4 + g.l5 + g.l7, g.l6, branch.knee)

    lever_y, lever_z = pantograph_lever(g, c2, s2)
    s_zeta = g.l4 * s1 + lever_z
    sx, sy, sz = s_zeta * s3, g.ly + g.l4 * c1 + lever_y, -g.lz + s_zeta * c3

    sb = sx / g.l3
    cb = math.sqrt(1.0 - sb * sb)
    reach = g.l3 * cb
    arm = math.sqrt(reach * reach + g.l33 * g.l33)
    cp3, sp3, ce, se = two_link(sy - g.e, sz + g.h1, g.m3, arm, branch.center)
    ca, sa = (ce * reach + se * g.l33) / arm, (se * reach - ce * g.l33) / arm

    gy, gz = sy + g.l33 * sa, sz - g.l33 * ca
    along, across = g.a * cb, g.a * sb
    cp1, sp1, x1, y1, z1 = outer_crank(
        g, 1.0, branch.crank_1, sx + along, gy - across * ca, gz - across * sa
    )
    cp2, sp2, x2, y2, z2 = outer_crank(
        g, -1.0, branch.crank_2, sx - along, gy + across * ca, gz + across * sa
    )
    return Pose(
        *(c1, s1, c2, s2, c3, s3),
        *(ca, sa, cb, sb),
        *(cp1, sp1, cp2, sp2, cp3, sp3),
        *(x1, y1, z1, x2, y2, z2),
    )


@inlined
def crank_angles(g: Geometry, p: Pose) -> tuple[float, float, float]:
    """Return the crank angles q about their zeros."""
    return (
        wrapped(arctan2(p.sp1, p.cp1) - g.phi1),
        wrapped(arctan2(p.sp2, p.cp2) - g.phi1),
        wrapped(arctan2(p.sp3, p.cp3) - g.phi3),
    )


@inlined
def closure_angles(p: Pose) -> tuple[float, float, float, float, float]:
    """Return the closure a, b, th1, th2, th3."""
    return (
        arctan2(p.sa, p.ca),
        arctan2(p.sb, p.cb),
        arctan2(p.s1, p.c1),
        arctan2(p.s2, p.c2),
        arctan2(p.s3, p.c3),
    )


@inlined
def pantograph_of_drive(
    g: Geometry,
    knee: float,
    center: tuple[float, float],
    a: tuple[float, float],
    b: tuple[float, float],
) -> tuple[float, float, float, float, float, float]:
    """Return (cos, sin) of th1, th2, th3 of the pantograph that the platform drives, or NaN."""
    y, z = center_pin(g, *center)
    sx = g.l3 * b[1]
    sy = y + g.l3 * b[0] * a[0] - g.l33 * a[1] - g.ly
    sz = z + g.l3 * b[0] * a[1] + g.l33 * a[0] + g.lz
    radius = math.sqrt(sx * sx + sz * sz)
    lever = math.sqrt(g.c * g.c + g.lg * g.lg)
    c1, s1, c, s = two_link(sy, -radius, g.l4, lever, knee)
    c2, s2 = (g.c * c + g.lg * s) / lever, (g.c * s - g.lg * c) / lever
    return c1, s1, c2, s2, -sz / radius, -sx / radius


@inlined
def foot_of_pose(g: Geometry, p: Pose) -> tuple[float, float, float]:
    """Return the foot C in {C}."""
    upper = g.l4 + g.l5 + g.l7
    zeta = upper * p.s1 + g.l6 * p.s2
    return zeta * p.s3, upper * p.c1 + g.l6 * p.c2, zeta * p.c3


@inlined
def in_platform(p: Pose, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the components of a vector along x_d, y_d and w."""
    radial = y * p.ca + z * p.sa
    return x * p.cb - radial * p.sb, y * p.sa - z * p.ca, x * p.sb + radial * p.cb


@inlined
def axis_angles(p: Pose) -> tuple[float, float, float]:
    """Return the angles of U1, U2, U3 about their axes along the cranks', from the cranks."""
    return (
        arctan2(p.cp1 * p.z1 - p.sp1 * p.y1, p.cp1 * p.y1 + p.sp1 * p.z1),
        arctan2(p.cp2 * p.z2 - p.sp2 * p.y2, p.cp2 * p.y2 + p.sp2 * p.z2),
        arctan2(p.cp3 * p.sa - p.sp3 * p.ca, p.cp3 * p.ca + p.sp3 * p.sa),
    )


@inlined
def chord(p: Pose, x: float, y: float, z: float, rest: Numbers) -> float:
    """Return |v - v_rest|² of a unit vector v seen from the platform; rises with their angle."""
    vx, vy, vz = in_platform(p, x, y, z)
    return (vx - rest[0]) ** 2 + (vy - rest[1]) ** 2 + (vz - rest[2]) ** 2


@inlined
def passive_measures(
    g: Geometry, p: Pose, rest: Numbers
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Return a measure of each passive joint that rises with its excursion, cheaply.

    U1, U2, U3 by two axes: the angle along, left from its rest, and the sine of the angle across.
    S1, S2 and S: the squared chord of the cone angle in the platform, of the rods and of B -> S.
    """
    along_1, along_2, along_3 = axis_angles(p)
    return (
        wrapped(along_1 - rest[0]),
        p.x1 / g.l1,
        wrapped(along_2 - rest[1]),
        p.x2 / g.l1,
        wrapped(along_3 - rest[2]),
        p.sb,
        chord(p, p.x1 / g.l1, p.y1 / g.l1, p.z1 / g.l1, rest[3:6]),
        chord(p, p.x2 / g.l1, p.y2 / g.l1, p.z2 / g.l1, rest[6:9]),
        chord(p, p.c2 * p.s3, -p.s2, p.c2 * p.c3, rest[9:12]),
    )


@inlined
def status_of_pose(
    g: Geometry, branch: Branch, rest: Numbers, limits: Numbers, q: Numbers, p: Pose
) -> int:
    """Return the status of a solved point.

    Args:
        g: The dimensions.
        branch: The assembly mode's branch.
        rest: What the passive joints' excursions are measured from, see `passive_measures`.
        limits: Lower and upper limit of the cranks, then of the passive joints' measures.
        q: Crank angles.
        p: The pose.
    """
    reached = math.isfinite(p.cp1 + p.cp2 + p.cp3) & math.isfinite(p.c1)
    regular = drive_on_branch(g, branch, p) & walking_on_branch(g, branch, p)
    in_range = within(q[0], limits[0:2]) & within(q[1], limits[2:4]) & within(q[2], limits[4:6])
    m = passive_measures(g, p, rest)
    passive_in_range = (
        within(m[0], limits[6:8])
        & within(m[1], limits[8:10])
        & within(m[2], limits[10:12])
        & within(m[3], limits[12:14])
        & within(m[4], limits[14:16])
        & within(m[5], limits[16:18])
        & within(m[6], limits[18:20])
        & within(m[7], limits[20:22])
        & within(m[8], limits[22:24])
    )
    status = OK if passive_in_range else PASSIVE_JOINT_LIMIT
    status = status if in_range else JOINT_LIMIT
    status = status if regular else SINGULAR
    return status if reached else UNREACHABLE


@inlined
def walking_rates(
    g: Geometry, p: Pose, f1: Gradient, f2: Gradient, crank: int
) -> tuple[float, float, float]:
    """Return the derivatives of th1, th2, th3 by crank 0, 1 or 2.

    Implicit differentiation of the rod equations gives (a', b'), hence S', and S' fixes the rates
    of the pantograph; this is J_2 and J_3 of equation (2) in one pass.
    """
    g1 = f1.q if crank == 0 else (f1.q3 if crank == 2 else 0.0)
    g2 = f2.q if crank == 1 else (f2.q3 if crank == 2 else 0.0)
    determinant = f1.a * f2.b - f1.b * f2.a
    a_rate = (g2 * f1.b - g1 * f2.b) / determinant
    b_rate = (g1 * f2.a - g2 * f1.a) / determinant

    pin_y, pin_z = (-g.m3 * p.sp3, g.m3 * p.cp3) if crank == 2 else (0.0, 0.0)
    reach = g.l3 * p.cb
    x_rate = reach * b_rate
    y_rate = pin_y - (reach * p.sa + g.l33 * p.ca) * a_rate - g.l3 * p.sb * p.ca * b_rate
    z_rate = pin_z + (reach * p.ca - g.l33 * p.sa) * a_rate - g.l3 * p.sb * p.sa * b_rate

    # l4 u'(th1) th1' + (c u'(th2) + lg u'(th2 + 90°)) th2' = (s_y', s_zeta')
    lever_y, lever_z = pantograph_lever(g, p.c2, p.s2)
    y1, z1 = -g.l4 * p.s1, g.l4 * p.c1
    y2, z2 = -lever_z, lever_y
    pantograph = y1 * z2 - y2 * z1
    zeta_rate = p.s3 * x_rate + p.c3 * z_rate
    return (
        (y_rate * z2 - zeta_rate * y2) / pantograph,
        (zeta_rate * y1 - y_rate * z1) / pantograph,
        (p.c3 * x_rate - p.s3 * z_rate) / (g.l4 * p.s1 + lever_z),
    )


@inlined
def jacobian_columns(
    g: Geometry, p: Pose, f1: Gradient, f2: Gradient, crank: int
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return column `crank` of J of (1), foot velocity, and of J_omega of (2), in the leg frame."""
    upper = g.l4 + g.l5 + g.l7
    zeta = upper * p.s1 + g.l6 * p.s2
    rate_1, rate_2, rate_3 = walking_rates(g, p, f1, f2, crank)
    y_rate = -upper * p.s1 * rate_1 - g.l6 * p.s2 * rate_2
    zeta_rate = upper * p.c1 * rate_1 + g.l6 * p.c2 * rate_2
    velocity = (
        zeta_rate * p.s3 + zeta * p.c3 * rate_3,
        y_rate,
        zeta_rate * p.c3 - zeta * p.s3 * rate_3,
    )
    omega = rate_1 * p.c3, rate_3, -rate_1 * p.s3  # of the shank R2 C
    return in_leg_frame(*velocity), in_leg_frame(*omega)


# --------------------------------------------------------------------------- kernels

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
def _inverse(parameters, foot, coordinates, status):
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
def _inverse_with_twist(parameters, foot, coordinates, status, twist):
    """`_inverse` and, below each other, both Jacobians of the solved pose in one pass."""
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


def _forward_kernels(find: Callable[..., None]) -> tuple[Callable[..., Any], Callable[..., Any]]:
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


_forward, _forward_with_twist = _forward_kernels(find_platforms)
_forward_search, _forward_search_with_twist = _forward_kernels(search_platforms)


@scalar
def fill_twist(g: Geometry, p: Pose, twist: FloatArray) -> None:
    """Fill J of equation (1), foot velocity, above J_omega of (2), angular velocity of R2C."""
    f1, f2 = gradients(g, p)
    for crank in range(3):
        v, omega = jacobian_columns(g, p, f1, f2, crank)
        for k in range(3):
            twist[k, crank], twist[3 + k, crank] = v[k], omega[k]


@points_kernel("(g),(points,3),(points,5)->(points,6,3)", "f8 f8 f8 f8")
def _twist(geometry, q, closure, twist):
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    for i in range(len(q)):
        fill_twist(g, pose_of_angles(g, q[i], closure[i]), twist[i])


@kernel("(g),(n),(c),(w)->(n,w)", "f8[:], f8[:], f8[:], f8[:], f8[:,:]")
def _constraint_jacobian(geometry, q, closure, shape, jacobian):
    """Constraint wrenches in the paper's axes; `shape` only sets the length of a wrench."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    p = pose_of_angles(g, q, closure)
    # U3 seen from G is -l3 w; the moments are its cross products with s_q2 and n2
    wx, wy, wz = -g.l3 * p.sb, -g.l3 * p.cb * p.ca, -g.l3 * p.cb * p.sa
    jacobian[:] = 0.0
    jacobian[0, 4], jacobian[0, 5] = p.ca, p.sa  # n1
    jacobian[1, 0] = 1.0  # s_q2
    jacobian[1, 4], jacobian[1, 5] = wz, -wy
    jacobian[2, 1], jacobian[2, 2] = p.cp3, p.sp3  # n2
    jacobian[2, 3] = wy * p.sp3 - wz * p.cp3
    jacobian[2, 4], jacobian[2, 5] = -wx * p.sp3, wx * p.cp3


@kernel("(g),(r),(n),(c),(p)->(p)", "f8[:], f8[:], f8[:], f8[:], f8[:], f8[:]")
def _passive_measures(geometry, rest, q, closure, shape, result):
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    pose = pose_of_angles(g, q, closure)
    measures = passive_measures(g, pose, to_fixed_tuple(rest, REST_SIZE))
    for joint in range(9):
        result[joint] = measures[joint]


# --------------------------------------------------------------------------- mechanism

ACROSS, CONES = [1, 3, 5], [6, 7, 8]  # passive joints told by a sine and by a chord
RANGE = math.radians(21.0)
PASSIVE_RANGE = math.radians(45.0)
FLIPPABLE = ("knee", "center", "crank_1", "crank_2")
UNIVERSAL_JOINTS = ("u1_along", "u1_across", "u2_along", "u2_across", "u3_along", "u3_across")


def closed(loop: Callable[..., Any], *arguments: Any) -> Any:
    """Return the directions that close a loop, or None if nothing does.

    Where compiled code gets NaN, Python has no root of a negative number.
    """
    try:
        directions = loop(*arguments)
    except (ValueError, ZeroDivisionError):
        return None
    return None if any(map(math.isnan, directions)) else directions


@dataclass(frozen=True)
class ParallelDrive(Dimensioned):
    """The parallel-driving leg; defaults are the paper's initial dimensions.

    The foot position is that of C in the leg frame, whose origin is the hip H.

    Raises:
        GeometryError: If a dimension is impossible or the leg cannot be assembled.
    """

    name: ClassVar[str] = "parallel_drive"
    joints: ClassVar[tuple[Joint, ...]] = (Joint("crank_1"), Joint("crank_2"), Joint("crank_3"))
    passive_joints: ClassVar[tuple[Joint, ...]] = tuple(
        Joint(n) for n in (*UNIVERSAL_JOINTS, "hip_swing", "hip_thigh", "r1", "r2", "r3", "r5")
    )
    excursions: ClassVar[tuple[Excursion, ...]] = tuple(
        Excursion(n) for n in (*UNIVERSAL_JOINTS, "s1_cone", "s2_cone", "s_cone")
    )
    closure_names: ClassVar[tuple[str, ...]] = (
        *("platform_elevation", "platform_tilt"),
        *("thigh_angle", "link_angle", "swing_angle"),
    )
    assembly_modes: ClassVar[tuple[str, ...]] = flipped_modes("initial", FLIPPABLE)

    crank_spacing: float = parameter("distance R_D1 R_D2 of the outer cranks", "d", "length", 0.276)
    center_crank_drop: float = offset("depth of R_D3 below the outer crank axis", "h1", 0.070)
    center_crank_forward: float = offset("R_D3 in front of the outer crank axis", "e", 0.0)
    crank_length: float = parameter("outer cranks R_Di U_i", "m1", "length", 0.200)
    center_crank_length: float = parameter("centre crank R_D3 U3", "m3", "length", 0.200)
    rod_length: float = parameter("rods U_i S_i", "l1", "length", 0.220)
    platform_arm: float = parameter("arms S_i G of the platform", "a", "length", 0.055)
    platform_length: float = parameter("platform U3 G", "l3", "length", 0.250)
    platform_post: float = parameter("post G S of the platform", "l33", "length", 0.120)
    hip_forward: float = offset("the hip H in front of the outer crank axis", "l_y", 0.190)
    hip_drop: float = offset("depth of the hip H below the crank axis", "l_z", 0.055)
    thigh_upper: float = parameter("R4 R1", "l4", "length", 0.200)
    drive_lever: float = parameter("connecting link R1 B", "c", "length", 0.110)
    drive_lever_offset: float = offset("S B, perpendicular to R1 R2", "l_g", 0.0465)
    thigh_lower: float = parameter("R1 R3", "l5", "length", 0.200)
    parallelogram_link: float = parameter("long link R1 R2", "l6", "length", 0.300)
    shank_length: float = parameter("shank R5 C", "l7", "length", 0.450)
    crank_zero: float = parameter(
        "outer cranks' zero from forward towards up (fitted)", "phi_1", "angle", math.radians(-36.0)
    )
    center_crank_zero: float = parameter(
        "centre crank's zero from forward towards up (fitted)",
        "phi_3",
        "angle",
        math.radians(-106.0),
    )

    joint_ranges: tuple[tuple[float, float], ...] = ((-RANGE, RANGE),) * 3
    passive_joint_ranges: tuple[tuple[float, float], ...] = (
        *((-PASSIVE_RANGE, PASSIVE_RANGE),) * 6,
        *((0.0, PASSIVE_RANGE),) * 3,
    )

    def __post_init__(self) -> None:
        """Check the dimensions by assembling the initial posture."""
        self.check_fields()
        self._signs  # noqa: B018  raises GeometryError

    @cached_property
    def _initial(self) -> Pose:
        """Pose of the initial posture, with all cranks at zero, where b = 0."""
        g = Geometry(*self._geometry.tolist())
        if not abs(0.5 * g.d - g.a) < g.l1:
            raise GeometryError(
                f"rod_length (l1) = {g.l1} m does not span half the crank spacing less the "
                f"platform arm, |d/2 - a| = {abs(0.5 * g.d - g.a)} m"
            )
        cranks = (*direction(g.phi1), *direction(g.phi1), *direction(g.phi3))
        a = closed(symmetric_elevation, g, cranks[0:2], cranks[4:6])
        if not a:
            raise GeometryError(
                "with all cranks at zero the rods (l1), cranks (m1, m3) and platform (l3) do not "
                "close a loop: change one of these lengths or the crank zeros (phi_1, phi_3)"
            )
        pantograph = closed(pantograph_of_drive, g, 1.0, cranks[4:6], a, (1.0, 0.0))
        if not pantograph:
            raise GeometryError(
                f"with all cranks at zero the pantograph's thigh (l4 = {g.l4} m) and lever "
                f"(c, l_g: {math.hypot(g.c, g.lg):.4f} m) do not join the hip H and the platform's "
                "drive point S"
            )
        return pose_of_directions(g, cranks, a, (1.0, 0.0), pantograph)

    @cached_property
    def _signs(self) -> FloatArray:
        """Branch signs of the initial posture (5,)."""
        g, p = Geometry(*self._geometry.tolist()), self._initial
        f1, f2 = gradients(g, p)
        knee = p.s2 * p.c1 - p.c2 * p.s1
        loop = f1.a * f2.b - f1.b * f2.a
        signs = np.sign([f1.q, f2.q, platform_bend(g, p), knee, loop])
        if not np.all(signs) or knee < 0.0:
            raise GeometryError("the posture with all cranks at zero is singular")
        return signs

    @cached_property
    def _rest(self) -> FloatArray:
        """What `passive_measures` compares with: three angles and three vectors in the platform."""
        p, l1 = self._initial, self.rod_length
        return np.array(
            [
                *axis_angles(p),
                *in_platform(p, p.x1 / l1, p.y1 / l1, p.z1 / l1),
                *in_platform(p, p.x2 / l1, p.y2 / l1, p.z2 / l1),
                *in_platform(p, p.c2 * p.s3, -p.s2, p.c2 * p.c3),
            ]
        )

    @cached_property
    def _across_rest(self) -> FloatArray:
        """Angles across the cranks of U1, U2, U3 in the initial posture (3,) [rad]."""
        p, l1 = self._initial, self.rod_length
        return np.arcsin([p.x1 / l1, p.x2 / l1, p.sb])

    @cached_property
    def _passive_bounds(self) -> FloatArray:
        """Limits of the passive joints in the terms of `passive_measures` (9, 2)."""
        bounds = self.passive_joint_limits.copy()
        across = bounds[ACROSS] + self._across_rest[:, None]
        bounds[ACROSS] = np.sin(np.clip(across, -0.5 * np.pi, 0.5 * np.pi))
        cone = np.clip(bounds[CONES], 0.0, np.pi)
        bounds[CONES] = (2.0 * np.sin(0.5 * cone)) ** 2
        return bounds

    def _branch(self, assembly_mode: str) -> FloatArray:
        """Return the branch signs of an assembly mode."""
        knee, center, crank_1, crank_2 = mode_signs(self, assembly_mode, FLIPPABLE)
        # Flipping the platform's bend turns the platform over, and with it the loop's orientation.
        return self._signs * [crank_1, crank_2, center, knee, center]

    @cached_property
    def _known_parameters(self) -> dict[str, FloatArray]:
        return {}

    def _parameters(self, assembly_mode: str) -> FloatArray:
        """Return all that the kernels know of the leg in one array, kept for the next call."""
        if assembly_mode not in self._known_parameters:
            limits = np.concatenate([self.joint_limits, self._passive_bounds])
            self._known_parameters[assembly_mode] = np.concatenate(
                [self._geometry, self._branch(assembly_mode), self._rest, limits.ravel()]
            )
        return self._known_parameters[assembly_mode]

    @cached_property
    def initial_posture(self) -> Posture:
        """The posture with all cranks at zero."""
        return self.forward(np.zeros(3))

    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the foot.

        Args:
            joint_positions: Crank angles about their zeros (..., 3) [rad].
            assembly_mode: One of `assembly_modes`; "" is "initial".

        Returns:
            The posture; NaN where the cranks admit none of this mode. Within the actuator ranges
            the mode's solution is unique; beyond the drive's singularity the status is SINGULAR.
        """
        q = as_array("joint_positions", joint_positions, 3)
        parameters = self._parameters(assembly_mode)
        results = _forward(parameters, q)
        if has_code(results[1], UNCERTAIN):
            search = partial(_forward_search, parameters)
            results = settled(results, results[1] == UNCERTAIN, search, (q, 1))
        coordinates, status = results
        return Posture(q, coordinates[..., 3:], coordinates[..., :3], status)

    def forward_with_twist(
        self, joint_positions: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`forward` and `twist_jacobian` in one pass."""
        q = as_array("joint_positions", joint_positions, 3)
        parameters = self._parameters(assembly_mode)
        results = _forward_with_twist(parameters, q)
        if has_code(results[1], UNCERTAIN):
            search = partial(_forward_search_with_twist, parameters)
            results = settled(results, results[1] == UNCERTAIN, search, (q, 1))
        coordinates, status, twist = results
        return Posture(q, coordinates[..., 3:], coordinates[..., :3], status), twist

    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the cranks, in closed form.

        Args:
            foot_position: Foot C in the leg frame (..., 3) [m].
            assembly_mode: One of `assembly_modes`; "" is "initial".

        Returns:
            The posture; NaN where the foot is out of reach.
        """
        foot = as_array("foot_position", foot_position, 3)
        coordinates, status = _inverse(self._parameters(assembly_mode), foot)
        return Posture(coordinates[..., :3], coordinates[..., 3:], foot, status)

    def inverse_with_twist(
        self, foot_position: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`inverse` and `twist_jacobian` in one pass, for half the price."""
        foot = as_array("foot_position", foot_position, 3)
        coordinates, status, twist = _inverse_with_twist(self._parameters(assembly_mode), foot)
        return Posture(coordinates[..., :3], coordinates[..., 3:], foot, status), twist

    def jacobian(self, posture: Posture) -> FloatArray:
        """J of the foot's velocity, v = J q' (..., 3, 3) [m/rad]; equation (1)."""
        return self.twist_jacobian(posture)[..., :3, :]

    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of the shank's angular velocity, omega = J_omega q' (..., 3, 3); equation (2)."""
        return self.twist_jacobian(posture)[..., 3:, :]

    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """J above J_omega (..., 6, 3), in one pass."""
        twist: FloatArray = _twist(self._geometry, posture.joint_positions, posture.closure)
        return twist

    def passive_joint_positions(self, posture: Posture) -> FloatArray:
        """Angles of the universal joints, the hip and the pantograph's pins (..., 12) [rad].

            u1_along, u2_along, u3_along       at U_i, about the crank's axis: from the crank to the
                                               projection of the rod, or of the platform's U3 G
            u1_across, u2_across, u3_across    from there to the rod or U3 G, towards crank 1's side
            hip_swing                          th3, of the pantograph's plane from the vertical
            hip_thigh                          th1, in that plane from forward to the thigh H R1
            r1 H-R1-R2    r2 R1-R2-R5          in that plane from one bar's far end to that of the
            r3 R1-R3-R5   r5 R3-R5-C           other

        In the plane angles count in the sense of the cranks.
        """
        universal = self.passive_joint_excursions(posture)[..., : len(UNIVERSAL_JOINTS)]
        universal = universal + np.stack([self._rest[:3], self._across_rest], axis=-1).ravel()
        thigh, bend = self._pantograph_angles(posture.closure)
        thigh_rest, bend_rest = self._pantograph_angles(np.array(closure_angles(self._initial)))
        thigh = thigh_rest + wrapped_angles(thigh - thigh_rest)
        bend = bend_rest + wrapped_angles(bend - bend_rest)
        hip = [posture.closure[..., 4], thigh]
        return np.concatenate(
            [universal, np.stack([*hip, bend, -bend, bend, -bend], axis=-1)], axis=-1
        )

    def _pantograph_angles(self, closure: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the angles H R1 of the thigh and H-R1-R2 in the pantograph's plane (...) [rad]."""
        thigh, link = closure[..., 2], closure[..., 3]
        return thigh, wrapped_angles(link - thigh - np.pi)

    def passive_joint_excursions(self, posture: Posture) -> FloatArray:
        """Excursions of the passive joints from the initial posture (..., 9) [rad].

        Universal joints by their two axes (along: the axis parallel to the crank's; across), the
        spherical joints by a cone angle in the platform: of the rods, and of B -> S for the ball
        S that drives the pantograph.
        """
        measures = _passive_measures(
            self._geometry, self._rest, posture.joint_positions, posture.closure, np.zeros(9)
        )
        angles = measures.copy()
        angles[..., ACROSS] = np.arcsin(measures[..., ACROSS]) - self._across_rest
        angles[..., CONES] = 2.0 * np.arcsin(0.5 * np.sqrt(measures[..., CONES]))
        return angles

    def constraint_jacobian(self, posture: Posture) -> FloatArray:
        """J_c of the drive's constraint wrenches (..., 3, 6): equations (8), (12), (13).

        Rows are the constraint wrenches of the RU limb at G, a force part (3) [1] then a moment
        part (3) [1 for the first row, m for the others]: a pure moment about
        n1 = s_q2 x s_q3 and two forces through U3 along s_q2 (to the right) and
        n2 = (s_q1 x n3) x s_q2 = n3, the direction of the centre crank.
        """
        jacobian = _constraint_jacobian(
            self._geometry, posture.joint_positions, posture.closure, np.zeros(6)
        )
        parts = leg_vectors(jacobian[..., :3]), leg_vectors(jacobian[..., 3:])
        return np.concatenate(parts, axis=-1)

    @np.errstate(invalid="ignore")  # joints that are not finite have no points
    def linkage(self, posture: Posture) -> Linkage:
        """Points of the leg in the leg frame and the bars between them."""
        g = Geometry(*self._geometry)
        q = np.moveaxis(posture.joint_positions, -1, 0)
        a, b, th1, th2, th3 = np.moveaxis(posture.closure, -1, 0)

        def vector(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> FloatArray:
            return np.stack(np.broadcast_arrays(x, y, z, a)[:3], axis=-1)

        def in_plane(length: float, angle: FloatArray) -> FloatArray:
            """Vector of the pantograph's plane, swung by th3: p(th3; length u(angle))."""
            zeta = length * np.sin(angle)
            return vector(zeta * np.sin(th3), length * np.cos(angle), zeta * np.cos(th3))

        hip = vector(0.0, g.ly, -g.lz)
        drives = [vector(0.5 * g.d, 0, 0), vector(-0.5 * g.d, 0, 0), vector(0.0, g.e, -g.h1)]
        zeros, lengths = (g.phi1, g.phi1, g.phi3), (g.m1, g.m1, g.m3)
        pins = [
            drives[i] + lengths[i] * vector(0.0, np.cos(zeros[i] + q[i]), np.sin(zeros[i] + q[i]))
            for i in range(3)
        ]
        w = vector(np.sin(b), np.cos(b) * np.cos(a), np.cos(b) * np.sin(a))
        arm = g.a * vector(np.cos(b), -np.sin(b) * np.cos(a), -np.sin(b) * np.sin(a))
        center = pins[2] + g.l3 * w
        drive_point = center + g.l33 * vector(0.0, -np.sin(a), np.cos(a))
        r1 = hip + in_plane(g.l4, th1)
        r3 = r1 + in_plane(g.l5, th1)
        points = {
            "R_D1": drives[0],
            "R_D2": drives[1],
            "R_D3": drives[2],
            "U1": pins[0],
            "U2": pins[1],
            "U3": pins[2],
            "S1": center + arm,
            "S2": center - arm,
            "G": center,
            "S": drive_point,
            "H": hip,
            "R1": r1,
            "B": r1 + in_plane(g.c, th2),
            "R2": r1 + in_plane(g.l6, th2),
            "R3": r3,
            "R5": r3 + in_plane(g.l6, th2),
            "C": r3 + in_plane(g.l6, th2) + in_plane(g.l7, th1),
        }
        names = tuple(points)
        bars = (
            *(("R_D1", "U1", "S1", "G"), ("R_D2", "U2", "S2", "G"), ("R_D3", "U3", "G", "S")),
            *(("S", "B"), ("H", "R1", "R3"), ("R1", "B", "R2"), ("R3", "R5"), ("R2", "R5", "C")),
        )
        return Linkage(
            names,
            leg_vectors(np.stack([p - hip for p in points.values()], axis=-2)),
            tuple(tuple(names.index(n) for n in bar) for bar in bars),
        )
