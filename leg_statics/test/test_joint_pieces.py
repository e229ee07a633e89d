# SPDX-License-Identifier: Apache-2.0
"""Joints that are told one by one give what one message of the whole leg gives."""

import numpy as np
import pytest

from leg_kinematics import load_robot
from leg_statics.joint_pieces import SPAN, JointPieces
from leg_statics.joint_stream import JointStateError, JointStream

ROBOT = load_robot("hexapod")
FRONT, REAR = (ROBOT.leg(name).joint_names for name in ("left_front", "right_rear"))
MS = 1_000_000


def told(joint):
    """Position, velocity and effort of a joint, each its own."""
    k = ROBOT.effort_limits()[0].index(joint)
    return [0.01 * k], [0.1 * k], [1.0 * k]


@pytest.mark.parametrize("order", [FRONT, FRONT[::-1]])
def test_one_joint_a_message_gives_the_states_of_the_whole_leg(order):
    pieces = JointPieces(ROBOT)
    found = [pieces.add(k * MS, [joint], *told(joint)) for k, joint in enumerate(order)]
    assert found[:-1] == [None, None]
    stream = JointStream(ROBOT, 0.4)
    rows = np.hstack([told(joint) for joint in FRONT])
    for one, other in zip(stream.read(*found[-1]), stream.read(FRONT, *rows), strict=True):
        np.testing.assert_array_equal(one, other)
    assert pieces.lacking == {}


def test_legs_that_a_message_completes_come_together_and_other_joints_are_ignored():
    pieces = JointPieces(ROBOT)
    for k in range(2):
        assert pieces.add(0, ["arm", FRONT[k], REAR[k]], [9.0, 0.1 * k, 0.2 * k]) is None
    whole = pieces.add(MS, [FRONT[2], REAR[2]], [0.3, 0.4])
    assert whole.names == (*FRONT, *REAR)
    np.testing.assert_array_equal(whole.position, [0.0, 0.1, 0.3, 0.0, 0.2, 0.4])
    assert np.isnan(whole.velocity).all()
    assert np.isnan(whole.effort).all()


def test_pieces_of_different_moments_are_not_put_together():
    pieces = JointPieces(ROBOT)
    pieces.add(0, [FRONT[0]], [0.0])
    pieces.add(MS, [FRONT[1]], [0.0])
    assert pieces.add(SPAN + 1, [FRONT[2]], [0.0]) is None
    assert pieces.add(SPAN + 2, [FRONT[0]], [0.0]) is not None  # the others are young enough


def test_joints_that_never_come_are_told_when_the_others_come_again():
    pieces = JointPieces(ROBOT)
    for k in range(2):
        pieces.add(k * MS, [FRONT[0]], [0.0])
    assert pieces.lacking == {"left_front": FRONT[1:]}


def test_a_piece_with_wrong_lengths_is_refused():
    with pytest.raises(JointStateError, match="position: got 2 values; allowed: 1 values"):
        JointPieces(ROBOT).add(0, [FRONT[0]], [0.0, 1.0])
