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

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import NotSupportedError
from leg_kinematics.nodes.requests import (
    BaseFrame,
    LegFrame,
    RequestError,
    check_count,
    find_frame,
)
from leg_kinematics.nodes.service import Summary, service
from leg_kinematics.robot import Leg, Mount, Robot
from leg_statics.nodes.contacts import read_contact
from leg_statics.nodes.hosts import StepsHost
from leg_statics.step_length import (
    FORWARD,
    PROFILE_POINTS,
    CommonStep,
    Criterion,
    common_step,
)
from leg_statics.weight import LEVEL_GRAVITY, level_gravity


def _summary(response: Any) -> Summary:
    lengths, common = from_field(response.length), from_field(response.common_length)
    best = float(np.max(common)) if common.size else np.nan
    return Summary(len(lengths), int(np.sum(lengths > 0.0)), best, Counter())


@service(QueryStepLength, summary=_summary, best_unit="m")
def query_step_length(host: StepsHost, request: Any, response: Any) -> None:
    """Fill the longest steps of legs, each and together."""
    robot = host.robot
    names = list(request.legs) or list(robot.legs)
    legs = [robot.leg(name) for name in names]
    on_body = _on_body(robot, legs, request.header.frame_id)
    gravity = LEVEL_GRAVITY if on_body else level_gravity(legs[0])
    if not on_body:
        legs = [replace(legs[0], mount=Mount(np.zeros(3), np.eye(3)))]
    heights = _finite("heights", request.heights)
    check_count("legs and heights", len(legs) * len(heights), host.max_steps, "max_steps")
    contact = read_contact(host.grounds, request, LegFrame()).under(gravity)
    offsets = _lateral_offsets(request, legs)
    direction = _finite("direction", request.direction)
    if not direction.any():
        direction = np.array(FORWARD)
    common = common_step(
        {leg.name: leg for leg in legs},
        -heights,
        contact,
        lateral_offset=lambda leg: offsets[leg.name],
        direction=direction,
        criterion=_criterion(request),
    )
    response.header.frame_id = request.header.frame_id
    _fill(response, legs, common)
    response.friction_coefficient = float(np.asarray(contact.friction))


def _on_body(robot: Robot, legs: Sequence[Leg], frame_id: str) -> bool:
    """Tell whether a request for a step length is in the base frame, not in that of its only leg.

    Raises:
        RequestError: If a leg is named twice, or these legs do not share the frame.
        NotSupportedError: If a leg has no point foot.
    """
    names = [leg.name for leg in legs]
    for leg in legs:
        if not leg.mechanism.has_point_foot:
            raise NotSupportedError(f"legs: {leg.name!r} has no point foot with x, y, z")
        if names.count(leg.name) > 1:
            raise RequestError(f"legs: {leg.name!r} is given twice; allowed: once each")
    if len(legs) == 1 and not isinstance(find_frame(robot, legs[0], frame_id), BaseFrame):
        return False
    if frame_id not in ("", robot.base_frame):
        raise RequestError(
            f"header.frame_id: got {frame_id!r}; allowed for several legs: '' or "
            f"{robot.base_frame!r}"
        )
    return True


def _finite(field: str, values: Any) -> FloatArray:
    array: FloatArray = from_field(values)
    if not np.isfinite(array).all():
        bad = array[~np.isfinite(array)][0]
        raise RequestError(f"{field}: got {bad}; allowed: finite values")
    return array


def _lateral_offsets(request: Any, legs: Sequence[Leg]) -> dict[str, float]:
    offsets = _finite("lateral_offsets", request.lateral_offsets)
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
