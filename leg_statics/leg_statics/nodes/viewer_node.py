# SPDX-License-Identifier: Apache-2.0
"""The viewer node: a page in the browser that shows a robot as its leg states tell."""

from __future__ import annotations

from typing import Any

from leg_msgs.msg import LegState, LegStates

from leg_kinematics.nodes.node_process import run
from leg_kinematics.nodes.robot_node import RobotNode
from leg_kinematics.robot import Robot
from leg_statics.view.page import LiveStates, Page
from leg_statics.view.scene import make_scene
from leg_statics.view.standing import Playground

LEG_STATES = "statics/leg_states"


class ViewerNode(RobotNode):
    """Shows the legs of its robot as the statics node tells of them."""

    def __init__(self) -> None:
        super().__init__("viewer")
        self.declare_number(
            "port",
            8080,
            "Port of the page, or the next that is free; 0 for any.",
            (0, 65535),
            read_only=True,
        )
        self.page = Page(Playground.of(self.robot), self.value("port"), live=True)
        self.listen(LegStates, LEG_STATES, self.leg_states)
        self.get_logger().info(f"shown at {self.page.address}")
        self.announce()

    def destroy_node(self) -> None:
        """End the page, then destroy the node."""
        self.page.close()
        super().destroy_node()

    def warm_up(self, robot: Robot) -> None:
        """Work a scene out once."""
        super().warm_up(robot)
        playground = Playground.of(robot)
        setting = playground.setting
        make_scene(playground, playground.stand_as({}, {}), setting)

    def robot_changed(self) -> None:
        """Show the new robot on a page of the same address."""
        port = self.page.server.get_port()
        self.page.close()
        self.page = Page(Playground.of(self.robot), port, live=True)

    def leg_states(self, message: Any) -> None:
        """Show legs as they are told."""
        legs = [state for state in message.legs if state.leg in self.robot.legs]
        self.page.show(
            LiveStates(
                {state.leg: state.joint_positions for state in legs},
                {state.leg: state.utilisation for state in legs},
                {
                    state.leg: state.contact == LegState.ON_THE_GROUND
                    for state in legs
                    if state.contact != LegState.CONTACT_UNKNOWN
                },
            )
        )


def main() -> int:
    """Run the node."""
    return run(ViewerNode)
