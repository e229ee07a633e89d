"""`six_bar`: a planar six-bar leg with one crank (paper 003).

The crank is a ternary link A-B-E. Its pin B drives the rocker CD through the coupler BC, as in the
Theo Jansen linkage; its pin E drives the foot link C-F-G through the rod EF. Dimensions are ratios
to the crank AB. In the linkage's plane (see `crank_linkage`):

    B = u(alpha),  E of the rigid triangle A-B-E,  D = l_AD u(theta_0)
    C = B + q3 (D - B) + q4 M (D - B)               equation (3), dyad BC-CD
    F = C + q5 (E - C) + q6 M (E - C)               equation (4), dyad CF-EF
    G = C + q1 (F - C) + q2 M (F - C)               equation (2), rigid triangle C-F-G
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from leg_kinematics.arrays import FloatArray
from leg_kinematics.assembly_modes import flipped_modes
from leg_kinematics.geometry import parameter
from leg_kinematics.kernels.blocks import BLOCK, get3, load
from leg_kinematics.kernels.kernel import inlined, kernel, scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.mechanism import Joint
from leg_kinematics.mechanisms.crank_linkage import (
    ANY_ANGLE,
    CLOSURE,
    CrankLinkage,
    Dyad,
    Kernels,
    Pivot,
    Triangle,
    approach,
    bracket_between,
    in_leg_frame,
    load_cranks,
    mode_sides,
    narrowed,
    put_forward,
    put_points,
    resting_pin,
    side,
    store_forward,
    store_points,
    turning_pin,
)
from leg_kinematics.mechanisms.dyads import (
    Point,
    dyad,
    dyad_coefficients,
    fixed,
    rigid_point,
    transmission,
    triangle_coefficients,
    turning_rate,
)


class Geometry(NamedTuple):
    """The dimensions under the paper's symbols, in the order of `SixBar`'s fields."""

    crank: float
    zero: float
    ad: float
    theta0: float
    bc: float
    cd: float
    be: float
    ae: float
    ef: float
    cf: float
    cg: float
    fg: float
    tolerance: float


class Constants(NamedTuple):
    """What the equations need of the geometry: lengths, D, and E and G within their links."""

    crank: float
    zero: float
    dx: float
    dy: float
    bc: float
    cd: float
    ef: float
    cf: float
    q_e: float
    m_e: float
    q1: float
    q2: float


class Points(NamedTuple):
    """The joints and the foot."""

    a: Point
    b: Point
    c: Point
    d: Point
    e: Point
    f: Point
    g: Point


GEOMETRY_SIZE, CONSTANTS_SIZE = len(Geometry._fields), len(Constants._fields)
POINTS_SIZE = len(Points._fields)

# Which way round the parts are assembled; the signs below are those of the walking leg.
PARTS = ("rocker", "rod", "crank", "foot")
WALKING = (
    -1.0,  # C lies to the right of the line from B to D
    -1.0,  # F to the right of C to E
    -1.0,  # E to the right of A to B
    -1.0,  # G to the right of C to F
)
SIDES_SIZE = len(PARTS)
Sides = tuple[float, float, float, float]


@scalar
def constants_of(g: Geometry) -> Constants:
    """Return the constants of a geometry, its links as in the walking leg or turned over."""
    q_e, m_e = triangle_coefficients(1.0, g.ae, g.be, 1.0)
    q1, q2 = triangle_coefficients(g.cf, g.cg, g.fg, 1.0)
    dx, dy = g.ad * math.cos(g.theta0), g.ad * math.sin(g.theta0)
    return Constants(g.crank, g.zero, dx, dy, g.bc, g.cd, g.ef, g.cf, q_e, m_e, q1, q2)


@inlined
def linkage_points(k: Constants, sides: Sides, b: Point) -> tuple[Points, Sides]:
    """Return all points, given the crank's pin, and the closure: q4, q6 and how E and G lie."""
    a, d = fixed(0.0, 0.0), fixed(k.dx, k.dy)
    side_e, side_g = side(sides[2]), side(sides[3])
    e = rigid_point(a, b, k.q_e, side_e * k.m_e)
    q3, q4 = dyad_coefficients(b, d, k.bc, k.cd, side(sides[0]))
    c = dyad(b, d, q3, q4)
    q5, q6 = dyad_coefficients(c, e, k.cf, k.ef, side(sides[1]))
    f = dyad(c, e, q5, q6)
    g = rigid_point(c, f, k.q1, side_g * k.q2)
    return Points(a, b, c, d, e, f, g), (q4, q6, side_e, side_g)


@inlined
def worst_transmission(k: Constants, p: Points, across: Sides) -> float:
    """Return the least transmission of the dyads."""
    return min(
        transmission(p.b, p.d, across[0], k.bc, k.cd),
        transmission(p.c, p.e, across[1], k.cf, k.ef),
    )


@inlined
def foot_motion(k: Constants, sides: Sides, angle: float) -> Point:
    """Return the foot G and its derivatives by the crank angle."""
    return linkage_points(k, sides, turning_pin(angle))[0].g


# --------------------------------------------------------------------------- kernels

# Rows of a block that follow those of `crank_linkage`:
POINTS = CLOSURE + SIDES_SIZE
ROWS = POINTS + 3 * POINTS_SIZE


@kernel("(g),(c)->(c)", "f8[:], f8[:], f8[:]")
def constants_of_geometry(geometry, shape, constants):  # type: ignore[no-untyped-def]
    """Geometry to the constants that the other kernels take; `shape` only sets a length."""
    k = constants_of(Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE)))
    for i in range(CONSTANTS_SIZE):
        constants[i] = k[i]


@points_kernel("(c),(s),(2),(points,1)->(points,3),(points,s),(points)", "f8 f8 f8 f8 f8 f8 u1")
def _forward(constants, sides, limits, q, foot, closure, status):  # type: ignore[no-untyped-def]
    """Crank angles to foot in the leg frame, closure and status."""
    k = Constants(*to_fixed_tuple(constants, CONSTANTS_SIZE))
    mode, bounds = to_fixed_tuple(sides, SIDES_SIZE), to_fixed_tuple(limits, 2)
    block = np.empty((ROWS, BLOCK))
    for start in range(0, len(q), BLOCK):
        end = min(start + BLOCK, len(q))
        load_cranks(block, q, k.zero, start, end)
        for i in range(end - start):
            p, assembly = linkage_points(k, mode, resting_pin(block, i))
            worst = worst_transmission(k, p, assembly)
            put_forward(block, i, k.crank, bounds, p.g, assembly, worst)
        store_forward(block, foot, closure, status, start, end, SIDES_SIZE)


@kernel("(c),(s),(n),(d)->(d),(d),(d)", "f8[:], f8[:], f8[:], f8[:], f8[:], f8[:], f8[:]")
def _motion(constants, sides, q, shape, velocity, acceleration, turning):  # type: ignore[no-untyped-def]
    """First and second derivative of the foot and the foot link's turning by the crank angle."""
    k = Constants(*to_fixed_tuple(constants, CONSTANTS_SIZE))
    p = linkage_points(k, sides, turning_pin(k.zero + q[0]))[0]
    velocity[0], velocity[1], velocity[2] = in_leg_frame(k.crank, p.g.vx, p.g.vy)
    acceleration[0], acceleration[1], acceleration[2] = in_leg_frame(k.crank, p.g.ax, p.g.ay)
    turning[0], turning[1], turning[2] = 0.0, turning_rate(p.c, p.f), 0.0


@points_kernel(f"(c),(points,s),(points,1)->(points,{POINTS_SIZE},3)", "f8 f8 f8 f8")
def _points(constants, sides, q, points):  # type: ignore[no-untyped-def]
    """All points in the leg frame."""
    k = Constants(*to_fixed_tuple(constants, CONSTANTS_SIZE))
    block = np.empty((ROWS, BLOCK))
    for start in range(0, len(q), BLOCK):
        end = min(start + BLOCK, len(q))
        load_cranks(block, q, k.zero, start, end)
        load(block, CLOSURE, sides, start, end, SIDES_SIZE)
        for i in range(end - start):
            mode = (*get3(block, CLOSURE, i), block[CLOSURE + 3, i])
            p = linkage_points(k, mode, resting_pin(block, i))[0]
            put_points(block, POINTS, i, k.crank, p)
        store_points(block, POINTS, points, start, end, POINTS_SIZE)


@kernel("(c),(s),(),(t)->(t)", "f8[:], f8[:], f8, f8[:], f8[:]")
def foot_in_plane(constants, sides, angle, shape, result):  # type: ignore[no-untyped-def]
    """Foot X, Y and dX/dalpha in the linkage's plane and crank lengths."""
    k = Constants(*to_fixed_tuple(constants, CONSTANTS_SIZE))
    p = foot_motion(k, sides, angle)
    result[0], result[1], result[2] = p.x, p.y, p.vx


@kernel("(c),(s),(),(),(),()->(),()", "f8[:], f8[:], f8, f8, f8, f8, f8[:], f8[:]")
def _nearest(constants, sides, x, y, lower, upper, angle, distance):  # type: ignore[no-untyped-def]
    """Crank angle in a bracket at which the foot is nearest to (X, Y), and how near."""
    k = Constants(*to_fixed_tuple(constants, CONSTANTS_SIZE))
    bracket = bracket_between(lower, upper)
    while not bracket.done:
        p = foot_motion(k, sides, bracket.angle)
        slope, curvature = approach(p, x, y)
        bracket = narrowed(bracket, slope, curvature)
    p = foot_motion(k, sides, bracket.angle)
    angle[0], distance[0] = bracket.angle, math.hypot(p.x - x, p.y - y)


@kernel("(c),(s),(),(),(),()->()", "f8[:], f8[:], f8, f8, f8, f8, f8[:]")
def _crossing(constants, sides, x, lower, upper, sense, angle):  # type: ignore[no-untyped-def]
    """Crank angle in a bracket where the foot's X is x; sense is +1 if X rises there, else -1."""
    k = Constants(*to_fixed_tuple(constants, CONSTANTS_SIZE))
    bracket = bracket_between(lower, upper)
    while not bracket.done:
        p = foot_motion(k, sides, bracket.angle)
        bracket = narrowed(bracket, sense * (p.x - x), sense * p.vx)
    angle[0] = bracket.angle


# --------------------------------------------------------------------------- mechanism


@dataclass(frozen=True)
class SixBar(CrankLinkage):
    """The paper's six-bar leg; defaults are its optimum at phi_max = 168°, with the paper's crank.

    The links A-B-E and C-F-G are flat plates: modes that flip them are assembled with the plate
    turned over.

    Raises:
        GeometryError: If a dimension is impossible or the leg cannot be assembled.
    """

    name: ClassVar[str] = "six_bar"
    passive_joints: ClassVar[tuple[Joint, ...]] = tuple(
        map(Joint, ("b", "e", "d", "c_coupler", "c_foot", "f"))
    )
    closure_names: ClassVar[tuple[str, ...]] = PARTS
    assembly_modes: ClassVar[tuple[str, ...]] = flipped_modes("walking", PARTS)

    sides: ClassVar[FloatArray] = mode_sides(WALKING)
    kernels: ClassVar[Kernels] = Kernels(
        constants_of_geometry, _forward, _motion, _points, foot_in_plane, _nearest, _crossing
    )
    constants_size: ClassVar[int] = CONSTANTS_SIZE
    point_names: ClassVar[tuple[str, ...]] = ("A", "B", "C", "D", "E", "F", "G")
    dyads: ClassVar[tuple[Dyad, ...]] = (
        Dyad("C", ("B", "D"), ("coupler", "rocker")),
        Dyad("F", ("C", "E"), ("foot_lever", "rod")),
    )
    triangles: ClassVar[tuple[Triangle, ...]] = (
        Triangle(("A", "B", "E"), ("crank", "rod_crank", "pin_spacing")),
        Triangle(("C", "F", "G"), ("foot_lever", "foot_bar", "foot_brace")),
    )
    pivots: ClassVar[tuple[Pivot, ...]] = (
        Pivot("b", "B", "A", "C"),
        Pivot("e", "E", "A", "F"),
        Pivot("d", "D", "A", "C"),
        Pivot("c_coupler", "C", "D", "B"),
        Pivot("c_foot", "C", "D", "F"),
        Pivot("f", "F", "C", "E"),
    )
    crank_points: ClassVar[tuple[str, ...]] = ("A", "B", "E")
    bars: ClassVar[tuple[tuple[str, ...], ...]] = (
        *(("A", "B", "E", "A"), ("B", "C"), ("C", "D"), ("E", "F"), ("C", "F", "G", "C")),
    )

    crank_length: float = parameter("crank A B", "l_AB", "length", 0.015)
    crank_zero: float = parameter("crank angle at joint position zero", "alpha_0", "angle", 0.0)
    frame_length: float = parameter("A D, in cranks", "l_AD", "ratio", math.hypot(38, 7.8) / 15)
    frame_angle: float = parameter("angle of A D", "theta_0", "angle", -math.atan2(7.8, 38))
    coupler: float = parameter("B C, in cranks", "l_BC", "ratio", 61.9 / 15)
    rocker: float = parameter("C D, in cranks", "l_CD", "ratio", 39.3 / 15)
    pin_spacing: float = parameter("B E, in cranks", "l_BE", "ratio", 0.8239872755278)
    rod_crank: float = parameter("A E, in cranks", "l_AE", "ratio", 1.8169426052256)
    rod: float = parameter("E F, in cranks", "l_EF", "ratio", 5.5455881232351)
    foot_lever: float = parameter("C F, in cranks", "l_CF", "ratio", 2.2750366459340)
    foot_bar: float = parameter("C G, in cranks", "l_CG", "ratio", 49 / 15)
    foot_brace: float = parameter("F G, in cranks", "l_FG", "ratio", 4.6479735860184)
    reach_tolerance: float = parameter(
        "largest distance of a wanted foot position from the foot curve", "-", "length", 0.001
    )

    joint_ranges: tuple[tuple[float, float], ...] = (ANY_ANGLE,)
    passive_joint_ranges: tuple[tuple[float, float], ...] = (ANY_ANGLE,) * 6
