# SPDX-License-Identifier: Apache-2.0
"""The kinematics node: foot and joint positions and Jacobians of the legs of one robot."""

from __future__ import annotations

from leg_kinematics.nodes.node_process import run
from leg_kinematics.nodes.robot_node import RobotNode
from leg_kinematics.nodes.services import SERVICES


class KinematicsNode(RobotNode):
    """Serves what the kinematics alone answer."""

    def __init__(self) -> None:
        super().__init__("kinematics")
        self.serve(SERVICES["kinematics"])
        self.announce()


def main() -> int:
    """Run the node."""
    return run(KinematicsNode)
