"""The statics node: what the legs of one robot can carry, asked by services and as a stream."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion
from leg_msgs.msg import EffortLimits, LegDescription, LegState, LegStates
from leg_msgs.srv import (
    ComputeEfforts,
    EvaluateIndices,
    GetLegDescription,
    QueryFootholds,
    QueryStepLength,
    SetEffortLimits,
)
from leg_msgs_py.arrays import from_field, to_field
from rclpy.qos import DurabilityPolicy, QoSProfile
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import UnknownNameError
from leg_kinematics.geometry import SI_UNITS, geometry_parameters
from leg_kinematics.mechanism import Posture
from leg_kinematics.nodes.requests import (
    XYZ,
    RequestError,
    check_count,
    find_frame,
    read_rows,
)
from leg_kinematics.nodes.robot_node import STREAM_QOS, RobotNode, run
from leg_kinematics.robot import Leg, Robot
from leg_kinematics.status import Status
from leg_statics.efforts import joint_efforts, utilisation
from leg_statics.indices import INDICES, evaluate_indices, supported_indices
from leg_statics.joint_layout import JointLayout
from leg_statics.joint_stream import KNOWN_LAYOUTS, JointStream, StampOrder
from leg_statics.leg_state import LegStates as States
from leg_statics.nodes.contacts import declare_grounds
from leg_statics.nodes.foothold_requests import fill_footholds, standing_leg
from leg_statics.nodes.step_requests import fill_step_length
from leg_statics.warm_up import warm_up_statics

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
            "state_rate_limit", 0.0, "Greatest rate of ~/leg_states [Hz]; 0 = no limit.", (0.0, 1e4)
        )
        self.declare_number(
            "max_steps",
            1000,
            "Steps (legs times heights) accepted in one request of a step length.",
            (1, 100_000),
        )
        self._grounds = declare_grounds(self)
        self._stamps = StampOrder()
        self._published_at: dict[tuple[str, ...], float] = {}
        self._limits_publisher = self.create_publisher(EffortLimits, "~/effort_limits", LATCHED)
        self._states_publisher = self.create_publisher(LegStates, "~/leg_states", STREAM_QOS.depth)
        self.robot_changed()
        self.add_post_set_parameters_callback(lambda parameters: self._renew_stream())
        self.listen(JointState, "joint_states", self.joint_states)
        self.serve(ComputeEfforts, "compute_efforts", self.compute_efforts)
        self.serve(EvaluateIndices, "evaluate_indices", self.evaluate_indices)
        self.serve(
            GetLegDescription, "get_leg_description", self.get_leg_description, self._fill_legs
        )
        self.serve(QueryFootholds, "query_footholds", self.query_footholds)
        self.serve(QueryStepLength, "query_step_length", self.query_step_length)
        self.serve(SetEffortLimits, "set_effort_limits", self.set_effort_limits, self._fill_limits)
        self.announce()

    def warm_up(self, robot: Robot) -> None:
        """Call the kernels of the statics once, too."""
        super().warm_up(robot)
        warm_up_statics(robot)

    def robot_changed(self) -> None:
        """Forget what was derived from the old description and publish the new limits."""
        self._renew_stream()
        self._published_at.clear()
        self.health.notes.clear()
        self._publish_limits()

    # ------------------------------------------------------------------ services

    def compute_efforts(self, request: Any, response: Any) -> None:
        """Fill the joint efforts that hold ground reactions."""
        leg = standing_leg(self.robot, request.leg)
        frame = find_frame(self.robot, leg, request.header.frame_id)
        posture = self._posture(leg, request)
        count = len(posture.status)
        forces = frame.vectors_to_leg(_vectors("forces", request.forces, count))
        moments = frame.vectors_to_leg(_vectors("moments", request.moments or [0.0] * 3, count))
        mechanism = leg.mechanism
        jacobian, angular_jacobian = (
            mechanism.jacobian(posture),
            mechanism.angular_jacobian(posture),
        )
        efforts = joint_efforts(jacobian, angular_jacobian, forces, moments)
        status = posture.status.copy()
        status[~np.isfinite(forces + moments).all(axis=-1)] = Status.INVALID_INPUT
        efforts[status != Status.OK] = np.nan
        used, limiting_joint = utilisation(efforts, leg.effort_limits)
        response.joint_names = list(leg.joint_names)
        response.joint_efforts = to_field(efforts)
        response.utilisation = to_field(used)
        response.limiting_joint = to_field(limiting_joint, np.int32)
        response.status = to_field(status, np.uint8)

    def evaluate_indices(self, request: Any, response: Any) -> None:
        """Fill indices at foot positions."""
        leg = self.robot.leg(request.leg)
        posture = self._posture(leg, request)
        names, values = evaluate_indices(leg.mechanism, posture, request.names)
        response.names = list(names)
        response.symbols = [INDICES[name].symbol for name in names]
        response.units = [INDICES[name].unit for name in names]
        response.values = to_field(values)
        response.status = to_field(posture.status, np.uint8)

    def query_footholds(self, request: Any, response: Any) -> None:
        """Fill what the leg can carry at candidate footholds."""
        response.header = self.header(request.header.frame_id)
        fill_footholds(self.robot, self._grounds, self.value("max_points"), request, response)

    def query_step_length(self, request: Any, response: Any) -> None:
        """Fill the longest steps of legs, each and together."""
        response.header = self.header(request.header.frame_id)
        fill_step_length(self.robot, self._grounds, self.value("max_steps"), request, response)

    def get_leg_description(self, request: Any, response: Any) -> None:
        """Fill the description of a leg."""
        response.description = description_message(self.robot, self.robot.leg(request.leg))

    def set_effort_limits(self, request: Any, response: Any) -> None:
        """Check new effort limits, then put all of them in force at once."""
        leg = self.robot.leg(request.leg)
        limits = leg.effort_limits.copy()
        limits[_joint_rows(leg, request.joint_names)] = _new_limits(request)
        legs = {**self.robot.legs, leg.name: replace(leg, effort_limits=limits)}
        self.robot = replace(self.robot, legs=legs)
        self._renew_stream()
        self._publish_limits()

    def _fill_legs(self, response: Any) -> None:
        response.legs = list(self.robot.legs)

    def _fill_limits(self, response: Any) -> None:
        response.limits = self._limits

    def _posture(self, leg: Leg, request: Any) -> Posture:
        """Return the postures at the foot positions of a request."""
        frame = find_frame(self.robot, leg, request.header.frame_id)
        coordinates = leg.mechanism.task_coordinates
        positions = read_rows("positions", request.positions, coordinates)
        check_count("positions", len(positions), self.value("max_points"))
        return leg.mechanism.inverse(frame.points_to_leg(positions), request.assembly_mode)

    def _publish_limits(self) -> None:
        names, limits = self.robot.effort_limits()
        self._limits = EffortLimits(
            header=self.header(""),
            joint_names=list(names),
            lower=to_field(limits[:, 0]),
            upper=to_field(limits[:, 1]),
        )
        self._limits_publisher.publish(self._limits)

    # ------------------------------------------------------------------ stream

    def joint_states(self, message: Any) -> None:
        """Publish the states of all legs whose joints are in the message."""
        names, stamp = tuple(message.name), message.header.stamp
        if not self._stamps.advances(names, 10**9 * stamp.sec + stamp.nanosec):
            self.health.disorder("joint_states")
        self._note_missing(self._stream.layout(names))
        now = time.monotonic()
        if now - self._published_at.get(names, -np.inf) < self._least_period:
            return
        states = self._stream.read(
            names,
            from_field(message.position),
            from_field(message.velocity),
            from_field(message.effort),
        )
        if not states.legs:
            return
        filled = self._states_message(states)
        filled.header.stamp = stamp
        self._states_publisher.publish(filled)
        if len(self._published_at) >= KNOWN_LAYOUTS:  # a stream whose names keep changing
            self._published_at.clear()
        self._published_at[names] = now

    def _renew_stream(self) -> None:
        """Take up the robot, its limits and the parameters of the stream."""
        self._stream = JointStream(self.robot, self.value("friction_coefficient"))
        rate = self.value("state_rate_limit")
        self._least_period = 1.0 / rate if rate > 0.0 else 0.0
        self._messages: dict[tuple[str, ...], LegStates] = {}

    def _note_missing(self, layout: JointLayout) -> None:
        for leg in layout.legs:
            self.health.notes.pop(f"leg not updated: {leg}", None)
        for leg, joints in layout.missing.items():
            text = f"{leg} is not updated: joint_states lack {', '.join(joints)}"
            self.health.notes[f"leg not updated: {leg}"] = text
            self.log.warning(f"{leg} not updated", text)

    def _states_message(self, states: States) -> LegStates:
        """Return the message of leg states; it is filled anew each time, since making one is dear.

        A publisher is done with a message when `publish` returns.
        """
        if states.legs not in self._messages:
            self._messages[states.legs] = LegStates(
                header=Header(frame_id=self.robot.base_frame),
                legs=[LegState(leg=leg) for leg in states.legs],
            )
        message = self._messages[states.legs]
        rows = zip(
            message.legs,
            states.joint_positions,
            states.status.tolist(),
            states.foot_position,
            states.foot_velocity,
            states.condition_number.tolist(),
            states.load_capacity.tolist(),
            states.rated_friction.tolist(),
            states.rated_friction_full.tolist(),
            states.utilisation.tolist(),
            strict=True,
        )
        for leg, joints, status, foot, velocity, condition, capacity, mu_e, mu_full, used in rows:
            leg.joint_positions = to_field(joints)
            leg.status = status
            leg.foot_position = foot
            leg.foot_velocity = velocity
            leg.condition_number = condition
            leg.load_capacity = capacity
            leg.rated_friction = mu_e
            leg.rated_friction_full = mu_full
            leg.utilisation = used
        return message


def _vectors(field: str, values: Any, count: int) -> FloatArray:
    """Return one vector for each of `count` points, from one for all or one for each.

    Raises:
        RequestError: If there are neither 3 values nor 3 for each point.
    """
    if len(values) not in (3, 3 * count):
        raise RequestError(
            f"{field}: got {len(values)} values; allowed: 3 (one vector for all points) or "
            f"{3 * count} (x, y, z of each of {count} points)"
        )
    return np.broadcast_to(read_rows(field, values, XYZ), (count, 3))


def _joint_rows(leg: Leg, names: Sequence[str]) -> list[int]:
    """Return where joints stand in a leg.

    Raises:
        UnknownNameError: If the leg has no such joint.
        RequestError: If a joint is named twice.
    """
    for name in names:
        if name not in leg.joint_names:
            raise UnknownNameError("joint", name, leg.joint_names)
        if list(names).count(name) > 1:
            raise RequestError(f"joint_names: {name!r} is given twice; allowed: once each")
    return [leg.joint_names.index(name) for name in names]


def _new_limits(request: Any) -> FloatArray:
    """Return the limits of a request (joints, 2).

    Raises:
        RequestError: If their number or a value is wrong.
    """
    count = len(request.joint_names)
    upper = from_field(request.upper)
    lower = from_field(request.lower) if len(request.lower) else -upper
    for field, values in (("upper", upper), ("lower", lower)):
        if len(values) != count:
            raise RequestError(f"{field}: got {len(values)} values; allowed: {count}, one a joint")
    for name, least, greatest in zip(request.joint_names, lower, upper, strict=True):
        if not (np.isfinite(greatest) and greatest >= 0.0):
            raise RequestError(f"upper of {name}: got {greatest}; allowed: finite and >= 0")
        if not (np.isfinite(least) and least <= 0.0):
            raise RequestError(f"lower of {name}: got {least}; allowed: finite and <= 0")
    return np.stack([lower, upper], axis=-1)


def description_message(robot: Robot, leg: Leg) -> Any:
    """Return a leg as a `leg_msgs/LegDescription`."""
    mechanism = leg.mechanism
    x, y, z = map(float, leg.mount.position)
    turn = map(float, Rotation.from_matrix(leg.mount.rotation).as_quat())
    parameters = geometry_parameters(leg.geometry)
    return LegDescription(
        robot=robot.name,
        leg=leg.name,
        leg_type=leg.leg_type,
        mechanism=mechanism.name,
        base_frame=robot.base_frame,
        leg_frame=leg.frame,
        mount=Pose(
            position=Point(x=x, y=y, z=z),
            orientation=Quaternion(**dict(zip(("x", "y", "z", "w"), turn, strict=True))),
        ),
        mirrored=leg.mirrored,
        joint_names=list(leg.joint_names),
        joint_types=[joint.type for joint in mechanism.joints],
        joint_position_units=[joint.unit for joint in mechanism.joints],
        joint_position_lower=to_field(mechanism.joint_limits[:, 0]),
        joint_position_upper=to_field(mechanism.joint_limits[:, 1]),
        joint_effort_units=[joint.effort_unit for joint in mechanism.joints],
        joint_effort_lower=to_field(leg.effort_limits[:, 0]),
        joint_effort_upper=to_field(leg.effort_limits[:, 1]),
        passive_joint_names=[joint.name for joint in mechanism.passive_joints],
        passive_joint_lower=to_field(mechanism.passive_joint_limits[:, 0]),
        passive_joint_upper=to_field(mechanism.passive_joint_limits[:, 1]),
        task_coordinates=list(mechanism.task_coordinates),
        task_units=list(mechanism.task_units),
        assembly_modes=list(mechanism.assembly_modes),
        initial_foot_position=mechanism.initial_posture.foot_position[..., :3],
        geometry_names=[f.name for f in parameters],
        geometry_symbols=[f.metadata["symbol"] for f in parameters],
        geometry_values=to_field([getattr(leg.geometry, f.name) for f in parameters]),
        geometry_units=[SI_UNITS[f.metadata["dimension"]] for f in parameters],
        index_names=list(supported_indices(mechanism)),
    )


def main() -> int:
    """Run the node."""
    return run(StaticsNode)
