# SPDX-License-Identifier: Apache-2.0
"""Start the nodes of one robot: `ros2 launch leg_bringup leg_suite.launch.py robot:=hexapod`."""

from pathlib import Path
from typing import Any

import yaml
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

NODES = Path(__file__).resolve().parent.parent / "nodes.yaml"


def generate_launch_description() -> LaunchDescription:
    """Return the nodes of `nodes.yaml` with the robot and namespace asked for."""
    known = yaml.safe_load(NODES.read_text())
    companions = [node["name"] for node in known["companions"]]
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "robot", default_value="hexapod", description="YAML file or name of a shipped robot"
            ),
            DeclareLaunchArgument(
                "namespace", default_value="", description="Namespace of the robot's nodes"
            ),
            DeclareLaunchArgument(
                "frame_prefix", default_value="", description="Before names of frames: robot_1/"
            ),
            *(
                DeclareLaunchArgument(
                    name, default_value="false", description=f"Whether to start the {name} node"
                )
                for name in companions
            ),
            *(_node(node) for node in known["nodes"]),
            *(
                _node(node, condition=IfCondition(LaunchConfiguration(node["name"])))
                for node in known["companions"]
            ),
        ]
    )


def _node(node: dict[str, str], **options: Any) -> Node:
    parameters = {
        name: ParameterValue(LaunchConfiguration(name), value_type=str)
        for name in ("robot", "frame_prefix")
    }
    return Node(
        package=node["package"],
        executable=node["executable"],
        name=node["name"],
        namespace=LaunchConfiguration("namespace"),
        parameters=[parameters],
        output="screen",
        **options,
    )
