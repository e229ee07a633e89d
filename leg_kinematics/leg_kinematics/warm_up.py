# SPDX-License-Identifier: Apache-2.0
"""Compile, or load from the cache, the kernels of a robot's legs before the first question."""

from __future__ import annotations

import numpy as np

from leg_kinematics.conditioning import condition_number
from leg_kinematics.robot import Robot

FAR = 1e5  # joint positions that no leg has: only the thorough way of a mechanism takes them


def warm_up_kinematics(robot: Robot) -> None:
    """Call the kinematics of every kind of leg once."""
    for mechanism in {leg.mechanism: None for leg in robot.legs.values()}:
        foot = mechanism.initial_posture.foot_position
        posture = mechanism.inverse(foot)
        condition_number(mechanism.jacobian(posture))
        mechanism.angular_jacobian(posture)
        mechanism.passive_joint_positions(posture)
        mechanism.inverse_with_twist(foot)
        mechanism.forward(np.full(len(mechanism.joints), FAR))
