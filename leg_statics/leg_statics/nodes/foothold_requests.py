"""Requests for footholds: what a leg can carry at candidates."""

from __future__ import annotations

from typing import Any

import numpy as np
from leg_msgs_py.arrays import to_field

from leg_kinematics.errors import NotSupportedError
from leg_kinematics.nodes.requests import XYZ, check_count, find_frame, read_rows
from leg_kinematics.robot import Leg, Robot
from leg_statics.footholds import evaluate_footholds
from leg_statics.grounds import Grounds
from leg_statics.nodes.contacts import read_bias, read_contact


def fill_footholds(
    robot: Robot, grounds: Grounds, max_points: int, request: Any, response: Any
) -> None:
    """Answer a `leg_msgs/QueryFootholds`, but for the header of the response.

    Args:
        robot: The robot of the leg.
        grounds: Grounds that the request may name.
        max_points: How many candidates are accepted.
        request: The request.
        response: The response to fill.

    Raises:
        LegError: If the request cannot be carried out.
    """
    leg = standing_leg(robot, request.leg)
    frame = find_frame(robot, leg, request.header.frame_id)
    contact = read_contact(grounds, request, frame)
    contact = contact._replace(bias_efforts=read_bias(leg, request.bias_efforts))
    positions = read_rows("positions", request.positions, XYZ)
    check_count("positions", len(positions), max_points)
    found = evaluate_footholds(leg, frame.points_to_leg(positions), contact)
    response.verdict = to_field(found.verdict, np.uint8)
    response.status = to_field(found.status, np.uint8)
    response.load_capacity = to_field(found.load_capacity)
    response.rated_friction = to_field(found.rated_friction)
    response.rated_friction_full = to_field(found.rated_friction_full)
    response.friction_margin = to_field(found.friction_margin)
    response.utilisation = to_field(found.utilisation)
    response.limiting_joint = to_field(found.limiting_joint, np.int32)
    response.ranking = to_field(found.ranking, np.int32)
    response.best = found.best
    response.friction_coefficient = float(np.asarray(contact.friction))
    if request.include_efforts:
        response.joint_names = list(leg.joint_names)
        response.joint_efforts = to_field(found.joint_efforts)
        response.forces = to_field(frame.vectors_from_leg(found.force))


def standing_leg(robot: Robot, name: str) -> Leg:
    """Return a leg by its name.

    Raises:
        UnknownNameError: If there is no such leg.
        NotSupportedError: If it does not end in a foot that the ground could push.
    """
    leg = robot.leg(name)
    if not leg.mechanism.has_point_foot:
        raise NotSupportedError(
            f"{leg.name}: mechanism {leg.mechanism.name!r} has the coordinates "
            f"{', '.join(leg.mechanism.task_coordinates)}; ground reactions need x, y, z"
        )
    return leg
