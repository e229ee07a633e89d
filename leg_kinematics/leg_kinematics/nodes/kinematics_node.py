# SPDX-License-Identifier: Apache-2.0
"""The kinematics node: foot and joint positions and Jacobians of the legs of one robot.

It also shows the robot to others: its URDF on `robot_description`, and joint states with those of
the passive joints on `completed_joint_states`, from which robot_state_publisher makes frames.
"""

from __future__ import annotations

import time
from typing import Any

from leg_msgs_py.arrays import from_field, to_field
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from leg_kinematics.completed_joints import CompletedJoints
from leg_kinematics.errors import NotSupportedError
from leg_kinematics.export.urdf import urdf_text
from leg_kinematics.nodes.node_process import run
from leg_kinematics.nodes.rate_limit import RateLimit
from leg_kinematics.nodes.robot_node import RobotNode
from leg_kinematics.nodes.services import SERVICES

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class KinematicsNode(RobotNode):
    """Serves what the kinematics alone answer, and completes joint states."""

    def __init__(self) -> None:
        super().__init__("kinematics")
        self.declare_number(
            "completed_rate_limit",
            50.0,
            "Greatest rate of completed_joint_states [Hz]; 0 = no limit.",
            (0.0, 1e4),
        )
        self._limit = RateLimit(0.0)
        self._descriptions = self.create_publisher(String, "robot_description", LATCHED)
        self._completed = self.create_publisher(JointState, "completed_joint_states", 10)
        self._joints: CompletedJoints | None = None
        self.robot_changed()
        self.listen(JointState, "joint_states", self.joint_states)
        self.serve(SERVICES["kinematics"])
        self.announce()

    def robot_changed(self) -> None:
        """Publish the URDF of the new robot."""
        try:
            self._joints = CompletedJoints(self.robot)
            self._descriptions.publish(String(data=urdf_text(self.robot)))
        except NotSupportedError as error:
            self._joints = None
            self.get_logger().warning(f"no robot_description: {error}")

    def joint_states(self, message: Any) -> None:
        """Publish where all joints stand of the legs that a message updates."""
        if self._joints is None or not self._completed.get_subscription_count():
            return
        self._joints.add(message.name, from_field(message.position))
        self._limit.rate = self.value("completed_rate_limit")
        if not self._limit.allows(time.monotonic()):
            return
        names, values = self._joints.take()
        if names:
            completed = JointState(name=list(names), position=to_field(values))
            completed.header.stamp = message.header.stamp
            self._completed.publish(completed)


def main() -> int:
    """Run the node."""
    return run(KinematicsNode)
