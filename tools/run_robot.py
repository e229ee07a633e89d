# SPDX-License-Identifier: Apache-2.0
"""Start the nodes of one robot, designs among them, and stop them at Ctrl-C."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time

from node_processes import NodeProcesses, node_names

from leg_kinematics import DescriptionError, load_robot


def main() -> int:
    """Run the nodes until Ctrl-C, or until one of them ends by itself."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--robot", default="hexapod", help="YAML file or name of a shipped robot (default: hexapod)"
    )
    parser.add_argument("--namespace", default="", help="namespace of the nodes (default: none)")
    parser.add_argument(
        "--gait", action="store_true", help="let the robot walk: publish joint states of a gait"
    )
    parser.add_argument(
        "parameters",
        nargs="*",
        type=_parameter,
        metavar="NAME:=VALUE",
        help="parameter of every node that has it, or of one node: NODE:NAME:=VALUE",
    )
    arguments = parser.parse_args()
    try:
        robot = load_robot(arguments.robot)
    except DescriptionError as error:
        print(error, file=sys.stderr)
        return 1
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's `&` leaves it ignored
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    nodes = NodeProcesses(
        arguments.robot,
        names=(*node_names(), "designs", *(["gait"] if arguments.gait else [])),
        namespace=arguments.namespace,
        parameters=dict(arguments.parameters),
    )
    try:
        with nodes:
            domain = os.environ.get("ROS_DOMAIN_ID", "0")
            print(
                f"Robot {robot.name!r} with legs {', '.join(robot.legs)}; ROS_DOMAIN_ID {domain}."
            )
            for name, process in nodes.processes.items():
                print(f"  {name} runs as process {process.pid}")
            print("Ctrl-C stops them.", flush=True)
            while not nodes.ended():
                time.sleep(0.2)
            for name, code in nodes.ended().items():
                print(f"{name} ended by itself with exit code {code}; stopping.", file=sys.stderr)
            return 1
    except KeyboardInterrupt:
        print("\nStopped.")
        return 0


def _parameter(text: str) -> tuple[str, str]:
    """Return name and value of an argument NAME:=VALUE."""
    name, separator, value = text.partition(":=")
    if not name or not separator:
        raise argparse.ArgumentTypeError(f"got {text!r}; allowed: NAME:=VALUE")
    return name, value


if __name__ == "__main__":
    sys.exit(main())
