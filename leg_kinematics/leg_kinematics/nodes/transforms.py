# SPDX-License-Identifier: Apache-2.0
"""Where the base frame is, as tf tells: on robots, where `tf2_ros` is installed."""

from __future__ import annotations

import importlib
from typing import Any

from rclpy.node import Node
from rclpy.time import Time

from leg_kinematics.nodes.frames import no_transforms, read_mount
from leg_kinematics.nodes.requests import RequestError
from leg_kinematics.robot import Mount, Robot


class Transforms:
    """Listens to tf from the first question on: who is not asked does not pay for it.

    Nothing is waited for: what is not known now is told.

    Args:
        node: The node that listens.
        oldest: How old the latest transform may be, if a request tells no time [s].
    """

    def __init__(self, node: Node, oldest: float) -> None:
        self._node = node
        self._oldest = oldest
        self._tf2: Any = None
        self._buffer: Any = None
        self._listener: Any = None

    def listen(self) -> None:
        """Listen from now on.

        Raises:
            ImportError: If `tf2_ros` is not installed.
        """
        if self._listener is None:
            self._tf2 = importlib.import_module("tf2_ros")
            self._buffer = self._tf2.Buffer()
            self._listener = self._tf2.TransformListener(self._buffer, self._node)

    def base_pose(self, robot: Robot, frame_id: str, stamp: Any) -> Mount:
        """Return where the base frame of a robot is in another frame.

        Args:
            robot: The robot.
            frame_id: Name of the frame.
            stamp: Time of the pose (builtin_interfaces/Time); zero for the latest.

        Raises:
            RequestError: If it is not known, or the latest is too old.
        """
        just_begun = self._listener is None
        try:
            self.listen()
        except ImportError:
            why = "tf is not asked, since tf2_ros is not installed here"
            raise no_transforms(robot, frame_id, why) from None
        try:
            found = self._buffer.lookup_transform(frame_id, robot.base_frame, Time.from_msg(stamp))
        except self._tf2.TransformException as error:
            why = f"tf: {error}"
            if just_begun:
                why += " (tf is listened to from this request on: ask again)"
            raise no_transforms(robot, frame_id, why) from None
        self._check_age(stamp, found.header.stamp, frame_id)
        return read_mount("tf", found.transform.translation, found.transform.rotation)

    def _check_age(self, asked: Any, found: Any, frame_id: str) -> None:
        """Raise a RequestError if a request for the latest transform would get an old one."""
        if _nanoseconds(asked) or not _nanoseconds(found):  # a time was told; static transforms
            return
        age = 1e-9 * (self._node.get_clock().now().nanoseconds - _nanoseconds(found))
        if age > self._oldest:
            raise RequestError(
                f"header.frame_id: tf's latest transform from {frame_id!r} is {age:.3g} s old; "
                f"allowed: at most {self._oldest:g} s (parameter transform_age), a header.stamp of "
                "that time, or base_pose"
            )


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)
