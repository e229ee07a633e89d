# SPDX-License-Identifier: Apache-2.0
"""Equations of the parallel-driving leg, as scalar code of one pose; see `parallel_drive`.

The loop equations of the platform and of the pantograph, both ways, their Jacobians, the passive
joints and the status of a pose. `parallel_drive_kernels` runs them over points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from leg_kinematics.arrays import FloatArray
from leg_kinematics.kernels.kernel import inlined, scalar
from leg_kinematics.kernels.scalars import arctan2, direction, within, wrapped
from leg_kinematics.mechanisms.walking_axes import in_leg_frame
from leg_kinematics.status import Status

REST_SIZE = 12  # of the passive joints' rest, see `passive_measures`

OK, UNREACHABLE, JOINT_LIMIT, PASSIVE_JOINT_LIMIT, SINGULAR, INVALID_INPUT = map(int, Status)

NEWTON_STEPS = 20
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
