# SPDX-License-Identifier: Apache-2.0
"""What the feet of a robot carry together, for many stances at once."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from leg_msgs.srv import QueryStance
from leg_msgs_py.arrays import from_field, to_field

from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.nodes.frames import read_poses
from leg_kinematics.nodes.requests import RequestError, check_count
from leg_kinematics.nodes.service import Summary, service
from leg_kinematics.robot import Leg, Robot
from leg_statics.nodes.contacts import finite, standing_legs
from leg_statics.nodes.hosts import GroundsHost
from leg_statics.stance.region import margin_along, support_region
from leg_statics.stance.stances import (
    Load,
    Stance,
    StanceVerdict,
    evaluate_stances,
    payload,
    ranking_of,
)
from leg_statics.stance.standing import BodyPose, robot_load, robot_stance
from leg_statics.weight import LEVEL_GRAVITY

FEWEST_DIRECTIONS, MOST_DIRECTIONS = 3, 360


class Asked(NamedTuple):
    """A request, read: stances and load with one leading axis (S,)."""

    legs: Sequence[Leg]
    pose: BodyPose
    stance: Stance
    load: Load


def _summary(response: Any) -> Summary:
    numbers, counts = np.unique(from_field(response.verdict, dtype=np.uint8), return_counts=True)
    kinds = map(StanceVerdict, numbers)
    verdicts = Counter[IntEnum](dict(zip(kinds, counts.tolist(), strict=True)))
    best = response.load_factor[response.best] if response.ranking else np.nan
    return Summary(len(response.verdict), verdicts[StanceVerdict.STANDS], best, verdicts)


@service(QueryStance, summary=_summary, best_unit="x")
def query_stance(host: GroundsHost, request: Any, response: Any) -> None:
    """Fill what the feet carry together in each stance."""
    directions = _directions(request.region_directions)
    asked = _read(host, request, max(1, directions))
    stance, load = asked.stance, asked.load
    found = evaluate_stances(stance, load)
    merit = found.load_factor
    if directions:
        region = support_region(stance, load, directions)
        merit = region.margin
        response.margin = to_field(region.margin)
        response.margin_error = to_field(region.error)
        response.region = to_field(region.vertices)
    if len(request.payload_position):
        position = asked.pose.from_base(_vectors("payload_position", request.payload_position)[0])
        response.payload = to_field(payload(stance, load, position).multiple)
    if len(request.margin_direction):
        direction = _vectors("margin_direction", request.margin_direction)[0]
        response.margin_along = to_field(margin_along(stance, load, direction).multiple)
    ranking = ranking_of(found.stands, merit)
    response.header.frame_id = request.header.frame_id
    response.legs = [leg.name for leg in asked.legs]
    response.weight_counted = [leg.mechanism.has_masses for leg in asked.legs]
    response.mass = float(np.asarray(load.mass))
    response.friction_coefficients = to_field(np.asarray(stance.friction)[0])
    response.verdict = to_field(found.verdict, np.uint8)
    response.status = to_field(stance.status, np.uint8)
    response.load_factor = to_field(found.load_factor)
    response.utilisation = to_field(found.utilisation)
    response.limit = to_field(found.limit, np.uint8)
    response.limiting_leg = to_field(found.limiting_leg, np.int32)
    response.limiting_joint = to_field(found.limiting_joint, np.int32)
    response.ranking = to_field(ranking, np.int32)
    response.best = int(ranking[0]) if len(ranking) else -1
    if request.include_forces:
        response.joint_names = [name for leg in asked.legs for name in leg.joint_names]
        efforts = [
            found.joint_efforts[:, k, : len(leg.joint_names)] for k, leg in enumerate(asked.legs)
        ]
        response.joint_efforts = to_field(np.concatenate(efforts, axis=-1))
        response.force = to_field(found.force)


def _read(host: GroundsHost, request: Any, directions: int) -> Asked:
    """Return a request as stances and their load.

    Raises:
        UnknownNameError: If there is no such leg or ground.
        NotSupportedError: If a leg has no point foot.
        RequestError: If something does not fit or is out of range.
    """
    legs = standing_legs(host.robot, list(request.legs) or list(host.robot.legs))
    count = len(legs)
    pose = _poses(host.robot, request)
    rows = {
        "base_poses": as_array("base_poses", pose.position, 3),
        "feet": _rows("feet", request.feet, 3 * count).reshape(-1, count, 3),
        "friction_coefficients": _friction(host, request, count),
        "normals": _normals(request, count),
        "center_of_mass": _vectors("center_of_mass", request.center_of_mass),
    }
    several = {name: len(row) for name, row in rows.items() if len(row) > 1}
    if not len(rows["feet"]):  # no stances
        several["feet"] = 0
    if len(set(several.values())) > 1:
        told = ", ".join(f"{name} {number}" for name, number in several.items())
        raise RequestError(f"stances: got {told}; allowed: 1 row, or as many as the others have")
    stances = max(several.values(), default=1)
    check_count("stances, legs and directions", stances * count * directions, host.max_points)
    load = _load(host.robot, request, pose, rows["center_of_mass"])
    feet = np.broadcast_to(rows["feet"], (stances, count, 3))
    normal = rows["normals"] if len(rows["normals"]) else -np.asarray(load.gravity)
    stance = robot_stance(
        host.robot,
        {leg.name: feet[:, k] for k, leg in enumerate(legs)},
        rows["friction_coefficients"],
        pose,
        normal=normal,
        gravity=load.falling,
    )
    return Asked(legs, pose, stance, load)


def _poses(robot: Robot, request: Any) -> BodyPose:
    """Return the poses of the base frame (1 or S)."""
    frame, poses = request.header.frame_id, request.base_poses
    if not poses:
        if frame not in ("", robot.base_frame):
            raise RequestError(
                f"header.frame_id: got {frame!r}; allowed without base_poses: '' or "
                f"{robot.base_frame!r} (the robot's base)"
            )
        return BodyPose(np.zeros((1, 3)), np.eye(3)[None])
    if frame in ("", robot.base_frame):
        raise RequestError(
            f"header.frame_id: got {frame!r} with base_poses; allowed: the name of the frame in "
            "which they are, such as 'map'"
        )
    return BodyPose(*read_poses("base_poses", poses))


def _friction(host: GroundsHost, request: Any, legs: int) -> FloatArray:
    """Return the friction coefficients (1 or S, L)."""
    told = from_field(request.friction_coefficients)
    if bool(request.ground) == bool(len(told)):
        raise RequestError(
            f"ground: got {request.ground!r} and {len(told)} friction_coefficients; allowed: a "
            "name or coefficients"
        )
    if request.ground:
        ground = host.grounds.find(request.ground)
        mu = ground.friction_high if request.use_high_end else ground.friction_low
        return np.full((1, legs), mu)
    if not np.all(told >= 0.0):
        raise RequestError(
            f"friction_coefficients: got {told[~(told >= 0.0)][0]}; allowed: >= 0, infinity "
            "included"
        )
    if len(told) == 1:
        return np.full((1, legs), told[0])
    return _rows("friction_coefficients", request.friction_coefficients, legs)


def _normals(request: Any, legs: int) -> FloatArray:
    """Return the normals of the ground (1 or S, L, 3); (0, L, 3) if level."""
    if len(request.normals) == 3:
        normals = np.broadcast_to(from_field(request.normals), (1, legs, 3))
    else:
        normals = _rows("normals", request.normals, 3 * legs).reshape(-1, legs, 3)
    if not (np.isfinite(normals).all() and normals.any(axis=-1).all()):
        raise RequestError("normals: got a zero or not finite vector; allowed: any other")
    return normals


def _load(robot: Robot, request: Any, pose: BodyPose, center: FloatArray) -> Load:
    """Return the load."""
    mass, gravity = float(request.mass), finite("gravity", request.gravity)
    if not 0.0 <= mass < math.inf:
        raise RequestError(f"mass: got {mass}; allowed: finite and >= 0 kg, 0 = the description's")
    if not gravity.any():
        gravity = np.array(LEVEL_GRAVITY)
    load = Load(mass, pose.from_base(np.zeros(3)), gravity) if mass else robot_load(robot, pose)
    if len(center):
        load = load._replace(center_of_mass=pose.from_base(center))
    wrench = finite("wrench", request.wrench)
    return load._replace(
        gravity=gravity,
        acceleration=finite("acceleration", request.acceleration),
        force=wrench[:3],
        moment=wrench[3:],
    )


def _directions(count: int) -> int:
    if count and not FEWEST_DIRECTIONS <= count <= MOST_DIRECTIONS:
        raise RequestError(
            f"region_directions: got {count}; allowed: 0, or {FEWEST_DIRECTIONS} to "
            f"{MOST_DIRECTIONS}"
        )
    return count


def _rows(field: str, values: Any, columns: int) -> FloatArray:
    """Return a flat field as rows (m, columns)."""
    if len(values) % columns:
        raise RequestError(
            f"{field}: got {len(values)} values; allowed: {columns}, or {columns} for each stance"
        )
    rows: FloatArray = from_field(values, (-1, columns))
    return rows


def _vectors(field: str, values: Any) -> FloatArray:
    """Return vectors (m, 3)."""
    return _rows(field, values, 3)
