# SPDX-License-Identifier: Apache-2.0
"""Compile, or load from the cache, the kernels of a robot's statics before the first question."""

from __future__ import annotations

import numpy as np

from leg_kinematics.robot import Leg, Robot
from leg_kinematics.warm_up import FAR
from leg_statics.capacity.problem import load_capacity
from leg_statics.efforts import utilisation
from leg_statics.footholds import Contact, evaluate_footholds
from leg_statics.indices import evaluate_indices
from leg_statics.joint_stream import JointStream
from leg_statics.stance.stances import Load, evaluate_stances
from leg_statics.stance.standing import robot_stance


def warm_up_statics(robot: Robot) -> None:
    """Call indices, load capacity, footholds, stances and the state of every leg once."""
    for leg in robot.legs.values():
        posture = leg.mechanism.initial_posture
        evaluate_indices(leg.mechanism, posture)
        if leg.mechanism.has_point_foot:
            jacobian = leg.mechanism.jacobian(posture)
            feet = np.tile(posture.foot_position, (2, 1))
            # limits that bind, and those that never do, which only the thorough way takes
            for tried in (leg, Leg.of(leg.mechanism)):
                lower, upper = tried.effort_limits.T
                load_capacity(jacobian, lower, upper, 0.4)
                evaluate_footholds(tried, feet, Contact(0.4))
                evaluate_footholds(tried, feet[0], Contact(0.4))
            utilisation(leg.effort_limits[:, 0], leg.effort_limits)
    warm_up_stances(robot)
    joints = [leg.mechanism.initial_posture.joint_positions for leg in robot.legs.values()]
    names, _ = robot.effort_limits()
    stream = JointStream(robot, friction=0.4)
    for positions in (np.concatenate(joints), np.full(len(names), FAR)):
        stream.read(names, positions)


def warm_up_stances(robot: Robot) -> None:
    """Evaluate the stance on all feet once, if the robot has point feet."""
    feet = {
        name: leg.mount.to_base(leg.mechanism.initial_posture.foot_position)
        for name, leg in robot.legs.items()
        if leg.mechanism.has_point_foot
    }
    if feet:
        evaluate_stances(robot_stance(robot, feet, 0.4), Load(1.0))
