# SPDX-License-Identifier: Apache-2.0
"""Start the node that searches for geometries: `ros2 launch leg_bringup designs.launch.py`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

# name, default and description of each argument, which is a parameter of the node as well
ARGUMENTS = (
    ("robot", "hexapod", "YAML file or name of a shipped robot, for studies that name none"),
    ("output_root", "~/.ros/geometry_searches", "Folder below which all results go"),
    ("workers", "0", "Worker processes; 0 for one a processor core"),
    ("scheduler", "", "Address of a Dask scheduler, to use its workers instead"),
)


def generate_launch_description() -> LaunchDescription:
    """Return the designs node with the parameters asked for."""
    types = {"workers": int}
    parameters = {
        name: ParameterValue(LaunchConfiguration(name), value_type=types.get(name, str))
        for name, *_ in ARGUMENTS
    }
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=description)
                for name, default, description in ARGUMENTS
            ),
            DeclareLaunchArgument("namespace", default_value="", description="Namespace"),
            Node(
                package="leg_statics",
                executable="designs_node",
                name="designs",
                namespace=LaunchConfiguration("namespace"),
                parameters=[parameters],
                output="screen",
            ),
        ]
    )
