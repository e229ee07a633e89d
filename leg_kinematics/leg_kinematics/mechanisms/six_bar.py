# SPDX-License-Identifier: Apache-2.0
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

from leg_kinematics.arrays import FloatArray
from leg_kinematics.assembly_modes import flipped_modes
from leg_kinematics.geometry import parameter
from leg_kinematics.kernels.kernel import inlined, scalar
from leg_kinematics.mechanism import Joint
from leg_kinematics.mechanisms.crank_kernels import Kernels, linkage_kernels, side
from leg_kinematics.mechanisms.crank_linkage import (
    ANY_ANGLE,
    CrankLinkage,
    Dyad,
    Pivot,
    Triangle,
    mode_sides,
)
from leg_kinematics.mechanisms.dyads import (
    Point,
    dyad,
    dyad_coefficients,
    fixed,
    rigid_point,
    transmission,
    triangle_coefficients,
)
from leg_kinematics.mechanisms.weighed import BarMass
from leg_kinematics.placed_joints import Meeting


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


# Which way round the parts are assembled; the signs below are those of the walking leg.
PARTS = ("rocker", "rod", "crank", "foot")
WALKING = (
    -1.0,  # C lies to the right of the line from B to D
    -1.0,  # F to the right of C to E
    -1.0,  # E to the right of A to B
    -1.0,  # G to the right of C to F
)
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


kernels = linkage_kernels(
    Geometry, Constants, Points, len(PARTS), constants_of, linkage_points, worst_transmission
)


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
    kernels: ClassVar[Kernels] = kernels
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

    placed: ClassVar[tuple[tuple[str, str, str], ...]] = (
        *(("crank", "", "A"), ("d", "", "D"), ("c_foot", "d", "C")),
        *(("b", "crank", "B"), ("e", "crank", "E")),
    )
    meetings: ClassVar[tuple[Meeting, ...]] = (
        Meeting("C", "b", "d"),
        Meeting("F", "e", "c_foot"),
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
    bar_masses: tuple[BarMass, ...] = ()
