# SPDX-License-Identifier: Apache-2.0
"""What a leg is: names, frames, joints, limits, geometry."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Point, Pose, Quaternion
from leg_msgs.msg import LegDescription
from leg_msgs.srv import GetLegDescription
from leg_msgs_py.arrays import to_field
from scipy.spatial.transform import Rotation

from leg_kinematics.geometry import SI_UNITS, geometry_parameters
from leg_kinematics.nodes.service import Host, no_points, service
from leg_kinematics.robot import Leg, Robot
from leg_statics.indices import supported_indices


def _fill_legs(host: Host, response: Any) -> None:
    response.legs = list(host.robot.legs)


@service(GetLegDescription, fill_always=_fill_legs, summary=no_points)
def get_leg_description(host: Host, request: Any, response: Any) -> None:
    """Fill the description of a leg, if one is meant."""
    if request.leg or len(host.robot.legs) == 1:
        response.description = description_message(host.robot, host.robot.leg(request.leg))


def description_message(robot: Robot, leg: Leg) -> Any:
    """Return a leg as a `leg_msgs/LegDescription`."""
    mechanism = leg.mechanism
    x, y, z = map(float, leg.mount.position)
    turn = map(float, Rotation.from_matrix(leg.mount.rotation).as_quat())
    parameters = geometry_parameters(leg.geometry)
    return LegDescription(
        robot=robot.name,
        leg=leg.name,
        leg_type=leg.leg_type,
        mechanism=mechanism.name,
        base_frame=robot.base_frame,
        leg_frame=leg.frame,
        mount=Pose(
            position=Point(x=x, y=y, z=z),
            orientation=Quaternion(**dict(zip(("x", "y", "z", "w"), turn, strict=True))),
        ),
        mirrored=leg.mirrored,
        joint_names=list(leg.joint_names),
        joint_types=[joint.type for joint in mechanism.joints],
        joint_position_units=[joint.unit for joint in mechanism.joints],
        joint_position_lower=to_field(mechanism.joint_limits[:, 0]),
        joint_position_upper=to_field(mechanism.joint_limits[:, 1]),
        joint_effort_units=[joint.effort_unit for joint in mechanism.joints],
        joint_effort_lower=to_field(leg.effort_limits[:, 0]),
        joint_effort_upper=to_field(leg.effort_limits[:, 1]),
        passive_joint_names=list(leg.passive_joint_names),
        passive_joint_types=[joint.type for joint in mechanism.passive_joints],
        passive_joint_position_units=[joint.unit for joint in mechanism.passive_joints],
        excursion_names=[excursion.name for excursion in mechanism.excursions],
        excursion_units=[excursion.unit for excursion in mechanism.excursions],
        excursion_lower=to_field(mechanism.passive_joint_limits[:, 0]),
        excursion_upper=to_field(mechanism.passive_joint_limits[:, 1]),
        weight_counted=mechanism.has_masses,
        task_coordinates=list(mechanism.task_coordinates),
        task_units=list(mechanism.task_units),
        assembly_modes=list(mechanism.assembly_modes),
        initial_foot_position=mechanism.initial_posture.foot_position[..., :3],
        geometry_names=[f.name for f in parameters],
        geometry_symbols=[f.metadata["symbol"] for f in parameters],
        geometry_values=to_field([getattr(leg.geometry, f.name) for f in parameters]),
        geometry_units=[SI_UNITS[f.metadata["dimension"]] for f in parameters],
        index_names=list(supported_indices(mechanism)),
    )
