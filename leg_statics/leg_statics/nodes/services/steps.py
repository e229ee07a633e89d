# SPDX-License-Identifier: Apache-2.0
"""The longest steps: one leg in its own frame, or several that step together on a body."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from leg_msgs.srv import QueryStepLength
from leg_msgs_py.arrays import from_field, to_field

from leg_kinematics.errors import NotSupportedError
from leg_kinematics.nodes.frames import OuterFrame, find_base, find_frame
from leg_kinematics.nodes.requests import RequestError, check_count
from leg_kinematics.nodes.service import Summary, service
from leg_kinematics.robot import BASE, Leg
from leg_statics.contact import Contact
from leg_statics.nodes.contacts import finite, magnitude, read_gravity, read_grounds
from leg_statics.nodes.hosts import StepsHost
from leg_statics.step_length import (
    FORWARD,
    PROFILE_POINTS,
    CommonStep,
    Criterion,
    GroundProfile,
    common_step,
)
from leg_statics.weight import LEVEL_GRAVITY, gravity_below


def _summary(response: Any) -> Summary:
    lengths, common = from_field(response.length), from_field(response.common_length)
    best = float(np.max(common)) if common.size else np.nan
    return Summary(len(lengths), int(np.sum(lengths > 0.0)), best, Counter())


@service(QueryStepLength, summary=_summary, best_unit="m")
def query_step_length(host: StepsHost, request: Any, response: Any) -> None:
    """Fill the longest steps of legs, each and together."""
    robot = host.robot
    given = [robot.leg(name) for name in list(request.legs) or list(robot.legs)]
    _check_legs(given)
    legs, down = _placed(host, given, request)
    heights = finite("heights", request.heights)
    check_count("legs and heights", len(legs) * len(heights), host.max_steps, "max_steps")
    profiles = _profiles(request, legs)
    contact = _contact(host, request)
    offsets = _lateral_offsets(request, legs)
    direction = finite("direction", request.direction)
    if not direction.any():
        direction = np.array(FORWARD)
    common = common_step(
        {leg.name: leg for leg in legs},
        -heights,
        contact.under(down if contact.gravity is None else contact.gravity),
        lateral_offset=lambda leg: offsets[leg.name],
        direction=direction,
        criterion=_criterion(request),
        profiles=profiles,
    )
    response.header.frame_id = request.header.frame_id
    _fill(response, legs, common)
    response.friction_coefficients = to_field(contact.friction)


def _check_legs(legs: Sequence[Leg]) -> None:
    """Raise an error if a leg is named twice or has no point foot."""
    names = [leg.name for leg in legs]
    for leg in legs:
        if not leg.mechanism.has_point_foot:
            raise NotSupportedError(f"legs: {leg.name!r} has no point foot with x, y, z")
        if names.count(leg.name) > 1:
            raise RequestError(f"legs: {leg.name!r} is given twice; allowed: once each")


def _placed(
    host: StepsHost, legs: Sequence[Leg], request: Any
) -> tuple[list[Leg], tuple[float, ...]]:
    """Return the legs as they stand in the frame of a request, and gravity if it tells none.

    Raises:
        RequestError: If these legs do not share the frame, or it is not known.
    """
    if len(legs) == 1:
        frame = find_frame(host, legs[0], request)
        mount = frame.mount if isinstance(frame, OuterFrame) else BASE
        down = LEVEL_GRAVITY if mount is not BASE else gravity_below(frame.vertical)
        return [replace(legs[0], mount=mount)], down
    base = find_base(host, request)
    return [replace(leg, mount=leg.mount.within(base)) for leg in legs], LEVEL_GRAVITY


def _contact(host: StepsHost, request: Any) -> Contact:
    """Return the contact of a request in its frame, along its profile if it has one.

    Raises:
        UnknownNameError: If it names an unknown ground.
        RequestError: If a value is out of range.
    """
    friction, normal = read_grounds(
        host.grounds, request.ground, len(request.profile_distances) or 1
    )
    moment = finite("required_moment", request.required_moment)
    return Contact(
        friction,
        normal,
        magnitude("required_load", request.required_load, "N"),
        tuple(moment.tolist()),
        magnitude("any_direction_moment", request.any_direction_moment, "N.m"),
        gravity=read_gravity(request),
    )


def _profiles(request: Any, legs: Sequence[Leg]) -> dict[str, GroundProfile] | None:
    """Return the ground along the line of each leg; None if it is level.

    Raises:
        RequestError: If there are too few or too many numbers, or distances do not increase.
    """
    distances = finite("profile_distances", request.profile_distances)
    count, given = len(distances), len(request.profile_heights)
    if count and (count < 2 or not (np.diff(distances) > 0.0).all()):
        raise RequestError(
            f"profile_distances: got {distances.tolist()[:10]}; allowed: none, or 2 and more that "
            "increase"
        )
    if given not in (count, count * len(legs)):
        raise RequestError(
            f"profile_heights: got {given} values; allowed: {count} (one a distance)"
            + (f", or {count * len(legs)} (for each of {len(legs)} legs)" if len(legs) > 1 else "")
        )
    if not count:
        return None
    rows = np.broadcast_to(from_field(request.profile_heights, (-1, count)), (len(legs), count))
    return {leg.name: GroundProfile(distances, row) for leg, row in zip(legs, rows, strict=True)}


def _lateral_offsets(request: Any, legs: Sequence[Leg]) -> dict[str, float]:
    offsets = finite("lateral_offsets", request.lateral_offsets)
    if len(offsets) not in (0, 1, len(legs)):
        raise RequestError(
            f"lateral_offsets: got {len(offsets)} values; allowed: none, 1, or {len(legs)} (one a "
            "leg)"
        )
    values = np.broadcast_to(offsets if len(offsets) else 0.0, len(legs))
    return {leg.name: float(value) for leg, value in zip(legs, values, strict=True)}


def _criterion(request: Any) -> Criterion:
    if request.criterion not in tuple(Criterion):
        allowed = ", ".join(f"{criterion.value} ({criterion.name})" for criterion in Criterion)
        raise RequestError(f"criterion: got {request.criterion}; allowed: {allowed}")
    return Criterion(request.criterion)


def _fill(response: Any, legs: Sequence[Leg], common: CommonStep) -> None:
    """Fill the arrays of a step length response."""
    steps = [common.steps[leg.name] for leg in legs]
    mounted = [(leg.mount, step) for leg, step in zip(legs, steps, strict=True)]
    response.legs = [leg.name for leg in legs]
    response.length = to_field([step.length for step in steps])
    response.start = to_field([mount.to_base(step.start) for mount, step in mounted])
    response.end = to_field([mount.to_base(step.end) for mount, step in mounted])
    response.start_limit = to_field([step.start_limit for step in steps], np.uint8)
    response.end_limit = to_field([step.end_limit for step in steps], np.uint8)
    response.load_capacity = to_field([step.load_capacity for step in steps])
    response.rated_friction = to_field([step.rated_friction for step in steps])
    response.rated_friction_full = to_field([step.rated_friction_full for step in steps])
    response.profile_points = PROFILE_POINTS
    response.common_length = to_field(common.common_length)
    response.limiting_leg = to_field(common.limiting_leg, np.int32)
    response.best_height = common.best_height
    response.weight_counted = [step.weight_counted for step in steps]
