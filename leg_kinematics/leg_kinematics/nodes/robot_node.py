"""What the nodes of a robot share: parameters, services, diagnostics, start and stop."""

from __future__ import annotations

import gc
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from leg_msgs.msg import ErrorCode
from rcl_interfaces.msg import (  # type: ignore[import-untyped]
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.service import Service
from rclpy.service_introspection import ServiceIntrospectionState
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Header

from leg_kinematics.description import load_robot
from leg_kinematics.errors import LegError, ValueRangeError
from leg_kinematics.nodes.health import Health
from leg_kinematics.nodes.node_log import LibraryLog, NodeLog
from leg_kinematics.nodes.requests import RequestError, error_code
from leg_kinematics.robot import Robot
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
STOP_TIMEOUT = 5.0  # a callback may take this long to end when the node stops [s]


class RobotNode(Node):
    """A node that serves the legs of one robot description.

    A subclass declares its services with `serve` and calls `announce` when it is ready. The robot
    can be exchanged at run time by setting the parameter `robot`; a description that is refused
    leaves the old one in force.

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
        self.declare_number(
            "max_points", 1_000_000, "Points accepted in one request.", (1, 10_000_000)
        )
        self.declare_number(
            "diagnostics_rate", 1.0, "Rate of /diagnostics [Hz].", (0.1, 100.0), read_only=True
        )
        self.declare(
            "service_events",
            "off",
            "What is published of every call on the topic _service_event below each service: "
            f"{', '.join(SERVICE_EVENTS)} (requests and responses, for recordings).",
        )
        _check_service_events(self.value("service_events"))
        self._served: list[Service] = []
        self.robot: Robot = load_robot(self.value("robot"))
        self.warm_up(self.robot)
        self._candidate = self.robot
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(1.0 / self.value("diagnostics_rate"), self._publish_diagnostics)

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

    def _check_parameters(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            try:
                if parameter.name == "robot":
                    candidate = load_robot(parameter.value)
                    self.warm_up(candidate)
                    self._candidate = candidate
                elif parameter.name == "service_events":
                    _check_service_events(parameter.value)
            except Exception as error:
                self.health.refuse(f"parameter {parameter.name}", str(error))
                self.get_logger().error(f"parameter {parameter.name} refused: {error}")
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters: Sequence[Parameter]) -> None:
        names = [parameter.name for parameter in parameters]
        if "robot" in names:
            self.robot = self._candidate
            self.robot_changed()
            self.get_logger().info(f"robot {self.robot.name!r} loaded from {self.value('robot')}")
        if "service_events" in names:
            for service in self._served:
                self._tell_events(service)

    def _tell_events(self, service: Service) -> None:
        """Publish as much of the calls of a service as the parameter `service_events` says."""
        state = SERVICE_EVENTS[self.value("service_events")]
        service.configure_introspection(self.get_clock(), SERVICE_QOS, state)

    # ------------------------------------------------------------------ for subclasses

    def warm_up(self, robot: Robot) -> None:
        """Call what requests will call once, so that no request waits for a compiler."""
        warm_up_kinematics(robot)

    def robot_changed(self) -> None:
        """Take up a new robot description; `self.robot` is already the new one."""

    def serve(
        self,
        service_type: Any,
        name: str,
        fill: Callable[[Any, Any], None],
        fill_always: Callable[[Any], None] = lambda response: None,
    ) -> None:
        """Offer a service whose every fault becomes an error code.

        Args:
            service_type: Type of the service.
            name: Name below the node's.
            fill: Fills the response of a request, or raises.
            fill_always: Fills what a response carries also on failure.
        """

        def answer(request: Any, response: Any) -> Any:
            with self.health.timed():
                try:
                    fill(request, response)
                    response.error.code = ErrorCode.SUCCESS
                except Exception as error:
                    response = service_type.Response()
                    response.error.code = error_code(error)
                    response.error.message = self._failure(name, error)
                fill_always(response)
            return response

        service = self.create_service(service_type, f"~/{name}", answer, qos_profile=SERVICE_QOS)
        self._tell_events(service)
        self._served.append(service)

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
                    self._failure(topic, error)

        def lose(event: Any) -> None:
            self.health.drop(topic, "lost by the middleware", event.total_count_change)

        self.create_subscription(
            message_type,
            topic,
            take,
            STREAM_QOS,
            raw=True,  # messages that are left out shall cost nothing
            event_callbacks=SubscriptionEventCallbacks(message_lost=lose),
        )

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

    def _failure(self, source: str, error: Exception) -> str:
        """Record a failed request and return its message."""
        message = str(error)
        if error_code(error) == ErrorCode.INTERNAL:
            message = f"{type(error).__name__}: {message}"
            self.health.fault(source, message)
            self.log.error(f"{source} failed", f"{source}: {traceback.format_exc()}")
        else:
            self.health.refuse(source, message)
            self.log.warning(f"{source} refused", f"{source} refused: {message}")
        return message

    def _publish_diagnostics(self) -> None:
        status = DiagnosticStatus(
            name=f"{self.get_fully_qualified_name()}: health", hardware_id=self.robot.name
        )
        report = self.health.report()
        status.level, status.message = bytes([report.level]), report.message
        status.values = [KeyValue(key=key, value=value) for key, value in report.values.items()]
        self.log.flush()
        self._diagnostics.publish(DiagnosticArray(header=self.header(""), status=[status]))


def _check_service_events(value: Any) -> None:
    """Raise a ValueRangeError if the parameter `service_events` cannot be this."""
    if value not in SERVICE_EVENTS:
        allowed = ", ".join(SERVICE_EVENTS)
        raise ValueRangeError(f"parameter service_events: got {value!r}; allowed: {allowed}")


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


# --------------------------------------------------------------------------- start and stop


def make_executor() -> Executor:
    """Return the executor of all nodes: one thread, so that callbacks need no locks.

    rclpy's other executors build a set of all that may happen anew, in Python, for every message:
    that takes longer than to answer it.
    """
    return EventsExecutor()


def run(make_node: Callable[[], RobotNode]) -> int:
    """Run a node until SIGINT or SIGTERM.

    The node spins in a thread and the main thread waits for signals, so that a signal never
    interrupts a callback: a request under way is still answered.

    Args:
        make_node: Makes the node.

    Returns:
        Exit code: 0 after a signal, 1 if the node could not start or stopped by itself.
    """
    try:
        _handle_signals(_interrupt)
        return _spin_until_signal(make_node)
    except KeyboardInterrupt:
        return 0
    except (LegError, ParameterException) as error:
        print(f"cannot start: {error}", file=sys.stderr, flush=True)
        return 1
    finally:
        _handle_signals(signal.SIG_IGN)  # until the process ends; the executor gave them back
        rclpy.try_shutdown()


def _spin_until_signal(make_node: Callable[[], RobotNode]) -> int:
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    executor = make_executor()
    _handle_signals(_interrupt)  # the executor took them for itself
    spinner = _Spinner(executor, make_node())
    try:
        if _stop_asked.is_set():
            raise KeyboardInterrupt
        spinner.ended.wait()
        return 1
    finally:
        spinner.stop()


def _handle_signals(handler: Any) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):  # a shell's `&` leaves SIGINT ignored
        signal.signal(number, handler)


_stop_asked = threading.Event()


def _interrupt(*_: object) -> None:
    """Raise a KeyboardInterrupt at the first signal; further ones shall not disturb the end.

    The signal is kept in mind, because what it meets at the start may swallow the exception, as
    numba's compiler does now and then.
    """
    _handle_signals(lambda *_: None)
    _stop_asked.set()
    raise KeyboardInterrupt


class _Spinner:
    """Spins a node in a thread.

    Attributes:
        ended: Set when the node no longer spins.
    """

    def __init__(self, executor: Executor, node: RobotNode) -> None:
        self.ended = threading.Event()
        self._node = node
        self._executor = executor
        self._executor.add_node(node)
        gc.collect()
        gc.freeze()  # to search all that was imported for garbage would hold callbacks up
        self._stopping = False
        self._thread = threading.Thread(target=self._spin, name="spin", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Let the callback under way end, then destroy the node."""
        self._stopping = True
        self._executor.create_task(lambda: None)  # `wake` alone does not make spin_once return
        self._thread.join(STOP_TIMEOUT)
        if not self._thread.is_alive():
            self._executor.shutdown()
            self._node.destroy_node()

    def _spin(self) -> None:
        try:
            while not self._stopping and rclpy.ok():
                try:
                    # without a time-out an `EventsExecutor` of rclpy 7.1 never wakes up
                    self._executor.spin_once(timeout_sec=1.0)
                except Exception:
                    self._node.health.fault("executor", traceback.format_exc(limit=-1))
                    text = traceback.format_exc()
                    self._node.log.error("executor", text)
                    time.sleep(0.01)  # a fault that stays must not take the whole processor
        finally:
            self.ended.set()
