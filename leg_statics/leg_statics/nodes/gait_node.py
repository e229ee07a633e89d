# SPDX-License-Identifier: Apache-2.0
"""The gait node: joint states and foot wrenches of a walk, for a robot that is not there.

It lets the stream, markers, recordings and their judgement be seen without a robot; it is no part
of a walking robot's nodes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from leg_msgs_py.arrays import to_field
from sensor_msgs.msg import JointState

from leg_kinematics.nodes.node_process import run
from leg_kinematics.nodes.robot_node import RobotNode
from leg_kinematics.robot import Robot
from leg_statics.gait import Gait, GaitCycle, gait_cycle

JOINT_STATES = "joint_states"
DEPTH = 10


class GaitNode(RobotNode):
    """Publishes what the joints and feet of its robot would do in a walk."""

    gait = Gait()
    samples = 100  # of a cycle

    def __init__(self) -> None:
        super().__init__("gait")
        self.declare_number("rate", 50.0, "Rate of joint_states [Hz].", (1.0, 1e3), read_only=True)
        self.declare_number(
            "period", Gait.period, "Time of a cycle [s].", (0.1, 1e3), read_only=True
        )
        self.declare_number(
            "stride",
            Gait.stride,
            "Length of a stance [m]; 0 for one that suits the legs.",
            (0.0, 1e2),
            read_only=True,
        )
        self.declare_number(
            "load",
            Gait.load,
            "Vertical force on a standing foot [N]; 0 for half of what the weakest leg bears.",
            (0.0, 1e6),
            read_only=True,
        )
        self.gait = Gait(self.value("period"), self.value("stride"), self.value("load"))
        self.samples = max(2, round(self.value("rate") * self.gait.period))
        self._cycle = gait_cycle(self.robot, self.gait, self.samples)
        self._next = 0
        self._joint_states = self.create_publisher(JointState, JOINT_STATES, DEPTH)
        self._offer_wrenches()
        self.create_timer(self.gait.period / self.samples, self._publish)
        self.announce()

    def warm_up(self, robot: Robot) -> None:
        """Work the walk out, which also tells whether the robot can walk."""
        super().warm_up(robot)
        self._worked_out = gait_cycle(robot, self.gait, self.samples)

    def robot_changed(self) -> None:
        """Let the new robot walk."""
        self._cycle, self._next = self._worked_out, 0
        self._offer_wrenches()

    def _offer_wrenches(self) -> None:
        for publisher in getattr(self, "_wrenches", {}).values():
            self.destroy_publisher(publisher)
        self._wrenches = {
            leg: self.create_publisher(WrenchStamped, f"{leg}/wrench", DEPTH)
            for leg in self._cycle.forces
        }

    def _publish(self) -> None:
        cycle, k = self._cycle, self._next % self.samples
        self._next = k + 1
        if k == 0 and self.count_publishers(JOINT_STATES) > 1:
            self.log.warning(
                "another publisher", f"{JOINT_STATES} has another publisher: is there a robot?"
            )
        header = self.header("")
        for leg, publisher in self._wrenches.items():
            publisher.publish(self._wrench(leg, cycle, k, header.stamp))
        self._joint_states.publish(
            JointState(
                header=header,
                name=list(cycle.names),
                position=to_field(cycle.positions[k]),
                velocity=to_field(cycle.velocities[k]),
                effort=to_field(cycle.efforts[k]),
            )
        )

    def _wrench(self, leg: str, cycle: GaitCycle, k: int, stamp: Any) -> WrenchStamped:
        x, y, z = np.asarray(cycle.forces[leg][k]).tolist()
        message = WrenchStamped(wrench=Wrench(force=Vector3(x=x, y=y, z=z)))
        message.header.stamp = stamp
        message.header.frame_id = self.robot.leg(leg).frame
        return message


def main() -> int:
    """Run the node."""
    return run(GaitNode)
