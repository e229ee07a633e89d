# SPDX-License-Identifier: Apache-2.0
"""Legs: those of a robot, and one by itself."""

import numpy as np
import pytest

from leg_kinematics import (
    Leg,
    ParallelDrive,
    ShapeError,
    UnknownNameError,
    ValueRangeError,
    load_robot,
)


def test_a_leg_by_itself_is_a_mechanism_with_limits_at_the_origin():
    mechanism = ParallelDrive()
    limits = np.array([[-1.0, 2.0], [-3.0, 4.0], [-5.0, 6.0]])
    leg = Leg.of(mechanism, limits)
    assert leg.mechanism is mechanism
    assert leg.joint_names == tuple(joint.name for joint in mechanism.joints)
    np.testing.assert_array_equal(leg.effort_limits, limits)
    np.testing.assert_array_equal(leg.mount.to_base([0.1, 0.2, 0.3]), [0.1, 0.2, 0.3])


def test_one_pair_of_limits_is_that_of_all_actuators_and_none_limits_nothing():
    mechanism = ParallelDrive()
    np.testing.assert_array_equal(Leg.of(mechanism, (-7, 8)).effort_limits, [[-7.0, 8.0]] * 3)
    np.testing.assert_array_equal(Leg.of(mechanism).effort_limits, [[-np.inf, np.inf]] * 3)


@pytest.mark.parametrize("robot", ["hexapod", "quadruped", "walker", "gantry", "solo12"])
def test_segments_of_a_leg_connect_the_points_of_its_bars_in_the_base_frame(robot):
    for leg in load_robot(robot).legs.values():
        initial = leg.mechanism.initial_posture.joint_positions
        posture = leg.mechanism.forward(np.stack([initial, initial + 1e-3]))
        linkage = leg.mechanism.linkage(posture)
        names = [linkage.names[k] for bar in linkage.bars for k in bar[:-1]]
        starts = np.stack([linkage.point(name) for name in names], axis=1)
        segments = leg.segments(posture)
        assert segments.shape == (2, len(names), 2, 3)
        np.testing.assert_allclose(leg.mount.to_leg(segments[:, :, 0]), starts, atol=1e-12)
        polylines = [linkage.points[:, list(bar)] for bar in linkage.bars]
        length = sum(np.linalg.norm(np.diff(p, axis=1), axis=-1).sum(axis=1) for p in polylines)
        pieces = np.linalg.norm(segments[:, :, 1] - segments[:, :, 0], axis=-1)
        np.testing.assert_allclose(pieces.sum(axis=1), length, atol=1e-12)


def test_a_point_that_a_linkage_lacks_is_told_with_those_it_has():
    leg = ParallelDrive()
    with pytest.raises(UnknownNameError, match="R_D1"):
        leg.linkage(leg.initial_posture).point("Q")


@pytest.mark.parametrize("limits", [np.zeros((2, 2)), np.zeros((3, 3)), np.zeros((1, 3, 2))])
def test_limits_of_another_shape_are_refused(limits):
    with pytest.raises(ShapeError, match="effort_limits"):
        Leg.of(ParallelDrive(), limits)


def test_a_prefix_stands_before_the_names_of_frames_and_of_nothing_else():
    plain = load_robot("hexapod")
    robot = plain.with_frame_prefix("fleet-2/robot_1/")
    assert robot.base_frame == f"fleet-2/robot_1/{plain.base_frame}"
    for leg, same in zip(robot.legs.values(), plain.legs.values(), strict=True):
        assert leg.frame == f"fleet-2/robot_1/{same.frame}"
        assert (leg.name, leg.joint_names) == (same.name, same.joint_names)
    assert plain.with_frame_prefix("").base_frame == plain.base_frame


@pytest.mark.parametrize("prefix", ["/robot_1/", "robot//", "robot 1/", "robot\n", "ä/"])
def test_a_prefix_that_makes_no_frame_is_refused(prefix):
    with pytest.raises(ValueRangeError, match="frame_prefix"):
        load_robot("hexapod").with_frame_prefix(prefix)
