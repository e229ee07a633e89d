# SPDX-License-Identifier: Apache-2.0
"""What the nodes of a robot share: parameters, services, streams and diagnostics."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from leg_msgs.msg import ErrorCode
from leg_msgs_py.losses import subscribe_raw
from rcl_interfaces.msg import (  # type: ignore[import-untyped]
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.service import Service as ServiceServer
from rclpy.service_introspection import ServiceIntrospectionState
from rclpy.timer import Timer
from std_msgs.msg import Header

from leg_kinematics.description import load_robot
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.nodes.health import Health
from leg_kinematics.nodes.node_log import LibraryLog, NodeLog
from leg_kinematics.nodes.requests import RequestError, error_code
from leg_kinematics.nodes.robot_folders import find_allowed_robot
from leg_kinematics.nodes.service import Service
from leg_kinematics.nodes.transforms import Transforms
from leg_kinematics.robot import Mount, Robot
from leg_kinematics.warm_up import warm_up_kinematics

# The default depth of 10 loses requests when many clients ask at once.
SERVICE_QOS = QoSProfile(depth=256)
STREAM_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
# What the parameter `service_events` may be.
SERVICE_EVENTS = {
    "off": ServiceIntrospectionState.OFF,
    "metadata": ServiceIntrospectionState.METADATA,
    "contents": ServiceIntrospectionState.CONTENTS,
}


class RobotNode(Node):
    """A node that serves the legs of one robot description.

    A subclass offers its services with `serve` and calls `announce` when it is ready. The robot
    can be exchanged at run time by setting the parameter `robot`, to what `robot_folders` allows; a
    description that is refused leaves the old one in force.

    Args:
        name: Name of the node.

    Raises:
        LegError: If the robot description of the parameter `robot` cannot be loaded.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._started = time.monotonic()
        self.health = Health()
        self.log = NodeLog(self.get_logger())
        self._library_log = LibraryLog(self.log)
        self._library_log.install()
        self.declare(
            "robot", "hexapod", "Robot description: path of a YAML file or name of a shipped robot."
        )
        self.declare(
            "robot_folders",
            ["~/.ros/robots"],
            "Folders of the descriptions that the parameter robot may be set to at run time.",
            read_only=True,
        )
        self.declare(
            "frame_prefix",
            "",
            "What stands before the names of the robot's frames, such as 'robot_1/', as in "
            "robot_state_publisher.",
            read_only=True,
        )
        self.declare_number(
            "max_points", 1_000_000, "Points accepted in one request.", (1, 10_000_000)
        )
        self.declare_number(
            "transform_age",
            1.0,
            "How old the latest transform of tf may be in answers to requests without a stamp [s].",
            (0.0, 3600.0),
            read_only=True,
        )
        self.transforms = Transforms(self, self.value("transform_age"))
        self.declare_number(
            "diagnostics_rate", 1.0, "Rate of /diagnostics [Hz].", (0.1, 100.0), read_only=True
        )
        self.declare(
            "service_events",
            "off",
            "What is published of every call on the topic _service_event below each service: "
            f"{', '.join(SERVICE_EVENTS)} (requests and responses, for recordings).",
            dynamic_typing=True,  # a bare `off` in YAML is no string
        )
        _introspection(self.value("service_events"))
        self._served: list[ServiceServer] = []
        self._robot_at_start = self.value("robot")
        self.robot: Robot = self._load(self._robot_at_start)
        self.warm_up(self.robot)
        self._candidate = self.robot
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.every(1.0 / self.value("diagnostics_rate"), self._publish_diagnostics)

    def destroy_node(self) -> None:
        """Leave the logging of libraries alone again, then destroy the node."""
        self._library_log.remove()
        super().destroy_node()

    # ------------------------------------------------------------------ parameters

    def declare(self, name: str, default: Any, description: str, **descriptor: Any) -> None:
        """Declare a parameter with its description."""
        self.declare_parameter(
            name, default, ParameterDescriptor(description=description, **descriptor)
        )

    def declare_number(
        self,
        name: str,
        default: float,
        description: str,
        limits: tuple[float, float],
        **descriptor: Any,
    ) -> None:
        """Declare a parameter that is a number within limits, whole if the default is."""
        lower, upper = limits
        if isinstance(default, int):
            ranges = {"integer_range": [IntegerRange(from_value=lower, to_value=upper)]}
        else:
            ranges = {
                "floating_point_range": [FloatingPointRange(from_value=lower, to_value=upper)]
            }
        self.declare(name, default, description, **ranges, **descriptor)

    def value(self, name: str) -> Any:
        """Return the value of a parameter."""
        return self.get_parameter(name).value

    @property
    def max_points(self) -> int:
        """Points accepted in one request."""
        points: int = self.value("max_points")
        return points

    def base_pose(self, frame_id: str, stamp: Any) -> Mount:
        """Return where the base frame is in a frame that is none of the robot's, as tf tells.

        Raises:
            RequestError: If it is not known.
        """
        return self.transforms.base_pose(self.robot, frame_id, stamp)

    def _check_parameters(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            try:
                if parameter.name == "robot":
                    candidate = self._load(self._robot_file(parameter.value))
                    self.warm_up(candidate)
                    self._candidate = candidate
                elif parameter.name == "service_events":
                    _introspection(parameter.value)
            except Exception as error:
                self.health.refuse(f"parameter {parameter.name}", str(error))
                self.get_logger().error(f"parameter {parameter.name} refused: {error}")
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _load(self, source: str | Path) -> Robot:
        return load_robot(source).with_frame_prefix(self.value("frame_prefix"))

    def _robot_file(self, source: str) -> str | Path:
        """Return the description that a robot's new name or path stands for."""
        if source == self._robot_at_start:  # whoever started the node may have it read again
            return source
        return self.find_robot(source)

    def _apply_parameters(self, parameters: Sequence[Parameter]) -> None:
        names = [parameter.name for parameter in parameters]
        if "robot" in names:
            self.robot = self._candidate
            self.robot_changed()
            self.get_logger().info(f"robot {self.robot.name!r} loaded from {self.value('robot')}")
        if "service_events" in names:
            for service in self._served:
                self._tell_events(service)

    def _tell_events(self, service: ServiceServer) -> None:
        """Publish as much of the calls of a service as the parameter `service_events` says."""
        state = _introspection(self.value("service_events"))
        service.configure_introspection(self.get_clock(), SERVICE_QOS, state)

    # ------------------------------------------------------------------ for subclasses

    def find_robot(self, source: str) -> Path:
        """Return a robot description that anyone may have this node read.

        Raises:
            DescriptionError: If it is neither shipped nor in one of the `robot_folders`.
        """
        return find_allowed_robot(source, self.value("robot_folders"))

    def warm_up(self, robot: Robot) -> None:
        """Call what requests will call once, so that no request waits for a compiler."""
        warm_up_kinematics(robot)

    def robot_changed(self) -> None:
        """Take up a new robot description; `self.robot` is already the new one."""

    def serve(self, services: Iterable[Service]) -> None:
        """Offer services, each below the node's name."""
        for each in services:
            offered = self.create_service(
                each.type, f"~/{each.name}", self._answerer(each), qos_profile=SERVICE_QOS
            )
            self._tell_events(offered)
            self._served.append(offered)

    def _answerer(self, service: Service) -> Callable[[Any, Any], Any]:
        """Return what is called with a request and an empty response."""
        name = service.name
        has_header = "header" in service.type.Response.get_fields_and_field_types()

        def tell(error: Exception) -> str:
            return self.failure(name, error)

        def answer(request: Any, response: Any) -> Any:
            with self.health.timed():
                response = service.answer(self, request, response, tell)
                if has_header and response.error.code == ErrorCode.SUCCESS:
                    response.header.stamp = self.get_clock().now().to_msg()
            return response

        return answer

    def listen(self, message_type: Any, topic: str, receive: Callable[[Any], None]) -> None:
        """Receive a stream of sensor data whose every fault is counted.

        Nothing is lost while a request or a pause holds the node up for a second at 1 kHz. What
        the node cannot follow is left out, so that requests are still answered.

        Args:
            message_type: Type of the messages.
            topic: Name of the topic.
            receive: Works a message off, or raises.
        """
        backlog = _Backlog(self, STREAM_QOS.depth)

        def take(data: bytes) -> None:
            self.health.received += 1
            if backlog.is_too_long():
                self.health.drop(topic, "more messages than the node can follow")
                return
            with self.health.timed():
                try:
                    receive(_decoded(data, message_type))
                except Exception as error:
                    self.failure(topic, error)

        lose = partial(self.health.drop, topic, "lost by the middleware")
        # undecoded: messages that are left out shall cost nothing
        subscribe_raw(self, message_type, topic, take, lose, STREAM_QOS)

    def every(self, period: float, work: Callable[[], None]) -> Timer:
        """Do work again and again, also while the clock of a simulation stands still.

        Args:
            period: Time between two calls [s].
            work: What is called.
        """
        return self.create_timer(period, work, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def header(self, frame_id: str) -> Header:
        """Return a header with the present time."""
        return Header(stamp=self.get_clock().now().to_msg(), frame_id=frame_id)

    def announce(self) -> None:
        """Log that the node is ready."""
        seconds = time.monotonic() - self._started
        self.get_logger().info(
            f"ready: robot {self.robot.name!r}, legs {', '.join(self.robot.legs)} "
            f"(started in {seconds:.1f} s)"
        )

    def failure(self, source: str, error: Exception) -> str:
        """Record what a request or message raised, and return the message that tells it."""
        message = str(error)
        if error_code(error) == ErrorCode.INTERNAL:
            message = f"{type(error).__name__}: {message}"
            self.health.fault(source, message)
            self.log.error(f"{source} failed", f"{source}: {traceback.format_exc()}")
        else:
            self.health.refuse(source, message)
            self.log.warning(f"{source} refused", f"{source} refused: {message}")
        return message

    def look_around(self) -> None:
        """Note in `health` what lasts and is to be told, before each report; nothing by default."""

    def _publish_diagnostics(self) -> None:
        self.look_around()
        status = DiagnosticStatus(
            name=f"{self.get_fully_qualified_name()}: health", hardware_id=self.robot.name
        )
        report = self.health.report()
        status.level, status.message = bytes([report.level]), report.message
        status.values = [KeyValue(key=key, value=value) for key, value in report.values.items()]
        self.log.flush()
        self._diagnostics.publish(DiagnosticArray(header=self.header(""), status=[status]))


def _introspection(value: Any) -> ServiceIntrospectionState:
    """Return the state that the parameter `service_events` asks for.

    Raises:
        ValueRangeError: If it cannot be this.
    """
    name = "off" if value is False else value  # as YAML reads it
    if not isinstance(name, str) or name not in SERVICE_EVENTS:
        allowed = ", ".join(SERVICE_EVENTS)
        raise ValueRangeError(f"parameter service_events: got {value!r}; allowed: {allowed}")
    return SERVICE_EVENTS[name]


def _decoded(data: bytes, message_type: Any) -> Any:
    """Return the message of serialized data.

    Raises:
        RequestError: If the data are not such a message.
    """
    try:
        return deserialize_message(data, message_type)
    except Exception as error:
        raise RequestError(f"{len(data)} bytes that cannot be decoded: {error}") from error


class _Backlog:
    """Tells whether the executor has more messages of a stream to announce than are kept.

    The queue of an `EventsExecutor` is first in, first out and has no bound: if messages came
    faster than they are worked off, requests would wait behind more and more of them. A task that
    is put at the end of the queue from time to time counts the messages before it.

    Args:
        node: The node whose executor it is.
        limit: Number of messages that are kept.
    """

    def __init__(self, node: Node, limit: int) -> None:
        self._node = node
        self._limit = limit
        self._count = -limit

    def is_too_long(self) -> bool:
        """Count a message and tell whether too many are still to come."""
        self._count += 1
        if self._count == 0:
            self._node.executor.create_task(self._reach_end)
        return self._count > self._limit

    def _reach_end(self) -> None:
        self._count = -self._limit
