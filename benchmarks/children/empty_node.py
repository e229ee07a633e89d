# SPDX-License-Identifier: Apache-2.0
"""The least a node can do, run as the suite's nodes are: services without work and a relay."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from leg_msgs.srv import InverseKinematics, QueryFootholds
from leg_msgs_py.arrays import to_field
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from leg_kinematics.nodes.node_process import run
from leg_kinematics.nodes.robot_node import SERVICE_QOS, STREAM_QOS


class EmptyNode(Node):
    """Answers without work and publishes joint states as they come.

    A Trigger is answered with nothing, the suite's own requests with an answer for one point that
    was made at the start: what they take longer is the conversion of their messages.
    """

    def __init__(self) -> None:
        super().__init__("empty")
        self.create_service(Trigger, "~/trigger", self.answer, qos_profile=SERVICE_QOS)
        for kind, name, ready in (
            (InverseKinematics, "~/inverse_kinematics", ready_joints()),
            (QueryFootholds, "~/query_footholds", ready_footholds()),
        ):
            self.create_service(kind, name, lambda *_, r=ready: r, qos_profile=SERVICE_QOS)
        self._relay = self.create_publisher(JointState, "~/joint_states", STREAM_QOS.depth)
        self.create_subscription(JointState, "joint_states", self._relay.publish, STREAM_QOS)

    def answer(self, request: Any, response: Any) -> Any:
        """Answer an empty request."""
        return response


def ready_joints() -> Any:
    """Return an answer of an inverse for one point."""
    return InverseKinematics.Response(
        joint_names=["crank_1", "crank_2", "crank_3"],
        joint_positions=to_field(np.ones(3)),
        status=to_field(np.zeros(1), np.uint8),
    )


def ready_footholds() -> Any:
    """Return an answer for one foothold."""
    numbers = ("load_capacity", "rated_friction", "rated_friction_full", "friction_margin")
    return QueryFootholds.Response(
        **{name: to_field(np.ones(1)) for name in (*numbers, "utilisation", "clearance", "margin")},
        **{name: to_field(np.zeros(1), np.uint8) for name in ("verdict", "status")},
        **{name: to_field(np.zeros(1), np.int32) for name in ("limiting_joint", "ranking", "best")},
        friction_coefficients=to_field(np.ones(1)),
        weight_counted=[False],
    )


if __name__ == "__main__":
    needed_of_a_robot_node: Any = EmptyNode
    sys.exit(run(needed_of_a_robot_node))
