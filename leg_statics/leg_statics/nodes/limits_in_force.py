# SPDX-License-Identifier: Apache-2.0
"""The effort limits that the statics node has put in force, for the nodes beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from leg_msgs.msg import EffortLimits
from leg_msgs_py.arrays import from_field
from rclpy.qos import DurabilityPolicy, QoSProfile

from leg_kinematics.nodes.robot_node import RobotNode
from leg_kinematics.robot import Robot

LIMITS_TYPE = "leg_msgs/msg/EffortLimits"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NOTE = "effort limits"


class LimitsInForce:
    """Hears of effort limits.

    Args:
        node: The node that listens.
        what: What has the limits last heard of, for its diagnostics.
        changed: Called when there are new ones.
    """

    def __init__(self, node: RobotNode, what: str, changed: Callable[[], None]) -> None:
        self._node = node
        self._what = what
        self._changed = changed
        self._message: Any = None
        self._subscription = node.create_subscription(
            EffortLimits, "statics/effort_limits", self._take, LATCHED
        )

    def of(self, robot: Robot) -> Robot:
        """Return a robot with the limits last heard of, if they are its own."""
        message = self._message
        if message is None or not set(message.joint_names) >= set(robot.effort_limits()[0]):
            return robot
        rows = np.stack([from_field(message.lower), from_field(message.upper)], axis=-1)
        limits = dict(zip(message.joint_names, rows, strict=True))
        legs = {
            name: replace(leg, effort_limits=np.array([limits[joint] for joint in leg.joint_names]))
            for name, leg in robot.legs.items()
        }
        return replace(robot, legs=legs)

    def look_around(self) -> None:
        """Note if no node tells the limits in force, as when the statics node has another name."""
        node, topic = self._node, self._subscription.topic_name
        node.health.notes.pop(NOTE, None)
        if self._subscription.get_publisher_count():
            return
        told = [name for name, types in node.get_topic_names_and_types() if LIMITS_TYPE in types]
        elsewhere = [name for name in told if node.count_publishers(name)]
        node.health.notes[NOTE] = (
            f"no node publishes {topic}: {self._what} have the limits last heard of, or else the "
            "robot description's"
            + (f"; remap statics/effort_limits to {' or '.join(elsewhere)}" if elsewhere else "")
        )

    def _take(self, message: Any) -> None:
        with self._node.health.timed():
            try:
                self._message = message
                self._changed()
            except Exception as error:
                self._node.failure("effort_limits", error)
