# SPDX-License-Identifier: Apache-2.0
"""What a node says when it is called with `--help`: what it is, and its interface as it stands.

Parameters, services and topics are read off the node itself, which nobody else can see meanwhile.
"""

from __future__ import annotations

import argparse
import inspect
import os
import textwrap
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import rclpy
from rcl_interfaces.msg import ParameterDescriptor  # type: ignore[import-untyped]
from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from leg_kinematics.nodes.robot_node import RobotNode

USAGE = "{name} [-h] [--ros-args -p PARAMETER:=VALUE ... -r __ns:=/NAMESPACE]"
# What every node of ROS has is not worth a line.
ROS_PARAMETERS = ("start_type_description_service", "use_sim_time")
ROS_PACKAGES = ("action_msgs", "rcl_interfaces", "type_description_interfaces")
INTERFACES: dict[str, Callable[[Node, str, str], list[tuple[str, list[str]]]]] = {
    "services": Node.get_service_names_and_types_by_node,
    "actions": get_action_server_names_and_types_by_node,
    "subscribes": Node.get_subscriber_names_and_types_by_node,
    "publishes": Node.get_publisher_names_and_types_by_node,
}


def asks_for_help(make_node: Callable[[], RobotNode], arguments: Sequence[str]) -> bool:
    """Tell whether a node was asked for help only; if so, it has been printed.

    Arguments that are neither that nor ROS's end the process with exit code 2.
    """
    name = Path(arguments[0]).name
    parser = argparse.ArgumentParser(prog=name, usage=USAGE.format(name=name), add_help=False)
    parser.add_argument("-h", "--help", action="store_true")
    if not parser.parse_args(remove_ros_args(list(arguments))[1:]).help:
        return False
    print(f"usage: {USAGE.format(name=name)}\n", flush=True)
    print("\n".join(_help(make_node)))
    return True


def _help(make_node: Callable[[], RobotNode]) -> Iterator[str]:
    yield (inspect.getdoc(inspect.getmodule(make_node)) or "") + "\n"
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "OFF"
    rclpy.init(
        args=["--ros-args", "--log-level", "warn"], signal_handler_options=SignalHandlerOptions.NO
    )
    node = make_node()
    try:
        yield "parameters:"
        for parameter in sorted({*node.get_parameters_by_prefix("")} - {*ROS_PARAMETERS}):
            yield from _parameter(node, node.describe_parameter(parameter))
        for kind, tell in INTERFACES.items():
            offered = tell(node, node.get_name(), node.get_namespace())
            lines = [
                f"  {name}  {', '.join(types)}"
                for name, types in offered
                if types[0].partition("/")[0] not in ROS_PACKAGES and "/_action/" not in name
            ]
            yield from [f"\n{kind}:", *lines] if lines else []
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _parameter(node: Node, descriptor: ParameterDescriptor) -> Iterator[str]:
    value = node.get_parameter(descriptor.name).value
    ranges = [*descriptor.integer_range, *descriptor.floating_point_range]
    limits = [f"{each.from_value:g} to {each.to_value:g}" for each in ranges]
    remarks = [f"default {value!r}", *limits, *(["read-only"] if descriptor.read_only else [])]
    yield f"  {descriptor.name}  ({', '.join(remarks)})"
    yield textwrap.fill(
        descriptor.description, 96, initial_indent=" " * 6, subsequent_indent=" " * 6
    )
