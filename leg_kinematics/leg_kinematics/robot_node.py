"""What the nodes of a robot share: parameters, services, diagnostics, start and stop."""

from __future__ import annotations

import signal
import sys
import threading
import time
import traceback
from collections import Counter
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
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Header

from leg_kinematics.description import load_robot
from leg_kinematics.errors import LegError
from leg_kinematics.requests import error_code
from leg_kinematics.robot import Robot
from leg_kinematics.warm_up import warm_up_kinematics

# The default depth of 10 loses requests when many clients ask at once.
SERVICE_QOS = QoSProfile(depth=256)
LOG_PERIOD = 5.0  # a bad stream is logged once in this time [s]
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
        self.declare(
            "robot", "hexapod", "Robot description: path of a YAML file or name of a shipped robot."
        )
        self.declare_number(
            "max_points", 1_000_000, "Points accepted in one request.", (1, 10_000_000)
        )
        self.declare_number(
            "diagnostics_rate", 1.0, "Rate of /diagnostics [Hz].", (0.1, 100.0), read_only=True
        )
        self.robot: Robot = load_robot(self.value("robot"))
        self.warm_up(self.robot)
        self._candidate = self.robot
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(1.0 / self.value("diagnostics_rate"), self._publish_diagnostics)

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
            if parameter.name != "robot":
                continue
            try:
                candidate = load_robot(parameter.value)
                self.warm_up(candidate)
                self._candidate = candidate
            except Exception as error:
                self.health.refuse("parameter robot", str(error))
                self.get_logger().error(f"robot description refused: {error}")
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters: Sequence[Parameter]) -> None:
        if any(parameter.name == "robot" for parameter in parameters):
            self.robot = self._candidate
            self.robot_changed()
            self.get_logger().info(f"robot {self.robot.name!r} loaded from {self.value('robot')}")

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

        self.create_service(service_type, f"~/{name}", answer, qos_profile=SERVICE_QOS)

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
            self.get_logger().error(f"{source}: {traceback.format_exc()}")
        else:
            self.health.refuse(source, message)
            self.get_logger().warning(
                f"{source} refused: {message}", throttle_duration_sec=LOG_PERIOD
            )
        return message

    def _publish_diagnostics(self) -> None:
        status = DiagnosticStatus(
            name=f"{self.get_fully_qualified_name()}: health", hardware_id=self.robot.name
        )
        status.level, status.message, values = self.health.report()
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        self._diagnostics.publish(DiagnosticArray(header=self.header(""), status=[status]))


class Health:
    """Counts what a node does, for its diagnostics.

    Attributes:
        received: Messages of the input stream.
        notes: Conditions that last, such as a leg that is not updated, by what they concern.
    """

    def __init__(self) -> None:
        self.received = 0
        self.notes: dict[str, str] = {}
        self._callbacks = 0
        self._refused: Counter[str] = Counter()
        self._faults = 0
        self._last_error = ""
        self._worst = 0.0
        self._begin_period()

    def timed(self) -> _Stopwatch:
        """Measure a callback: `with health.timed():`."""
        return _Stopwatch(self)

    def observe(self, seconds: float) -> None:
        """Count a callback and its duration."""
        self._callbacks += 1
        self._worst = max(self._worst, seconds)

    def refuse(self, source: str, reason: str) -> None:
        """Count an input that was refused."""
        self._refused[source] += 1
        self._recent_refusals += 1
        self._last_error = f"{source}: {reason}"

    def fault(self, source: str, reason: str) -> None:
        """Count a fault of the node itself."""
        self._faults += 1
        self._recent_faults += 1
        self._last_error = f"{source}: {reason}"

    def report(self) -> tuple[bytes, str, dict[str, str]]:
        """Return level, message and values since the last report, and begin a new period."""
        elapsed = max(time.monotonic() - self._began, 1e-9)
        values = {
            "input rate [Hz]": f"{(self.received - self._received_before) / elapsed:.1f}",
            "worst callback latency [ms]": f"{1e3 * self._worst:.3f}",
            "callbacks": str(self._callbacks),
            "refused inputs": str(sum(self._refused.values())),
            **{f"refused: {source}": str(count) for source, count in self._refused.items()},
            "internal faults": str(self._faults),
            **self.notes,
            "last error": self._last_error,
        }
        if self._recent_faults:
            level, message = DiagnosticStatus.ERROR, f"internal fault: {self._last_error}"
        elif self._recent_refusals:
            level, message = DiagnosticStatus.WARN, f"refused input: {self._last_error}"
        elif self.notes:
            level, message = DiagnosticStatus.WARN, "; ".join(self.notes.values())
        else:
            level, message = DiagnosticStatus.OK, "ok"
        self._begin_period()
        return level, message, values

    def _begin_period(self) -> None:
        self._began = time.monotonic()
        self._received_before = self.received
        self._worst = 0.0
        self._recent_refusals = 0
        self._recent_faults = 0


class _Stopwatch:
    """Reports the duration of a block to a `Health`."""

    def __init__(self, health: Health) -> None:
        self._health = health

    def __enter__(self) -> None:
        self._start = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self._health.observe(time.perf_counter() - self._start)


# --------------------------------------------------------------------------- start and stop


def make_executor() -> Executor:
    """Return the executor of all nodes: one thread, so that callbacks need no locks."""
    return SingleThreadedExecutor()


def run(make_node: Callable[[], RobotNode]) -> int:
    """Run a node until SIGINT or SIGTERM.

    The node spins in a thread and the main thread waits for signals, so that a signal never
    interrupts a callback: a request under way is still answered.

    Args:
        make_node: Makes the node.

    Returns:
        Exit code: 0 after a signal, 1 if the node could not start or stopped by itself.
    """
    for number in (signal.SIGINT, signal.SIGTERM):  # a shell's `&` leaves SIGINT ignored
        signal.signal(number, signal.default_int_handler)
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        spinner = _Spinner(make_node())
        try:
            spinner.ended.wait()
            return 1
        except KeyboardInterrupt:
            return 0
        finally:
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, signal.SIG_IGN)
            spinner.stop()
    except KeyboardInterrupt:
        return 0
    except (LegError, ParameterException) as error:
        print(f"cannot start: {error}", file=sys.stderr, flush=True)
        return 1
    finally:
        rclpy.try_shutdown()


class _Spinner:
    """Spins a node in a thread.

    Attributes:
        ended: Set when the node no longer spins.
    """

    def __init__(self, node: RobotNode) -> None:
        self.ended = threading.Event()
        self._node = node
        self._executor = make_executor()
        self._executor.add_node(node)
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
                    self._executor.spin_once()
                except Exception:
                    self._node.health.fault("executor", traceback.format_exc(limit=-1))
                    self._node.get_logger().error(traceback.format_exc())
                    time.sleep(0.01)  # a fault that stays must not take the whole processor
        finally:
            self.ended.set()
