# SPDX-License-Identifier: Apache-2.0
"""A gait planner node: walks the hexapod over a map of terrain, asking the nodes at every step.

Start the nodes with `make run`; then, in another terminal:

    ./leg python examples/04_walk_over_terrain.py

How it chooses is told in tripod_gait.py. Parameters, such as `--ros-args -p distance:=2.0`:
`terrain` (YAML file), `distance` [m], `mass` [kg], `robot` (namespace of its nodes), `pause`
between half steps [s], `patience` while the nodes start [s].
It publishes after every half step, in the frame `map`:
~/footholds (geometry_msgs/PoseArray), ~/step_length (std_msgs/Float64), ~/plan (MarkerArray).
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import Point, Pose, PoseArray, Vector3
from leg_msgs_py.client import LegClient
from leg_msgs_py.errors import LegServiceError, ServerUnavailableError
from rcl_interfaces.msg import ParameterDescriptor  # type: ignore[import-untyped]
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from std_msgs.msg import ColorRGBA, Float64, Header
from terrain import Terrain, load_terrain
from tripod_gait import COLOURS, TRIPODS, Gait, HalfStep, NoFootholdsError, TripodPlanner
from visualization_msgs.msg import Marker, MarkerArray

from leg_kinematics.errors import DescriptionError, ValueRangeError

MAP = "map"
TERRAIN = Path(__file__).resolve().with_name("terrain.yaml")
# Who subscribes later gets the last half steps, too.
KEPT = QoSProfile(depth=200, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class TerrainWalker(Node):
    """Plans one half step after the other and publishes them, until it has arrived or is stuck.

    Attributes:
        ended: Done when the walk is over.
        half_steps: What was planned so far.
        reason: Why the walk ended early; empty if it did not.
    """

    def __init__(self) -> None:
        super().__init__("walker")
        source = self.declare_parameter("terrain", str(TERRAIN)).value
        robot = self.declare_parameter("robot", "").value
        self.distance = self._number("distance", 3.0)
        self.gait = Gait(mass=self._number("mass", Gait.mass))
        pause, patience = self._number("pause", 0.0), self._number("patience", 10.0)
        self.terrain: Terrain = load_terrain(source)
        self.client = LegClient(namespace=robot)
        self.client.wait_until_ready(patience)
        self.planner = TripodPlanner(self.client, self.terrain, self.gait, self.distance)
        self.state = self.planner.start()
        self.half_steps: list[HalfStep] = []
        self.reason = ""
        self.ended = Future()
        self._footholds = self.create_publisher(PoseArray, "~/footholds", KEPT)
        self._step_length = self.create_publisher(Float64, "~/step_length", KEPT)
        self._plan = self.create_publisher(MarkerArray, "~/plan", LATCHED)
        self._timer = self.create_timer(pause, self.advance)

    def _number(self, name: str, default: float) -> float:
        """Return a new parameter; a whole number needs no decimal point.

        Raises:
            ValueRangeError: If it is not a finite number >= 0.
        """
        anything = ParameterDescriptor(dynamic_typing=True)
        value = self.declare_parameter(name, default, anything).value
        if type(value) not in (int, float) or not 0.0 <= value < float("inf"):
            raise ValueRangeError(f"parameter {name}: got {value!r}; allowed: a number >= 0")
        return float(value)

    def advance(self) -> None:
        """Plan a half step and publish it; the client has a thread of its own, so it may block."""
        try:
            half_step, self.state = self.planner.next_half_step(self.state)
            self.half_steps.append(half_step)
            self.publish(half_step)
        except NoFootholdsError as error:
            self.reason = str(error)
        except LegServiceError as error:
            self.reason = f"{type(error).__name__}: {error}"
        if self.reason or self.planner.arrived(self.state):
            self._timer.cancel()
            self.ended.set_result(None)

    def publish(self, half_step: HalfStep) -> None:
        """Publish the footholds, the step length and the plan so far."""
        header = Header(frame_id=MAP, stamp=self.get_clock().now().to_msg())
        poses = [Pose(position=_point(foothold.position)) for foothold in half_step.footholds]
        self._footholds.publish(PoseArray(header=header, poses=poses))
        self._step_length.publish(Float64(data=half_step.step_length))
        path = _marker(header, "body", Marker.LINE_STRIP, 0.02, "#000000")
        path.points = [_point(step.body_start) for step in self.half_steps]
        path.points.append(_point(half_step.body_end))
        markers = [path]
        for leg in (leg for tripod in TRIPODS for leg in tripod):
            feet = _marker(header, leg, Marker.SPHERE_LIST, 0.06, COLOURS[leg])
            feet.points = [
                _point(foothold.position)
                for step in self.half_steps
                for foothold in step.footholds
                if foothold.leg == leg
            ]
            markers.append(feet)
        self._plan.publish(MarkerArray(markers=markers))

    def report(self) -> dict[str, Any]:
        """Return the walk as plain data."""
        steps = [asdict(step) for step in self.half_steps]
        for step in steps:
            del step["rejected_at"]
        return {
            "mass": self.gait.mass,
            "reserve": self.gait.reserve,
            "distance": self.distance,
            "arrived": self.planner.arrived(self.state),
            "reason": self.reason,
            "half_steps": steps,
        }

    def print_row(self, number: int) -> None:
        """Print one half step."""
        step = self.half_steps[number - 1]
        feet = ", ".join(f"{foothold.leg} on {foothold.ground}" for foothold in step.footholds)
        print(
            f"{number:3d}  x {step.body_end[0]:5.2f} m  height {step.body_height:.2f} m  "
            f"step {step.step_length:.3f} m  margin {step.margin:.3f} m  {feet}"
        )


def _point(position: Sequence[float]) -> Point:
    x, y, z = position
    return Point(x=x, y=y, z=z)


def _marker(header: Header, name: str, kind: int, size: float, colour: str) -> Marker:
    red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    marker = Marker(header=header, ns=name, type=kind, action=Marker.ADD)
    marker.scale = Vector3(x=size, y=size, z=size)
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    marker.pose.orientation.w = 1.0
    return marker


def write(walker: TerrainWalker, arguments: argparse.Namespace) -> None:
    """Write what was asked for on the command line."""
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(walker.report(), indent=1))
    if not walker.half_steps:
        return
    from walk_pictures import plot_steps, plot_terrain  # late, because it takes a second

    arguments.output.mkdir(parents=True, exist_ok=True)
    for name, figure in (
        ("walk_terrain.png", plot_terrain(walker.terrain, walker.half_steps)),
        ("walk_steps.png", plot_steps(walker.half_steps, walker.gait.reserve)),
    ):
        figure.savefig(arguments.output / name, dpi=200, bbox_inches="tight")
        print(f"wrote {arguments.output / name}")


def main() -> int:
    """Walk, then write the pictures; Ctrl-C stops."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--output", type=Path, default=Path("demo_output"), help="folder of the pictures"
    )
    parser.add_argument("--json", type=Path, help="file for the plan")
    arguments = parser.parse_args(remove_ros_args(sys.argv)[1:])
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's `&` leaves it ignored
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    walker = None
    try:
        walker = TerrainWalker()
        printed = 0
        while not walker.ended.done():
            rclpy.spin_once(walker, timeout_sec=0.5)
            for number in range(printed + 1, len(walker.half_steps) + 1):
                walker.print_row(number)
                printed = number
        write(walker, arguments)
        if walker.reason:
            print(f"stopped at x = {walker.state.body[0]:.2f} m: {walker.reason}", file=sys.stderr)
        return 1 if walker.reason else 0
    except (KeyboardInterrupt, ExternalShutdownException):
        print("\nStopped.")
        return 0
    except ServerUnavailableError as error:
        print(f"{error}\nStart the nodes first: make run", file=sys.stderr)
    except (DescriptionError, ValueRangeError, NoFootholdsError, LegServiceError) as error:
        print(error, file=sys.stderr)
    finally:
        if walker is not None:
            walker.client.close()
            walker.destroy_node()
        rclpy.try_shutdown()
    return 1


if __name__ == "__main__":
    sys.exit(main())
