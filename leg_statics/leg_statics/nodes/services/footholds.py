# SPDX-License-Identifier: Apache-2.0
"""What legs can carry at candidate footholds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from enum import IntEnum
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from leg_msgs.srv import QueryFootholds
from leg_msgs_py.arrays import from_field, to_field

from leg_kinematics.nodes.frames import LegFrame, find_base, find_frame, outer_frame
from leg_kinematics.nodes.requests import XYZ, RequestError, check_count, read_rows
from leg_kinematics.nodes.service import Summary, service
from leg_kinematics.robot import Leg
from leg_statics.footholds import (
    AROUND,
    Footholds,
    Verdict,
    evaluate_around,
    evaluate_footholds,
)
from leg_statics.nodes.contacts import magnitude, read_contacts, standing_legs
from leg_statics.nodes.hosts import GroundsHost


def _summary(response: Any) -> Summary:
    numbers, counts = np.unique(from_field(response.verdict, dtype=np.uint8), return_counts=True)
    verdicts = Counter[IntEnum](dict(zip(map(Verdict, numbers), counts.tolist(), strict=True)))
    best = [response.load_capacity[row] for row in response.best if row >= 0]
    least = float(min(best, default=np.nan))
    return Summary(len(response.verdict), verdicts[Verdict.FEASIBLE], least, verdicts)


@service(QueryFootholds, summary=_summary, best_unit="N")
def query_footholds(host: GroundsHost, request: Any, response: Any) -> None:
    """Fill what legs can carry at candidate footholds."""
    legs = standing_legs(host.robot, list(request.legs) or [""])
    frames = _frames(host, legs, request)
    positions = read_rows("positions", request.positions, XYZ)
    parts = _parts(request, legs, len(positions))
    radius = magnitude("radius", request.radius, "m")
    check_count("positions", len(positions) * (len(AROUND) if radius else 1), host.max_points)
    joints = max((leg.joint_names for leg in legs), key=len)
    contacts = read_contacts(host.grounds, request, len(positions), joints)
    evaluate = partial(evaluate_around, radius=radius) if radius else evaluate_footholds
    found = [
        evaluate(
            leg,
            frame.points_to_leg(positions[rows]),
            contacts.of(leg, frame, rows),
            assembly_mode=request.assembly_mode,
        )
        for leg, frame, rows in zip(legs, frames, parts, strict=True)
    ]
    response.header.frame_id = request.header.frame_id
    _fill(response, found)
    rankings = [each.ranking + rows.start for each, rows in zip(found, parts, strict=True)]
    response.ranking = to_field(np.concatenate(rankings), np.int32)
    response.best = to_field([rows[0] if len(rows) else -1 for rows in rankings], np.int32)
    response.friction_coefficients = to_field(contacts.ground.friction)
    if request.include_efforts:
        n = len(joints)
        response.joint_names = [
            name for leg in legs for name in (*leg.joint_names, *[""] * (n - len(leg.joint_names)))
        ]
        efforts = np.full((len(positions), n), np.nan)
        for each, rows in zip(found, parts, strict=True):
            own = each.joint_efforts
            efforts[rows, : own.shape[-1]] = own
        response.joint_efforts = to_field(efforts)
        forces = zip(frames, found, strict=True)
        response.force = to_field(np.concatenate([f.vectors_from_leg(e.force) for f, e in forces]))


def _frames(host: GroundsHost, legs: Sequence[Leg], request: Any) -> list[LegFrame]:
    """Return the frame of a request for each of its legs.

    Raises:
        RequestError: If these legs do not share it.
    """
    if len(legs) == 1:
        return [find_frame(host, legs[0], request)]
    base = find_base(host, request)
    return [outer_frame(leg, base, request.header.frame_id) for leg in legs]


def _parts(request: Any, legs: Sequence[Leg], count: int) -> list[slice]:
    """Return the rows of the candidates of each leg.

    Raises:
        RequestError: If they are not those that there are.
    """
    given = [int(each) for each in request.candidates]
    counts = given or [count // len(legs)] * len(legs)
    if len(counts) != len(legs):
        raise RequestError(
            f"candidates: got {len(counts)} numbers; allowed: none, or {len(legs)} (one a leg)"
        )
    if sum(counts) != count:
        raise RequestError(
            f"candidates: got {f'{given}, {sum(given)} in all' if given else 'none'}, and "
            f"positions has {count} points; allowed: as many in all, or none for as many each"
        )
    ends = np.cumsum([0, *counts]).tolist()
    return [slice(*pair) for pair in pairwise(ends)]


def _fill(response: Any, found: Sequence[Footholds]) -> None:
    """Fill the arrays that have a number for each candidate, leg by leg."""
    for name, kind in NUMBERS.items():
        values = [getattr(each, name) for each in found]
        setattr(response, name, to_field(np.concatenate(values), kind))
    response.weight_counted = [each.weight_counted for each in found]


# Numbers for each candidate: fields of the response, and of the library's answer.
NUMBERS = {
    "verdict": np.uint8,
    "status": np.uint8,
    "load_capacity": np.float64,
    "rated_friction": np.float64,
    "rated_friction_full": np.float64,
    "friction_margin": np.float64,
    "utilisation": np.float64,
    "clearance": np.float64,
    "margin": np.float64,
    "limiting_joint": np.int32,
}
