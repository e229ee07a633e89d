# SPDX-License-Identifier: Apache-2.0
"""What a leg can carry at candidate footholds."""

from __future__ import annotations

from collections import Counter
from enum import IntEnum
from typing import Any

import numpy as np
from leg_msgs.srv import QueryFootholds
from leg_msgs_py.arrays import from_field, to_field

from leg_kinematics.nodes.requests import XYZ, check_count, find_frame, read_rows
from leg_kinematics.nodes.service import Summary, service
from leg_statics.footholds import AROUND, Verdict, evaluate_around, evaluate_footholds
from leg_statics.nodes.contacts import magnitude, read_bias, read_contact, standing_leg
from leg_statics.nodes.hosts import GroundsHost


def _summary(response: Any) -> Summary:
    numbers, counts = np.unique(from_field(response.verdict, dtype=np.uint8), return_counts=True)
    verdicts = Counter[IntEnum](dict(zip(map(Verdict, numbers), counts.tolist(), strict=True)))
    best = response.load_capacity[response.best] if response.ranking else np.nan
    return Summary(len(response.verdict), verdicts[Verdict.FEASIBLE], best, verdicts)


@service(QueryFootholds, summary=_summary, best_unit="N")
def query_footholds(host: GroundsHost, request: Any, response: Any) -> None:
    """Fill what the leg can carry at candidate footholds."""
    leg = standing_leg(host.robot, request.leg)
    frame = find_frame(host.robot, leg, request.header.frame_id)
    contact = read_contact(host.grounds, request, frame)
    contact = contact._replace(bias_efforts=read_bias(leg, request.bias_efforts))
    positions = read_rows("positions", request.positions, XYZ)
    feet = frame.points_to_leg(positions)
    radius = magnitude("radius", request.radius, "m")
    check_count("positions", len(positions) * (len(AROUND) if radius else 1), host.max_points)
    if radius:
        found = evaluate_around(leg, feet, contact, radius)
    else:
        found = evaluate_footholds(leg, feet, contact)
    ranking = found.ranking
    response.header.frame_id = request.header.frame_id
    response.verdict = to_field(found.verdict, np.uint8)
    response.status = to_field(found.status, np.uint8)
    response.load_capacity = to_field(found.load_capacity)
    response.rated_friction = to_field(found.rated_friction)
    response.rated_friction_full = to_field(found.rated_friction_full)
    response.friction_margin = to_field(found.friction_margin)
    response.utilisation = to_field(found.utilisation)
    response.clearance = to_field(found.clearance)
    response.margin = to_field(found.margin)
    response.limiting_joint = to_field(found.limiting_joint, np.int32)
    response.ranking = to_field(ranking, np.int32)
    response.best = int(ranking[0]) if len(ranking) else -1  # `found.best` would rank again
    response.friction_coefficient = float(np.asarray(contact.friction))
    if request.include_efforts:
        response.joint_names = list(leg.joint_names)
        response.joint_efforts = to_field(found.joint_efforts)
        response.force = to_field(frame.vectors_from_leg(found.force))
