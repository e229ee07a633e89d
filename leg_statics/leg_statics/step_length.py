# SPDX-License-Identifier: Apache-2.0
"""Step length: the longest straight stance of a foot on which every point is feasible.

During stance the foot moves along a straight line relative to the body, at constant height. The
smoother the ground, the shorter the part of that line on which the leg may bear its load; this is
the use that paper 000 makes of the rated friction (section 3.3, figure 8).

Over a `GroundProfile` the line follows the ground: the longest part of it is sought whose points
are all feasible.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arguments import require
from leg_kinematics.arrays import FloatArray, StatusArray, as_array
from leg_kinematics.errors import NotSupportedError, ShapeError, ValueRangeError
from leg_kinematics.mechanism import Mechanism
from leg_kinematics.robot import Leg
from leg_kinematics.status import Status
from leg_statics.capacity.problem import GRIP
from leg_statics.footholds import Contact, Footholds, Verdict, evaluate_footholds
from leg_statics.workspace import actuator_grid, check_heights

END_TOLERANCE = 1e-6  # m, to which the ends of a stance are found
SAMPLING = 2e-3  # m, a feasible stretch shorter than this may be overlooked
PARTS = 8  # of a sampling distance; a gap in a stance that is shorter than one may be overlooked
PROFILE_POINTS = 21
FORWARD = (1.0, 0.0, 0.0)  # of a leg and of the body: both frames follow REP-103
LONGEST_LINE = 20_000  # samples of one line
LINES_AT_ONCE = 32


class Criterion(IntEnum):
    """What makes a point of the stance feasible, besides a posture that is OK.

    Attributes:
        CAPACITY: The load capacity within the friction cone is at least the required load.
        RATED_FRICTION: The paper's: the ground's friction is at least mu_e = |F_x / F_z|, (22).
    """

    CAPACITY = 0
    RATED_FRICTION = 1


class GroundProfile(NamedTuple):
    """Height of the ground along a line: linear between points, unknown elsewhere and next to NaN.

    Attributes:
        distance: Distances along the line from the origin of the leg frame, increasing (Q,) [m].
        height: How high the ground is there, above the height of the line (Q,) [m].
    """

    distance: ArrayLike
    height: ArrayLike

    def rise(self, s: FloatArray) -> FloatArray:
        """Return how high the ground is at distances s (...,); NaN where it is unknown [m]."""
        distance, height = as_array("distance", self.distance), as_array("height", self.height)
        return np.interp(s, distance, height, left=np.nan, right=np.nan)

    def contact(self, contact: Contact, s: FloatArray) -> Contact:
        """Return a contact whose friction (Q,) or normal (Q, 3) varies, at distances s (...,)."""
        distance, s = as_array("distance", self.distance), np.nan_to_num(s)  # nowhere is no matter
        friction, normal = as_array("friction", contact.friction), contact.normal
        if friction.ndim:
            friction = np.interp(s, distance, np.minimum(friction, GRIP))
        if normal is not None and np.ndim(normal) > 1:
            columns = np.moveaxis(as_array("normal", normal, 3), -1, 0)
            normal = np.stack([np.interp(s, distance, column) for column in columns], axis=-1)
        return contact._replace(friction=friction, normal=normal)

    def check(self, contact: Contact) -> None:
        """Raise an error unless distances increase and all else has a value, or one for all."""
        distance = as_array("distance", self.distance)
        if distance.ndim != 1 or len(distance) < 2:
            raise ShapeError(f"distance must have shape (Q,) with Q >= 2, got {distance.shape}")
        if not (np.isfinite(distance).all() and (np.diff(distance) > 0.0).all()):
            raise ValueRangeError(f"distance must be finite and increase, got {distance.tolist()}")
        for name, values, shapes in (
            ("height", self.height, [distance.shape]),
            ("friction", contact.friction, [(), distance.shape]),
            ("normal", contact.normal, [(), (3,), (*distance.shape, 3)]),
        ):
            if np.shape(values) not in shapes:  # type: ignore[arg-type]
                allowed = " or ".join(map(str, shapes))
                raise ShapeError(f"{name} must have shape {allowed}, got {np.shape(values)}")  # type: ignore[arg-type]


class StepLength(NamedTuple):
    """Longest feasible stance for each height (...,).

    Attributes:
        length: Step length [m]; 0 where no point of the line is feasible.
        start: Rear end in the leg frame (..., 3) [m]; NaN where there is none.
        end: Front end in the leg frame (..., 3) [m].
        start_limit: `Verdict` of the points just behind the rear end.
        end_limit: `Verdict` of the points just before the front end.
        positions: Points along the stance (..., 21, 3) [m].
        load_capacity: Load capacity at these points (..., 21) [N].
        rated_friction: mu_e at these points (..., 21).
        rated_friction_full: Its full form at these points (..., 21).
        weight_counted: Whether the actuators hold the leg's own weight, too.
    """

    length: FloatArray
    start: FloatArray
    end: FloatArray
    start_limit: StatusArray
    end_limit: StatusArray
    positions: FloatArray
    load_capacity: FloatArray
    rated_friction: FloatArray
    rated_friction_full: FloatArray
    weight_counted: bool


def longest_step(
    leg: Leg,
    height: ArrayLike,
    contact: Contact,
    *,
    lateral_offset: ArrayLike = 0.0,
    direction: ArrayLike = FORWARD,
    criterion: Criterion = Criterion.CAPACITY,
    profile: GroundProfile | None = None,
) -> StepLength:
    """Find the longest straight stance on which every point is feasible.

    The line runs along `direction` at the given height; it passes the origin of the leg frame at
    the lateral offset, which counts to the left of the direction (y for the default direction).
    It is sampled every 2 mm, and what seems feasible every 0.25 mm: a shorter feasible stretch, or
    a shorter gap in one, may be overlooked.

    Args:
        leg: The leg; its foot must be a point in space.
        height: z of the foot in the leg frame (...,) [m], negative below the hip.
        contact: Ground, required load and moment, the same for all points; with a profile, friction
            (Q,) and normal (Q, 3) may be those at its points.
        lateral_offset: Distance of the line from the leg frame's origin (...,) [m].
        direction: Walking direction, horizontal (3,) of any length.
        criterion: What makes a point feasible.
        profile: Height of the ground along the line; None = level.

    Returns:
        The step for each height, its ends to 0.1 mm and better, and what limits them.

    Raises:
        NotSupportedError: If the end is no point foot, or the leg has no rated friction and that
            is the criterion.
        ValueRangeError: If heights or offsets are not finite, a height is positive and above all
            that the foot reaches, or the direction is not horizontal.
        ShapeError: If shapes do not fit.
    """
    require("leg", leg, Leg)
    along = _horizontal_unit(direction)
    axes = np.stack([along, _left_of(along), np.array([0.0, 0.0, 1.0])])
    return _longest_stance(leg, axes, height, lateral_offset, contact, criterion, profile)


def _longest_stance(
    leg: Leg,
    axes: FloatArray,
    height: ArrayLike,
    lateral_offset: ArrayLike,
    contact: Contact,
    criterion: Criterion,
    profile: GroundProfile | None,
) -> StepLength:
    """Find the longest stance along the first of three axes (3, 3), whose third is upwards."""
    along, left, up = axes
    heights, offsets = np.broadcast_arrays(
        _finite("height", height), _finite("lateral_offset", lateral_offset)
    )
    if profile is None:
        check_heights(leg.mechanism, heights, up)
    else:
        profile.check(contact)
    _check_criterion(leg.mechanism, criterion)
    batch = heights.shape
    origins = offsets.reshape(-1, 1) * left + heights.reshape(-1, 1) * up
    lines, reach = np.arange(len(origins)), _reach(leg.mechanism)

    def place(s: FloatArray, line: NDArray[np.intp] = lines) -> FloatArray:
        """Return the points of the ground at distances s along lines."""
        points = origins[line] + s[..., None] * along
        return points if profile is None else points + profile.rise(s)[..., None] * up

    def evaluate(line: NDArray[np.intp], s: FloatArray) -> tuple[StatusArray, Footholds]:
        """Return verdict and footholds at distances s along lines."""
        ground = contact if profile is None else profile.contact(contact, s)
        footholds = evaluate_footholds(leg, place(s, line), ground)
        return _verdicts(footholds, ground, criterion), footholds

    def is_feasible(line: NDArray[np.intp], s: FloatArray) -> NDArray[np.bool_]:
        return np.asarray(evaluate(line, s)[0] == Verdict.FEASIBLE)

    brackets: list[FloatArray] = [np.empty((2, 2, 0))]
    for first in range(0, len(lines), LINES_AT_ONCE):
        brackets.append(_brackets(is_feasible, lines[first : first + LINES_AT_ONCE], reach))
    good, bad = np.concatenate(brackets, axis=-1)
    while np.nanmax(np.abs(bad - good), initial=0.0) > END_TOLERANCE:
        middle = 0.5 * (good + bad)
        ok = is_feasible(lines, middle)
        good = np.where(ok, middle, good)
        bad = np.where(ok | np.isnan(middle), bad, middle)
    limits, _ = evaluate(lines, bad)
    start, end = good
    share = np.linspace(0.0, 1.0, PROFILE_POINTS)
    _, footholds = evaluate(lines[:, None], start[:, None] + (end - start)[:, None] * share)
    return StepLength(
        length=np.nan_to_num(end - start).reshape(batch),
        start=place(start).reshape(*batch, 3),
        end=place(end).reshape(*batch, 3),
        start_limit=limits[0].reshape(batch),
        end_limit=limits[1].reshape(batch),
        positions=footholds.posture.foot_position.reshape(*batch, PROFILE_POINTS, 3),
        load_capacity=footholds.load_capacity.reshape(*batch, PROFILE_POINTS),
        rated_friction=footholds.rated_friction.reshape(*batch, PROFILE_POINTS),
        rated_friction_full=footholds.rated_friction_full.reshape(*batch, PROFILE_POINTS),
        weight_counted=footholds.weight_counted,
    )


def _brackets(
    is_feasible: Callable[[NDArray[np.intp], FloatArray], NDArray[np.bool_]],
    lines: NDArray[np.intp],
    reach: float,
) -> FloatArray:
    """Return a feasible point of each end of the longest stance, and one beyond it that is not.

    Between two samples that are feasible all is taken to be so, until they are part of the longest
    stance and looked at more closely.

    Returns:
        Distances along the lines (2, 2, lines): feasible or not, rear or front. Where no sample is
        feasible, NaN and the ends of the line.
    """
    samples = int(min(2.0 * reach / SAMPLING, LONGEST_LINE)) + 1
    s = np.linspace(-reach, reach, PARTS * (samples - 1) + 1)
    place, last = np.arange(len(s)), len(s) - 1
    coarse = is_feasible(lines[:, None], s[::PARTS])
    known = np.zeros((len(lines), len(s)), dtype=bool)
    feasible = np.zeros_like(known)
    known[:, ::PARTS], feasible[:, ::PARTS] = True, coarse
    for k in range(1, PARTS):
        feasible[:, k::PARTS] = coarse[:, :-1] & coarse[:, 1:]
    while True:
        rear, front = _longest_run(feasible)
        unsure = (rear[:, None] < place) & (place < front[:, None]) & ~known
        if not unsure.any():
            break
        rows, columns = np.nonzero(unsure)
        feasible[rows, columns] = is_feasible(lines[rows], s[columns])
        known |= unsure
    row = np.arange(len(lines))
    behind = rear - np.where(known[row, np.clip(rear - 1, 0, last)], 1, PARTS)
    before = front + np.where(known[row, np.clip(front + 1, 0, last)], 1, PARTS)
    found = rear >= 0
    good = np.where(found, s[np.stack([rear, front])], np.nan)
    bad = s[np.where(found, np.clip([behind, before], 0, last), [[0], [last]])]
    return np.stack([good, bad])


class CommonStep(NamedTuple):
    """The step that several legs of a robot can make together.

    Attributes:
        common_length: The shortest of their steps for each height (...,) [m].
        limiting_leg: Index of the leg that has it (...,).
        steps: The step of each leg, by name; points are in the leg frames.
    """

    common_length: FloatArray
    limiting_leg: NDArray[np.int64]
    steps: Mapping[str, StepLength]

    @property
    def best_height(self) -> int:
        """Flat index of the longest common step; -1 if none is longer than 0."""
        longest = np.max(self.common_length, initial=0.0)
        return int(np.argmax(self.common_length)) if longest > 0.0 else -1


def common_step(
    legs: Mapping[str, Leg],
    body_height: ArrayLike,
    contact: Contact,
    *,
    lateral_offset: Callable[[Leg], float] | float = 0.0,
    direction: ArrayLike = FORWARD,
    criterion: Criterion = Criterion.CAPACITY,
    profiles: Mapping[str, GroundProfile] | None = None,
) -> CommonStep:
    """Find the step that all given legs can make at once.

    Args:
        legs: Legs of one robot, by name.
        body_height: Height of the base frame's origin over the ground (...,) [m].
        contact: Ground, required load and moment of each leg; its vectors in the base frame.
        lateral_offset: Horizontal offset of each leg's line from its own origin [m], or a function
            of the leg.
        direction: Walking direction in the base frame, horizontal (3,).
        criterion: What makes a point feasible.
        profiles: Height of the ground along the line of each leg, by name; None = level.
    """
    require("legs", legs, Mapping)
    require("contact", contact, Contact)
    if not legs:
        raise ValueRangeError("legs must be at least one leg, got none")
    along = _horizontal_unit(direction)
    axes = np.stack([along, _left_of(along), np.array([0.0, 0.0, 1.0])])
    steps = {}
    for name, leg in legs.items():
        require("legs", leg, Leg)
        mount = leg.mount
        steps[name] = _longest_stance(
            leg,
            mount.vectors_to_leg(axes),
            -as_array("body_height", body_height) - mount.position[2],
            lateral_offset(leg) if callable(lateral_offset) else lateral_offset,
            contact.turned(mount.vectors_to_leg),
            criterion,
            None if profiles is None else profiles[name],
        )
    lengths = np.stack([step.length for step in steps.values()], axis=-1)
    return CommonStep(np.min(lengths, axis=-1), np.argmin(lengths, axis=-1), steps)


def _verdicts(footholds: Footholds, contact: Contact, criterion: Criterion) -> NDArray[np.uint8]:
    if criterion == Criterion.CAPACITY:
        return footholds.verdict
    solved = np.asarray(footholds.posture.status) == Status.OK
    holds = footholds.rated_friction <= np.asarray(contact.friction)  # NaN at a singularity
    rated = np.where(holds, Verdict.FEASIBLE, Verdict.FRICTION)
    return np.where(solved, rated, footholds.posture.status).astype(np.uint8)


def _longest_run(feasible: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return first and last index of the longest run of True along the last axis, or -1, -1."""
    count = feasible.shape[-1]
    flat = feasible.reshape(-1, count)
    position = np.arange(count)
    # index of the last False at or before each position
    gap = np.maximum.accumulate(np.where(flat, -1, position), axis=1)
    run = np.where(flat, position - gap, 0)
    last = np.argmax(run, axis=1)
    length = run[np.arange(len(run)), last]
    rear = np.where(length > 0, last - length + 1, -1)
    front = np.where(length > 0, last, -1)
    shape = feasible.shape[:-1]
    return rear.reshape(shape), front.reshape(shape)


def _reach(mechanism: Mechanism) -> float:
    """Radius about the leg frame's origin that holds the workspace, with a margin [m]."""
    foot = mechanism.forward(actuator_grid(mechanism, 9)).foot_position
    return 1.1 * float(np.nanmax(np.linalg.norm(foot, axis=-1)))


def _horizontal_unit(direction: ArrayLike) -> FloatArray:
    vector = as_array("direction", direction, 3)
    length = float(np.linalg.norm(vector))
    if vector.ndim != 1 or not np.isfinite(length) or length == 0.0:
        raise ValueRangeError(f"direction must be one finite vector that is not zero, got {vector}")
    if abs(vector[2]) > 1e-9 * length:
        raise ValueRangeError(f"direction must be horizontal (z = 0), got {vector}")
    return np.array([vector[0], vector[1], 0.0]) / length


def _left_of(along: FloatArray) -> FloatArray:
    return np.array([-along[1], along[0], 0.0])


def _check_criterion(mechanism: Mechanism, criterion: Criterion) -> None:
    """Raise an error for what is no criterion, or not defined for a mechanism."""
    require("criterion", criterion, Criterion)
    if criterion == Criterion.RATED_FRICTION and len(mechanism.joints) != 3:
        raise NotSupportedError(
            f"criterion RATED_FRICTION: mechanism {mechanism.name!r} has {len(mechanism.joints)} "
            "actuators; rated friction is that of three"
        )


def _finite(name: str, value: ArrayLike) -> FloatArray:
    array = as_array(name, value)
    if not np.isfinite(array).all():
        raise ValueRangeError(f"{name} must be finite, got {array[~np.isfinite(array)].flat[0]}")
    return array
