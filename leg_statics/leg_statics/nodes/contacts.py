# SPDX-License-Identifier: Apache-2.0
"""What the nodes share in reading requests about grounds: friction, normal, loads and moments."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from leg_msgs.msg import Ground

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import DescriptionError, NotSupportedError
from leg_kinematics.nodes.requests import LegFrame, RequestError
from leg_kinematics.robot import Leg, Robot
from leg_statics.footholds import Contact
from leg_statics.grounds import Grounds, load_grounds

if TYPE_CHECKING:  # requests are read without ROS, too
    from leg_kinematics.nodes.robot_node import RobotNode

NO_FRICTION_GIVEN = Ground().friction_coefficient


def declare_grounds(node: RobotNode) -> Grounds:
    """Declare the parameter `grounds` of a node and load the file that it names.

    Raises:
        DescriptionError: If the file is missing or wrong.
    """
    node.declare(
        "grounds",
        "grounds",
        "Grounds that requests may name: path of a YAML file, or 'grounds' for the shipped one.",
        read_only=True,
    )
    source = node.value("grounds")
    if not source:
        raise DescriptionError("parameter grounds: got ''; allowed: the path of a YAML file")
    return load_grounds(source)


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


def read_ground(grounds: Grounds, ground: Any, frame: LegFrame) -> Contact:
    """Return a `leg_msgs/Ground` as an unloaded contact.

    Args:
        grounds: The grounds that it may name.
        ground: The message.
        frame: Frame of its normal.

    Raises:
        UnknownNameError: If it names an unknown ground.
        RequestError: If friction or normal are out of range, or there is no ground.
    """
    friction = _friction(grounds, ground)
    if not any(ground.normal):
        return Contact(friction)
    normal = _finite("ground.normal", ground.normal)
    return Contact(friction, _numbers(frame.vectors_to_leg(normal)))


def is_ground(ground: Any) -> bool:
    """Tell whether a `leg_msgs/Ground` says anything of a ground."""
    return _tells_friction(ground) or any(ground.normal)


def read_contact(grounds: Grounds, request: Any, frame: LegFrame) -> Contact:
    """Return the contact of a request that has ground, required load and moments.

    Raises:
        UnknownNameError: If it names an unknown ground.
        RequestError: If a value is out of range.
    """
    moment = frame.vectors_to_leg(_finite("required_moment", request.required_moment))
    return Contact(
        *read_ground(grounds, request.ground, frame)[:2],
        load=magnitude("required_load", request.required_load, "N"),
        moment=_numbers(moment),
        any_direction_moment=magnitude("any_direction_moment", request.any_direction_moment, "N.m"),
    )


def read_bias(leg: Leg, values: Any) -> tuple[float, ...]:
    """Return the efforts that the actuators of a leg exert anyway (n,).

    Raises:
        RequestError: If their number is wrong or one is not finite.
    """
    count = len(leg.joint_names)
    if len(values) not in (0, count):
        raise RequestError(
            f"bias_efforts: got {len(values)} values; allowed: {count} "
            f"({', '.join(leg.joint_names)}) or none"
        )
    return _numbers(_finite("bias_efforts", values)) if len(values) else (0.0,) * count


def _numbers(vector: FloatArray) -> tuple[float, ...]:
    """Return a vector as plain numbers: what is known of such a contact is kept."""
    return tuple(vector.tolist())


def _friction(grounds: Grounds, ground: Any) -> float:
    if ground.name:
        found = grounds.find(ground.name)
        return found.friction_high if ground.use_high_end else found.friction_low
    if not _tells_friction(ground):
        raise RequestError(
            "ground: neither name nor friction_coefficient is given; allowed: a name "
            f"({', '.join(grounds.by_name)}), or a friction coefficient >= 0"
        )
    friction = float(ground.friction_coefficient)
    if not friction >= 0.0:
        raise RequestError(
            f"ground.friction_coefficient: got {friction}; allowed: >= 0, infinity included"
        )
    return friction


def _tells_friction(ground: Any) -> bool:
    return bool(ground.name) or ground.friction_coefficient != NO_FRICTION_GIVEN


def magnitude(field: str, value: float, unit: str) -> float:
    """Return a number of a request that is a size.

    Raises:
        RequestError: If it is negative or not finite.
    """
    if not 0.0 <= value < np.inf:
        raise RequestError(f"{field}: got {value}; allowed: finite and >= 0 {unit}")
    return float(value)


def _finite(field: str, values: Any) -> FloatArray:
    if not all(map(math.isfinite, values)):
        raise RequestError(f"{field}: got {list(map(float, values))}; allowed: finite values")
    return np.array(values, dtype=np.float64)
