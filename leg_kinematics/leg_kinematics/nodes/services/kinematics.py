# SPDX-License-Identifier: Apache-2.0
"""Foot positions of joints, joints of foot positions, and the Jacobians between them."""

from __future__ import annotations

from typing import Any

import numpy as np
from leg_msgs.srv import ForwardKinematics, GetJacobian, InverseKinematics
from leg_msgs_py.arrays import to_field

from leg_kinematics.conditioning import condition_number
from leg_kinematics.nodes.frames import find_frame, read_feet, read_posture
from leg_kinematics.nodes.requests import (
    RequestError,
    check_count,
    read_joints,
)
from leg_kinematics.nodes.service import Host, service

ALL_MODES = "ALL"


@service(ForwardKinematics)
def forward_kinematics(host: Host, request: Any, response: Any) -> None:
    """Fill the foot positions of joint positions."""
    leg = host.robot.leg(request.leg)
    frame = find_frame(host, leg, request)
    joints = read_joints(leg, request, host.max_points)
    posture = leg.mechanism.forward(joints, request.assembly_mode)
    response.header.frame_id = request.header.frame_id
    response.positions = to_field(frame.points_from_leg(posture.foot_position))
    response.status = to_field(posture.status, np.uint8)


@service(InverseKinematics)
def inverse_kinematics(host: Host, request: Any, response: Any) -> None:
    """Fill the joint positions of foot positions."""
    leg = host.robot.leg(request.leg)
    mechanism = leg.mechanism
    every_mode = request.assembly_mode == ALL_MODES
    modes = mechanism.assembly_modes if every_mode else [request.assembly_mode]
    frame = find_frame(host, leg, request)
    feet = read_feet(leg, request, frame)
    check_count("positions", len(modes) * len(feet), host.max_points)
    postures = [mechanism.inverse(feet, mode) for mode in modes]
    response.assembly_modes = [mode or mechanism.assembly_modes[0] for mode in modes]
    response.joint_names = list(leg.joint_names)
    response.joint_positions = to_field([p.joint_positions for p in postures])
    response.status = to_field([p.status for p in postures], np.uint8)
    if request.include_passive_joints:
        passive = [mechanism.passive_joint_positions(p) for p in postures]
        response.passive_joint_names = list(leg.passive_joint_names)
        response.passive_joint_positions = to_field(passive)
        excursions = [mechanism.passive_joint_excursions(p) for p in postures]
        response.excursion_names = [excursion.name for excursion in mechanism.excursions]
        response.excursions = to_field(excursions)


@service(GetJacobian)
def get_jacobian(host: Host, request: Any, response: Any) -> None:
    """Fill the Jacobians of poses given by joint or foot positions."""
    leg = host.robot.leg(request.leg)
    mechanism = leg.mechanism
    frame = find_frame(host, leg, request)
    if len(request.joint_positions) and len(request.positions):
        raise RequestError(
            f"joint_positions and positions are both given ({len(request.joint_positions)} and "
            f"{len(request.positions)} values); allowed: one of them, the other empty"
        )
    if len(request.joint_positions):
        joints = read_joints(leg, request, host.max_points)
        posture = mechanism.forward(joints, request.assembly_mode)
    else:
        posture = read_posture(leg, request, frame, host.max_points)
    jacobian = mechanism.jacobian(posture)
    angular_jacobian = mechanism.angular_jacobian(posture)
    response.header.frame_id = request.header.frame_id
    response.joint_names = list(leg.joint_names)
    response.jacobian = to_field(frame.rows_from_leg(jacobian))
    response.angular_jacobian = to_field(frame.rows_from_leg(angular_jacobian))
    response.condition_number = to_field(condition_number(jacobian))
    response.status = to_field(posture.status, np.uint8)
