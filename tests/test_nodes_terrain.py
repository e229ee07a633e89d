# SPDX-License-Identifier: Apache-2.0
"""The terrain node: foothold maps are those of the library, and follow terrain, body and limits."""

from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from leg_msgs_py.client import LegClient
from leg_msgs_py.clouds import from_cloud, to_cloud
from leg_msgs_py.recordings.bags import Bag
from make_golden_bags import TERRAIN_STEP, rough_terrain
from node_processes import NodeProcesses
from nodes_support import START_TIMEOUT, set_parameter, wait_for
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from leg_kinematics.robot import Mount
from leg_statics.footholds import Contact, Verdict
from leg_statics.terrain import foothold_map, gridded, survey

BAG = Path(__file__).parent / "bags" / "rough_terrain"
# Cells of the recorded terrain with a score, and the best score, at its five poses.
GOLDEN = [(55, 0.8), (48, 0.693), (36, 0.4), (17, 0.4), (18, 0.425)]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FRONT, REAR = "left_front", "right_rear"


class Mapper:
    """Publishes terrain and poses, and hears foothold maps and diagnostics."""

    def __init__(self, node):
        self.node = node
        self.maps = {FRONT: [], REAR: []}
        self.told = []
        self.terrain = node.create_publisher(PointCloud2, "/terrain", LATCHED)
        self.pose = node.create_publisher(PoseStamped, "/base_pose", 10)
        for leg, maps in self.maps.items():
            topic = f"/terrain/{leg}/footholds"
            node.create_subscription(PointCloud2, topic, maps.append, LATCHED)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnose, 10)

    def _diagnose(self, message):
        self.told.append(message.status[0])

    def publish(self, points, frame="map", **fields):
        self.terrain.publish(to_cloud(Header(frame_id=frame), points, fields))

    def place(self, position, rotation):
        message = PoseStamped()
        message.header.frame_id = "map"
        place, turn = message.pose.position, message.pose.orientation
        place.x, place.y, place.z = map(float, position)
        turn.x, turn.y, turn.z, turn.w = rotation.as_quat()
        self.pose.publish(message)

    def forget(self):
        for maps in self.maps.values():
            maps.clear()
        self.told.clear()

    def wait(self, leg=FRONT, accept=lambda points, fields: True):
        """Return points and fields of the next map that is accepted."""

        def found():
            maps, self.maps[leg][:] = list(self.maps[leg]), []
            return next((m for m in map(from_cloud, maps) if accept(*m)), None)

        return wait_for(found)

    def wait_for_words(self, *words):
        """Return the next diagnostics that have all these words."""

        def found():
            told, self.told[:] = list(self.told), []
            return next((s for s in told if all(w in s.message for w in words)), None)

        return wait_for(found)


@pytest.fixture(scope="module")
def mapper():
    parameters = {"diagnostics_rate": 10.0, "rate": 50.0}
    with NodeProcesses(names=["terrain"], parameters=parameters) as nodes, LegClient() as client:
        found = Mapper(client.node)
        wait_for(lambda: found.told, START_TIMEOUT)
        wait_for(lambda: found.terrain.get_subscription_count() == 1)
        wait_for(lambda: found.pose.get_subscription_count() == 1)
        yield found
        assert nodes.ended() == {}


POINTS = rough_terrain()
BODY = ((0.3, 0.1, 0.68), Rotation.from_rotvec([0.03, -0.05, 0.2]))


def wanted(robot, leg, points, place, contact=None, **fields):
    """Return the map of the library, as a cloud tells it."""
    position, rotation = place
    singles = np.asarray(points, np.float32).astype(float)
    ground = survey(gridded(singles, **fields))
    base = Mount(np.array(position), rotation.as_matrix())
    found = foothold_map(robot.leg(leg), ground, contact or Contact(0.4), base)
    near = np.isfinite(found.verdict) & (found.verdict != Verdict.REACH)
    return ground.points[near], found, near


def same(cloud, expected):
    points, fields = cloud
    places, found, near = expected
    np.testing.assert_allclose(points, places, atol=1e-6)
    for name in ("verdict", "load_capacity", "friction_margin", "score"):
        values = getattr(found, name)[near]
        np.testing.assert_allclose(fields[name], values, rtol=1e-5, atol=1e-5, err_msg=name)


def test_without_a_pose_the_body_is_nowhere_and_it_is_told(mapper):
    mapper.publish(POINTS)
    told = mapper.wait_for_words("no pose of 'base_link'", "'map'", "base_pose is heard in none")
    values = {value.key: value.value for value in told.values}
    assert float(values["terrain age [s]"]) >= 0.0
    assert int(values["terrain cells"]) >= len(POINTS)


def test_every_cell_of_every_leg_is_what_the_library_says(mapper, hexapod):
    mapper.publish(POINTS)
    mapper.place(*BODY)
    for leg in (FRONT, REAR):
        expected = wanted(hexapod, leg, POINTS, BODY)
        count = len(expected[0])
        cloud = mapper.wait(leg, lambda points, fields, count=count: len(points) == count)
        same(cloud, expected)
        assert (cloud[1]["verdict"] == Verdict.FEASIBLE).sum() > 50


def test_a_body_that_moves_and_one_that_stands(mapper, hexapod):
    mapper.publish(POINTS)
    moved = ((0.45, 0.1, 0.66), BODY[1])
    mapper.place(*moved)
    expected = wanted(hexapod, FRONT, POINTS, moved)
    same(mapper.wait(accept=lambda points, fields: len(points) == len(expected[0])), expected)
    mapper.forget()
    mapper.place((0.4501, 0.1, 0.66), BODY[1])  # within what is no motion
    mapper.wait_for_words("")
    mapper.wait_for_words("")
    assert mapper.maps[FRONT] == []


def test_parameters_count_at_once(mapper, hexapod):
    mapper.publish(POINTS)
    mapper.place(*BODY)
    assert set_parameter(mapper.node, "terrain", "required_load", 600.0).successful
    try:
        expected = wanted(hexapod, FRONT, POINTS, BODY, Contact(0.4, load=600.0))
        scores = expected[1].score[expected[2]]
        same(mapper.wait(accept=lambda p, f: np.allclose(f["score"], scores, atol=1e-5)), expected)
    finally:
        assert set_parameter(mapper.node, "terrain", "required_load", 0.0).successful


def test_friction_of_the_terrain_counts(mapper, hexapod):
    friction = np.where(POINTS[:, 0] > 0.5, 0.05, 0.9)
    mapper.place(*BODY)
    mapper.publish(POINTS, friction=friction)
    expected = wanted(
        hexapod, FRONT, POINTS, BODY, friction=friction.astype(np.float32).astype(float)
    )
    margins = expected[1].friction_margin[expected[2]]
    same(
        mapper.wait(
            accept=lambda p, f: np.allclose(f["friction_margin"], margins, 1e-5, 1e-5, True)
        ),
        expected,
    )


def test_a_recorded_terrain_is_judged_as_it_was(mapper, hexapod):
    """The bag has a cloud and five poses; numbers of good cells and best scores are as ever."""
    bag, seen = Bag(BAG), []
    for message in bag.messages():
        publisher = mapper.terrain if message.topic == "/terrain" else mapper.pose
        publisher.publish(bytes(message.data))
        if message.topic == "/terrain":
            points, fields = from_cloud(deserialize_message(message.data, PointCloud2))
            friction = fields["friction"].astype(float)
            continue
        pose = vars_of(deserialize_message(message.data, PoseStamped).pose)
        expected = wanted(hexapod, FRONT, points, pose, friction=friction)
        scores = expected[1].score[expected[2]]

        def is_wanted(found, fields, scores=scores):
            return len(found) == len(scores) and np.allclose(fields["score"], scores, atol=1e-5)

        same(mapper.wait(accept=is_wanted), expected)
        seen.append((int((scores > 0.0).sum()), round(float(scores.max()), 3)))
    assert seen == GOLDEN


def vars_of(pose):
    """Return position and rotation of a pose."""
    place, turn = pose.position, pose.orientation
    rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
    return (place.x, place.y, place.z), rotation


def test_terrain_in_the_base_frame_needs_no_pose(mapper, hexapod):
    points = POINTS - [0.3, 0.0, 0.7]
    mapper.publish(points, "base_link")
    level = ((0.0, 0.0, 0.0), Rotation.identity())
    expected = wanted(hexapod, FRONT, points, level)
    same(mapper.wait(accept=lambda p, f: len(p) == len(expected[0])), expected)


def test_no_terrain_at_all_is_a_map_without_cells(mapper):
    mapper.forget()
    mapper.publish(np.empty((0, 3)), "base_link")
    points, _ = mapper.wait(accept=lambda p, f: len(p) == 0)
    assert points.shape == (0, 3)


def test_a_cloud_that_is_none_is_refused_and_the_next_is_taken(mapper):
    bad = to_cloud(Header(frame_id="base_link"), POINTS, {})
    bad.fields = bad.fields[:2]
    mapper.forget()
    mapper.terrain.publish(bad)
    mapper.wait_for_words("refused input: terrain", "no field z")
    mapper.publish(POINTS[::2] - [0.3, 0.0, 0.7], "base_link")
    mapper.wait(accept=lambda p, f: len(p) > 0)


def test_too_fine_a_grid_is_told(mapper):
    assert set_parameter(mapper.node, "terrain", "resolution", 1e-4).successful
    try:
        mapper.publish(1.001 * POINTS)
        mapper.wait_for_words("refused input: terrain", "too many cells")
    finally:
        assert set_parameter(mapper.node, "terrain", "resolution", TERRAIN_STEP).successful


@pytest.mark.parametrize("name", ["steepest", "edge_margin", "required_load", "fit_radius"])
def test_parameters_out_of_range_are_refused(mapper, name):
    bad = -1 if name == "fit_radius" else -1.0
    assert not set_parameter(mapper.node, "terrain", name, bad).successful
