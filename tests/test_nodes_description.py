# SPDX-License-Identifier: Apache-2.0
"""What robot_state_publisher, RViz and Foxglove are given: URDF, completed joint states, frames."""

from xml.etree import ElementTree

import numpy as np
import pytest
from node_processes import NodeProcesses
from nodes_support import START_TIMEOUT, wait_for
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from leg_kinematics import load_robot
from leg_kinematics.export.named_legs import named_legs

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SHARED = {"/diagnostics", "/parameter_events", "/rosout"}


class Viewer:
    """Receives what a robot publishes for viewers, and plays its drives."""

    def __init__(self, node, namespace=""):
        self.description = self.joints = self.markers = None
        self.publisher = node.create_publisher(
            JointState, f"{namespace}/joint_states", qos_profile_sensor_data
        )
        self.subscriptions = [
            node.create_subscription(String, f"{namespace}/robot_description", self.read, LATCHED),
            node.create_subscription(
                JointState, f"{namespace}/completed_joint_states", self.complete, 10
            ),
            node.create_subscription(MarkerArray, f"{namespace}/maps/markers", self.draw, LATCHED),
        ]

    def read(self, message):
        self.description = message.data

    def complete(self, message):
        self.joints = dict(zip(message.name, message.position, strict=True))

    def draw(self, message):
        self.markers = message.markers

    def completed(self, names, positions):
        """Return all joints by name once drives have told; a message may be lost."""

        def told():
            self.publisher.publish(JointState(name=list(names), position=list(positions)))
            return self.joints

        self.joints = None
        return wait_for(told, START_TIMEOUT)


def link_frames(urdf, joints):
    """Return rotation and origin of each link of a URDF, as robot_state_publisher finds them."""
    root = ElementTree.fromstring(urdf)

    def numbers(element, attribute):
        return np.array([float(v) for v in element.get(attribute, "0 0 0").split()])

    held = {joint.find("child").get("link"): joint for joint in root.iter("joint")}

    def frame(link):
        if link not in held:
            return Rotation.identity(), np.zeros(3)
        joint = held[link]
        turned, origin = frame(joint.find("parent").get("link"))
        place = joint.find("origin")
        origin = origin + turned.apply(numbers(place, "xyz"))
        turned = turned * Rotation.from_euler("xyz", numbers(place, "rpy"))
        if joint.get("type") == "fixed":
            return turned, origin
        move = joints[joint.get("name")] * numbers(joint.find("axis"), "xyz")
        if joint.get("type") == "prismatic":
            return turned, origin + turned.apply(move)
        return turned * Rotation.from_rotvec(move), origin

    return {link.get("name"): frame(link.get("name")) for link in root.iter("link")}


def test_with_the_completed_joint_states_the_published_legs_are_closed(suite, hexapod):
    viewer = Viewer(suite.client.node)
    urdf = wait_for(lambda: viewer.description)
    legs = named_legs(hexapod)
    names = [name for leg in legs for name in leg.leg.joint_names]
    told = np.random.default_rng(4).uniform(-0.15, 0.15, len(names))
    frames = link_frames(urdf, viewer.completed(names, told))

    def place(site):
        turned, origin = frames[site.link]
        return origin + turned.apply(site.point)

    for leg, q in zip(legs, told.reshape(len(legs), -1), strict=True):
        assert len(leg.closures) == 4
        for first, second in leg.closures:
            np.testing.assert_allclose(place(first), place(second), rtol=0, atol=1e-9)
        foot = leg.leg.mechanism.forward(q).foot_position
        np.testing.assert_allclose(frames[leg.foot][1], leg.leg.mount.to_base(foot), atol=1e-9)
        turned, origin = frames[leg.leg.frame]
        np.testing.assert_allclose(origin, leg.leg.mount.position, atol=1e-12)
        np.testing.assert_allclose(turned.as_matrix(), leg.leg.mount.rotation, atol=1e-12)


@pytest.fixture(scope="module")
def fleet():
    """Two quadrupeds, each with the nodes that show it."""
    names = ("robot_1", "robot_2")
    robots = [
        NodeProcesses(
            "quadruped",
            names=["kinematics", "maps"],
            namespace=name,
            parameters={"frame_prefix": f"{name}/"},
        )
        for name in names
    ]
    with robots[0], robots[1]:
        yield names


def test_two_robots_in_one_viewer_share_no_frame_topic_or_joint_state(suite, fleet):
    node, robot = suite.client.node, load_robot("quadruped")
    legs = robot.legs.values()
    drives = [
        (n, q)
        for leg in legs
        for n, q in zip(leg.joint_names, leg.mechanism.initial_posture.joint_positions, strict=True)
    ]
    viewers = {name: Viewer(node, f"/{name}") for name in fleet}
    links, topics = [], []
    for name, viewer in viewers.items():
        joints = viewer.completed(*zip(*drives, strict=True))
        urdf = wait_for(lambda viewer=viewer: viewer.description)
        markers = wait_for(lambda viewer=viewer: viewer.markers, START_TIMEOUT)
        frames = link_frames(urdf, joints)
        links.append({*frames})
        assert all(link.startswith(f"{name}/") for link in frames)
        assert {marker.header.frame_id for marker in markers} == {f"{name}/base_link"} <= {*frames}
        spaces = [marker.ns for marker in markers]
        assert len({*spaces}) == len(spaces)
        for leg in legs:
            assert any(space.startswith(f"{leg.name}/") for space in spaces)
        topics.append(
            {
                topic
                for each in ("kinematics", "maps")
                for topic, _ in node.get_publisher_names_and_types_by_node(each, f"/{name}")
            }
        )
    assert not links[0] & links[1]
    assert topics[0] & topics[1] <= SHARED
