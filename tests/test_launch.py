# SPDX-License-Identifier: Apache-2.0
"""The launch file of the suite: which nodes it starts with which arguments, and what viewers get.

Where ROS's `launch` is not installed, stand-ins record what is handed to it.
"""

import json
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

import pytest
from node_processes import node_names
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parent.parent
CONFIG = ROOT / "config"
KNOWN = YAML(typ="safe").load(CONFIG / "nodes.yaml")


class Recorded(SimpleNamespace):
    """An action of a launch file with what it was made with."""


def recorder(kind):
    return lambda *values, **options: Recorded(kind=kind, values=values, **options)


@pytest.fixture
def launched(monkeypatch):
    """Return a function that launches with arguments, and with further packages installed."""

    def launch(installed=(), **told):
        missing = type("PackageNotFoundError", (KeyError,), {})

        def prefix(package):
            if package not in installed:
                raise missing(package)

        modules = {
            "launch": {"LaunchDescription": list},
            "launch.actions": {
                name: recorder(name)
                for name in ("DeclareLaunchArgument", "LogInfo", "OpaqueFunction")
            },
            "launch_ros": {},
            "launch_ros.actions": {"Node": recorder("Node")},
            "ament_index_python.packages": {
                "PackageNotFoundError": missing,
                "get_package_prefix": prefix,
            },
        }
        for name, members in modules.items():
            module = ModuleType(name)
            vars(module).update(members)
            monkeypatch.setitem(sys.modules, name, module)
        file = runpy.run_path(str(CONFIG / "launch" / "leg_suite.launch.py"))
        *arguments, function = file["generate_launch_description"]()
        assert {argument.kind for argument in arguments} == {"DeclareLaunchArgument"}
        assert all(argument.description for argument in arguments)
        values = {argument.values[0]: argument.default_value for argument in arguments}
        assert {*told} <= {*values}
        return function.function(SimpleNamespace(launch_configurations=values | told))

    return launch


def names(actions):
    return [action.name for action in actions if action.kind == "Node"]


def test_it_starts_the_nodes_that_make_run_starts_and_companions_when_asked(launched):
    assert tuple(names(launched())) == node_names()
    assert names(launched(gait="true", designs="true")) == [*node_names(), "designs", "gait"]
    for node in (*KNOWN["nodes"], *KNOWN["companions"]):
        package, executable = node["package"], node["executable"]
        setup = (ROOT / package / "setup.py").read_text()
        assert f'"{executable} = {package}.nodes.entry_points:{executable}"' in setup


def test_arguments_reach_every_node(launched):
    told = {"robot": "walker", "namespace": "dog", "frame_prefix": "dog/", "log_level": "debug"}
    told |= {"use_sim_time": "True", "respawn": "true", "params_file": "mine.yaml"}
    installed = ("robot_state_publisher", "rviz2")
    nodes = launched(installed, rviz="true", **told)
    assert names(nodes) == [*node_names(), "robot_state_publisher", "rviz"]
    for node in nodes:
        assert node.namespace == "dog"
        assert node.ros_arguments == ["--log-level", "debug"]
        assert node.respawn is True
        file, parameters = node.parameters
        assert file == "mine.yaml"
        assert parameters["use_sim_time"] is True
    for node in nodes[: len(node_names())]:
        assert node.parameters[1]["robot"] == "walker"
        assert node.parameters[1]["frame_prefix"] == "dog/"


def test_robot_state_publisher_is_given_the_same_robot_and_the_completed_joint_states(launched):
    *_, frames = launched(("robot_state_publisher",), robot="quadruped", frame_prefix="a/")
    links = ElementTree.fromstring(frames.parameters[-1]["robot_description"]).iter("link")
    assert next(links).get("name") == "a/base_link"
    assert ("joint_states", "completed_joint_states") in frames.remappings


def test_what_is_not_installed_is_told_and_the_nodes_start(launched):
    actions = launched(rviz="true")
    told = [action.msg for action in actions if action.kind == "LogInfo"]
    assert tuple(names(actions)) == node_names()
    assert [text.split()[0] for text in told] == ["robot_state_publisher", "rviz2"]
    assert all("is not installed" in text for text in told)
    assert [a.kind for a in launched(robot_state_publisher="false")] == ["Node"] * len(node_names())


def test_an_argument_that_is_neither_true_nor_false_is_told(launched):
    with pytest.raises(ValueError, match="allowed: true, false"):
        launched(rviz="maybe")


def test_the_viewers_show_topics_that_the_nodes_publish():
    view = YAML(typ="safe").load(CONFIG / "viewers" / "leg_suite.rviz")
    displays = {d["Class"].split("/")[1]: d for d in view["Visualization Manager"]["Displays"]}
    shown = {
        displays["RobotModel"]["Description Topic"]["Value"],
        displays["MarkerArray"]["Topic"]["Value"],
        displays["PointCloud2"]["Topic"]["Value"],
    }
    layout = json.loads((CONFIG / "viewers" / "leg_suite.foxglove.json").read_text())
    panels = layout["configById"]
    scene = panels["3D!robot"]
    shown |= {topic.removeprefix("/") for topic in scene["topics"]}
    shown.add(scene["layers"]["robot"]["topic"].removeprefix("/"))
    plots = [path["value"] for p in panels.values() for path in p.get("paths", ())]
    shown |= {plot.partition(".legs")[0].removeprefix("/") for plot in plots}
    assert shown == {"robot_description", "maps/markers", "maps/index_map", "statics/leg_states"}
    fields = (ROOT / "leg_msgs" / "msg" / "LegState.msg").read_text()
    assert all(f" {plot.rpartition('.')[2]} " in fields for plot in plots)

    def leaves(tree):
        if isinstance(tree, str):
            return {tree}
        return leaves(tree["first"]) | leaves(tree["second"])

    assert leaves(layout["layout"]) == {*panels}
