# SPDX-License-Identifier: Apache-2.0
"""Step length: the longest straight stance of a foot on which every point is feasible.

During stance the foot moves along a straight line relative to the body, at constant height. The
smoother the ground, the shorter the part of that line on which the leg may bear its load; this is
the use that paper 000 makes of the rated friction (section 3.3, figure 8).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arguments import require
from leg_kinematics.arrays import FloatArray, StatusArray, as_array
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.mechanism import Mechanism
from leg_kinematics.robot import Leg
from leg_kinematics.status import Status
from leg_statics.footholds import Contact, Footholds, Verdict, evaluate_footholds
from leg_statics.workspace import actuator_grid

END_TOLERANCE = 1e-6  # m, to which the ends of a stance are found
SAMPLING = 2e-3  # m, a feasible stretch shorter than this may be overlooked
PROFILE_POINTS = 21
FORWARD = (1.0, 0.0, 0.0)  # of a leg and of the body: both frames follow REP-103
LONGEST_LINE = 20_000  # samples of one line


class Criterion(IntEnum):
    """What makes a point of the stance feasible, besides a posture that is OK.

    Attributes:
        CAPACITY: The load capacity within the friction cone is at least the required load.
        RATED_FRICTION: The paper's: the ground's friction is at least mu_e = |F_x / F_z|, (22).
    """

    CAPACITY = 0
    RATED_FRICTION = 1


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


def longest_step(
    leg: Leg,
    height: ArrayLike,
    contact: Contact,
    *,
    lateral_offset: ArrayLike = 0.0,
    direction: ArrayLike = FORWARD,
    criterion: Criterion = Criterion.CAPACITY,
) -> StepLength:
    """Find the longest straight stance on which every point is feasible.

    The line runs along `direction` at the given height; it passes the origin of the leg frame at
    the lateral offset, which counts to the left of the direction (y for the default direction).

    Args:
        leg: The leg; its foot must be a point in space.
        height: z of the foot in the leg frame (...,) [m], negative below the hip.
        contact: Ground, required load and moment, the same for all points.
        lateral_offset: Distance of the line from the leg frame's origin (...,) [m].
        direction: Walking direction, horizontal (3,) of any length.
        criterion: What makes a point feasible.

    Returns:
        The step for each height, its ends to 0.1 mm and better, and what limits them.

    Raises:
        ValueRangeError: If heights or offsets are not finite, or the direction is not horizontal.
        ShapeError: If shapes do not fit.
    """
    require("leg", leg, Leg)
    require("criterion", criterion, Criterion)
    along = _horizontal_unit(direction)
    heights, offsets = np.broadcast_arrays(
        _finite("height", height), _finite("lateral_offset", lateral_offset)
    )
    left = np.array([-along[1], along[0], 0.0])
    origin = offsets[..., None] * left + heights[..., None] * np.array([0.0, 0.0, 1.0])

    def evaluate(s: FloatArray) -> tuple[NDArray[np.uint8], Footholds]:
        """Return verdict and footholds at distances s (..., m) along the lines."""
        points = origin[..., None, :] + s[..., None] * along
        footholds = evaluate_footholds(leg, points, contact)
        return _verdicts(footholds, contact, criterion), footholds

    reach = _reach(leg.mechanism)
    samples = int(min(2.0 * reach / SAMPLING, LONGEST_LINE)) + 1
    s = np.linspace(-reach, reach, samples)
    feasible = evaluate(np.broadcast_to(s, (*heights.shape, samples)))[0] == Verdict.FEASIBLE
    rear, front = _longest_run(feasible)
    found = rear >= 0

    def refined(inside: NDArray[np.int64], outward: int) -> tuple[FloatArray, StatusArray]:
        """Bisect between a feasible sample and its infeasible neighbour."""
        good = s[np.where(found, inside, 0)]
        bad = s[np.clip(np.where(found, inside, 0) + outward, 0, samples - 1)]
        while np.max(np.abs(bad - good), initial=0.0) > END_TOLERANCE:
            middle = 0.5 * (good + bad)
            ok = evaluate(middle[..., None])[0][..., 0] == Verdict.FEASIBLE
            good, bad = np.where(ok, middle, good), np.where(ok, bad, middle)
        return np.where(found, good, np.nan), evaluate(bad[..., None])[0][..., 0]

    start, start_limit = refined(rear, -1)
    end, end_limit = refined(front, 1)
    share = np.linspace(0.0, 1.0, PROFILE_POINTS)
    profile = start[..., None] + (end - start)[..., None] * share
    _, footholds = evaluate(profile)
    return StepLength(
        length=np.where(found, end - start, 0.0),
        start=origin + start[..., None] * along,
        end=origin + end[..., None] * along,
        start_limit=start_limit,
        end_limit=end_limit,
        positions=footholds.posture.foot_position,
        load_capacity=footholds.load_capacity,
        rated_friction=footholds.rated_friction,
        rated_friction_full=footholds.rated_friction_full,
    )


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
) -> CommonStep:
    """Find the step that all given legs can make at once.

    Args:
        legs: Legs of one robot, by name, mounted with their z axis along the body's.
        body_height: Height of the base frame's origin over the ground (...,) [m].
        contact: Ground, required load and moment of each leg; its vectors in the base frame.
        lateral_offset: Offset of each leg's line from its own origin [m], or a function of the leg.
        direction: Walking direction in the base frame, horizontal (3,).
        criterion: What makes a point feasible.
    """
    require("legs", legs, Mapping)
    require("contact", contact, Contact)
    if not legs:
        raise ValueRangeError("legs must be at least one leg, got none")
    steps = {}
    for name, leg in legs.items():
        require("legs", leg, Leg)
        offset = lateral_offset(leg) if callable(lateral_offset) else lateral_offset
        steps[name] = longest_step(
            leg,
            -as_array("body_height", body_height) - leg.mount.position[2],
            contact._replace(
                normal=leg.mount.vectors_to_leg(contact.normal),
                moment=leg.mount.vectors_to_leg(contact.moment),
                gravity=None
                if contact.gravity is None
                else leg.mount.vectors_to_leg(contact.gravity),
            ),
            lateral_offset=offset,
            direction=leg.mount.vectors_to_leg(direction),
            criterion=criterion,
        )
    lengths = np.stack([step.length for step in steps.values()], axis=-1)
    return CommonStep(np.min(lengths, axis=-1), np.argmin(lengths, axis=-1), steps)


def _verdicts(footholds: Footholds, contact: Contact, criterion: Criterion) -> NDArray[np.uint8]:
    if criterion == Criterion.CAPACITY:
        return footholds.verdict
    solved = np.asarray(footholds.posture.status) == Status.OK
    slips = footholds.rated_friction > np.asarray(contact.friction)
    rated = np.where(slips, Verdict.FRICTION, Verdict.FEASIBLE)
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


def _finite(name: str, value: ArrayLike) -> FloatArray:
    array = as_array(name, value)
    if not np.isfinite(array).all():
        raise ValueRangeError(f"{name} must be finite, got {array[~np.isfinite(array)].flat[0]}")
    return array
