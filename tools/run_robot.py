# SPDX-License-Identifier: Apache-2.0
"""Start the nodes of one robot, and stop them at Ctrl-C."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time

from node_processes import NodeProcesses

from leg_kinematics import DescriptionError, load_robot


def main() -> int:
    """Run the nodes until Ctrl-C, or until one of them ends by itself."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--robot", default="hexapod", help="YAML file or name of a shipped robot (default: hexapod)"
    )
    parser.add_argument("--namespace", default="", help="namespace of the nodes (default: none)")
    arguments = parser.parse_args()
    try:
        robot = load_robot(arguments.robot)
    except DescriptionError as error:
        print(error, file=sys.stderr)
        return 1
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's `&` leaves it ignored
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    nodes = NodeProcesses(arguments.robot, namespace=arguments.namespace)
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


if __name__ == "__main__":
    sys.exit(main())
