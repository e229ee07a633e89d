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
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array, has_code, wrapped_angles
from leg_kinematics.assembly_modes import flipped_modes, mode_signs
from leg_kinematics.bodies import LegTree
from leg_kinematics.errors import GeometryError
from leg_kinematics.geometry import offset, parameter
from leg_kinematics.kernels.scalars import direction
from leg_kinematics.kernels.settled import UNCERTAIN, settled
from leg_kinematics.mechanism import Excursion, Joint, Linkage, Posture
from leg_kinematics.mechanisms import parallel_drive_kernels as kernels
from leg_kinematics.mechanisms.parallel_drive_equations import (
    Geometry,
    Pose,
    axis_angles,
    closure_angles,
    gradients,
    in_platform,
    pantograph_of_drive,
    platform_bend,
    pose_of_directions,
    symmetric_elevation,
)
from leg_kinematics.mechanisms.walking_axes import leg_vectors
from leg_kinematics.mechanisms.weighed import BarMass, Weighed
from leg_kinematics.placed_joints import Meeting, PlacedJoint, tree_of

ACROSS, CONES = [1, 3, 5], [6, 7, 8]  # passive joints told by a sine and by a chord
RANGE = math.radians(21.0)
PASSIVE_RANGE = math.radians(45.0)
FLIPPABLE = ("knee", "center", "crank_1", "crank_2")
FORWARD, RIGHT = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])  # in the leg frame
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
class ParallelDrive(Weighed):
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
    bar_masses: tuple[BarMass, ...] = ()

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
    def _known_parameters(self) -> dict[int, FloatArray]:
        return {}

    def _parameters(self, assembly_mode: str) -> FloatArray:
        """Return all that the kernels know of the leg in one array, kept for the next call."""
        mode = self.mode_index(assembly_mode)
        if mode not in self._known_parameters:
            limits = np.concatenate([self.joint_limits, self._passive_bounds])
            self._known_parameters[mode] = np.concatenate(
                [self._geometry, self._branch(assembly_mode), self._rest, limits.ravel()]
            )
        return self._known_parameters[mode]

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
        results = kernels.forward(parameters, q)
        if has_code(results[1], UNCERTAIN):
            search = partial(kernels.forward_search, parameters)
            results = settled(results, results[1] == UNCERTAIN, search, (q, 1))
        coordinates, status = results
        return Posture(q, coordinates[..., 3:], coordinates[..., :3], status)

    def forward_with_twist(
        self, joint_positions: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`forward` and `twist_jacobian` in one pass."""
        q = as_array("joint_positions", joint_positions, 3)
        parameters = self._parameters(assembly_mode)
        results = kernels.forward_with_twist(parameters, q)
        if has_code(results[1], UNCERTAIN):
            search = partial(kernels.forward_search_with_twist, parameters)
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
        coordinates, status = kernels.inverse(self._parameters(assembly_mode), foot)
        return Posture(coordinates[..., :3], coordinates[..., 3:], foot, status)

    def inverse_with_twist(
        self, foot_position: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`inverse` and `twist_jacobian` in one pass, for half the price."""
        foot = as_array("foot_position", foot_position, 3)
        coordinates, status, twist = kernels.inverse_with_twist(
            self._parameters(assembly_mode), foot
        )
        return Posture(coordinates[..., :3], coordinates[..., 3:], foot, status), twist

    def jacobian(self, posture: Posture) -> FloatArray:
        """J of the foot's velocity, v = J q' (..., 3, 3) [m/rad]; equation (1)."""
        return self.twist_jacobian(posture)[..., :3, :]

    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of the shank's angular velocity, omega = J_omega q' (..., 3, 3); equation (2)."""
        return self.twist_jacobian(posture)[..., 3:, :]

    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """J above J_omega (..., 6, 3), in one pass."""
        twist: FloatArray = kernels.twist(self._geometry, posture.joint_positions, posture.closure)
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
        measures = kernels.passive(
            self._geometry, self._rest, posture.joint_positions, posture.closure
        )
        angles = measures.copy()
        angles[..., ACROSS] = np.arcsin(measures[..., ACROSS]) - self._across_rest
        angles[..., CONES] = 2.0 * np.arcsin(0.5 * np.sqrt(measures[..., CONES]))
        return angles

    def body_tree(self, assembly_mode: str = "") -> LegTree:
        """Cranks, rods, platform and pantograph, cut at S1, S2, S and R2, in any mode.

        A universal joint is two joints with a cross between them.
        """
        self.mode_index(assembly_mode)
        return self._tree

    @cached_property
    def _tree(self) -> LegTree:
        linkage = self.linkage(self.initial_posture)
        hip, thigh, link = (linkage.point(name) for name in ("H", "R1", "R2"))
        plane = np.cross(link - thigh, hip - thigh)
        plane = plane * np.sign(plane @ RIGHT)
        joints = []
        for k, end in (("1", "S1"), ("2", "S2"), ("3", "G")):
            along = linkage.point(end) - linkage.point(f"U{k}")
            joints += [
                PlacedJoint(f"crank_{k}", "", f"R_D{k}", RIGHT),
                PlacedJoint(f"u{k}_along", f"crank_{k}", f"U{k}", RIGHT),
                PlacedJoint(f"u{k}_across", f"u{k}_along", f"U{k}", np.cross(along, RIGHT)),
            ]
        joints += [
            PlacedJoint("hip_swing", "", "H", FORWARD),
            PlacedJoint("hip_thigh", "hip_swing", "H", plane),
            PlacedJoint("r1", "hip_thigh", "R1", plane),
            PlacedJoint("r3", "hip_thigh", "R3", plane),
            PlacedJoint("r5", "r3", "R5", plane),
        ]
        meetings = (
            Meeting("S1", "u1_across", "u3_across"),
            Meeting("S2", "u2_across", "u3_across"),
            Meeting("S", "u3_across", "r1"),
            Meeting("R2", "r1", "r5"),
        )
        return tree_of(self, self.initial_posture, joints, meetings, ("C", "r5"))

    def constraint_jacobian(self, posture: Posture) -> FloatArray:
        """J_c of the drive's constraint wrenches (..., 3, 6): equations (8), (12), (13).

        Rows are the constraint wrenches of the RU limb at G, a force part (3) [1] then a moment
        part (3) [1 for the first row, m for the others]: a pure moment about
        n1 = s_q2 x s_q3 and two forces through U3 along s_q2 (to the right) and
        n2 = (s_q1 x n3) x s_q2 = n3, the direction of the centre crank.
        """
        jacobian = kernels.constraint_jacobian(
            self._geometry, posture.joint_positions, posture.closure
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
