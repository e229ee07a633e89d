# SPDX-License-Identifier: Apache-2.0
"""Poses that tf tells are those that a request may tell, and what tf does not know is told.

`tf2_ros` has no wheels: what stands in for it here has the calls of its Python interface that are
used, and answers from a list. That the real one is called so is not tested.
"""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, TransformStamped

from leg_kinematics import load_robot
from leg_kinematics.nodes.frames import find_frame
from leg_kinematics.nodes.requests import RequestError
from leg_kinematics.nodes.transforms import Transforms

ROBOT = load_robot("hexapod")
LEG = ROBOT.leg("left_front")
NOW = 1_000  # [s]
PLACE, TURN = (1.0, 2.0, 0.5), (0.0, 0.6, 0.0, 0.8)


class Clock:
    """A clock that stands."""

    def now(self):
        return SimpleNamespace(nanoseconds=NOW * 10**9)


class Buffer:
    """Knows one transform, of one time."""

    stamp = NOW

    def lookup_transform(self, target_frame, source_frame, time, timeout=None):
        if (target_frame, source_frame) != ("map", "base_link"):
            raise sys.modules["tf2_ros"].TransformException(f'"{target_frame}" does not exist')
        if time.nanoseconds not in (0, self.stamp * 10**9):
            raise sys.modules["tf2_ros"].TransformException("extrapolation into the past")
        found = TransformStamped()
        found.header.stamp.sec = self.stamp
        place, turn = found.transform.translation, found.transform.rotation
        place.x, place.y, place.z = PLACE
        turn.x, turn.y, turn.z, turn.w = TURN
        return found


@pytest.fixture
def tf2(monkeypatch):
    """What stands in for tf2_ros."""
    module = ModuleType("tf2_ros")
    module.TransformException = type("TransformException", (Exception,), {})
    module.Buffer = type("KnownBuffer", (Buffer,), {})
    module.TransformListener = lambda buffer, node: SimpleNamespace(buffer=buffer, node=node)
    monkeypatch.setitem(sys.modules, "tf2_ros", module)
    return module


class Host:
    """Asks tf as a node does."""

    def __init__(self):
        self.robot = ROBOT
        self.transforms = Transforms(SimpleNamespace(get_clock=Clock), 1.0)

    def base_pose(self, frame_id, stamp):
        return self.transforms.base_pose(ROBOT, frame_id, stamp)


def request(frame_id, pose=None, stamp=0):
    header = SimpleNamespace(frame_id=frame_id, stamp=Time(sec=stamp))
    return SimpleNamespace(header=header, base_pose=[] if pose is None else [pose])


def explicit():
    pose = Pose()
    pose.position.x, pose.position.y, pose.position.z = PLACE
    turn = pose.orientation
    turn.x, turn.y, turn.z, turn.w = TURN
    return pose


@pytest.mark.parametrize("stamp", [0, NOW])
def test_what_tf_tells_is_what_the_request_would(tf2, stamp):
    told = find_frame(Host(), LEG, request("map", stamp=stamp))
    given = find_frame(Host(), LEG, request("map", explicit()))
    np.testing.assert_array_equal(told.mount.rotation, given.mount.rotation)
    np.testing.assert_array_equal(told.mount.position, given.mount.position)
    assert told.vertical == given.vertical


def test_the_pose_of_the_request_counts_and_tf_is_not_asked():
    host = SimpleNamespace(robot=ROBOT)
    frame = find_frame(host, LEG, request("map", explicit()))
    foot = np.array([0.1, -0.2, -0.6])
    turned = LEG.mount.to_base(foot)
    back = 2.0 * np.array(TURN[:3])[1] * TURN[3], 1.0 - 2.0 * TURN[1] ** 2  # sine, cosine
    x, y, z = turned
    wanted = [back[1] * x + back[0] * z + 1.0, y + 2.0, -back[0] * x + back[1] * z + 0.5]
    np.testing.assert_allclose(frame.points_from_leg(foot), wanted, atol=1e-12)


def test_a_frame_that_tf_does_not_know_is_told_with_its_reason(tf2):
    host = Host()
    with pytest.raises(RequestError, match=r"odom.*base_pose.*tf: \"odom\" does not exist.*again"):
        host.base_pose("odom", Time())
    with pytest.raises(RequestError) as caught:
        host.base_pose("odom", Time())
    assert "again" not in str(caught.value)


def test_a_time_that_tf_does_not_know_is_told(tf2):
    with pytest.raises(RequestError, match="tf: extrapolation into the past"):
        Host().base_pose("map", Time(sec=NOW - 60))


def test_an_old_transform_is_not_the_latest_but_one_that_was_asked_for(tf2):
    tf2.Buffer.stamp = NOW - 2
    with pytest.raises(RequestError, match=r"latest transform from 'map' is 2 s old.*at most 1 s"):
        Host().base_pose("map", Time())
    np.testing.assert_array_equal(Host().base_pose("map", Time(sec=NOW - 2)).position, PLACE)


def test_a_static_transform_is_never_old(tf2):
    tf2.Buffer.stamp = 0
    np.testing.assert_array_equal(Host().base_pose("map", Time()).position, PLACE)


def test_without_tf2_ros_the_request_is_refused_and_told_how_to_ask(monkeypatch):
    monkeypatch.setitem(sys.modules, "tf2_ros", None)
    with pytest.raises(RequestError, match=r"unknown frame 'map'.*base_pose.*tf2_ros is not inst"):
        find_frame(Host(), LEG, request("map"))
