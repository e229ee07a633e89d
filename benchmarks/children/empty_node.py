"""The least a node can do, run as the suite's nodes are: an empty service and a relay."""

from __future__ import annotations

import sys
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from leg_kinematics.robot_node import SERVICE_QOS, STREAM_QOS, run


class EmptyNode(Node):
    """Answers a Trigger with nothing and publishes joint states as they come."""

    def __init__(self) -> None:
        super().__init__("empty")
        self.create_service(Trigger, "~/trigger", self.answer, qos_profile=SERVICE_QOS)
        self._relay = self.create_publisher(JointState, "~/joint_states", STREAM_QOS.depth)
        self.create_subscription(JointState, "joint_states", self._relay.publish, STREAM_QOS)

    def answer(self, request: Any, response: Any) -> Any:
        """Answer an empty request."""
        return response


if __name__ == "__main__":
    needed_of_a_robot_node: Any = EmptyNode
    sys.exit(run(needed_of_a_robot_node))
