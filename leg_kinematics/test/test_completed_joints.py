# SPDX-License-Identifier: Apache-2.0
"""Joint states completed: what drives tell, in any pieces, gives all joints of the bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from leg_kinematics import load_robot
from leg_kinematics.completed_joints import CompletedJoints
from leg_kinematics.robot import Drives

ROBOTS = ("hexapod", "quadruped", "walker", "gantry", "solo12")


def initial(robot):
    """Return names and positions of all drives in the initial posture, a little moved."""
    names = [name for leg in robot.legs.values() for name in leg.joint_names]
    rest = [leg.mechanism.initial_posture.joint_positions for leg in robot.legs.values()]
    return names, np.concatenate(rest) + 1e-3


@pytest.mark.parametrize("name", ROBOTS)
def test_every_joint_of_every_leg_stands_where_the_mechanism_tells(name):
    robot = load_robot(name)
    joints = CompletedJoints(robot)
    joints.add(*initial(robot))
    found = dict(zip(*joints.take(), strict=True))
    for leg in robot.legs.values():
        posture = leg.mechanism.forward(leg.mechanism.initial_posture.joint_positions + 1e-3)
        wanted = leg.mechanism.tree_positions(posture)
        told = [found.pop(joint) for joint in leg.tree_joint_names()]
        np.testing.assert_allclose(told, wanted, rtol=0, atol=1e-12)
    assert not found


def test_a_leg_is_told_when_all_its_drives_have_and_again_when_one_changes():
    robot = load_robot("hexapod")
    joints, leg = CompletedJoints(robot), robot.leg("left_rear")
    for name in leg.joint_names[:2]:
        joints.add([name], np.array([0.05]))
        assert joints.take().names == ()
    joints.add([leg.joint_names[2], "wheel"], np.array([0.02, 7.0]))
    assert joints.take().names == leg.tree_joint_names()
    assert joints.take().names == ()
    joints.add([leg.joint_names[0]], np.array([0.01]))
    found = dict(zip(*joints.take(), strict=True))
    assert [found[name] for name in leg.joint_names] == [0.01, 0.05, 0.02]


def test_a_leg_whose_loops_do_not_close_is_left_out():
    robot = load_robot("quadruped")
    joints = CompletedJoints(robot)
    names, values = initial(robot)
    values[0] = 9.0
    joints.add(names, values)
    found = joints.take().names
    first, *others = robot.legs.values()
    assert not {*found} & {*first.tree_joint_names()}
    assert {*others[-1].tree_joint_names()} < {*found}


def test_what_drives_tell_becomes_joint_positions():
    robot = load_robot("hexapod")
    leg = replace(robot.leg("left_rear"), drives=Drives(np.full(3, -2.0), np.full(3, 0.5)))
    joints = CompletedJoints(replace(robot, legs={leg.name: leg}))
    joints.add(leg.joint_names, np.array([0.49, 0.5, 0.52]))
    found = dict(zip(*joints.take(), strict=True))
    np.testing.assert_allclose([found[n] for n in leg.joint_names], [0.02, 0.0, -0.04], atol=1e-12)
