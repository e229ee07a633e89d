# SPDX-License-Identifier: Apache-2.0
"""`double_rhombus`: a serial-parallel leg driven by three cylinders (Wang, Jin, Li 2019).

Two cylinders turn the two cranks of a planar five-bar at the hip O; the double rhombus OFGE, GHIJ
below it magnifies their motion to the foot I. A third cylinder (RPR) swings the whole planar
mechanism sideways.

Symbols and axes of the code are the paper's. Its plane has X along OC, the walking direction, and
Z up; angles count from X towards Z, about -Y. The leg frame is the paper's, with origin O. With
`u(t) = (cos t, sin t)` in the plane:

    phi = 3 pi/2 - (beta + theta),  theta = (alpha - beta) / 2    swing of OI, half angle EOF, (1)
    F = l u(beta),  E = l u(alpha),  G = F + E                    upper rhombus
    A = l1 u(beta - varphi),  D = l5 u(alpha - gamma)             cylinder pins of the cranks, (2)
    C = (l6, 0),  B = C + l3 (-cos OCB, sin OCB)                  cylinder pins of the swung frame
    l2 = |AB|,  l4 = |CD|                                         upper, lower cylinder, (3), (4)
    (I_x, I_z) = -4 l cos(theta) (sin phi, cos phi)               foot in the plane, (5)
    I = (I_x, -I_z sin psi_s, I_z cos psi_s)                      foot in the leg frame
    q3² = r_b² + r_l² - 2 r_b r_l cos(psi_s + delta)              side swing cylinder

Positive phi puts the foot backward (-x), positive psi_s (about +x) to the left (+y). EGH and FGJ
are straight bars: they make the lower rhombus follow the upper one.

Corrections of the printed equations: with these angles (12) and (13) have no minus sign,
J_alphabeta of (14) is diagonal (as printed it swaps the cylinders), and "omega_2" above (12) is
w_1, the direction of OA, whose angle is beta - varphi.

The paper does not give varphi: the default makes the two crank triangles mirror images at phi = 0,
so that the maps are symmetric as the paper says. It gives no dimension of the side swing, no stroke
and no pin range: these defaults are placeholders that cover |phi| <= 30°, 0.5 m <= OI <= 0.95 m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array, wrapped_angles
from leg_kinematics.assembly_modes import flipped_modes, mode_signs
from leg_kinematics.bodies import LegTree
from leg_kinematics.errors import GeometryError
from leg_kinematics.geometry import parameter
from leg_kinematics.kernels.kernel import kernel, scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.scalars import included_angle, swing_plane, within, wrapped
from leg_kinematics.mechanism import Excursion, Joint, Linkage, Posture
from leg_kinematics.mechanisms.weighed import BarMass, Weighed
from leg_kinematics.placed_joints import Meeting, PlacedJoint, tree_of
from leg_kinematics.status import Status

OK, UNREACHABLE, JOINT_LIMIT, PASSIVE_JOINT_LIMIT, SINGULAR, INVALID_INPUT = map(int, Status)

PASSIVE_COUNT = 10
DEAD_CENTRE = 1e-9  # least lever of a cylinder in the initial posture, relative to its crank
SWING_BODY_PIN = -0.5 * math.pi  # direction O -> K from +z about +x: K lies on the left (+y)


class Geometry(NamedTuple):
    """The dimensions under the paper's symbols, in the order of `DoubleRhombus`'s fields."""

    l1: float
    l5: float
    l3: float
    l6: float
    l: float  # noqa: E741
    ocb: float
    varphi: float
    gamma: float
    r_b: float
    r_l: float
    delta: float


GEOMETRY_SIZE = len(Geometry._fields)


class Branch(NamedTuple):
    """Signs that tell the solutions of the loop equations apart; each is +1 or -1.

    Attributes:
        rhombus: Of theta: whether E or F comes first.
        upper: Of dl2/dbeta: the side of OB on which A lies.
        lower: Of dl4/dalpha: the side of OC on which D lies.
        swing: Of dq3/dpsi_s: the side to which the swing cylinder's triangle bends.
    """

    rhombus: float
    upper: float
    lower: float
    swing: float


# --------------------------------------------------------------------------- scalar mathematics


@scalar
def upper_anchor(g: Geometry) -> tuple[float, float]:
    """Return B, the upper cylinder's pin in the swung frame."""
    return g.l6 - g.l3 * math.cos(g.ocb), g.l3 * math.sin(g.ocb)


@scalar
def cylinder_vectors(g: Geometry, beta: float, alpha: float) -> tuple[float, float, float, float]:
    """Return the vectors A -> B and D -> C: l2 w2 of (3) and l4 w4 of (4)."""
    bx, bz = upper_anchor(g)
    ax, az = g.l1 * math.cos(beta - g.varphi), g.l1 * math.sin(beta - g.varphi)
    dx, dz = g.l5 * math.cos(alpha - g.gamma), g.l5 * math.sin(alpha - g.gamma)
    return bx - ax, bz - az, g.l6 - dx, -dz


@scalar
def cylinder_levers(g: Geometry, beta: float, alpha: float) -> tuple[float, float]:
    """Return dl2/dbeta and dl4/dalpha [m/rad]: (13) and (12), both with a plus sign."""
    abx, abz, dcx, dcz = cylinder_vectors(g, beta, alpha)
    l2, l4 = math.hypot(abx, abz), math.hypot(dcx, dcz)
    w1x, w1z = math.cos(beta - g.varphi), math.sin(beta - g.varphi)
    w5x, w5z = math.cos(alpha - g.gamma), math.sin(alpha - g.gamma)
    return g.l1 * (abx * w1z - abz * w1x) / l2, g.l5 * (dcx * w5z - dcz * w5x) / l4


@scalar
def swing_cylinder(g: Geometry, psi_s: float) -> float:
    """Return the length of the side swing cylinder."""
    angle = psi_s + g.delta
    return math.hypot(g.r_l * math.cos(angle) - g.r_b, g.r_l * math.sin(angle))


@scalar
def swing_lever(g: Geometry, psi_s: float) -> float:
    """Return dq3/dpsi_s [m/rad]."""
    return g.r_b * g.r_l * math.sin(psi_s + g.delta) / swing_cylinder(g, psi_s)


@scalar
def cranks_from_foot(
    g: Geometry, rhombus: float, foot_x: float, foot_z: float
) -> tuple[float, float]:
    """Return beta and alpha of a foot in the plane: (5), then (1)."""
    phi = math.atan2(-foot_x, -foot_z)
    cosine = math.hypot(foot_x, foot_z) / (4.0 * g.l)
    theta = rhombus * math.acos(cosine) if cosine <= 1.0 else math.nan
    psi = 1.5 * math.pi - phi
    return psi - theta, psi + theta


@scalar
def cranks_from_cylinders(g: Geometry, branch: Branch, l2: float, l4: float) -> tuple[float, float]:
    """Return beta and alpha: the triangles OAB and ODC, then the turn with theta in ±90°."""
    bx, bz = upper_anchor(g)
    beta = (
        g.varphi + math.atan2(bz, bx) + branch.upper * included_angle(g.l1, math.hypot(bx, bz), l2)
    )
    alpha = g.gamma + branch.lower * included_angle(g.l5, g.l6, l4)
    theta = 0.5 * wrapped(alpha - beta)
    psi = 1.5 * math.pi - wrapped(1.5 * math.pi - beta - theta)
    return psi - theta, psi + theta


@scalar
def foot_in_plane(g: Geometry, beta: float, alpha: float) -> tuple[float, float]:
    """Return I_x, I_z: equations (1) and (5)."""
    theta = 0.5 * (alpha - beta)
    phi = 1.5 * math.pi - (beta + theta)
    return (
        -4.0 * g.l * math.cos(theta) * math.sin(phi),
        -4.0 * g.l * math.cos(theta) * math.cos(phi),
    )


@scalar
def planar_rates(g: Geometry, beta: float, alpha: float) -> tuple[float, float, float, float]:
    """Return G_V of (19) row by row: v_x and v_z per unit speed of the cylinders l2 and l4."""
    theta = 0.5 * (alpha - beta)
    phi = 1.5 * math.pi - (beta + theta)
    x_theta = 4.0 * g.l * math.sin(theta) * math.sin(phi)  # J_thetaphi, (16)
    x_phi = -4.0 * g.l * math.cos(theta) * math.cos(phi)
    z_theta = 4.0 * g.l * math.sin(theta) * math.cos(phi)
    z_phi = 4.0 * g.l * math.cos(theta) * math.sin(phi)
    lever_2, lever_4 = cylinder_levers(g, beta, alpha)  # J_alphabeta^-1, diagonal, (14)
    return (
        -0.5 * (x_theta + x_phi) / lever_2,  # J_Z, (18)
        0.5 * (x_theta - x_phi) / lever_4,
        -0.5 * (z_theta + z_phi) / lever_2,
        0.5 * (z_theta - z_phi) / lever_4,
    )


@scalar
def passive_angles(g: Geometry, closure: FloatArray, angles: FloatArray) -> None:
    """Fill the angles of the passive joints, in the order of `DoubleRhombus.excursions`."""
    beta, alpha, psi_s = closure[0], closure[1], closure[2]
    abx, abz, dcx, dcz = cylinder_vectors(g, beta, alpha)
    upper, lower = math.atan2(abz, abx), math.atan2(dcz, dcx)
    leg_pin = SWING_BODY_PIN + g.delta + psi_s
    swing = math.atan2(
        g.r_l * math.sin(leg_pin) - g.r_b * math.sin(SWING_BODY_PIN),
        g.r_l * math.cos(leg_pin) - g.r_b * math.cos(SWING_BODY_PIN),
    )
    angles[0] = beta
    angles[1] = alpha
    angles[2] = alpha - beta
    angles[3] = upper - (beta - g.varphi)
    angles[4] = upper
    angles[5] = lower
    angles[6] = lower - (alpha - g.gamma)
    angles[7] = psi_s
    angles[8] = swing
    angles[9] = swing - leg_pin


@scalar
def on_branch(g: Geometry, branch: Branch, closure: FloatArray) -> bool:
    """Tell whether a posture lies strictly inside the branch, off its singularities.

    The leg is singular with the rhombi stretched (theta = 0) or flat (theta = ±90°), a cylinder in
    line with its crank (dead centre), or the foot on the axis of the side swing.
    """
    beta, alpha, psi_s = closure[0], closure[1], closure[2]
    lever_2, lever_4 = cylinder_levers(g, beta, alpha)
    _, foot_z = foot_in_plane(g, beta, alpha)
    return (
        math.sin(alpha - beta) * branch.rhombus > 0.0
        and lever_2 * branch.upper > 0.0
        and lever_4 * branch.lower > 0.0
        and swing_lever(g, psi_s) * branch.swing > 0.0
        and foot_z < 0.0
    )


@scalar
def status_of_point(
    g: Geometry,
    branch: Branch,
    rest: FloatArray,
    limits: FloatArray,
    passive_limits: FloatArray,
    q: FloatArray,
    closure: FloatArray,
) -> int:
    """Return the status of a solved point."""
    if not math.isfinite(closure[0] + closure[1] + closure[2]):
        return UNREACHABLE
    if not on_branch(g, branch, closure):
        return SINGULAR
    for i in range(3):
        if not within(q[i], limits[i]):
            return JOINT_LIMIT
    angles = np.empty(PASSIVE_COUNT)
    passive_angles(g, closure, angles)
    for i in range(PASSIVE_COUNT):
        if not within(wrapped(angles[i] - rest[i]), passive_limits[i]):
            return PASSIVE_JOINT_LIMIT
    return OK


@scalar
def all_finite(vector: FloatArray) -> bool:
    """Tell whether the three elements of a vector are finite."""
    return math.isfinite(vector[0]) and math.isfinite(vector[1]) and math.isfinite(vector[2])


# --------------------------------------------------------------------------- kernels


@kernel(
    "(g),(b),(p),(n,k),(p,k),(n)->(n),(n),()",
    "f8[:], f8[:], f8[:], f8[:,:], f8[:,:], f8[:], f8[:], f8[:], u1[:]",
)
def _inverse(geometry, signs, rest, limits, passive_limits, foot, q, closure, status):  # type: ignore[no-untyped-def]
    """Foot position to cylinder lengths and closure."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    branch = Branch(*to_fixed_tuple(signs, 4))
    q[:] = math.nan
    closure[:] = math.nan
    if not all_finite(foot):
        status[0] = INVALID_INPUT
        return
    psi_s, foot_z = swing_plane(-foot[1], foot[2])
    beta, alpha = cranks_from_foot(g, branch.rhombus, foot[0], foot_z)
    if math.isnan(beta):
        status[0] = UNREACHABLE
        return
    abx, abz, dcx, dcz = cylinder_vectors(g, beta, alpha)
    q[0], q[1], q[2] = math.hypot(abx, abz), math.hypot(dcx, dcz), swing_cylinder(g, psi_s)
    closure[0], closure[1], closure[2] = beta, alpha, psi_s
    status[0] = status_of_point(g, branch, rest, limits, passive_limits, q, closure)


@kernel(
    "(g),(b),(p),(n,k),(p,k),(n)->(n),(n),()",
    "f8[:], f8[:], f8[:], f8[:,:], f8[:,:], f8[:], f8[:], f8[:], u1[:]",
)
def _forward(geometry, signs, rest, limits, passive_limits, q, foot, closure, status):  # type: ignore[no-untyped-def]
    """Cylinder lengths to foot position and closure."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    branch = Branch(*to_fixed_tuple(signs, 4))
    foot[:] = math.nan
    closure[:] = math.nan
    if not all_finite(q):
        status[0] = INVALID_INPUT
        return
    beta, alpha = cranks_from_cylinders(g, branch, q[0], q[1])
    psi_s = wrapped(branch.swing * included_angle(g.r_b, g.r_l, q[2]) - g.delta)
    if min(q[0], q[1], q[2]) < 0.0 or not math.isfinite(beta + alpha + psi_s):
        status[0] = UNREACHABLE
        return
    foot_x, foot_z = foot_in_plane(g, beta, alpha)
    foot[0], foot[1], foot[2] = foot_x, -foot_z * math.sin(psi_s), foot_z * math.cos(psi_s)
    closure[0], closure[1], closure[2] = beta, alpha, psi_s
    status[0] = status_of_point(g, branch, rest, limits, passive_limits, q, closure)


@points_kernel("(g),(points,3)->(points,2,2)", "f8 f8 f8")
def _planar_jacobian(geometry, closure, jacobian):  # type: ignore[no-untyped-def]
    """Equation (19)."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    for i in range(len(closure)):
        rates = planar_rates(g, closure[i, 0], closure[i, 1])
        (jacobian[i, 0, 0], jacobian[i, 0, 1], jacobian[i, 1, 0], jacobian[i, 1, 1]) = rates


@kernel("(g),(n)->(n,n)", "f8[:], f8[:], f8[:,:]")
def _jacobian(geometry, closure, jacobian):  # type: ignore[no-untyped-def]
    """Foot velocity by cylinder speeds."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    beta, alpha, psi_s = closure[0], closure[1], closure[2]
    x_2, x_4, z_2, z_4 = planar_rates(g, beta, alpha)
    _, foot_z = foot_in_plane(g, beta, alpha)
    lever = swing_lever(g, psi_s)
    cs, ss = math.cos(psi_s), math.sin(psi_s)
    jacobian[0, 0], jacobian[0, 1], jacobian[0, 2] = x_2, x_4, 0.0
    jacobian[1, 0], jacobian[1, 1], jacobian[1, 2] = -z_2 * ss, -z_4 * ss, -foot_z * cs / lever
    jacobian[2, 0], jacobian[2, 1], jacobian[2, 2] = z_2 * cs, z_4 * cs, -foot_z * ss / lever


@kernel("(g),(n)->(n,n)", "f8[:], f8[:], f8[:,:]")
def _angular_jacobian(geometry, closure, jacobian):  # type: ignore[no-untyped-def]
    """Angular velocity of the frame UIW by cylinder speeds."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    lever_2, lever_4 = cylinder_levers(g, closure[0], closure[1])
    cs, ss = math.cos(closure[2]), math.sin(closure[2])
    for k in range(2):
        psi_rate = 0.5 / (lever_2 if k == 0 else lever_4)
        jacobian[0, k] = 0.0
        jacobian[1, k] = -psi_rate * cs
        jacobian[2, k] = -psi_rate * ss
    jacobian[0, 2] = 1.0 / swing_lever(g, closure[2])
    jacobian[1, 2] = 0.0
    jacobian[2, 2] = 0.0


@kernel("(g),(n),(p)->(p)", "f8[:], f8[:], f8[:], f8[:]")
def _excursions(geometry, closure, rest, excursions):  # type: ignore[no-untyped-def]
    """Passive joint angles less those at rest."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    passive_angles(g, closure, excursions)
    for i in range(PASSIVE_COUNT):
        excursions[i] = wrapped(excursions[i] - rest[i])


@kernel("(g),(n)->(n)", "f8[:], f8[:], f8[:]")
def _levers(geometry, closure, levers):  # type: ignore[no-untyped-def]
    """Derivatives of the cylinder lengths by beta, alpha and psi_s."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    levers[0], levers[1] = cylinder_levers(g, closure[0], closure[1])
    levers[2] = swing_lever(g, closure[2])


# --------------------------------------------------------------------------- mechanism

FLIPPABLE = ("rhombus", "upper", "lower")


class Pin(NamedTuple):
    """A passive joint: its position is `rate` times an angle of `passive_angles`, plus an offset.

    Attributes:
        name: Name of the joint.
        angle: Index of the angle.
        rate: Position by the angle.
        offset: Position where the angle is zero [rad].
    """

    name: str
    angle: int
    rate: float
    offset: float


PINS = (
    Pin("hip_upper_crank", 0, 1.0, 0.0),
    Pin("hip_lower_crank", 1, 1.0, 0.0),
    Pin("f", 2, 1.0, -math.pi),
    Pin("e", 2, -1.0, math.pi),
    Pin("g", 2, -1.0, 0.0),
    Pin("h", 2, 1.0, -math.pi),
    Pin("j", 2, -1.0, math.pi),
    Pin("i", 2, -1.0, 0.0),
    Pin("foot", 2, -0.5, 0.0),
    Pin("upper_pin_a", 3, 1.0, -math.pi),
    Pin("upper_pin_b", 4, 1.0, 0.0),
    Pin("lower_pin_c", 5, 1.0, 0.0),
    Pin("lower_pin_d", 6, 1.0, -math.pi),
    Pin("swing_axis", 7, 1.0, 0.0),
    Pin("swing_pin_body", 8, 1.0, -math.pi - SWING_BODY_PIN),
    Pin("swing_pin_leg", 9, 1.0, 0.0),
)

GUIDE = Joint("foot_guide", "prismatic")  # from I to G

# The initial posture: phi = 0, theta = 45°, psi_s = 0.
INITIAL_CLOSURE = (1.25 * math.pi, 1.75 * math.pi, 0.0)


def _range_deg(lower: float, upper: float) -> tuple[float, float]:
    return math.radians(lower), math.radians(upper)


@dataclass(frozen=True)
class DoubleRhombus(Weighed):
    """The leg with double rhombus and three cylinders; defaults are the paper's dimensions.

    Joint positions are the lengths of the cylinders, pin to pin. The foot position is that of I in
    the leg frame, whose origin is O. The side swing's body pin K lies on the left, so this is a leg
    of the right side; its mirror image is one of the left side.

    Raises:
        GeometryError: If a dimension is impossible, or a cylinder has no lever in the initial
            posture.
    """

    name: ClassVar[str] = "double_rhombus"
    joints: ClassVar[tuple[Joint, ...]] = (
        Joint("upper_cylinder", "prismatic"),
        Joint("lower_cylinder", "prismatic"),
        Joint("swing_cylinder", "prismatic"),
    )
    passive_joints: ClassVar[tuple[Joint, ...]] = tuple(Joint(pin.name) for pin in PINS)
    excursions: ClassVar[tuple[Excursion, ...]] = tuple(
        Excursion(n)
        for n in (
            *("hip_upper_crank", "hip_lower_crank", "rhombus"),
            *("upper_pin_a", "upper_pin_b", "lower_pin_c", "lower_pin_d"),
            *("swing_axis", "swing_pin_body", "swing_pin_leg"),
        )
    )
    closure_names: ClassVar[tuple[str, ...]] = (
        *("upper_crank_angle", "lower_crank_angle", "side_swing_angle"),
    )
    assembly_modes: ClassVar[tuple[str, ...]] = flipped_modes("initial", FLIPPABLE)

    upper_crank_arm: float = parameter("arm O A of the upper crank AOF", "l1", "length", 0.045)
    lower_crank_arm: float = parameter("arm O D of the lower crank DOE", "l5", "length", 0.045)
    frame_post: float = parameter("frame C B", "l3", "length", 0.240)
    frame_base: float = parameter("frame O C", "l6", "length", 0.305)
    rhombus_side: float = parameter("side of the rhombi, O F", "l", "length", 0.260)
    frame_angle: float = parameter("angle O C B", "∠OCB", "angle", math.radians(75.0))
    upper_crank_angle: float = parameter(
        "angle A O F of the upper crank (reconstructed)", "varphi", "angle", math.radians(121.33)
    )
    lower_crank_angle: float = parameter(
        "angle D O E of the lower crank", "gamma", "angle", math.radians(15.0)
    )
    swing_body_arm: float = parameter(
        "swing axis to the cylinder's pin K in the body (placeholder)", "r_b", "length", 0.120
    )
    swing_leg_arm: float = parameter(
        "swing axis to the cylinder's pin L in the leg (placeholder)", "r_l", "length", 0.090
    )
    swing_offset: float = parameter(
        "angle K O L without side swing (placeholder)", "delta", "angle", math.radians(-90.0)
    )

    joint_ranges: tuple[tuple[float, float], ...] = (
        (0.292, 0.355),
        (0.261, 0.324),
        (0.115, 0.178),
    )
    passive_joint_ranges: tuple[tuple[float, float], ...] = (
        *(_range_deg(-55.0, 55.0), _range_deg(-55.0, 55.0), _range_deg(-42.0, 33.0)),
        *(_range_deg(-55.0, 55.0), _range_deg(-10.0, 10.0)),
        *(_range_deg(-10.0, 10.0), _range_deg(-55.0, 55.0)),
        *(_range_deg(-30.0, 30.0), _range_deg(-15.0, 15.0), _range_deg(-25.0, 25.0)),
    )
    bar_masses: tuple[BarMass, ...] = ()

    def __post_init__(self) -> None:
        """Check the dimensions; the initial posture must be off every dead centre."""
        self.check_fields()
        self._signs  # noqa: B018  raises GeometryError

    @cached_property
    def _signs(self) -> FloatArray:
        """Branch signs of the initial posture."""
        levers = _levers(self._geometry, np.array(INITIAL_CLOSURE))
        arms = np.array([self.upper_crank_arm, self.lower_crank_arm, self.swing_leg_arm])
        needs = (
            "upper cylinder: upper_crank_angle (varphi), frame_angle (∠OCB) or frame_post (l3)",
            "lower cylinder: lower_crank_angle (gamma)",
            "swing cylinder: swing_offset (delta)",
        )
        for lever, arm, need in zip(levers, arms, needs, strict=True):
            if not abs(lever) > DEAD_CENTRE * arm:
                cylinder, names = need.split(": ")
                raise GeometryError(
                    f"the {cylinder} has no lever about its axis in the initial posture "
                    f"(phi = 0, theta = 45°, no side swing): change {names}"
                )
        return np.array([1.0, *np.sign(levers)])

    @cached_property
    def _rest(self) -> FloatArray:
        """Passive joint angles in the initial posture."""
        return _excursions(self._geometry, np.array(INITIAL_CLOSURE), np.zeros(PASSIVE_COUNT))

    def _branch(self, assembly_mode: str) -> FloatArray:
        """Return the branch signs of an assembly mode."""
        return self._signs * [*mode_signs(self, assembly_mode, FLIPPABLE), 1.0]

    def _parameters(self, assembly_mode: str) -> tuple[FloatArray, ...]:
        return (
            self._geometry,
            self._branch(assembly_mode),
            self._rest,
            self.joint_limits,
            self.passive_joint_limits,
        )

    @cached_property
    def initial_posture(self) -> Posture:
        """The posture with the foot below O and theta = 45°, where the leg is nearly isotropic.

        A cylinder cannot have length zero, so this takes the place of "all actuators at zero".
        """
        return self.inverse([0.0, 0.0, -4.0 * self.rhombus_side * math.cos(0.25 * math.pi)])

    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the foot, in closed form.

        Args:
            joint_positions: Cylinder lengths l2, l4, q3 (..., 3) [m].
            assembly_mode: One of `assembly_modes`; "" is "initial". Its "upper" and "lower"
                select the solution; one whose rhombus stands the other way round is SINGULAR.

        Returns:
            The posture; NaN where the cylinders do not close their triangles.
        """
        q = as_array("joint_positions", joint_positions, 3)
        foot, closure, status = _forward(*self._parameters(assembly_mode), q)
        return Posture(q, closure, foot, status)

    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the cylinders, in closed form.

        Args:
            foot_position: Foot I in the leg frame (..., 3) [m].
            assembly_mode: One of `assembly_modes`; "" is "initial". Its "rhombus" selects the
                solution; one with a cylinder on the other side of its dead centre is SINGULAR.

        Returns:
            The posture; NaN where the foot is out of reach.
        """
        foot = as_array("foot_position", foot_position, 3)
        q, closure, status = _inverse(*self._parameters(assembly_mode), foot)
        return Posture(q, closure, foot, status)

    def planar_jacobian(self, posture: Posture) -> FloatArray:
        """G_V of the planar mechanism (..., 2, 2) [1]; equation (19).

        Rows are the foot's velocity along the walking direction (paper's X) and up in the swung
        plane (paper's Z), columns the speeds of the upper and lower cylinder.
        """
        return _planar_jacobian(self._geometry, posture.closure)

    def jacobian(self, posture: Posture) -> FloatArray:
        """J of the foot's velocity, v = J q' (..., 3, 3) [1]; (19) and the side swing."""
        return _jacobian(self._geometry, posture.closure)

    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of the foot's angular velocity, omega = J_omega q' (..., 3, 3) [rad/m].

        The foot's body is the one that carries the paper's frame UIW, with W along IO: the spring
        and foot below I, held in line with the diagonal of the rhombi. It turns by phi' about the
        swung y axis and by psi_s' about the leg's x axis.
        """
        return _angular_jacobian(self._geometry, posture.closure)

    def passive_joint_positions(self, posture: Posture) -> FloatArray:
        """Angles between the bars at the pins and axes (..., 16) [rad].

        At a pin, from one bar's far end to that of the other: in the leg's plane from the walking
        direction upwards, across it in the sense of the side swing psi_s.

            hip_upper_crank C-O-F    hip_lower_crank C-O-E    foot H-I-O
            f O-F-G    e O-E-G    g F-G-E    h G-H-I    j G-J-I    i H-I-J
            upper_pin_a O-A-B    upper_pin_b from C O to B A
            lower_pin_d O-D-C    lower_pin_c O-C-D
            swing_pin_body O-K-L    swing_pin_leg O-L-K

        The foot's body is in line with O I; swing_axis is psi_s.
        """
        angles = self.passive_joint_excursions(posture)[..., [pin.angle for pin in PINS]]
        return self._pin_rest + angles * [pin.rate for pin in PINS]

    @cached_property
    def _pin_rest(self) -> FloatArray:
        """Positions of the passive joints in the initial posture (16,) [rad]."""
        return wrapped_angles([self._rest[pin.angle] * pin.rate + pin.offset for pin in PINS])

    def passive_joint_excursions(self, posture: Posture) -> FloatArray:
        """Excursions of the passive joints from the initial posture (..., 10) [rad].

        Cranks AOF and DOE about the hip O (beta, alpha); the opening 2 theta, which all joints of
        the rhombi share; the cylinders about their pins, against the crank (A, D) and against the
        swung frame (B, C); the side swing psi_s; its cylinder against the body and the leg.
        """
        return _excursions(self._geometry, posture.closure, self._rest)

    def positions_by_name(self, posture: Posture) -> dict[str, FloatArray]:
        """Positions (...) of all joints by name, and of the guide that holds the foot in line."""
        positions = super().positions_by_name(posture)
        return positions | {GUIDE.name: 2.0 * self.rhombus_side * np.cos(positions["foot"])}

    def body_tree(self, assembly_mode: str = "") -> LegTree:
        """Cranks, rhombi and cylinders, cut at A, D, L, G and I, in any mode.

        The foot's body turns about I and is held in line with I O by a guide, which slides from I
        to G.
        """
        self.mode_index(assembly_mode)
        return self._tree

    @cached_property
    def _tree(self) -> LegTree:
        linkage = self.linkage(self.initial_posture)
        right, forward = (0.0, -1.0, 0.0), (1.0, 0.0, 0.0)

        def along(first: str, second: str) -> FloatArray:
            return linkage.point(second) - linkage.point(first)

        joints = (
            PlacedJoint("swing_axis", "", "O", forward),
            PlacedJoint("swing_pin_body", "", "K", forward),
            PlacedJoint("swing_cylinder", "swing_pin_body", "L", along("K", "L")),
            PlacedJoint("hip_upper_crank", "swing_axis", "O", right),
            PlacedJoint("hip_lower_crank", "swing_axis", "O", right),
            PlacedJoint("upper_pin_b", "swing_axis", "B", right),
            PlacedJoint("upper_cylinder", "upper_pin_b", "A", along("B", "A")),
            PlacedJoint("lower_pin_c", "swing_axis", "C", right),
            PlacedJoint("lower_cylinder", "lower_pin_c", "D", along("C", "D")),
            PlacedJoint("f", "hip_upper_crank", "F", right),
            PlacedJoint("e", "hip_lower_crank", "E", right),
            PlacedJoint("h", "e", "H", right),
            PlacedJoint("j", "f", "J", right),
            PlacedJoint("foot", "h", "I", right),
            PlacedJoint(GUIDE.name, "foot", "G", along("I", "G")),
        )
        meetings = (
            Meeting("L", "swing_cylinder", "swing_axis"),
            Meeting("A", "upper_cylinder", "hip_upper_crank"),
            Meeting("D", "lower_cylinder", "hip_lower_crank"),
            Meeting("G", "e", "f"),
            Meeting("I", "h", "j"),
            Meeting("G", GUIDE.name, "f"),
        )
        return tree_of(
            self, self.initial_posture, joints, meetings, ("I", "foot"), {GUIDE.name: GUIDE}
        )

    def linkage(self, posture: Posture) -> Linkage:
        """Points of the leg in the leg frame and the bars between them.

        The sides of H (on EG) and J (on FG) and the directions of the swing cylinder's pins K (in
        the body) and L (in the leg) are chosen for drawing; the paper's figures decide them.
        """
        g = Geometry(*self._geometry)
        beta, alpha, psi_s = np.moveaxis(posture.closure, -1, 0)

        def in_plane(length: float, angle: ArrayLike) -> FloatArray:
            """Vector length u(angle) of the swung plane, in the leg frame."""
            x, z = length * np.cos(angle), length * np.sin(angle)
            return np.stack([x + 0.0 * psi_s, -z * np.sin(psi_s), z * np.cos(psi_s)], axis=-1)

        def across(length: float, angle: ArrayLike) -> FloatArray:
            """Vector of the plane of the side swing, at an angle from +z about +x."""
            angle = angle + 0.0 * psi_s
            components = [np.zeros_like(psi_s), -np.sin(angle), np.cos(angle)]
            return length * np.stack(components, axis=-1)

        origin = in_plane(0.0, 0.0)
        c, e, f = in_plane(g.l6, 0.0), in_plane(g.l, alpha), in_plane(g.l, beta)
        points = {
            "O": origin,
            "A": in_plane(g.l1, beta - g.varphi),
            "B": c + in_plane(g.l3, math.pi - g.ocb),
            "C": c,
            "D": in_plane(g.l5, alpha - g.gamma),
            "E": e,
            "F": f,
            "G": e + f,
            "H": e + 2.0 * f,
            "I": 2.0 * (e + f),
            "J": 2.0 * e + f,
            "K": across(g.r_b, SWING_BODY_PIN),
            "L": across(g.r_l, SWING_BODY_PIN + g.delta + psi_s),
        }
        names = tuple(points)
        bars = (
            *(("O", "C", "B"), ("A", "O", "F"), ("D", "O", "E")),
            *(("A", "B"), ("C", "D")),
            *(("F", "G", "J"), ("E", "G", "H"), ("H", "I", "J")),
            *(("K", "O", "L"), ("K", "L")),
        )
        return Linkage(
            names,
            np.stack(list(points.values()), axis=-2),
            tuple(tuple(names.index(n) for n in bar) for bar in bars),
        )
