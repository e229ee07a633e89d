# SPDX-License-Identifier: Apache-2.0
"""New effort limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from leg_msgs.msg import EffortLimits
from leg_msgs.srv import SetEffortLimits
from leg_msgs_py.arrays import from_field, to_field

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import UnknownNameError
from leg_kinematics.nodes.requests import RequestError
from leg_kinematics.nodes.service import no_points, service
from leg_kinematics.robot import Leg, Robot
from leg_statics.nodes.hosts import LimitsHost


def _fill_limits(host: LimitsHost, response: Any) -> None:
    response.limits = host.limits


@service(SetEffortLimits, fill_always=_fill_limits, summary=no_points, changes_host=True)
def set_effort_limits(host: LimitsHost, request: Any, response: Any) -> None:
    """Check new effort limits, then put all of them in force at once."""
    leg = host.robot.leg(request.leg)
    limits = leg.effort_limits.copy()
    limits[_joint_rows(leg, request.joint_names)] = _new_limits(request)
    legs = {**host.robot.legs, leg.name: replace(leg, effort_limits=limits)}
    host.put_in_force(replace(host.robot, legs=legs))


def limits_message(robot: Robot) -> EffortLimits:
    """Return the effort limits of a robot as a `leg_msgs/EffortLimits`, but for the header."""
    names, limits = robot.effort_limits()
    return EffortLimits(
        joint_names=list(names), lower=to_field(limits[:, 0]), upper=to_field(limits[:, 1])
    )


def _joint_rows(leg: Leg, names: Sequence[str]) -> list[int]:
    """Return where joints stand in a leg.

    Raises:
        UnknownNameError: If the leg has no such joint.
        RequestError: If a joint is named twice.
    """
    for name in names:
        if name not in leg.joint_names:
            raise UnknownNameError("joint", name, leg.joint_names)
        if list(names).count(name) > 1:
            raise RequestError(f"joint_names: {name!r} is given twice; allowed: once each")
    return [leg.joint_names.index(name) for name in names]


def _new_limits(request: Any) -> FloatArray:
    """Return the limits of a request (joints, 2).

    Raises:
        RequestError: If their number or a value is wrong.
    """
    count = len(request.joint_names)
    upper = from_field(request.upper)
    lower = from_field(request.lower) if len(request.lower) else -upper
    for field, values in (("upper", upper), ("lower", lower)):
        if len(values) != count:
            raise RequestError(f"{field}: got {len(values)} values; allowed: {count}, one a joint")
    for name, least, greatest in zip(request.joint_names, lower, upper, strict=True):
        if not (np.isfinite(greatest) and greatest >= 0.0):
            raise RequestError(f"upper of {name}: got {greatest}; allowed: finite and >= 0")
        if not (np.isfinite(least) and least <= 0.0):
            raise RequestError(f"lower of {name}: got {least}; allowed: finite and <= 0")
    return np.stack([lower, upper], axis=-1)
