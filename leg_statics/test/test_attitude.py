# SPDX-License-Identifier: Apache-2.0
"""Gravity in the base frame: by a parameter, or by the orientation that an IMU tells."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from rclpy.parameter import Parameter
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu

from leg_kinematics import load_robot
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.nodes.requests import RequestError
from leg_kinematics.robot import Mount
from leg_statics.nodes import attitude
from leg_statics.nodes.attitude import Attitude

G = 9.80665


class Node:
    """Stands for a node: its parameters, its subscription, its notes."""

    def __init__(self, **parameters):
        self.parameters = parameters
        self.robot = load_robot("hexapod")
        self.health = SimpleNamespace(notes={})
        self.transforms = SimpleNamespace(base_pose=self.tilted)
        self.heard = None
        self.checks = []

    def declare(self, name, default, description, **descriptor):
        self.parameters.setdefault(name, default)

    def declare_number(self, name, default, description, limits):
        self.parameters.setdefault(name, default)

    def value(self, name):
        return self.parameters[name]

    def listen(self, kind, topic, receive):
        self.heard = receive

    def add_on_set_parameters_callback(self, check):
        self.checks.append(check)

    def add_post_set_parameters_callback(self, renew):
        self.renew = renew

    def tilted(self, robot, frame_id, stamp):
        """Return where the base is in the frame of an IMU that is mounted upside down."""
        if frame_id != "imu_link":
            raise RequestError(f"unknown frame {frame_id!r}")
        return Mount(np.zeros(3), Rotation.from_euler("x", np.pi).as_matrix())


def imu(rotation, frame_id="base_link"):
    message = Imu()
    message.header.frame_id = frame_id
    turn = message.orientation
    turn.x, turn.y, turn.z, turn.w = rotation.as_quat()
    return message


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand."""
    now = [100.0]
    monkeypatch.setattr(attitude.time, "monotonic", lambda: now[0])
    return now


def test_without_an_imu_the_parameter_counts_and_can_be_set():
    node = Node()
    found = Attitude(node)
    np.testing.assert_array_equal(found.gravity(), [0.0, 0.0, -G])
    node.parameters["gravity"] = [1.0, 0.0, -9.0]
    node.renew([])
    np.testing.assert_array_equal(found.gravity(), [1.0, 0.0, -9.0])
    assert node.heard is None


def test_a_gravity_without_direction_is_refused():
    (check,) = (node := Node(), Attitude(node), node.checks)[-1]
    for value in ([0.0, 0.0, 0.0], [0.0, 1.0], [0.0, float("nan"), 1.0]):
        told = check([Parameter("gravity", value=value)])
        assert not told.successful
        assert "parameter gravity: got" in told.reason
    assert check([Parameter("gravity", value=[0.0, 0.0, -1.0])]).successful
    with pytest.raises(ValueRangeError, match="parameter gravity"):
        Attitude(Node(gravity=[0.0, 0.0, 0.0]))


def test_a_body_with_its_nose_up_feels_gravity_backwards(clock):
    node = Node(imu_topic="/imu")
    found = Attitude(node)
    node.heard(imu(Rotation.from_euler("y", -0.3)))  # about y to the left: nose up
    np.testing.assert_allclose(
        found.gravity(), [-G * np.sin(0.3), 0.0, -G * np.cos(0.3)], atol=1e-12
    )


def test_an_imu_may_be_mounted_anyhow_where_that_is_known(clock):
    node = Node(imu_topic="/imu")
    found = Attitude(node)
    body = Rotation.from_euler("xyz", [0.2, -0.3, 1.0])
    upside_down = Rotation.from_euler("x", np.pi)
    node.heard(imu(body * upside_down.inv(), "imu_link"))
    np.testing.assert_allclose(found.gravity(), body.inv().apply([0.0, 0.0, -G]), atol=1e-12)
    with pytest.raises(RequestError, match="unknown frame 'camera'"):
        node.heard(imu(body, "camera"))


def test_a_silent_imu_is_told_and_nothing_is_guessed(clock):
    node = Node(imu_topic="/imu")
    found = Attitude(node)
    assert np.isnan(found.gravity()).all()
    assert "no usable orientation on /imu within 0.5 s" in node.health.notes["gravity"]
    node.heard(imu(Rotation.identity()))
    np.testing.assert_array_equal(found.gravity(), [0.0, 0.0, -G])
    assert node.health.notes == {}
    clock[0] += 1.0
    assert np.isnan(found.gravity()).all()


@pytest.mark.parametrize("what", ["no orientation", "no quaternion"])
def test_an_imu_that_tells_no_orientation_is_refused(clock, what):
    node = Node(imu_topic="/imu")
    found = Attitude(node)
    message = imu(Rotation.identity())
    if what == "no orientation":
        message.orientation_covariance[0] = -1.0
    else:
        message.orientation.w = 0.0
    with pytest.raises(RequestError, match="/imu"):
        node.heard(message)
    assert np.isnan(found.gravity()).all()
