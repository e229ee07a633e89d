# SPDX-License-Identifier: Apache-2.0
"""`gantry_hybrid`: a 4-DOF hybrid manipulator with four slides (Yu, Chen, Ma, paper 004).

A carriage E runs along Y and carries a parallel mechanism whose platform moves in X and Z and tilts
by beta about X: slides A and B on one rail along X carry bars with a pin at each end, slide C on a
parallel rail carries a rod with a universal joint at each end. An auxiliary shaft turns a tool on
the platform (see `universal_joints`).

Symbols of the code are the paper's, and so is the leg frame: OXYZ, Z from the carriage to the
platform. REP-103 names x, y and z by a body's forward, left and up; a manipulator on a gantry does
not travel, and with X along the rails as its forward the paper's frame is one of REP-103, in which
the task coordinates x, y, z and beta keep the paper's meaning. On the carriage, with s2 of the
slide E as y:

    A'' = (s1 - b1, 0, 0)      A' = (x - a, 0, z)      |A'A''| = L1, (2)
    B'' = (s3 + b2, 0, 0)      B' = (x + a, 0, z)      |B'B''| = L2, (3)
    C'' = (s4 + c, d, 0)       C' = (x, e cos beta, z + e sin beta)      |C'C''| = L3, (9)
    n1 = x - a + b1 - s1,  n2 = x + a - b2 - s3,  k = x - c - s4      bars along X
    k m1 = z + e sin beta,  k m2 = e (z cos beta + d sin beta)

Five signs tell the solutions apart: those of z (5), of m2 k (10), and of n1, n2, k, which in (12)
and (13) are opposite to the printed ones. Given the slides, (10) is solved in the form
sin(phi - beta) = w3 / |(w1, w2)|, phi = atan2(d, z), which holds for z < 0 too.

Corrections of the printed equations: (5) is z² = L1² - n1² with n1 from (4); the matrix missing in
(20) is, with x' = (n2 s3' - n1 s1') / (n2 - n1),

    z' = n1 n2 (s1' - s3') / (z (n2 - n1)),    m2 k beta' = k (s4' - x') - m1 k z'

and (26) lacks the outer G and one transposed G: V'' = G q'' - G [q'T GT H_k G q'].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array, as_matching
from leg_kinematics.assembly_modes import flipped_modes, mode_signs
from leg_kinematics.bodies import LegTree
from leg_kinematics.errors import GeometryError
from leg_kinematics.geometry import offset, parameter
from leg_kinematics.kernels.kernel import kernel, scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.scalars import within, wrapped
from leg_kinematics.mechanism import Excursion, Joint, Linkage, Posture
from leg_kinematics.mechanisms.universal_joints import AuxiliaryChain, shaft_state
from leg_kinematics.mechanisms.weighed import BarMass, Weighed
from leg_kinematics.placed_joints import Meeting, PlacedJoint, tree_of
from leg_kinematics.status import Status

OK, UNREACHABLE, JOINT_LIMIT, PASSIVE_JOINT_LIMIT, SINGULAR, INVALID_INPUT = map(int, Status)

PASSIVE_COUNT = 9
ANGLE_COUNT = 8  # of them: the last passive joint is the sleeve of the shaft
SINGULAR_BAND = 1e-9  # distance from a singularity, relative to the bars, that counts as singular


class Geometry(NamedTuple):
    """The dimensions under the paper's symbols, in the order of `GantryHybrid`'s fields."""

    a: float
    b1: float
    b2: float
    c: float
    d: float
    e: float
    ee: float
    ee_prime: float
    l1: float
    l2: float
    l3: float


GEOMETRY_SIZE = len(Geometry._fields)


class Branch(NamedTuple):
    """Signs that tell the solutions of the loop equations apart; each is +1 or -1.

    Attributes:
        z: Of z, as in (5).
        beta: Of m2 k = e (z cos beta + d sin beta), as in (10): how the arm O''C' bends.
        s1: Of n1, opposite to (12): the side on which bar A leans.
        s3: Of n2, opposite to (13): the side on which bar B leans.
        s4: Of k, opposite to (14): the side on which rod C leans.
    """

    z: float
    beta: float
    s1: float
    s3: float
    s4: float


class Levers(NamedTuple):
    """Components of the bars: what (16)-(18) are made of.

    Attributes:
        n1: A''A' along X [m].
        n2: B''B' along X [m].
        k: C''C' along X [m].
        z: A''A' and B''B' along Z [m].
        km1: C''C' along Z [m].
        km2: Of C''C' about the platform's hinge [m²].
    """

    n1: float
    n2: float
    k: float
    z: float
    km1: float
    km2: float


# --------------------------------------------------------------------------- scalar mathematics


@scalar
def side(hypotenuse: float, other: float) -> float:
    """Return the third side of a right-angled triangle; NaN if there is none."""
    squared = (hypotenuse - other) * (hypotenuse + other)
    return math.sqrt(squared) if squared >= 0.0 else math.nan


@scalar
def slides(
    g: Geometry, branch: Branch, x: float, z: float, beta: float
) -> tuple[float, float, float]:
    """Return s1, s3, s4: equations (12)-(14)."""
    across = math.hypot(g.e * math.cos(beta) - g.d, z + g.e * math.sin(beta))
    return (
        x - g.a + g.b1 - branch.s1 * side(g.l1, z),
        x + g.a - g.b2 - branch.s3 * side(g.l2, z),
        x - g.c - branch.s4 * side(g.l3, across),
    )


@scalar
def platform(
    g: Geometry, branch: Branch, s1: float, s3: float, s4: float
) -> tuple[float, float, float]:
    """Return x, z, beta: equations (4), (5), (10)."""
    difference = g.b1 + g.b2 - 2.0 * g.a + s3 - s1  # n1 - n2
    # With equal bars n1 + n2 = 0; where they coincide that is one of their many solutions.
    total = 0.0 if g.l1 == g.l2 else (g.l1 - g.l2) * (g.l1 + g.l2) / difference
    n1 = 0.5 * (total + difference)
    x = s1 - g.b1 + g.a + n1
    z = branch.z * side(g.l1, n1)
    k = x - g.c - s4
    sine = (g.d**2 + z**2 + g.e**2 - (g.l3 - k) * (g.l3 + k)) / (2.0 * g.e * math.hypot(g.d, z))
    bend = math.atan2(sine, branch.beta * side(1.0, sine))
    return x, z, wrapped(math.atan2(g.d, z) - bend)


@scalar
def levers(g: Geometry, q: FloatArray, closure: FloatArray) -> Levers:
    """Return the components of the bars."""
    x, z, beta = closure[0], closure[1], closure[2]
    cb, sb = math.cos(beta), math.sin(beta)
    return Levers(
        x - g.a + g.b1 - q[0],
        x + g.a - g.b2 - q[2],
        x - g.c - q[3],
        z,
        z + g.e * sb,
        g.e * (z * cb + g.d * sb),
    )


@scalar
def platform_rates(
    v: Levers, s1: float, s2: float, s3: float, s4: float
) -> tuple[float, float, float, float]:
    """Return G q', the rates of x, y, z, beta by those of the slides: equation (20)."""
    x_rate = (v.n2 * s3 - v.n1 * s1) / (v.n2 - v.n1)
    z_rate = v.n1 * v.n2 * (s1 - s3) / (v.z * (v.n2 - v.n1))
    beta_rate = (v.k * (s4 - x_rate) - v.km1 * z_rate) / v.km2
    return x_rate, s2, z_rate, beta_rate


@scalar
def slide_rates(
    v: Levers, x: float, y: float, z: float, beta: float
) -> tuple[float, float, float, float]:
    """Return the rates of the slides by those of x, y, z, beta: equation (19)."""
    return (
        x + v.z / v.n1 * z,
        y,
        x + v.z / v.n2 * z,
        x + v.km1 / v.k * z + v.km2 / v.k * beta,
    )


@scalar
def second_order(g: Geometry, v: Levers, beta: float) -> tuple[float, float, float, float, float]:
    """Return the elements of H1 (zz), H3 (zz) and H4 (zz, z beta, beta beta): (21)-(24)."""
    m1, m2 = v.km1 / v.k, v.km2 / v.k
    cb, sb = math.cos(beta), math.sin(beta)
    return (
        (v.n1**2 + v.z**2) / v.n1**3,
        (v.n2**2 + v.z**2) / v.n2**3,
        (1.0 + m1**2) / v.k,
        (m1 * m2 + g.e * cb) / v.k,
        (m2**2 + g.e * (g.d * cb - v.z * sb)) / v.k,
    )


@scalar
def bending(
    g: Geometry, v: Levers, beta: float, z_rate: float, beta_rate: float
) -> tuple[float, float, float]:
    """Return V'T H_k V' for the slides s1, s3, s4 [m/s²]; that of s2 is zero."""
    h1, h3, h4_zz, h4_zb, h4_bb = second_order(g, v, beta)
    return (
        h1 * z_rate**2,
        h3 * z_rate**2,
        h4_zz * z_rate**2 + 2.0 * h4_zb * z_rate * beta_rate + h4_bb * beta_rate**2,
    )


@scalar
def on_branch(g: Geometry, branch: Branch, v: Levers) -> bool:
    """Tell whether a posture lies strictly inside the branch, off its singularities.

    With n1 = n2 or z = 0 the slides A and B lose hold of the platform, with m2 = 0 slide C of its
    tilt; with n1, n2 or k = 0 a bar is across its rail, at the end of its reach.
    """
    return (
        v.z * branch.z > SINGULAR_BAND * g.l1
        and v.km2 * branch.beta > SINGULAR_BAND * g.e * g.l3
        and v.n1 * branch.s1 > SINGULAR_BAND * g.l1
        and v.n2 * branch.s3 > SINGULAR_BAND * g.l2
        and v.k * branch.s4 > SINGULAR_BAND * g.l3
        and abs(v.n1 - v.n2) > SINGULAR_BAND * (g.l1 + g.l2)
    )


@scalar
def passive_state(g: Geometry, v: Levers, closure: FloatArray, state: FloatArray) -> None:
    """Fill the state of the passive joints, in the order of `GantryHybrid.excursions`."""
    x, z, beta = closure[0], closure[1], closure[2]
    rod_y = g.e * math.cos(beta) - g.d
    along = math.atan2(v.km1, rod_y)
    state[0] = math.atan2(z, v.n1)
    state[1] = math.atan2(z, v.n2)
    state[2] = beta
    state[3] = along
    state[4] = along - beta
    state[5] = math.atan2(v.k, math.hypot(rod_y, v.km1))
    state[6], state[7], state[8] = shaft_state(g.ee, g.ee_prime, x, z, beta)


@scalar
def excursion(state: FloatArray, rest: FloatArray, joint: int) -> float:
    """Return how far a passive joint is from its rest."""
    difference = state[joint] - rest[joint]
    return wrapped(difference) if joint < ANGLE_COUNT else difference


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
    v = levers(g, q, closure)
    if not on_branch(g, branch, v):
        return SINGULAR
    for i in range(4):
        if not within(q[i], limits[i]):
            return JOINT_LIMIT
    state = np.empty(PASSIVE_COUNT)
    passive_state(g, v, closure, state)
    for i in range(PASSIVE_COUNT):
        if not within(excursion(state, rest, i), passive_limits[i]):
            return PASSIVE_JOINT_LIMIT
    return OK


@scalar
def all_finite(vector: FloatArray) -> bool:
    """Tell whether the four elements of a vector are finite."""
    return (
        math.isfinite(vector[0])
        and math.isfinite(vector[1])
        and math.isfinite(vector[2])
        and math.isfinite(vector[3])
    )


# --------------------------------------------------------------------------- kernels


@scalar
def slides_of_platform(
    g: Geometry, branch: Branch, task: FloatArray, q: FloatArray, closure: FloatArray
) -> bool:
    """Fill slides and closure of a platform position; return whether it is within reach."""
    x, y, z, beta = task[0], task[1], task[2], wrapped(task[3])
    s1, s3, s4 = slides(g, branch, x, z, beta)
    if not math.isfinite(s1 + s3 + s4):
        return False
    q[0], q[1], q[2], q[3] = s1, y, s3, s4
    closure[0], closure[1], closure[2] = x, z, beta
    return True


@scalar
def platform_of_slides(
    g: Geometry, branch: Branch, q: FloatArray, task: FloatArray, closure: FloatArray
) -> bool:
    """Fill platform position and closure of slides; return whether the bars reach."""
    x, z, beta = platform(g, branch, q[0], q[2], q[3])
    if not math.isfinite(x + z + beta):
        return False
    task[0], task[1], task[2], task[3] = x, q[1], z, beta
    closure[0], closure[1], closure[2] = x, z, beta
    return True


@points_kernel(
    "(g),(b),(p),(4,2),(p,2),(points,4)->(points,4),(points,3),(points)",
    "f8 f8 f8 f8 f8 f8 f8 f8 u1",
)
def _inverse(geometry, signs, rest, limits, passive_limits, task, q, closure, status):  # type: ignore[no-untyped-def]
    """Platform position to slides and closure."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    branch = Branch(*to_fixed_tuple(signs, 5))
    for i in range(len(task)):
        q[i] = math.nan
        closure[i] = math.nan
        if not all_finite(task[i]):
            status[i] = INVALID_INPUT
        elif not slides_of_platform(g, branch, task[i], q[i], closure[i]):
            status[i] = UNREACHABLE
        else:
            status[i] = status_of_point(g, branch, rest, limits, passive_limits, q[i], closure[i])


@points_kernel(
    "(g),(b),(p),(4,2),(p,2),(points,4)->(points,4),(points,3),(points)",
    "f8 f8 f8 f8 f8 f8 f8 f8 u1",
)
def _forward(geometry, signs, rest, limits, passive_limits, q, task, closure, status):  # type: ignore[no-untyped-def]
    """Slides to platform position and closure."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    branch = Branch(*to_fixed_tuple(signs, 5))
    for i in range(len(q)):
        task[i] = math.nan
        closure[i] = math.nan
        if not all_finite(q[i]):
            status[i] = INVALID_INPUT
        elif not platform_of_slides(g, branch, q[i], task[i], closure[i]):
            status[i] = UNREACHABLE
        else:
            status[i] = status_of_point(g, branch, rest, limits, passive_limits, q[i], closure[i])


@kernel("(g),(n),(c)->(n,n)", "f8[:], f8[:], f8[:], f8[:,:]")
def _jacobian(geometry, q, closure, jacobian):  # type: ignore[no-untyped-def]
    """Equation (20), column by column."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    v = levers(g, q, closure)
    unit = np.zeros(4)
    for i in range(4):
        unit[:] = 0.0
        unit[i] = 1.0
        column = platform_rates(v, unit[0], unit[1], unit[2], unit[3])
        jacobian[0, i], jacobian[1, i], jacobian[2, i], jacobian[3, i] = column


@kernel("(g),(n),(c)->(n,n)", "f8[:], f8[:], f8[:], f8[:,:]")
def _inverse_jacobian(geometry, q, closure, jacobian):  # type: ignore[no-untyped-def]
    """Equation (19), column by column."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    v = levers(g, q, closure)
    unit = np.zeros(4)
    for i in range(4):
        unit[:] = 0.0
        unit[i] = 1.0
        column = slide_rates(v, unit[0], unit[1], unit[2], unit[3])
        jacobian[0, i], jacobian[1, i], jacobian[2, i], jacobian[3, i] = column


@kernel("(g),(n),(c)->(n,n,n)", "f8[:], f8[:], f8[:], f8[:,:,:]")
def _influence(geometry, q, closure, influence):  # type: ignore[no-untyped-def]
    """H_k by slide k; H2 is zero."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    h1, h3, h4_zz, h4_zb, h4_bb = second_order(g, levers(g, q, closure), closure[2])
    influence[:] = 0.0
    influence[0, 2, 2], influence[2, 2, 2] = h1, h3
    influence[3, 2, 2], influence[3, 3, 3] = h4_zz, h4_bb
    influence[3, 2, 3], influence[3, 3, 2] = h4_zb, h4_zb
    for i in range(4):  # a posture without an answer has none in its zeros either
        for j in range(4):
            for k in range(4):
                influence[i, j, k] += 0.0 * closure[0]


@kernel(
    "(g),(n),(c),(n),(n)->(n)",
    "f8[:], f8[:], f8[:], f8[:], f8[:], f8[:]",
)
def _acceleration(geometry, q, closure, velocities, accelerations, result):  # type: ignore[no-untyped-def]
    """Equation (26), corrected."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    v = levers(g, q, closure)
    _, _, z, beta = platform_rates(v, velocities[0], velocities[1], velocities[2], velocities[3])
    bend_1, bend_3, bend_4 = bending(g, v, closure[2], z, beta)
    result[0], result[1], result[2], result[3] = platform_rates(
        v,
        accelerations[0] - bend_1,
        accelerations[1],
        accelerations[2] - bend_3,
        accelerations[3] - bend_4,
    )


@kernel(
    "(g),(n),(c),(n),(n)->(n)",
    "f8[:], f8[:], f8[:], f8[:], f8[:], f8[:]",
)
def _inverse_acceleration(geometry, q, closure, velocities, accelerations, result):  # type: ignore[no-untyped-def]
    """Equation (25)."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    v = levers(g, q, closure)
    bend_1, bend_3, bend_4 = bending(g, v, closure[2], velocities[2], velocities[3])
    s1, s2, s3, s4 = slide_rates(
        v, accelerations[0], accelerations[1], accelerations[2], accelerations[3]
    )
    result[0], result[1], result[2], result[3] = s1 + bend_1, s2, s3 + bend_3, s4 + bend_4


@kernel("(g),(n),(c),(p)->(p)", "f8[:], f8[:], f8[:], f8[:], f8[:]")
def _excursions(geometry, q, closure, rest, excursions):  # type: ignore[no-untyped-def]
    """State of the passive joints less that at rest."""
    g = Geometry(*to_fixed_tuple(geometry, GEOMETRY_SIZE))
    state = np.empty(PASSIVE_COUNT)
    passive_state(g, levers(g, q, closure), closure, state)
    for joint in range(PASSIVE_COUNT):
        excursions[joint] = excursion(state, rest, joint)


# --------------------------------------------------------------------------- mechanism

FLIPPABLE = Branch._fields

# Which of `passive_state` each passive joint measures, and in which sense.
PIN_STATES = [0, 0, 1, 1, 2, 3, 5, 5, 4, 8]
PIN_SENSES = np.array([1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 1.0])


def _range_deg(lower: float, upper: float) -> tuple[float, float]:
    return math.radians(lower), math.radians(upper)


@dataclass(frozen=True)
class GantryHybrid(Weighed):
    """The gantry manipulator; defaults are the dimensions of the paper's example.

    Joint positions are the displacements s1, s2, s3, s4 of the slides A, E, B, C. The "foot
    position" is that of the platform: x, y, z of O'' in the leg frame and its tilt beta about X.

    Raises:
        GeometryError: If a dimension is impossible, or the posture with all slides at zero cannot
            be assembled or is singular.
    """

    name: ClassVar[str] = "gantry_hybrid"
    joints: ClassVar[tuple[Joint, ...]] = tuple(
        Joint(n, "prismatic") for n in ("s1", "s2", "s3", "s4")
    )
    passive_joints: ClassVar[tuple[Joint, ...]] = (
        *(Joint("bar_a_slide"), Joint("bar_a_hinge"), Joint("bar_b_slide"), Joint("bar_b_hinge")),
        *(Joint("platform_hinge"), Joint("rod_slide_along"), Joint("rod_slide_across")),
        *(Joint("rod_platform_across"), Joint("rod_platform_along")),
        Joint("shaft_sleeve", "prismatic"),
    )
    excursions: ClassVar[tuple[Excursion, ...]] = (
        *(Excursion("bar_a"), Excursion("bar_b"), Excursion("platform_hinge")),
        *(Excursion("rod_slide_along"), Excursion("rod_platform_along"), Excursion("rod_across")),
        *(Excursion("shaft_base_bend"), Excursion("shaft_platform_bend")),
        Excursion("shaft_sleeve", "length"),
    )
    closure_names: ClassVar[tuple[str, ...]] = ("platform_x", "platform_z", "platform_tilt")
    assembly_modes: ClassVar[tuple[str, ...]] = flipped_modes("initial", FLIPPABLE)
    task_coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "z", "beta")
    task_units: ClassVar[tuple[str, ...]] = ("m", "m", "m", "rad")

    platform_half_width: float = parameter("platform's middle O'' to A' and B'", "a", "length", 0.1)
    slide_a_start: float = parameter("distance O' A with s1 = 0", "b1", "length", 0.15025)
    slide_b_start: float = parameter("distance O' B with s3 = 0", "b2", "length", 0.15025)
    slide_c_start: float = offset("X of C from D with s4 = 0", "c", 0.10308)
    rail_c_left: float = offset("Y of the rail D C", "d", 0.200)
    platform_arm: float = parameter("platform's middle O'' to C'", "e", "length", 0.150)
    shaft_base_left: float = offset("Y of the shaft's joint F on the carriage", "ee", 0.100)
    shaft_platform_left: float = offset("Y'' of the shaft's joint F' on it", "ee'", 0.080)
    bar_a_length: float = parameter("bar A' A''", "L1", "length", 0.255)
    bar_b_length: float = parameter("bar B' B''", "L2", "length", 0.255)
    rod_c_length: float = parameter("rod C' C''", "L3", "length", 0.275)

    joint_ranges: tuple[tuple[float, float], ...] = (
        *((-0.150, 0.150), (-0.200, 0.200)),
        *((-0.150, 0.150), (-0.150, 0.150)),
    )
    passive_joint_ranges: tuple[tuple[float, float], ...] = (
        *(_range_deg(-60.0, 60.0), _range_deg(-60.0, 60.0), _range_deg(-45.0, 45.0)),
        *(_range_deg(-60.0, 60.0), _range_deg(-60.0, 60.0), _range_deg(-60.0, 60.0)),
        *(_range_deg(-10.0, 40.0), _range_deg(-10.0, 40.0)),
        (-0.150, 0.050),
    )
    bar_masses: tuple[BarMass, ...] = ()

    def __post_init__(self) -> None:
        """Check the dimensions by assembling the posture with all slides at zero."""
        self.check_fields()
        if not all(map(math.isfinite, self._initial_closure)):
            bars = "bar_a_length (L1), bar_b_length (L2), slide_a_start (b1), slide_b_start (b2)"
            rod = "rod_c_length (L3), slide_c_start (c), rail_c_left (d), platform_arm (e)"
            raise GeometryError(
                "with all slides at zero the bars do not reach the platform: change "
                f"{bars}, platform_half_width (a) or {rod}"
            )
        if self.initial_posture.status == SINGULAR:
            raise GeometryError(
                "the posture with all slides at zero is singular: change platform_half_width (a), "
                "slide_a_start (b1), slide_b_start (b2) or slide_c_start (c)"
            )

    @cached_property
    def auxiliary_chain(self) -> AuxiliaryChain:
        """The shaft that turns a tool on the platform."""
        return AuxiliaryChain(self.shaft_base_left, self.shaft_platform_left)

    @cached_property
    def _initial_closure(self) -> FloatArray:
        """x, z, beta with all slides at zero, z > 0 and the printed sign of (10)."""
        any_rest = np.zeros(PASSIVE_COUNT)
        limits = (self.joint_limits, self.passive_joint_limits)
        signs = np.ones(len(Branch._fields))
        closure: FloatArray = _forward(self._geometry, signs, any_rest, *limits, np.zeros(4))[1]
        return closure

    @cached_property
    def _signs(self) -> FloatArray:
        """Branch signs of the initial posture; 0 where it is singular."""
        v = levers(Geometry(*self._geometry), np.zeros(4), self._initial_closure)
        return np.array([1.0, 1.0, *np.sign([v.n1, v.n2, v.k])])

    @cached_property
    def _rest(self) -> FloatArray:
        """State of the passive joints in the initial posture."""
        none = np.zeros(PASSIVE_COUNT)
        rest: FloatArray = _excursions(self._geometry, np.zeros(4), self._initial_closure, none)
        return rest

    def _branch(self, assembly_mode: str) -> FloatArray:
        """Return the branch signs of an assembly mode."""
        return self._signs * mode_signs(self, assembly_mode, FLIPPABLE)

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
        """The posture with all slides at zero."""
        return self.forward(np.zeros(4))

    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the platform, in closed form: (1), (4), (5), (10).

        Args:
            joint_positions: Slides s1, s2, s3, s4 (..., 4) [m].
            assembly_mode: One of `assembly_modes`; "" is "initial". Its "z" and "beta" select the
                solution; one whose bars lean to the other side is SINGULAR.

        Returns:
            The posture; NaN where the bars do not reach the platform.
        """
        q = as_array("joint_positions", joint_positions, 4)
        task, closure, status = _forward(*self._parameters(assembly_mode), q)
        return Posture(q, closure, task, status)

    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the slides, in closed form: (11)-(14).

        Args:
            foot_position: Platform x, y, z, beta in the leg frame (..., 4) [m, m, m, rad].
            assembly_mode: One of `assembly_modes`; "" is "initial". Its "s1", "s3" and "s4" select
                the solution; a platform on the other side of the carriage, or tilted beyond the
                branch of (10), is SINGULAR. So is every pose of a mode that leans bars of equal
                length to one side: they move in parallel.

        Returns:
            The posture; NaN where the platform is out of reach.
        """
        task = as_array("foot_position", foot_position, 4)
        q, closure, status = _inverse(*self._parameters(assembly_mode), task)
        return Posture(q, closure, task, status)

    def jacobian(self, posture: Posture) -> FloatArray:
        """J of V = J q', the rates of x, y, z, beta (..., 4, 4) [1, last row rad/m]: (20)."""
        jacobian: FloatArray = _jacobian(self._geometry, posture.joint_positions, posture.closure)
        return jacobian

    def inverse_jacobian(self, posture: Posture) -> FloatArray:
        """G of q' = G V (..., 4, 4) [1, last column m/rad]; equation (19)."""
        jacobian: FloatArray = _inverse_jacobian(
            self._geometry, posture.joint_positions, posture.closure
        )
        return jacobian

    def second_order_influence(self, posture: Posture) -> FloatArray:
        """H_k of q_k'' = V^T H_k V + (G V')_k by slide k (..., 4, 4, 4); (21)-(24)."""
        influence: FloatArray = _influence(self._geometry, posture.joint_positions, posture.closure)
        return influence

    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of the platform's angular velocity, beta' about X (..., 3, 4) [rad/m]."""
        tilt = self.jacobian(posture)[..., 3, :]
        none = np.where(np.isnan(tilt), np.nan, 0.0)
        return np.stack([tilt, none, none], axis=-2)

    def acceleration(
        self, posture: Posture, joint_velocities: ArrayLike, joint_accelerations: ArrayLike
    ) -> FloatArray:
        """Second derivatives of x, y, z, beta (..., 4) [m/s², rad/s²]; (26), corrected.

        Args:
            posture: The posture (...).
            joint_velocities: Of the slides (..., 4) [m/s].
            joint_accelerations: Of the slides (..., 4) [m/s²].
        """
        rates = _rates(posture, "joint", joint_velocities, joint_accelerations)
        result: FloatArray = _acceleration(
            self._geometry, posture.joint_positions, posture.closure, *rates
        )
        return result

    def inverse_acceleration(
        self, posture: Posture, task_velocities: ArrayLike, task_accelerations: ArrayLike
    ) -> FloatArray:
        """Accelerations of the slides (..., 4) [m/s²]; equation (25).

        Args:
            posture: The posture (...).
            task_velocities: Rates of x, y, z, beta (..., 4) [m/s, rad/s].
            task_accelerations: Their second derivatives (..., 4) [m/s², rad/s²].
        """
        rates = _rates(posture, "task", task_velocities, task_accelerations)
        result: FloatArray = _inverse_acceleration(
            self._geometry, posture.joint_positions, posture.closure, *rates
        )
        return result

    def passive_joint_positions(self, posture: Posture) -> FloatArray:
        """Angles of the bars and rod at their ends, length of the shaft (..., 10) [rad, last m].

            bar_a_slide, bar_b_slide      at A'', B'': from X to the bar, towards Z
            bar_a_hinge, bar_b_hinge      at A', B': from the bar to X, in the same sense
            platform_hinge                beta
            rod_slide_along               at C'', about X: from Y to the rod's projection
            rod_slide_across              at C'': from there to the rod, towards X
            rod_platform_across           at C': from the rod back into the plane across X
            rod_platform_along            at C', about X: from the arm O''C' to the rod's projection
            shaft_sleeve                  F F'

        The forks of the auxiliary shaft turn with its input, which is no joint of the mechanism.
        """
        state = self._rest + self.passive_joint_excursions(posture)
        return state[..., PIN_STATES] * PIN_SENSES

    def passive_joint_excursions(self, posture: Posture) -> FloatArray:
        """Excursions of the passive joints from the initial posture (..., 9) [rad, last m].

        Inclinations of the bars A and B, which the pins at both their ends share; the hinge A'B' of
        the platform (beta); the rod's universal joints, by the outer axes at C'' and at C' (along
        X) and the inner ones, which are parallel (across); the bends phi_1, phi_2 of the auxiliary
        shaft's universal joints at F and F' and its length.
        """
        excursions: FloatArray = _excursions(
            self._geometry, posture.joint_positions, posture.closure, self._rest
        )
        return excursions

    def body_tree(self, assembly_mode: str = "") -> LegTree:
        """Slides, bars, rod and platform, cut at B' and at C', in any mode.

        The auxiliary shaft, which holds nothing, is left out.
        """
        self.mode_index(assembly_mode)
        return self._tree

    @cached_property
    def _tree(self) -> LegTree:
        x, y = np.eye(3)[:2]
        linkage = self.linkage(self.initial_posture)
        rod = linkage.point("C'") - linkage.point("C''")
        across = np.cross(rod, x)
        joints = (
            PlacedJoint("s2", "", "O'", y),
            PlacedJoint("s1", "s2", "A''", x),
            PlacedJoint("s3", "s2", "B''", x),
            PlacedJoint("s4", "s2", "C''", x),
            PlacedJoint("bar_a_slide", "s1", "A''", -y),
            PlacedJoint("bar_b_slide", "s3", "B''", -y),
            PlacedJoint("bar_a_hinge", "bar_a_slide", "A'", -y),
            PlacedJoint("platform_hinge", "bar_a_hinge", "O''", x),
            PlacedJoint("rod_slide_along", "s4", "C''", x),
            PlacedJoint("rod_slide_across", "rod_slide_along", "C''", across),
            PlacedJoint("rod_platform_across", "rod_slide_across", "C'", across),
        )
        meetings = (
            Meeting("B'", "bar_b_slide", "bar_a_hinge"),
            Meeting("C'", "rod_platform_across", "platform_hinge", x),
        )
        return tree_of(self, self.initial_posture, joints, meetings, ("O''", "platform_hinge"))

    def linkage(self, posture: Posture) -> Linkage:
        """Points of the manipulator in the leg frame and the bars between them.

        A, B, C are where the slides stand at zero, O the leg frame's origin; O A'' and its like
        show the displacements. F F' is the auxiliary shaft.
        """
        g = Geometry(*self._geometry)
        s1, s2, s3, s4 = np.moveaxis(posture.joint_positions, -1, 0)
        x, z, beta = np.moveaxis(posture.closure, -1, 0)
        cosine, sine = np.cos(beta), np.sin(beta)

        def point(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> FloatArray:
            """Return a point given on the carriage, in the leg frame."""
            return np.stack(np.broadcast_arrays(x, s2 + y, z), axis=-1)

        def on_platform(across: float, forward: float) -> FloatArray:
            return point(x + across, forward * cosine, z + forward * sine)

        points = {
            "O": np.zeros_like(point(0.0, 0.0, 0.0)),
            "O'": point(0.0, 0.0, 0.0),
            "D": point(0.0, g.d, 0.0),
            "A": point(-g.b1, 0.0, 0.0),
            "B": point(g.b2, 0.0, 0.0),
            "C": point(g.c, g.d, 0.0),
            "A''": point(s1 - g.b1, 0.0, 0.0),
            "B''": point(s3 + g.b2, 0.0, 0.0),
            "C''": point(s4 + g.c, g.d, 0.0),
            "A'": on_platform(-g.a, 0.0),
            "B'": on_platform(g.a, 0.0),
            "C'": on_platform(0.0, g.e),
            "O''": on_platform(0.0, 0.0),
            "F": point(0.0, g.ee, 0.0),
            "F'": on_platform(0.0, g.ee_prime),
        }
        names = tuple(points)
        bars = (
            *(("O", "O'"), ("A", "A''"), ("B", "B''"), ("C", "C''")),
            *(("A", "O'", "B"), ("O'", "F", "D", "C")),
            *(("A''", "A'"), ("B''", "B'"), ("C''", "C'")),
            *(("A'", "O''", "B'", "C'", "A'"), ("O''", "F'", "C'")),
            ("F", "F'"),
        )
        return Linkage(
            names,
            np.stack(list(points.values()), axis=-2),
            tuple(tuple(names.index(n) for n in bar) for bar in bars),
        )


def _rates(
    posture: Posture, kind: str, velocities: ArrayLike, accelerations: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return velocities and accelerations that fit a posture."""
    batch = posture.closure.shape[:-1]
    v = as_matching(f"{kind}_velocities", velocities, (4,), batch)
    batch = np.broadcast_shapes(batch, v.shape[:-1])
    return v, as_matching(f"{kind}_accelerations", accelerations, (4,), batch)
