# SPDX-License-Identifier: Apache-2.0
"""The joint efforts that hold ground reactions."""

from __future__ import annotations

from typing import Any

import numpy as np
from leg_msgs.srv import ComputeEfforts
from leg_msgs_py.arrays import to_field

from leg_kinematics.arrays import FloatArray
from leg_kinematics.nodes.frames import find_frame, read_posture
from leg_kinematics.nodes.requests import XYZ, RequestError, read_rows
from leg_kinematics.nodes.service import Host, service
from leg_kinematics.status import Status
from leg_statics.efforts import joint_efforts, utilisation
from leg_statics.nodes.contacts import gravity_in_leg, standing_leg
from leg_statics.weight import weight_efforts


@service(ComputeEfforts)
def compute_efforts(host: Host, request: Any, response: Any) -> None:
    """Fill the joint efforts that hold ground reactions."""
    leg = standing_leg(host.robot, request.leg)
    frame = find_frame(host, leg, request)
    posture = read_posture(leg, request, frame, host.max_points)
    count = len(posture.status)
    forces = frame.vectors_to_leg(_vectors("forces", request.forces, count))
    no_moment = [0.0] * 3
    moments = request.moments if len(request.moments) else no_moment
    moments = frame.vectors_to_leg(_vectors("moments", moments, count))
    mechanism = leg.mechanism
    weight = weight_efforts(mechanism, posture, gravity_in_leg(frame, request))
    efforts = weight + joint_efforts(
        mechanism.jacobian(posture), mechanism.angular_jacobian(posture), forces, moments
    )
    status = posture.status.copy()
    status[~np.isfinite(forces + moments).all(axis=-1)] = Status.INVALID_INPUT
    efforts[status != Status.OK] = np.nan
    used, limiting_joint = utilisation(efforts, leg.effort_limits)
    response.joint_names = list(leg.joint_names)
    response.joint_efforts = to_field(efforts)
    response.utilisation = to_field(used)
    response.limiting_joint = to_field(limiting_joint, np.int32)
    response.status = to_field(status, np.uint8)
    response.weight_counted = mechanism.has_masses


def _vectors(field: str, values: Any, count: int) -> FloatArray:
    """Return one vector for each of `count` points, from one for all or one for each.

    Raises:
        RequestError: If there are neither 3 values nor 3 for each point.
    """
    if len(values) not in (3, 3 * count):
        raise RequestError(
            f"{field}: got {len(values)} values; allowed: 3 (one vector for all points) or "
            f"{3 * count} (x, y, z of each of {count} points)"
        )
    return np.broadcast_to(read_rows(field, values, XYZ), (count, 3))
