"""The kinematics node: foot and joint positions and Jacobians of the legs of one robot."""

from __future__ import annotations

from typing import Any

import numpy as np
from leg_msgs.srv import ForwardKinematics, GetJacobian, InverseKinematics
from leg_msgs_py.arrays import to_field

from leg_kinematics.conditioning import condition_number
from leg_kinematics.mechanism import Posture
from leg_kinematics.nodes.requests import RequestError, check_count, find_frame, read_rows
from leg_kinematics.nodes.robot_node import RobotNode, run
from leg_kinematics.robot import Leg

ALL_MODES = "ALL"


class KinematicsNode(RobotNode):
    """Serves ~/forward_kinematics, ~/inverse_kinematics and ~/get_jacobian."""

    def __init__(self) -> None:
        super().__init__("kinematics")
        self.serve(ForwardKinematics, "forward_kinematics", self.forward_kinematics)
        self.serve(InverseKinematics, "inverse_kinematics", self.inverse_kinematics)
        self.serve(GetJacobian, "get_jacobian", self.get_jacobian)
        self.announce()

    def forward_kinematics(self, request: Any, response: Any) -> None:
        """Fill the foot positions of joint positions."""
        leg = self.robot.leg(request.leg)
        frame = find_frame(self.robot, leg, request.header.frame_id)
        posture = self._posture_of_joints(leg, request)
        response.header = self.header(request.header.frame_id)
        response.positions = to_field(frame.points_from_leg(posture.foot_position))
        response.status = to_field(posture.status, np.uint8)

    def inverse_kinematics(self, request: Any, response: Any) -> None:
        """Fill the joint positions of foot positions."""
        leg = self.robot.leg(request.leg)
        mechanism = leg.mechanism
        every_mode = request.assembly_mode == ALL_MODES
        modes = mechanism.assembly_modes if every_mode else [request.assembly_mode]
        frame = find_frame(self.robot, leg, request.header.frame_id)
        positions = read_rows("positions", request.positions, mechanism.task_coordinates)
        check_count("positions", len(modes) * len(positions), self.value("max_points"))
        feet = frame.points_to_leg(positions)
        postures = [mechanism.inverse(feet, mode) for mode in modes]
        response.assembly_modes = [mode or mechanism.assembly_modes[0] for mode in modes]
        response.joint_names = list(leg.joint_names)
        response.joint_positions = to_field([p.joint_positions for p in postures])
        response.status = to_field([p.status for p in postures], np.uint8)
        if request.include_passive_joints:
            passive = [mechanism.passive_joint_positions(p) for p in postures]
            response.passive_joint_names = [joint.name for joint in mechanism.passive_joints]
            response.passive_joint_positions = to_field(passive)

    def get_jacobian(self, request: Any, response: Any) -> None:
        """Fill the Jacobians of poses given by joint or foot positions."""
        leg = self.robot.leg(request.leg)
        mechanism = leg.mechanism
        frame = find_frame(self.robot, leg, request.header.frame_id)
        if len(request.joint_positions) and len(request.positions):
            raise RequestError(
                f"joint_positions and positions are both given ({len(request.joint_positions)} and "
                f"{len(request.positions)} values); allowed: one of them, the other empty"
            )
        if len(request.joint_positions):
            posture = self._posture_of_joints(leg, request)
        else:
            positions = read_rows("positions", request.positions, mechanism.task_coordinates)
            check_count("positions", len(positions), self.value("max_points"))
            posture = mechanism.inverse(frame.points_to_leg(positions), request.assembly_mode)
        jacobian = mechanism.jacobian(posture)
        angular_jacobian = mechanism.angular_jacobian(posture)
        response.header = self.header(request.header.frame_id)
        response.joint_names = list(leg.joint_names)
        response.jacobian = to_field(frame.rows_from_leg(jacobian))
        response.angular_jacobian = to_field(frame.rows_from_leg(angular_jacobian))
        response.condition_number = to_field(condition_number(jacobian))
        response.status = to_field(posture.status, np.uint8)

    def _posture_of_joints(self, leg: Leg, request: Any) -> Posture:
        joints = read_rows("joint_positions", request.joint_positions, leg.joint_names)
        check_count("joint_positions", len(joints), self.value("max_points"))
        return leg.mechanism.forward(joints, request.assembly_mode)


def main() -> int:
    """Run the node."""
    return run(KinematicsNode)
