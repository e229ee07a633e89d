# SPDX-License-Identifier: Apache-2.0
"""The maps node: planes, whole workspaces with progress and cancellation, clouds and markers."""

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from leg_msgs.msg import EffortLimits, ErrorCode
from leg_msgs.msg import Ground as GroundMessage
from leg_msgs.srv import GetIndexMap
from leg_msgs_py import errors
from leg_msgs_py.client import LegClient
from leg_msgs_py.clouds import from_cloud
from leg_msgs_py.grounds import Ground
from nodes_support import (
    MAX_POINTS,
    PATIENCE,
    START_TIMEOUT,
    ask,
    is_served,
    set_parameter,
    wait_for,
)
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState, PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from leg_kinematics import Status
from leg_statics.footholds import Contact
from leg_statics.maps import grid_shape, plane_map, supported_layers, volume_map

LEG = "left_front"
SLOPE = (0.1, 0.2, 1.0)
COARSE = 0.04  # m
GATED_NODE = Path(__file__).with_name("nodes_gated.py")
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture(scope="module", autouse=True)
def many_points(suite):
    """Let the maps node accept large maps."""
    assert set_parameter(suite.client.node, "maps", "max_points", 1_000_000).successful
    yield
    assert set_parameter(suite.client.node, "maps", "max_points", MAX_POINTS).successful


def whole_map(leg, resolution, **options):
    return list(volume_map(leg, resolution, **options))[-1]


def points_inside(index_map):
    """Return the points of a map within the workspace and their values."""
    z, y, x = np.meshgrid(index_map.height, index_map.y, index_map.x, indexing="ij")
    inside = index_map.status == Status.OK
    return np.stack([x, y, z], axis=-1)[inside], index_map.values[inside]


def last_message(message_type, topic):
    """Return what a subscriber that comes late receives."""
    received = []
    with LegClient() as late:
        late.node.create_subscription(message_type, topic, received.append, LATCHED)
        return wait_for(lambda: received)[-1]


# --------------------------------------------------------------------------- planes


def test_a_plane_equals_the_library(suite, hexapod):
    leg = hexapod.legs[LEG]
    wanted = plane_map(leg, -0.65, COARSE, contact=Contact(0.6, SLOPE))
    answer = suite.client.index_map(LEG, -0.65, COARSE, ground=Ground("wood", SLOPE))
    assert answer.layers == wanted.layers == supported_layers(leg.mechanism)
    assert (answer.symbols, answer.units) == (wanted.symbols, wanted.units)
    assert answer.height == wanted.height == -0.65
    np.testing.assert_allclose(answer.x, wanted.x, atol=1e-12)
    np.testing.assert_allclose(answer.y, wanted.y, atol=1e-12)
    np.testing.assert_allclose(answer.values, wanted.values, rtol=1e-9)
    np.testing.assert_array_equal(answer.status, wanted.status)
    assert np.isnan(answer.values[answer.status != Status.OK]).all()
    assert np.isfinite(answer.layer("load_capacity")).any()


def test_layers_come_in_the_order_asked_for(suite):
    answer = suite.client.index_map(LEG, -0.65, COARSE, ["load_capacity", "rated_friction"], "ice")
    assert answer.layers == ("load_capacity", "rated_friction")
    assert answer.units == ("N", "1")


def test_without_a_ground_a_map_has_all_but_load_capacity(suite, hexapod):
    answer = suite.client.index_map(LEG, -0.65, 0.1)
    assert (*answer.layers, "load_capacity") == supported_layers(hexapod.legs[LEG].mechanism)
    with pytest.raises(errors.InvalidInputError, match="ground: neither name nor friction"):
        suite.client.index_map(LEG, -0.65, 0.1, ["load_capacity"])


def test_a_plane_beyond_reach_is_empty(suite):
    answer = suite.client.index_map(LEG, -5.0, COARSE)
    assert np.isnan(answer.values).all()
    assert (answer.status != Status.OK).all()


def test_new_effort_limits_change_the_capacity_layer(suite, hexapod):
    leg = hexapod.legs[LEG]

    def capacity():
        return suite.client.index_map(LEG, -0.65, COARSE, ["load_capacity"], "wood").values

    before = capacity()
    suite.client.set_effort_limits(LEG, leg.joint_names, [75.0] * 3)
    try:
        wait_for(lambda: not np.array_equal(capacity(), before, equal_nan=True))
        np.testing.assert_allclose(capacity(), 0.5 * before, rtol=1e-9)
    finally:
        suite.client.set_effort_limits(LEG, leg.joint_names, [150.0] * 3)
    wait_for(lambda: np.array_equal(capacity(), before, equal_nan=True))


# --------------------------------------------------------------------------- whole workspaces


def test_a_whole_workspace_equals_the_library(suite, hexapod):
    leg = hexapod.legs[LEG]
    answer = suite.client.compute_index_map(LEG, COARSE, ground="cement")
    points, values = points_inside(whole_map(leg, COARSE, contact=Contact(0.4)))
    assert answer.layers == supported_layers(leg.mechanism)
    assert answer.fraction == 1.0
    assert answer.frame == leg.frame
    np.testing.assert_allclose(answer.positions, points, atol=1e-6)
    np.testing.assert_allclose(answer.values, values, rtol=1e-6)


def test_the_base_frame_is_the_leg_frame_moved_by_the_mount(suite, hexapod):
    mount = hexapod.legs[LEG].mount
    own = suite.client.compute_index_map(LEG, COARSE, ["load_capacity"], Ground(0.4, SLOPE))
    base = suite.client.compute_index_map(
        LEG,
        COARSE,
        ["load_capacity"],
        Ground(0.4, mount.vectors_to_base(SLOPE)),
        frame=hexapod.base_frame,
    )
    assert base.frame == hexapod.base_frame
    np.testing.assert_allclose(base.positions, mount.to_base(own.positions), atol=1e-6)
    np.testing.assert_allclose(base.values, own.values, rtol=1e-5)


# --------------------------------------------------------------------------- work under way


class GatedMaps:
    """A maps node of its own that computes maps only as far as it is let, and its client."""

    def __init__(self, namespace):
        self.process = subprocess.Popen(
            [sys.executable, GATED_NODE, "--ros-args", "-r", f"__ns:=/{namespace}"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.client = LegClient(namespace=namespace, timeout=PATIENCE)
        self.orders = []

    def __enter__(self):
        wait_for(self.is_there, START_TIMEOUT)
        return self

    def __exit__(self, *_):
        self.client.close()
        self.process.kill()
        self.process.communicate()

    def is_there(self):
        return is_served(self.client, "compute_index_map")

    def let(self, planes):
        """Let so many planes pass from now on."""
        self.process.stdin.write(f"{planes}\n")
        self.process.stdin.flush()
        assert self.process.stdout.readline() == f"{planes}\n"

    def order(self, resolution):
        """Order a map; return the work and its progress, of which something has been heard."""
        progress = []
        work = self.client.compute_index_map.future(
            LEG, resolution, ["rated_friction"], on_progress=progress.append
        )
        self.orders.append(work)
        wait_for(lambda: progress)
        return work, progress


@pytest.fixture(scope="module")
def gated_node():
    with GatedMaps("gated") as gated:
        yield gated


@pytest.fixture
def gated(gated_node):
    """The gated node, with nothing to do and the gate closed."""
    yield gated_node
    for work in gated_node.orders:
        work.cancel()
    gated_node.let(0)


def test_maps_tell_if_no_node_tells_them_the_limits_in_force(gated_node, suite):
    """As when the statics node has another name."""
    node, said = suite.client.node, {}

    def hear(message):
        said[message.status[0].name] = message.status[0].message

    heard = node.create_subscription(DiagnosticArray, "/diagnostics", hear, 10)
    elsewhere = node.create_publisher(EffortLimits, "/gated/leg_load/effort_limits", LATCHED)
    try:
        wait_for(lambda: "/gated/leg_load/effort_limits" in said.get("/gated/maps: health", ""))
        assert "no node publishes /gated/statics/effort_limits" in said["/gated/maps: health"]
        told = node.create_publisher(EffortLimits, "/gated/statics/effort_limits", LATCHED)
        wait_for(lambda: said["/gated/maps: health"] == "ok")
        node.destroy_publisher(told)
    finally:
        node.destroy_publisher(elsewhere)
        node.destroy_subscription(heard)


def planes_of(hexapod, resolution):
    return grid_shape(hexapod.legs[LEG].mechanism, resolution)[0]


def test_progress_tells_the_best_so_far(gated, hexapod):
    leg = hexapod.legs[LEG]
    *_, whole = volume_map(leg, COARSE, layers=["rated_friction"])
    planes = len(whole.height) // 2
    work, progress = gated.order(COARSE)
    gated.let(planes)
    wait_for(lambda: progress[-1].fraction == planes / len(whole.height))
    assert progress[-1].layers == ("rated_friction",)
    assert progress[-1].best[0] == np.nanmin(whole.values[:planes])
    assert progress[-1].remaining > 0.0
    gated.let(len(whole.height) - planes)
    assert work.wait().fraction == 1.0


def test_queries_are_answered_while_a_map_is_computed(gated, hexapod):
    work, progress = gated.order(0.03)
    for k in range(1, 6):
        gated.let(1)
        plane = gated.client.index_map("right_rear", -0.65, 0.1, ["condition_number"])
        assert np.isfinite(plane.values).any()
        wait_for(lambda k=k: progress[-1].fraction == k / planes_of(hexapod, 0.03))
    assert not work.done()
    gated.let(planes_of(hexapod, 0.03))
    assert work.wait().fraction == 1.0


def test_a_cancelled_map_gives_what_there_is(gated, hexapod):
    planes = planes_of(hexapod, 0.02)
    work, progress = gated.order(0.02)
    gated.let(planes // 2)
    wait_for(lambda: progress[-1].fraction == planes // 2 / planes)
    work.cancel()
    with pytest.raises(errors.CancelledError, match="cancelled by the caller") as caught:
        work.wait()
    partial = caught.value.partial
    assert partial.fraction == (planes // 2 + 1) / planes  # the plane under way is the last one
    assert len(partial.positions)
    posture = hexapod.legs[LEG].mechanism.inverse(partial.positions[::50])
    assert np.mean(posture.status == Status.OK) > 0.95  # float32 moves points across the border


def test_a_map_that_waits_for_another_can_be_cancelled(gated):
    first, _ = gated.order(0.05)
    second, heard = gated.order(0.06)
    assert heard[-1].fraction == 0.0
    second.cancel()
    with pytest.raises(errors.CancelledError) as caught:
        second.wait()
    assert len(caught.value.partial.positions) == 0
    assert not first.done()
    first.cancel()
    with pytest.raises(errors.CancelledError):
        first.wait()


def test_what_the_progress_callback_raises_ends_the_work(gated):
    def give_up(progress):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        gated.client.compute_index_map(LEG, 0.07, on_progress=give_up)
    gated.let(1000)
    assert gated.client.compute_index_map(LEG, 0.1).fraction == 1.0


DYING = """
from leg_msgs_py.client import LegClient
with LegClient(namespace="gated", timeout=600.0) as client:
    def tell(progress):
        print(progress.fraction, flush=True)

    client.compute_index_map("right_rear", 0.08, on_progress=tell)
"""


def test_a_client_that_dies_leaves_the_node_alive(gated):
    client = subprocess.Popen([sys.executable, "-c", DYING], stdout=subprocess.PIPE)
    assert client.stdout.readline() == b"0.0\n"
    os.kill(client.pid, signal.SIGKILL)
    client.wait()
    client.stdout.close()
    assert gated.client.index_map(LEG, -0.65, 0.1).status.size
    gated.let(1000)  # the map of the dead one, and another
    assert gated.client.compute_index_map(LEG, 0.09).fraction == 1.0
    assert gated.process.poll() is None


def test_a_node_that_stops_ends_the_map_under_way():
    with GatedMaps("stopping") as stopping:
        work, _ = stopping.order(COARSE)
        stopping.process.send_signal(signal.SIGINT)
        assert stopping.process.wait(PATIENCE) == 0
        wait_for(lambda: not stopping.is_there())
        stopping.client.caller.timeout = 0.5
        with pytest.raises(errors.ServerUnavailableError, match="compute_index_map"):
            work.wait()


# --------------------------------------------------------------------------- bad requests

# fields, error code, words that the message must have
BAD = {
    "leg": ({"leg": "tail"}, "UNKNOWN_LEG", ["tail", LEG]),
    "ground": ({"ground": GroundMessage(name="lava")}, "UNKNOWN_GROUND", ["lava", "cement"]),
    "mu < 0": (
        {"ground": GroundMessage(friction_coefficients=[-0.1])},
        "INVALID_INPUT",
        ["ground.friction_coefficients", "-0.1"],
    ),
    "normal": (
        {"ground": GroundMessage(name="ice", normals=[math.nan, 0.0, 1.0])},
        "INVALID_INPUT",
        ["ground.normals", "nan"],
    ),
    "layer": ({"layers": ["beauty"]}, "INVALID_INPUT", ["layer", "beauty", "load_capacity"]),
    "resolution 0": ({"resolution": 0.0}, "INVALID_INPUT", ["resolution", "> 0", "0.0"]),
    "resolution NaN": ({"resolution": math.nan}, "INVALID_INPUT", ["resolution", "nan"]),
    "too fine": ({"resolution": 1e-5}, "TOO_LARGE", ["resolution", "1000000", "max_points"]),
    "much too fine": ({"resolution": 5e-324}, "TOO_LARGE", ["resolution", "max_points"]),
}


@pytest.mark.parametrize("case", BAD.values(), ids=BAD.keys())
def test_a_bad_plane_is_refused(suite, case):
    fields, code, words = case
    request = GetIndexMap.Request(**{"leg": LEG, "height": -0.65, "resolution": 0.1, **fields})
    with pytest.raises(errors.LegServiceError) as caught:
        ask(suite.client, "get_index_map", request)
    assert caught.value.code == getattr(ErrorCode, code)
    for word in words:
        assert word in caught.value.message


@pytest.mark.parametrize("case", BAD.values(), ids=BAD.keys())
def test_a_bad_goal_is_ended_with_the_reason(suite, case):
    fields, code, words = case
    fields = {"leg": LEG, "resolution": 0.1, **fields}
    ground = fields.pop("ground", None)
    ground = Ground(
        (ground.name or ground.friction_coefficients[0]) if ground else 0.4,
        ground.normals if ground and len(ground.normals) else None,
    )
    with pytest.raises(errors.LegServiceError) as caught:
        suite.client.compute_index_map(ground=ground, **fields)
    assert caught.value.code == getattr(ErrorCode, code)
    for word in words:
        assert word in caught.value.message


def test_a_goal_in_an_unknown_frame_is_ended_with_the_reason(suite):
    with pytest.raises(errors.InvalidInputError, match=r"header\.frame_id.*map"):
        suite.client.compute_index_map(LEG, 0.1, frame="map")


def test_a_height_that_is_not_finite_or_above_the_foot_is_refused(suite):
    with pytest.raises(errors.InvalidInputError, match="height must be negative below"):
        suite.client.index_map(LEG, 0.65, 0.1)
    with pytest.raises(errors.InvalidInputError, match="height"):
        suite.client.index_map(LEG, math.nan, 0.1)


def test_without_a_node_the_map_ends_in_time():
    with LegClient(namespace="nobody", timeout=0.3) as client:
        with pytest.raises(errors.ServerUnavailableError, match="/nobody/maps/compute_index_map"):
            client.compute_index_map(LEG, 0.1)
        work = client.compute_index_map.future(LEG, 0.1)
    with pytest.raises(errors.CancelledError, match="closed"):
        work.wait()


# --------------------------------------------------------------------------- clouds and markers


def test_a_late_subscriber_receives_the_map_computed_last(suite, hexapod):
    own = suite.client.compute_index_map(LEG, 0.06, ["rated_friction", "load_capacity"], "wood")
    cloud = last_message(PointCloud2, "/maps/index_map")
    assert cloud.header.frame_id == hexapod.base_frame
    assert (cloud.header.stamp.sec, cloud.header.stamp.nanosec) == (0, 0)
    assert [field.name for field in cloud.fields] == [
        *("x", "y", "z"),
        *("rated_friction", "load_capacity"),
    ]
    points, fields = from_cloud(cloud)
    np.testing.assert_allclose(points, hexapod.legs[LEG].mount.to_base(own.positions), atol=1e-6)
    np.testing.assert_array_equal(fields["load_capacity"], own.layer("load_capacity"))
    assert cloud.is_dense


class Markers:
    """The markers received last, by namespace."""

    def __init__(self, node):
        self.node = node
        self.received = []
        self.subscription = node.create_subscription(
            MarkerArray, "/maps/markers", self.received.append, LATCHED
        )
        wait_for(lambda: self.received)

    def latest(self):
        return {marker.ns: marker for marker in self.received[-1].markers}

    def points(self, namespace):
        return np.array([[p.x, p.y, p.z] for p in self.latest()[namespace].points])


@pytest.fixture
def markers(suite):
    markers = Markers(suite.client.node)
    yield markers
    suite.client.node.destroy_subscription(markers.subscription)


def test_markers_show_every_leg_in_the_base_frame(markers, hexapod):
    shown = {
        name: marker for name, marker in markers.latest().items() if marker.action == Marker.ADD
    }
    parts = ("linkage", "foot", "friction_cone", "force_polytope", "workspace")
    assert set(shown) == {f"{leg}/{part}" for leg in hexapod.legs for part in parts}
    for namespace, marker in shown.items():
        assert marker.frame_locked
        assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (0, 0)
        assert marker.header.frame_id == hexapod.base_frame
        assert np.isfinite(markers.points(namespace)).all()
        assert len(marker.colors) in (0, len(marker.points))
        if marker.type == Marker.LINE_LIST:
            assert len(marker.points) % 2 == 0
    for name, leg in hexapod.legs.items():
        foot = leg.mount.to_base(leg.mechanism.initial_posture.foot_position)
        np.testing.assert_allclose(markers.points(f"{name}/foot")[0], foot, atol=1e-9)
        workspace = markers.latest()[f"{name}/workspace"]
        assert len(workspace.points) > 50
        assert len({(c.r, c.g, c.b) for c in workspace.colors}) > 10


def test_markers_of_a_former_robot_are_taken_away_until_it_comes_back(suite, markers, hexapod):
    node, ghost = suite.client.node, "left_middle/linkage"
    assert "left_middle" in hexapod.legs
    assert set_parameter(node, "maps", "robot", "quadruped").successful
    try:
        wait_for(lambda: markers.latest()[ghost].action == Marker.DELETE)
        assert markers.latest()["left_front/linkage"].action == Marker.ADD
    finally:
        assert set_parameter(node, "maps", "robot", "hexapod").successful
    wait_for(lambda: markers.latest()[ghost].action == Marker.ADD)


def test_while_a_simulation_is_paused_maps_are_delivered_and_diagnostics_told(suite):
    node, told = suite.client.node, []
    subscription = node.create_subscription(DiagnosticArray, "/diagnostics", told.append, 10)
    assert set_parameter(node, "maps", "use_sim_time", True).successful
    try:
        assert suite.client.compute_index_map(LEG, 0.06, ["condition_number"]).fraction == 1.0
        told.clear()
        wait_for(lambda: any(message.status[0].name.startswith("/maps") for message in told))
    finally:
        assert set_parameter(node, "maps", "use_sim_time", False).successful
        node.destroy_subscription(subscription)


def test_markers_follow_the_joint_states(suite, markers, hexapod):
    leg = hexapod.legs[LEG]
    joints = [0.1, 0.15, -0.05]
    foot = leg.mount.to_base(leg.mechanism.forward(joints).foot_position)
    publisher = suite.client.node.create_publisher(
        JointState, "/joint_states", qos_profile_sensor_data
    )

    def drawn():
        publisher.publish(JointState(name=list(leg.joint_names), position=joints))
        time.sleep(0.05)
        return np.allclose(markers.points(f"{LEG}/foot")[0], foot)

    try:
        wait_for(drawn)
        publisher.publish(JointState(name=list(leg.joint_names), position=joints[:2]))
        wait_for(drawn)  # a bad message leaves the node alive
    finally:
        suite.client.node.destroy_publisher(publisher)


def test_the_force_polytope_grows_with_the_limits(suite, markers, hexapod):
    names = hexapod.legs[LEG].joint_names
    foot = markers.points(f"{LEG}/foot")[0]

    def size():
        return np.abs(markers.points(f"{LEG}/force_polytope") - foot).max()

    before = size()
    suite.client.set_effort_limits(LEG, names, [300.0] * 3)
    try:
        wait_for(lambda: size() == pytest.approx(2.0 * before))
    finally:
        suite.client.set_effort_limits(LEG, names, [150.0] * 3)
    wait_for(lambda: size() == pytest.approx(before))


def test_an_unknown_marker_layer_takes_the_workspace_away(suite, markers):
    node = suite.client.node
    assert set_parameter(node, "maps", "marker_layer", "beauty").successful
    wait_for(lambda: markers.latest()[f"{LEG}/workspace"].action == Marker.DELETE)
    assert set_parameter(node, "maps", "marker_layer", "rated_friction").successful
    wait_for(lambda: markers.latest()[f"{LEG}/workspace"].action == Marker.ADD)
    assert set_parameter(node, "maps", "marker_layer", "load_capacity").successful
