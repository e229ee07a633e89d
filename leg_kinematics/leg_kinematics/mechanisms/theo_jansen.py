# SPDX-License-Identifier: Apache-2.0
"""`theo_jansen`: Theo Jansen's eight-bar leg with one crank (the paradigm of paper 003).

One crank AB drives two rockers on D: the lower one CD through the coupler BC, and the plate D-U-L
through the coupler BU. C and L carry the foot link C-F-G. Dimensions are ratios to the crank; in
Jansen's own numbers the crank is 15. In the linkage's plane (see `crank_linkage`):

    B = u(alpha),  D = l_AD u(theta_0)
    C: dyad B-C-D (k, c);  U: dyad B-U-D (j, b);  L of the rigid triangle D-U-L (b, d, e)
    F: dyad L-F-C (f, g);  G of the rigid triangle C-F-G (g, i, h)
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
    """The dimensions under Jansen's letters, in the order of `TheoJansen`'s fields."""

    crank: float
    zero: float
    ad: float
    theta0: float
    j: float
    k: float
    b: float
    c: float
    d: float
    e: float
    f: float
    g: float
    h: float
    i: float
    tolerance: float


class Constants(NamedTuple):
    """What the equations need of the geometry: lengths, D, and L and G within their links."""

    crank: float
    zero: float
    dx: float
    dy: float
    j: float
    k: float
    b: float
    c: float
    f: float
    g: float
    along_l: float
    across_l: float
    along_g: float
    across_g: float


class Points(NamedTuple):
    """The joints and the foot."""

    a: Point
    b: Point
    c: Point
    d: Point
    u: Point
    l: Point  # noqa: E741  the joint L
    f: Point
    g: Point


# Which way round the dyads are assembled; the signs below are those of the walking leg.
PARTS = ("lower_rocker", "upper_rocker", "foot")
WALKING = (
    -1.0,  # C lies to the right of the line from B to D
    1.0,  # U to the left of B to D
    1.0,  # F to the left of L to C
)
Sides = tuple[float, float, float]


@scalar
def constants_of(g: Geometry) -> Constants:
    """Return the constants of a geometry; L and G lie to the right of D-U and C-F."""
    dx, dy = g.ad * math.cos(g.theta0), g.ad * math.sin(g.theta0)
    along_l, across_l = triangle_coefficients(g.b, g.d, g.e, -1.0)
    along_g, across_g = triangle_coefficients(g.g, g.i, g.h, -1.0)
    return Constants(
        *(g.crank, g.zero, dx, dy, g.j, g.k, g.b, g.c, g.f, g.g),
        *(along_l, across_l, along_g, across_g),
    )


@inlined
def linkage_points(k: Constants, sides: Sides, b: Point) -> tuple[Points, Sides]:
    """Return all points, given the crank's pin, and the `across` coefficients of C, U and F."""
    a, d = fixed(0.0, 0.0), fixed(k.dx, k.dy)
    along, across_c = dyad_coefficients(b, d, k.k, k.c, side(sides[0]))
    c = dyad(b, d, along, across_c)
    along, across_u = dyad_coefficients(b, d, k.j, k.b, side(sides[1]))
    u = dyad(b, d, along, across_u)
    l = rigid_point(d, u, k.along_l, k.across_l)  # noqa: E741
    along, across_f = dyad_coefficients(l, c, k.f, k.g, side(sides[2]))
    f = dyad(l, c, along, across_f)
    g = rigid_point(c, f, k.along_g, k.across_g)
    return Points(a, b, c, d, u, l, f, g), (across_c, across_u, across_f)


@inlined
def worst_transmission(k: Constants, p: Points, across: Sides) -> float:
    """Return the least transmission of the dyads."""
    return min(
        transmission(p.b, p.d, across[0], k.k, k.c),
        transmission(p.b, p.d, across[1], k.j, k.b),
        transmission(p.l, p.c, across[2], k.f, k.g),
    )


kernels = linkage_kernels(
    Geometry, Constants, Points, len(PARTS), constants_of, linkage_points, worst_transmission
)


# --------------------------------------------------------------------------- mechanism


@dataclass(frozen=True)
class TheoJansen(CrankLinkage):
    """Theo Jansen's leg; defaults are his proportions.

    Raises:
        GeometryError: If a dimension is impossible or the leg cannot be assembled.
    """

    name: ClassVar[str] = "theo_jansen"
    passive_joints: ClassVar[tuple[Joint, ...]] = tuple(
        map(
            Joint,
            ("b_upper", "b_lower", "d_upper", "d_lower", "u", "c_coupler", "c_foot", "l", "f"),
        )
    )
    closure_names: ClassVar[tuple[str, ...]] = PARTS
    assembly_modes: ClassVar[tuple[str, ...]] = flipped_modes("walking", PARTS)

    sides: ClassVar[FloatArray] = mode_sides(WALKING)
    kernels: ClassVar[Kernels] = kernels
    point_names: ClassVar[tuple[str, ...]] = ("A", "B", "C", "D", "U", "L", "F", "G")
    dyads: ClassVar[tuple[Dyad, ...]] = (
        Dyad("C", ("B", "D"), ("lower_coupler", "lower_rocker")),
        Dyad("U", ("B", "D"), ("upper_coupler", "upper_rocker")),
        Dyad("F", ("L", "C"), ("link", "foot_lever")),
    )
    triangles: ClassVar[tuple[Triangle, ...]] = (
        Triangle(("D", "U", "L"), ("upper_rocker", "plate_arm", "plate_brace")),
        Triangle(("C", "F", "G"), ("foot_lever", "foot_bar", "foot_brace")),
    )
    pivots: ClassVar[tuple[Pivot, ...]] = (
        Pivot("b_upper", "B", "A", "U"),
        Pivot("b_lower", "B", "A", "C"),
        Pivot("d_upper", "D", "A", "U"),
        Pivot("d_lower", "D", "A", "C"),
        Pivot("u", "U", "D", "B"),
        Pivot("c_coupler", "C", "D", "B"),
        Pivot("c_foot", "C", "D", "F"),
        Pivot("l", "L", "D", "F"),
        Pivot("f", "F", "C", "L"),
    )
    bars: ClassVar[tuple[tuple[str, ...], ...]] = (
        *(("A", "B"), ("B", "U"), ("B", "C"), ("D", "U", "L", "D"), ("C", "D")),
        *(("L", "F"), ("C", "F", "G", "C")),
    )

    placed: ClassVar[tuple[tuple[str, str, str], ...]] = (
        *(("crank", "", "A"), ("d_lower", "", "D"), ("d_upper", "", "D")),
        *(("b_lower", "crank", "B"), ("b_upper", "crank", "B")),
        *(("c_foot", "d_lower", "C"), ("l", "d_upper", "L")),
    )
    meetings: ClassVar[tuple[Meeting, ...]] = (
        Meeting("C", "b_lower", "d_lower"),
        Meeting("U", "b_upper", "d_upper"),
        Meeting("F", "l", "c_foot"),
    )

    crank_length: float = parameter("crank A B", "m", "length", 0.015)
    crank_zero: float = parameter("crank angle at joint position zero", "alpha_0", "angle", 0.0)
    frame_length: float = parameter("A D, in cranks", "l_AD", "ratio", math.hypot(38, 7.8) / 15)
    frame_angle: float = parameter("angle of A D", "theta_0", "angle", -math.atan2(7.8, 38))
    upper_coupler: float = parameter("B U, in cranks", "j", "ratio", 50 / 15)
    lower_coupler: float = parameter("B C, in cranks", "k", "ratio", 61.9 / 15)
    upper_rocker: float = parameter("D U, in cranks", "b", "ratio", 41.5 / 15)
    lower_rocker: float = parameter("D C, in cranks", "c", "ratio", 39.3 / 15)
    plate_arm: float = parameter("D L, in cranks", "d", "ratio", 40.1 / 15)
    plate_brace: float = parameter("U L, in cranks", "e", "ratio", 55.8 / 15)
    link: float = parameter("L F, in cranks", "f", "ratio", 39.4 / 15)
    foot_lever: float = parameter("C F, in cranks", "g", "ratio", 36.7 / 15)
    foot_brace: float = parameter("F G, in cranks", "h", "ratio", 65.7 / 15)
    foot_bar: float = parameter("C G, in cranks", "i", "ratio", 49 / 15)
    reach_tolerance: float = parameter(
        "largest distance of a wanted foot position from the foot curve", "-", "length", 0.001
    )

    joint_ranges: tuple[tuple[float, float], ...] = (ANY_ANGLE,)
    passive_joint_ranges: tuple[tuple[float, float], ...] = (ANY_ANGLE,) * 9
    bar_masses: tuple[BarMass, ...] = ()
