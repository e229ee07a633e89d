# SPDX-License-Identifier: Apache-2.0
"""Start the nodes of one robot: `ros2 launch leg_bringup leg_suite.launch.py robot:=hexapod`.

With robot_state_publisher installed the robot's frames are published, too, and `rviz:=true` shows
it. Several robots, each in its namespace and with its frame_prefix, show in one viewer.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch_ros.actions import Node

SHARE = Path(__file__).resolve().parent.parent
# name, default and description of each argument
ARGUMENTS = (
    ("robot", "hexapod", "YAML file or name of a shipped robot"),
    ("namespace", "", "Namespace of the robot's nodes"),
    ("frame_prefix", "", "Before names of frames: robot_1/"),
    ("params_file", "", "YAML file with parameters of the nodes"),
    ("log_level", "info", "Of all nodes: debug, info, warn, error"),
    ("use_sim_time", "false", "Whether time is that of a simulation"),
    ("respawn", "false", "Whether a node that has ended is started again"),
    ("robot_state_publisher", "true", "Whether to publish the robot's frames"),
    ("rviz", "false", "Whether to start RViz"),
)


def generate_launch_description() -> LaunchDescription:
    """Return the nodes of `nodes.yaml` and the viewers, as the arguments ask for."""
    companions = [
        (node["name"], "false", f"Whether to start the {node['name']} node")
        for node in _known_nodes()["companions"]
    ]
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=description)
                for name, default, description in (*ARGUMENTS, *companions)
            ),
            OpaqueFunction(function=lambda context: list(_actions(context.launch_configurations))),
        ]
    )


def _known_nodes() -> Any:
    return yaml.safe_load((SHARE / "nodes.yaml").read_text())


def _actions(told: dict[str, str]) -> Iterator[Any]:
    known = _known_nodes()
    asked = [node for node in known["companions"] if _is_true(told[node["name"]])]
    robot = {"robot": told["robot"], "frame_prefix": told["frame_prefix"]}
    for node in (*known["nodes"], *asked):
        yield _node(told, node["package"], node["executable"], node["name"], robot)
    if _is_true(told["robot_state_publisher"]):
        yield _frames(told)
    if _is_true(told["rviz"]):
        yield _rviz(told)


def _frames(told: dict[str, str]) -> Any:
    """Return robot_state_publisher; the kinematics node tells it where all joints stand."""
    package = "robot_state_publisher"
    if not _is_installed(package):
        return LogInfo(msg=f"{package} is not installed: the robot's frames are not published")
    from leg_kinematics.export.urdf import urdf_text

    # the kinematics node has published the same description
    topics = [
        ("joint_states", "completed_joint_states"),
        ("robot_description", "~/robot_description"),
    ]
    description = {"robot_description": urdf_text(_robot(told))}
    return _node(told, package, package, package, description, remappings=topics)


def _rviz(told: dict[str, str]) -> Any:
    if not _is_installed("rviz2"):
        return LogInfo(msg="rviz2 is not installed: install ros-jazzy-rviz2 to see the robot")
    view = SHARE / "viewers" / "leg_suite.rviz"
    arguments = ["-d", str(view), "-f", _robot(told).base_frame]
    return _node(told, "rviz2", "rviz2", "rviz", {}, arguments=arguments)


def _robot(told: dict[str, str]) -> Any:
    from leg_kinematics import load_robot

    return load_robot(told["robot"]).with_frame_prefix(told["frame_prefix"])


def _node(
    told: dict[str, str],
    package: str,
    executable: str,
    name: str,
    parameters: dict[str, str],
    **options: Any,
) -> Node:
    files = [told["params_file"]] if told["params_file"] else []
    return Node(
        package=package,
        executable=executable,
        name=name,
        namespace=told["namespace"],
        parameters=[*files, parameters | {"use_sim_time": _is_true(told["use_sim_time"])}],
        ros_arguments=["--log-level", told["log_level"]],
        respawn=_is_true(told["respawn"]),
        respawn_delay=2.0,
        output="screen",
        **options,
    )


def _is_true(text: str) -> bool:
    """Return what an argument says.

    Raises:
        ValueError: If it is neither true nor false.
    """
    values = {"true": True, "1": True, "false": False, "0": False}
    if text.lower() not in values:
        raise ValueError(f"got {text!r}; allowed: true, false")
    return values[text.lower()]


def _is_installed(package: str) -> bool:
    try:
        get_package_prefix(package)
    except PackageNotFoundError:
        return False
    return True
