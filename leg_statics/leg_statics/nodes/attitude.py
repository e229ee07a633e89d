# SPDX-License-Identifier: Apache-2.0
"""Which way gravity acts on the body: as a parameter says, or as an IMU tells."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from rcl_interfaces.msg import SetParametersResult  # type: ignore[import-untyped]
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.nodes.frames import read_mount
from leg_kinematics.nodes.requests import RequestError
from leg_kinematics.nodes.robot_node import RobotNode
from leg_kinematics.robot import BASE, Mount
from leg_statics.weight import LEVEL_GRAVITY

LATEST = Imu().header.stamp
UNKNOWN: FloatArray = np.full(3, np.nan)
NOTE = "gravity"
ORIGIN = Imu().linear_acceleration  # zero


class Attitude:
    """Tells gravity in the base frame.

    Args:
        node: The node whose parameters and subscription it declares.

    Raises:
        LegError: If a parameter is wrong.
    """

    def __init__(self, node: RobotNode) -> None:
        self._node = node
        node.declare(
            "gravity",
            list(LEVEL_GRAVITY),
            "Acceleration of gravity in the base frame for ~/leg_states, if no IMU tells it "
            "[m/s^2]: that of a level body by default.",
        )
        node.declare(
            "imu_topic",
            "",
            "Topic of a sensor_msgs/Imu whose orientation tells gravity for ~/leg_states instead; "
            "'' for none.",
            read_only=True,
        )
        node.declare_number(
            "imu_patience",
            0.5,
            "After how long without a message of the IMU gravity is not known any more [s].",
            (0.01, 3600.0),
        )
        self._topic: str = node.value("imu_topic")
        self._heard = -np.inf
        self._told: FloatArray = UNKNOWN
        self._constant = _gravity(node.value("gravity"))
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._renew)
        if self._topic:
            node.listen(Imu, self._topic, self._take)

    def gravity(self) -> FloatArray:
        """Return gravity in the base frame (3,) [m/s²]; NaN if the IMU is silent."""
        if not self._topic:
            return self._constant
        patience = self._node.value("imu_patience")
        if time.monotonic() - self._heard <= patience:
            self._node.health.notes.pop(NOTE, None)
            return self._told
        self._node.health.notes[NOTE] = (
            f"no usable orientation on {self._topic} within {patience:g} s: "
            "load capacity and contact in ~/leg_states are not known"
        )
        return UNKNOWN

    def _take(self, message: Any) -> None:
        """Take up what the IMU tells.

        Raises:
            RequestError: If it tells no orientation, or it is not known how it is mounted.
        """
        if message.orientation_covariance[0] == -1.0:
            raise RequestError(
                f"{self._topic}: orientation_covariance[0] is -1, no orientation is told; allowed: "
                "an IMU with orientation"
            )
        world = read_mount(self._topic, ORIGIN, message.orientation)
        body = self._base_in(message.header.frame_id)
        self._told = body.vectors_to_leg(world.vectors_to_leg(np.array(LEVEL_GRAVITY)))
        self._heard = time.monotonic()

    def _base_in(self, frame_id: str) -> Mount:
        """Return where the base frame is in that of the IMU.

        Raises:
            RequestError: If it is not known.
        """
        robot = self._node.robot
        if frame_id in ("", robot.base_frame):
            return BASE
        return self._node.transforms.base_pose(robot, frame_id, LATEST)

    def _check(self, parameters: Sequence[Parameter]) -> Any:
        for parameter in parameters:
            if parameter.name == "gravity":
                try:
                    _gravity(parameter.value)
                except ValueRangeError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _renew(self, parameters: Sequence[Parameter]) -> None:
        self._constant = _gravity(self._node.value("gravity"))


def _gravity(value: Any) -> FloatArray:
    """Return the parameter `gravity` (3,).

    Raises:
        ValueRangeError: If it is no direction.
    """
    gravity = np.array(value, dtype=np.float64)
    if gravity.shape != (3,) or not np.isfinite(gravity).all() or not gravity.any():
        raise ValueRangeError(
            f"parameter gravity: got {list(value)}; allowed: 3 finite numbers, not all zero"
        )
    return gravity
