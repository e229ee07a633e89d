# SPDX-License-Identifier: Apache-2.0
"""What a robot's legs are: names, frames, joints, limits, geometry."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from leg_msgs.srv import GetLegDescription
from leg_msgs_py.arrays import FloatArray, from_field
from leg_msgs_py.client.questions import Request, question
from leg_msgs_py.errors import UnknownLegError


class GeometryParameter(NamedTuple):
    """One dimension of a mechanism.

    Attributes:
        symbol: The literature's symbol.
        value: Value [unit].
        unit: "m", "rad" or "1".
    """

    symbol: str
    value: float
    unit: str


class LegDescription(NamedTuple):
    """Answer of `describe`; the comments of `leg_msgs/LegDescription` say more.

    Attributes:
        robot: Name of the robot.
        leg: Name of the leg.
        leg_type: Name of its type in the robot description.
        mechanism: Name of its mechanism.
        base_frame: Name of the robot's base frame.
        leg_frame: Name of the leg's own frame.
        mount_position: Origin of the leg frame in the base frame (3,) [m].
        mount_orientation: Quaternion x, y, z, w of the leg frame in the base frame (4,).
        mirrored: Whether this leg is its leg type mirrored in x.
        joint_names: Names of the actuated joints (n).
        joint_types: "revolute" or "prismatic" (n).
        joint_units: Units of position (n).
        joint_limits: Least and greatest position (n, 2) [rad or m].
        effort_units: Units of effort (n).
        effort_limits: Least and greatest effort (n, 2) [N.m or N].
        passive_joint_names: Names of the passive joints that have a position (p).
        passive_joint_types: "revolute" or "prismatic" (p).
        passive_joint_units: Units of position (p).
        excursion_names: Names of the excursions of passive joints that are limited (e).
        excursion_units: Their units (e).
        excursion_limits: Least and greatest excursion (e, 2) [rad or m].
        weight_counted: Whether the leg's own weight counts: whether a model tells its masses.
        task_coordinates: Names of the foot's coordinates (t).
        task_units: Their units (t).
        assembly_modes: Names of the branches of the closed chain; the first is the default.
        initial_foot_position: Foot in the initial pose, in the leg's own frame (3,) [m].
        geometry: The mechanism's dimensions by name.
        index_names: Names that `evaluate_indices` accepts.
    """

    robot: str
    leg: str
    leg_type: str
    mechanism: str
    base_frame: str
    leg_frame: str
    mount_position: FloatArray
    mount_orientation: FloatArray
    mirrored: bool
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    joint_units: tuple[str, ...]
    joint_limits: FloatArray
    effort_units: tuple[str, ...]
    effort_limits: FloatArray
    passive_joint_names: tuple[str, ...]
    passive_joint_types: tuple[str, ...]
    passive_joint_units: tuple[str, ...]
    excursion_names: tuple[str, ...]
    excursion_units: tuple[str, ...]
    excursion_limits: FloatArray
    weight_counted: bool
    task_coordinates: tuple[str, ...]
    task_units: tuple[str, ...]
    assembly_modes: tuple[str, ...]
    initial_foot_position: FloatArray
    geometry: dict[str, GeometryParameter]
    index_names: tuple[str, ...]

    @classmethod
    def from_message(cls, message: Any) -> LegDescription:
        """Return the content of a `leg_msgs/LegDescription`."""
        origin, turn = message.mount.position, message.mount.orientation

        def pairs(lower: Any, upper: Any) -> FloatArray:
            return np.stack([from_field(lower), from_field(upper)], axis=-1)

        parameters = zip(
            message.geometry_symbols, message.geometry_values, message.geometry_units, strict=True
        )
        return cls(
            robot=message.robot,
            leg=message.leg,
            leg_type=message.leg_type,
            mechanism=message.mechanism,
            base_frame=message.base_frame,
            leg_frame=message.leg_frame,
            mount_position=np.array([origin.x, origin.y, origin.z]),
            mount_orientation=np.array([turn.x, turn.y, turn.z, turn.w]),
            mirrored=message.mirrored,
            joint_names=tuple(message.joint_names),
            joint_types=tuple(message.joint_types),
            joint_units=tuple(message.joint_position_units),
            joint_limits=pairs(message.joint_position_lower, message.joint_position_upper),
            effort_units=tuple(message.joint_effort_units),
            effort_limits=pairs(message.joint_effort_lower, message.joint_effort_upper),
            passive_joint_names=tuple(message.passive_joint_names),
            passive_joint_types=tuple(message.passive_joint_types),
            passive_joint_units=tuple(message.passive_joint_position_units),
            excursion_names=tuple(message.excursion_names),
            excursion_units=tuple(message.excursion_units),
            excursion_limits=pairs(message.excursion_lower, message.excursion_upper),
            weight_counted=message.weight_counted,
            task_coordinates=tuple(message.task_coordinates),
            task_units=tuple(message.task_units),
            assembly_modes=tuple(message.assembly_modes),
            initial_foot_position=np.array(message.initial_foot_position),
            geometry={
                name: GeometryParameter(*parameter)
                for name, parameter in zip(message.geometry_names, parameters, strict=True)
            },
            index_names=tuple(message.index_names),
        )


@question("statics", GetLegDescription)
def legs() -> Request[tuple[str, ...]]:
    """Return the names of all legs of the robot."""
    return Request(GetLegDescription.Request(), lambda response: tuple(response.legs))


@question("statics", GetLegDescription)
def describe(leg: str) -> Request[LegDescription]:
    """Return what a leg is: names, frames, joints, limits, geometry.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
    """

    def decode(response: Any) -> LegDescription:
        if not response.description.leg:  # without a name the node tells those of several legs
            raise UnknownLegError(f"leg: got ''; allowed: {', '.join(response.legs)}")
        return LegDescription.from_message(response.description)

    return Request(GetLegDescription.Request(leg=leg), decode)
