"""Compile, or load from the cache, the kernels of a robot's statics before the first question."""

from __future__ import annotations

import numpy as np

from leg_kinematics.robot import Robot
from leg_statics.capacity.problem import load_capacity
from leg_statics.efforts import utilisation
from leg_statics.footholds import Contact, evaluate_footholds
from leg_statics.indices import evaluate_indices
from leg_statics.joint_stream import JointStream


def warm_up_statics(robot: Robot) -> None:
    """Call indices, load capacity, footholds and the state of every leg once."""
    for leg in robot.legs.values():
        posture = leg.mechanism.initial_posture
        evaluate_indices(leg.mechanism, posture)
        if leg.mechanism.has_point_foot:
            lower, upper = leg.effort_limits.T
            load_capacity(leg.mechanism.jacobian(posture), lower, upper, 0.4)
            feet = np.tile(posture.foot_position, (2, 1))
            contact = Contact(friction=0.4, load=[0.0, 1e9])  # one that is too heavy
            evaluate_footholds(leg, feet, contact)
            evaluate_footholds(leg, feet[0], Contact(0.4))
            utilisation(lower, leg.effort_limits)
    joints = [leg.mechanism.initial_posture.joint_positions for leg in robot.legs.values()]
    names, _ = robot.effort_limits()
    JointStream(robot, friction=0.4).read(names, np.concatenate(joints))
