# SPDX-License-Identifier: Apache-2.0
"""The statics node: what the legs of one robot can carry, asked by services and as a stream."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from leg_msgs.msg import EffortLimits, LegState, LegStates
from leg_msgs_py.arrays import from_field, to_field
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from leg_kinematics.arrays import FloatArray
from leg_kinematics.nodes.node_process import run
from leg_kinematics.nodes.rate_limit import RateLimit
from leg_kinematics.nodes.robot_node import STREAM_QOS, RobotNode
from leg_kinematics.robot import Robot
from leg_statics.joint_layout import JointLayout
from leg_statics.joint_pieces import JointPieces
from leg_statics.joint_stream import CONTACT_FORCE, KNOWN_LAYOUTS, JointStream, StampOrder
from leg_statics.leg_state import LegStates as States
from leg_statics.leg_state import vectors_in_base
from leg_statics.nodes.attitude import Attitude
from leg_statics.nodes.contacts import declare_grounds
from leg_statics.nodes.services import SERVICES
from leg_statics.nodes.services.limits import limits_message
from leg_statics.warm_up import warm_up_statics

FOREIGN = "joint_states of another robot"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class StaticsNode(RobotNode):
    """Serves what a gait planner asks, and turns joint states into leg states."""

    def __init__(self) -> None:
        super().__init__("statics")
        self.declare_number(
            "friction_coefficient",
            0.4,  # the low end of cement
            "Friction coefficient of the ground for the load capacity in ~/leg_states.",
            (0.0, 10.0),
        )
        self.declare_number(
            "contact_force",
            CONTACT_FORCE,
            "Force against gravity by which a foot in ~/leg_states is on the ground [N].",
            (0.0, 1e6),
        )
        self._attitude = Attitude(self)
        self.declare_number(
            "state_rate_limit", 0.0, "Greatest rate of ~/leg_states [Hz]; 0 = no limit.", (0.0, 1e4)
        )
        self.declare_number(
            "max_steps",
            1000,
            "Steps (legs times heights) accepted in one request of a step length.",
            (1, 100_000),
        )
        self.grounds = declare_grounds(self)
        self._stamps = StampOrder()
        self._limit = RateLimit(0.0, KNOWN_LAYOUTS)
        self._limits_publisher = self.create_publisher(EffortLimits, "~/effort_limits", LATCHED)
        self._states_publisher = self.create_publisher(LegStates, "~/leg_states", STREAM_QOS.depth)
        self.robot_changed()
        self.add_post_set_parameters_callback(lambda parameters: self._renew_stream())
        self.listen(JointState, "joint_states", self.joint_states)
        self.serve(SERVICES["statics"])
        self.announce()

    def warm_up(self, robot: Robot) -> None:
        """Call the kernels of the statics once, too."""
        super().warm_up(robot)
        warm_up_statics(robot)

    def robot_changed(self) -> None:
        """Forget what was derived from the old description and publish the new limits."""
        self._renew_stream()
        self.health.notes.clear()
        self._publish_limits()

    # ------------------------------------------------------------------ for the services

    @property
    def max_steps(self) -> int:
        """Steps (legs times heights) accepted in one request."""
        steps: int = self.value("max_steps")
        return steps

    def put_in_force(self, robot: Robot) -> None:
        """Take up a robot with other effort limits."""
        self.robot = robot
        self._renew_stream()
        self._publish_limits()

    def _publish_limits(self) -> None:
        self.limits = limits_message(self.robot)
        self.limits.header = self.header("")
        self._limits_publisher.publish(self.limits)

    # ------------------------------------------------------------------ stream

    def joint_states(self, message: Any) -> None:
        """Publish the states of all legs whose joints are in the message."""
        names, stamp = tuple(message.name), message.header.stamp
        if not self._stamps.advances(names, 10**9 * stamp.sec + stamp.nanosec):
            self.health.disorder("joint_states")
        position, velocity, effort = map(
            from_field, (message.position, message.velocity, message.effort)
        )
        layout = self._stream.layout(names)
        missing = layout.missing
        if missing and not layout.legs:  # one joint a message, maybe
            whole = self._pieces.add(time.monotonic_ns(), names, position, velocity, effort)
            missing = self._pieces.lacking
            if whole is not None:
                names, position, velocity, effort = whole
                layout = self._stream.layout(names)
        self._note_missing(names, layout, missing)
        if not self._limit.allows(time.monotonic(), names):
            return
        gravity = self._attitude.gravity()
        states = self._stream.read(names, position, velocity, effort, gravity)
        if not states.legs:
            return
        filled = self._states_message(states, gravity)
        filled.header.stamp = stamp
        self._states_publisher.publish(filled)

    def _renew_stream(self) -> None:
        """Take up the robot, its limits and the parameters of the stream."""
        friction, contact = self.value("friction_coefficient"), self.value("contact_force")
        self._stream = JointStream(self.robot, friction, contact)
        self._limit.rate = self.value("state_rate_limit")
        self._pieces = JointPieces(self.robot)
        self._messages: dict[tuple[str, ...], _Filling] = {}

    def _note_missing(
        self, names: tuple[str, ...], layout: JointLayout, missing: Mapping[str, tuple[str, ...]]
    ) -> None:
        """Tell which legs a message does not update, and whether only foreign joints ever came."""
        if layout.legs:
            self.health.notes.pop(FOREIGN, None)
        elif not self._messages:
            known, _ = self.robot.effort_limits()
            if not {*known} & {*names}:
                self.health.notes[FOREIGN] = (
                    f"joint_states name no joint of {self.robot.name} but "
                    f"{', '.join(names[:3])}, ...; its joints are {', '.join(known[:3])}, ..."
                )
                self.log.warning(FOREIGN, self.health.notes[FOREIGN])
        for leg in layout.legs:
            self.health.notes.pop(f"leg not updated: {leg}", None)
        for leg, joints in missing.items():
            text = f"{leg} is not updated: joint_states lack {', '.join(joints)}"
            self.health.notes[f"leg not updated: {leg}"] = text
            self.log.warning(f"{leg} not updated", text)

    def _states_message(self, states: States, gravity: FloatArray) -> LegStates:
        """Return the message of leg states; it is filled anew each time, since making one is dear.

        A publisher is done with a message when `publish` returns.
        """
        if states.legs not in self._messages:
            self._messages[states.legs] = _Filling.of(self.robot, states.legs)
        message, rotation, position = self._messages[states.legs]
        _fill_vector(message.gravity, gravity.tolist())
        rows = zip(
            message.legs,
            states.joint_positions,
            states.status.tolist(),
            (vectors_in_base(rotation, states.foot_position) + position).tolist(),
            vectors_in_base(rotation, states.foot_velocity).tolist(),
            vectors_in_base(rotation, states.ground_force).tolist(),
            states.contact.tolist(),
            states.condition_number.tolist(),
            states.load_capacity.tolist(),
            states.rated_friction.tolist(),
            states.rated_friction_full.tolist(),
            states.utilisation.tolist(),
            strict=True,
        )
        for leg, joints, status, foot, velocity, force, contact, *numbers in rows:
            leg.joint_positions = to_field(joints)
            leg.status = status
            _fill_vector(leg.foot_position, foot)
            _fill_vector(leg.foot_velocity, velocity)
            _fill_vector(leg.ground_force, force)
            leg.contact = contact
            (
                leg.condition_number,
                leg.load_capacity,
                leg.rated_friction,
                leg.rated_friction_full,
                leg.utilisation,
            ) = numbers
        return message


class _Filling(NamedTuple):
    """A message of leg states to fill, and the mounts of its legs."""

    message: LegStates
    rotation: FloatArray
    position: FloatArray

    @classmethod
    def of(cls, robot: Robot, names: tuple[str, ...]) -> _Filling:
        """Return the filling of some legs of a robot."""
        message = LegStates(
            header=Header(frame_id=robot.base_frame), legs=[LegState(leg=name) for name in names]
        )
        mounts = [robot.legs[name].mount for name in names]
        rotation = np.array([mount.rotation for mount in mounts])
        return cls(message, rotation, np.array([mount.position for mount in mounts]))


def _fill_vector(message: Any, numbers: Sequence[float]) -> None:
    """Fill a message with fields x, y, z."""
    message.x, message.y, message.z = numbers


def main() -> int:
    """Run the node."""
    return run(StaticsNode)
