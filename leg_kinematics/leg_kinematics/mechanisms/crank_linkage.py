# SPDX-License-Identifier: Apache-2.0
"""What planar legs driven by one crank have in common, whatever bars follow the crank.

The linkage is computed in its own plane and in crank lengths: crank axis A at the origin, X and Y
as papers draw them (Y up, the foot below), the crank turning counter-clockwise. The leg frame has
its origin at A too, with x = -X and z = Y, because a foot on the ground then moves towards -x when
the crank turns forwards: the leg walks along +x. The crank's axis is +y of the leg frame.

A mechanism adds its geometry, its `sides`, numbers whose signs tell the assembly (see `dyads`), and
the points that follow from them, of which `crank_kernels` makes its kernels. A posture's closure is
such numbers, the `across` coefficient of each dyad.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from itertools import product
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arrays import FloatArray, as_array, as_matching, wrapped_angles
from leg_kinematics.bodies import LegTree
from leg_kinematics.errors import GeometryError
from leg_kinematics.kernels.scalars import LIMIT_TOLERANCE
from leg_kinematics.mechanism import Joint, Linkage, Posture
from leg_kinematics.mechanisms.crank_kernels import Kernels, near_brackets
from leg_kinematics.mechanisms.weighed import Weighed
from leg_kinematics.placed_joints import Meeting, PlacedJoint, tree_of
from leg_kinematics.status import Status

OK, UNREACHABLE, JOINT_LIMIT, PASSIVE_JOINT_LIMIT, SINGULAR, INVALID_INPUT = map(int, Status)

TURN = 2.0 * math.pi
ANY_ANGLE = (-math.pi, math.pi)  # a range of a whole turn or more is no limit
CURVE_SAMPLES = 720  # of the foot curve, between which passes of the foot are refined
REFINEMENTS = 60


class Dyad(NamedTuple):
    """Two bars that meet in a joint: names of points and of the geometry's fields."""

    joint: str
    ends: tuple[str, str]
    bars: tuple[str, str]


class Triangle(NamedTuple):
    """A rigid triangle p, q, tip: its points and the fields of the sides p-q, p-tip, q-tip."""

    points: tuple[str, str, str]
    sides: tuple[str, str, str]


class Pivot(NamedTuple):
    """A passive joint at a point: the angle from one bar to another, by their far ends."""

    name: str
    point: str
    first: str
    second: str


class Passes(NamedTuple):
    """Crank angles at which the foot passes a point, nearest first; NaN beyond the last.

    Attributes:
        crank_angles: (..., 8) [rad].
        distances: Distance of the foot from the point (..., 8) [m].
    """

    crank_angles: FloatArray
    distances: FloatArray


def mode_sides(walking: Sequence[float]) -> FloatArray:
    """Return the sides of every mode of `flipped_modes` (modes, parts)."""
    flips = product((1.0, -1.0), repeat=len(walking))
    return np.array(list(flips), dtype=np.float64) * np.asarray(walking)


def _direction(vectors: FloatArray) -> FloatArray:
    """Return the direction of vectors (..., 3) in the linkage's plane, whose X is -x [rad]."""
    return np.arctan2(vectors[..., 2], -vectors[..., 0])


class CrankLinkage(Weighed):
    """Base of the mechanisms with one crank; a subclass is a frozen dataclass of its geometry.

    A range of a joint that spans a whole turn or more does not limit it: the joint turns endlessly,
    and inverse answers are given within one turn about the middle of the range.
    """

    name: ClassVar[str]
    joints: ClassVar[tuple[Joint, ...]] = (Joint("crank"),)
    passive_joints: ClassVar[tuple[Joint, ...]]
    closure_names: ClassVar[tuple[str, ...]]
    assembly_modes: ClassVar[tuple[str, ...]]

    sides: ClassVar[FloatArray]  # of every assembly mode
    kernels: ClassVar[Kernels]
    point_names: ClassVar[tuple[str, ...]]
    dyads: ClassVar[tuple[Dyad, ...]]
    triangles: ClassVar[tuple[Triangle, ...]]
    pivots: ClassVar[tuple[Pivot, ...]]
    crank_points: ClassVar[tuple[str, ...]] = ("A", "B")  # points of the crank's body
    bars: ClassVar[tuple[tuple[str, ...], ...]]

    placed: ClassVar[tuple[tuple[str, str, str], ...]]  # joints of the tree, see `PlacedJoint`
    meetings: ClassVar[tuple[Meeting, ...]]  # where its loops are cut

    crank: ClassVar[float] = 1.0  # A B, the unit of all ratios

    crank_length: float
    crank_zero: float
    reach_tolerance: float
    joint_ranges: tuple[tuple[float, float], ...]
    passive_joint_ranges: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        """Check the dimensions by assembling the posture with the crank at zero."""
        self.check_fields()
        for triangle in self.triangles:
            a, b, c = sorted(getattr(self, field) for field in triangle.sides)
            if a + b < c * (1.0 - 1e-9):
                sides = ", ".join(f"{field} = {getattr(self, field)}" for field in triangle.sides)
                raise GeometryError(
                    f"the rigid triangle {'-'.join(triangle.points)} does not close: {sides}; "
                    "each must be <= the sum of the other two"
                )
        self._check_initial_posture()

    def _check_initial_posture(self) -> None:
        _, _, status = self._solve(np.zeros(1), self.sides[0])
        if status == SINGULAR:
            raise GeometryError("the posture with the crank at zero is singular")
        if status != UNREACHABLE:
            return
        points = dict(zip(self.point_names, self._points(np.zeros(1), self.sides[0]), strict=True))
        for dyad in self.dyads:
            if np.isnan(points[dyad.joint]).any():
                first, second = dyad.bars
                distance = np.linalg.norm(points[dyad.ends[0]] - points[dyad.ends[1]])
                raise GeometryError(
                    f"with the crank at zero the bars {first} = {getattr(self, first)} and "
                    f"{second} = {getattr(self, second)} do not meet in {dyad.joint}: their ends "
                    f"{' and '.join(dyad.ends)} are {distance / self.crank_length:.6g} crank "
                    "lengths apart"
                )
        raise GeometryError("the lengths are too large or too small to compute with")

    @cached_property
    def initial_posture(self) -> Posture:
        """The posture with the crank at zero."""
        return self.forward(np.zeros(1))

    @cached_property
    def _constants(self) -> FloatArray:
        constants: FloatArray = self.kernels.constants(self._geometry)
        return constants

    def _sides(self, assembly_mode: str) -> FloatArray:
        sides: FloatArray = self.sides[self.mode_index(assembly_mode)]
        return sides

    def _solve(self, q: FloatArray, sides: FloatArray) -> Any:
        return self.kernels.forward(self._constants, sides, self.joint_limits[0], q)

    def _points(self, q: FloatArray, sides: FloatArray) -> Any:
        return self.kernels.points(self._constants, sides, q)

    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the foot, in closed form.

        Args:
            joint_positions: Crank angle about its zero (..., 1) [rad].
            assembly_mode: One of `assembly_modes`; "" is "walking".

        Returns:
            The posture; NaN where the bars do not close.
        """
        q = as_array("joint_positions", joint_positions, 1)
        foot, closure, status = self._solve(q, self._sides(assembly_mode))
        posture = Posture(q, closure, foot, status)
        limited = self._limited_excursions
        if limited.any():
            excursions = self.passive_joint_excursions(posture)[..., limited]
            lower, upper = self.passive_joint_limits[limited].T
            outside = (excursions < lower - LIMIT_TOLERANCE) | (
                excursions > upper + LIMIT_TOLERANCE
            )
            exceeded = (status == OK) & outside.any(axis=-1)
            posture = posture._replace(
                status=np.where(exceeded, np.uint8(PASSIVE_JOINT_LIMIT), status)
            )
        return posture

    @property
    def _limited_excursions(self) -> NDArray[np.bool_]:
        """Which passive joints have limits (p,)."""
        return np.asarray(np.ptp(self.passive_joint_limits, axis=-1) < TURN - LIMIT_TOLERANCE)

    @property
    def _is_limited(self) -> bool:
        """Whether any joint has limits."""
        turns = np.ptp(self.joint_limits[0]) >= TURN - LIMIT_TOLERANCE
        return not turns or bool(self._limited_excursions.any())

    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the crank angle at which the foot passes nearest to a position.

        Within limits it is the nearest pass that keeps them, if one is within `reach_tolerance`.

        Args:
            foot_position: Wanted foot in the leg frame (..., 3) [m].
            assembly_mode: One of `assembly_modes`; "" is "walking".

        Returns:
            The posture with the foot where the crank brings it; NaN and UNREACHABLE where that is
            farther than `reach_tolerance` from the wanted position.
        """
        foot = as_array("foot_position", foot_position, 3)
        passes = self.nearest_crank_angles(foot, assembly_mode)
        reached = passes.distances[..., 0] <= self.reach_tolerance
        q = np.where(reached, passes.crank_angles[..., 0], np.nan)[..., None]
        if self._is_limited:
            q = self._within_limits(foot, passes, q, assembly_mode)
            reached = np.isfinite(q[..., 0])
        posture = self.forward(q, assembly_mode)
        missed = np.where(np.isfinite(foot).all(axis=-1), UNREACHABLE, INVALID_INPUT)
        status = np.where(reached, posture.status, missed).astype(np.uint8)
        return posture._replace(status=status)

    def _within_limits(
        self, foot: FloatArray, passes: Passes, default: FloatArray, assembly_mode: str
    ) -> FloatArray:
        """Return the crank angle (..., 1) that keeps all limits and brings the foot nearest.

        It is the default where none does within `reach_tolerance`.
        """
        angles = passes.crank_angles
        tried = self.forward(angles[..., None], assembly_mode)
        with np.errstate(over="ignore", invalid="ignore"):  # infinitely far is far enough
            distances = np.linalg.norm(tried.foot_position - foot[..., None, :], axis=-1)
        kept = (tried.status == OK) & (distances <= self.reach_tolerance)
        nearest = np.argmin(np.where(kept, distances, np.inf), axis=-1, keepdims=True)
        angle = np.take_along_axis(angles, nearest, -1)
        chosen: FloatArray = np.where(kept.any(axis=-1, keepdims=True), angle, default)
        return chosen

    def nearest_crank_angles(self, foot_position: ArrayLike, assembly_mode: str = "") -> Passes:
        """Return all passes of the foot near a position: local minima of the distance.

        Args:
            foot_position: Position in the leg frame (..., 3) [m].
            assembly_mode: One of `assembly_modes`; "" is "walking".
        """
        foot = as_array("foot_position", foot_position, 3)
        mode = self.mode_index(assembly_mode)
        with np.errstate(over="ignore"):  # infinitely far is far enough
            x, y = -foot[..., 0] / self.crank_length, foot[..., 2] / self.crank_length
        lower, upper = near_brackets(self._curves[mode], x, y)
        angles, distances = self.kernels.nearest(
            self._constants, self.sides[mode], x[..., None], y[..., None], lower, upper
        )
        distances = np.hypot(distances * self.crank_length, foot[..., 1:2])
        order = np.argsort(distances, axis=-1, kind="stable")  # NaN last
        angles = self._in_range(angles - self.crank_zero)
        return Passes(
            np.take_along_axis(angles, order, -1), np.take_along_axis(distances, order, -1)
        )

    def crank_angles_at(self, x: ArrayLike, assembly_mode: str = "") -> FloatArray:
        """Return all crank angles at which the foot has a given x (..., k) [rad].

        Args:
            x: Coordinates along the walking direction (...) [m].
            assembly_mode: One of `assembly_modes`; "" is "walking".

        Returns:
            The angles in ascending order, NaN beyond the last; k is the largest number of passes
            the foot curve allows, 2 for a simple one.
        """
        mode = self.mode_index(assembly_mode)
        with np.errstate(over="ignore"):
            in_plane = -as_array("x", x)[..., None] / self.crank_length
        lower, upper, start, end = self._strokes[mode]
        inside = (np.minimum(start, end) <= in_plane) & (in_plane <= np.maximum(start, end))
        angles = self.kernels.crossing(
            self._constants,
            self.sides[mode],
            in_plane,
            np.where(inside, lower, np.nan),
            np.where(inside, upper, np.nan),
            np.sign(end - start),
        )
        return np.sort(self._in_range(angles - self.crank_zero), axis=-1)

    def _foot_in_plane(self, mode: int, angles: FloatArray) -> FloatArray:
        """Return the foot's X, Y and dX in the linkage's plane, in cranks (..., 3)."""
        foot: FloatArray = self.kernels.foot_in_plane(self._constants, self.sides[mode], angles)
        return foot

    def _closing_ranges(self, mode: int) -> list[tuple[float, float]]:
        """Return the crank angles between which the bars close; (0, 2 pi) for a whole turn."""
        step = TURN / CURVE_SAMPLES
        angles = np.arange(CURVE_SAMPLES) * step
        closed = np.isfinite(self._foot_in_plane(mode, angles)[:, 0])
        if closed.all():
            return [(0.0, TURN)]
        # one turn that starts and ends where the bars do not close
        angles = (np.argmin(closed) + np.arange(CURVE_SAMPLES + 1)) * step
        closed = np.isfinite(self._foot_in_plane(mode, angles)[:, 0])
        edges = np.flatnonzero(closed[1:] != closed[:-1])
        ending = closed[edges]
        inside, outside = angles[edges + ~ending], angles[edges + ending]
        for _ in range(REFINEMENTS):
            middle = 0.5 * (inside + outside)
            closes = np.isfinite(self._foot_in_plane(mode, middle)[:, 0])
            inside, outside = np.where(closes, middle, inside), np.where(closes, outside, middle)
        return list(zip(inside[~ending].tolist(), inside[ending].tolist(), strict=False))

    @cached_property
    def _curves(self) -> tuple[FloatArray, ...]:
        """Samples of the foot curve by mode: crank angle, X, Y, dX (m, 4).

        A whole turn is sampled evenly and one sample beyond its ends; ranges in which the bars
        close are sampled more densely towards their ends, where the foot moves as a square root,
        and stand between samples that are NaN.
        """
        return tuple(self._curve(mode) for mode in range(len(self.sides)))

    def _curve(self, mode: int) -> FloatArray:
        ranges = self._closing_ranges(mode)
        if ranges == [(0.0, TURN)]:
            angles = np.arange(-1, CURVE_SAMPLES + 1) * (TURN / CURVE_SAMPLES)
        else:
            fractions = 0.5 - 0.5 * np.cos(np.linspace(0.0, math.pi, CURVE_SAMPLES))
            parts = [np.array([math.nan])]
            for lower, upper in ranges:
                parts += [lower + (upper - lower) * fractions, np.array([math.nan])]
                parts[-2][-1] = upper
            angles = np.concatenate(parts)
        return np.column_stack([angles, self._foot_in_plane(mode, angles)])

    @cached_property
    def _strokes(self) -> tuple[FloatArray, ...]:
        """Ranges of the crank in which the foot goes one way, by mode.

        Lower and upper angle, X at both (4, k).
        """
        return tuple(self._strokes_of(mode) for mode in range(len(self.sides)))

    def _strokes_of(self, mode: int) -> FloatArray:
        angles, _, _, rate = self._curves[mode].T
        rising = rate > 0.0
        inside = np.isfinite(rate)
        turns = np.flatnonzero(inside[:-1] & inside[1:] & (rising[:-1] != rising[1:]))
        lower, upper, before = angles[turns], angles[turns + 1], rising[turns]
        for _ in range(REFINEMENTS):
            middle = 0.5 * (lower + upper)
            same = (self._foot_in_plane(mode, middle)[:, 2] > 0.0) == before
            lower, upper = np.where(same, middle, lower), np.where(same, upper, middle)
        strokes = []
        for start, end in self._closing_ranges(mode):
            knots = upper[(start <= upper) & (upper < end)]
            whole = end - start == TURN
            if whole and len(knots):
                knots = np.append(knots, knots[0] + TURN)
            elif not whole:
                knots = np.concatenate([[start], knots, [end]])
            feet = self._foot_in_plane(mode, knots)[:, 0]
            strokes.append(np.stack([knots[:-1], knots[1:], feet[:-1], feet[1:]]))
        return np.concatenate(strokes, axis=-1) if strokes else np.empty((4, 0))

    def _in_range(self, angles: FloatArray) -> FloatArray:
        """Return angles shifted by whole turns to the turn about the middle of the range."""
        lower, upper = self.joint_ranges[0]
        middle = 0.5 * (lower + upper) if math.isfinite(upper - lower) else 0.0
        shifted: FloatArray = angles - TURN * np.floor((angles - middle) / TURN + 0.5)
        return shifted

    def _motion(self, posture: Posture) -> Any:
        return self.kernels.motion(self._constants, posture.closure, posture.joint_positions)

    def jacobian(self, posture: Posture) -> FloatArray:
        """J of the foot's velocity, v = J q' (..., 3, 1) [m/rad]."""
        velocity: FloatArray = self._motion(posture)[0]
        return velocity[..., None]

    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of the foot link's angular velocity, omega = J_omega q' (..., 3, 1)."""
        turning: FloatArray = self._motion(posture)[2]
        return turning[..., None]

    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """J above J_omega (..., 6, 1), in one pass."""
        velocity, _, turning = self._motion(posture)
        return np.concatenate([velocity, turning], axis=-1)[..., None]

    def acceleration(
        self, posture: Posture, joint_velocities: ArrayLike, joint_accelerations: ArrayLike
    ) -> FloatArray:
        """Acceleration of the foot (..., 3) [m/s²].

        Args:
            posture: The leg's posture (...).
            joint_velocities: Crank velocity (..., 1) [rad/s].
            joint_accelerations: Crank acceleration (..., 1) [rad/s²].
        """
        batch = posture.joint_positions.shape[:-1]
        rate = as_matching("joint_velocities", joint_velocities, (1,), batch)
        acceleration = as_matching(
            "joint_accelerations",
            joint_accelerations,
            (1,),
            np.broadcast_shapes(batch, rate.shape[:-1]),
        )
        first, second, _ = self._motion(posture)
        with np.errstate(all="ignore"):
            result: FloatArray = first * acceleration + second * rate**2
        return result

    def passive_joint_positions(self, posture: Posture) -> FloatArray:
        """Angles between the bars at each of `pivots` (..., p) [rad].

        From the direction of the first bar's far end to that of the second's, in the sense in which
        the crank turns. Those at the crank's body follow it over whole turns; the other bars are
        taken to stay within half a turn of where they are in the initial posture.
        """
        first, second = self._bar_directions(posture.joint_positions, posture.closure)
        first_rest, second_rest = self._rest_directions
        turned = wrapped_angles(first - first_rest)
        on_crank = [{p.point, p.first} <= set(self.crank_points) for p in self.pivots]
        turned[..., on_crank] = posture.joint_positions
        return self._rest_angles + wrapped_angles(second - second_rest) - turned

    def passive_joint_excursions(self, posture: Posture) -> FloatArray:
        """Excursions of the passive joints from the initial posture (..., p) [rad].

        In [-pi, pi): a range of a whole turn is no limit.
        """
        return wrapped_angles(self.passive_joint_positions(posture) - self._rest_angles)

    @cached_property
    def _rest_angles(self) -> FloatArray:
        """Positions of the passive joints in the initial posture (p,) [rad]."""
        first, second = self._rest_directions
        return wrapped_angles(second - first)

    @cached_property
    def _rest_directions(self) -> tuple[FloatArray, FloatArray]:
        return self._bar_directions(np.zeros(1), self.sides[0])

    def _bar_directions(self, q: FloatArray, sides: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the directions of both bars at each pivot, counter-clockwise from X (..., p)."""
        points = self._points(q, sides)
        index = self.point_names.index
        pivot = points[..., [index(p.point) for p in self.pivots], :]
        first = points[..., [index(p.first) for p in self.pivots], :] - pivot
        second = points[..., [index(p.second) for p in self.pivots], :] - pivot
        return _direction(first), _direction(second)

    def body_tree(self, assembly_mode: str = "") -> LegTree:
        """The bars as bodies; `c_foot` moves that of the foot."""
        mode = self.mode_index(assembly_mode)
        if mode not in self._trees:
            joints = [PlacedJoint(*placed, (0.0, 1.0, 0.0)) for placed in self.placed]
            self._trees[mode] = tree_of(
                self, self._closed_posture(assembly_mode), joints, self.meetings, ("G", "c_foot")
            )
        return self._trees[mode]

    @cached_property
    def _trees(self) -> dict[int, LegTree]:
        return {}

    def _body_modes(self, posture: Posture) -> Any:
        """Return indices of the modes (...), by the signs of the closure."""
        same = np.sign(posture.closure)[..., None, :] == np.sign(self.sides)
        return np.argmax(same.all(axis=-1), axis=-1)

    def _closed_posture(self, assembly_mode: str) -> Posture:
        """Return the posture at zero, or the middle of where the bars close."""
        posture = self.forward(np.zeros(1), assembly_mode)
        if np.isfinite(posture.foot_position).all():
            return posture
        ranges = self._closing_ranges(self.mode_index(assembly_mode))
        if not ranges:
            raise GeometryError(f"the bars close nowhere in assembly mode {assembly_mode!r}")
        return self.forward([0.5 * sum(ranges[0]) - self.crank_zero], assembly_mode)

    def linkage(self, posture: Posture) -> Linkage:
        """Points of the leg in the leg frame and the bars between them."""
        index = self.point_names.index
        return Linkage(
            self.point_names,
            self._points(posture.joint_positions, posture.closure),
            tuple(tuple(index(point) for point in bar) for bar in self.bars),
        )
