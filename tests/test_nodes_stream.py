# SPDX-License-Identifier: Apache-2.0
"""Joint states in, leg states out: what the statics node makes of a stream, good or bad."""

import itertools
import math
import time
from contextlib import suppress

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from leg_msgs.msg import LegState, LegStates, PointStatus
from leg_msgs_py.losses import subscribe_raw
from nodes_support import set_parameter, wait_for
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from leg_statics.capacity.problem import load_capacity
from leg_statics.indices import condition_number, rated_friction, rated_friction_full

DEEP = QoSProfile(depth=2000)

_stamps = itertools.count(1)


class Stream:
    """Publishes joint states and receives leg states and diagnostics."""

    def __init__(self, node):
        self.states = {}
        self.lost = 0  # leg states, by the middleware
        self.diagnostics = None
        self.node = node
        self.publisher = node.create_publisher(JointState, "/joint_states", qos_profile_sensor_data)
        self.subscriptions = [
            subscribe_raw(node, LegStates, "/statics/leg_states", self.receive, self.lose, DEEP),
            node.create_subscription(DiagnosticArray, "/diagnostics", self.diagnose, 10),
        ]
        wait_for(lambda: self.publisher.get_subscription_count() >= 2)  # statics and maps
        wait_for(lambda: self.subscriptions[0].get_publisher_count() == 1)
        wait_for(lambda: self.ask(["left_front_crank_1"]) is None and self.diagnostics)

    def receive(self, data):
        message = deserialize_message(data, LegStates)
        self.states[message.header.stamp.sec] = message

    def lose(self, count):
        self.lost += count

    def diagnose(self, message):
        if message.status[0].name.startswith("/statics"):
            self.diagnostics = message.status[0]

    def send(self, names, position=None, velocity=(), effort=()):
        """Publish one message and return its stamp."""
        message = JointState(name=list(names))
        message.header.stamp.sec = next(_stamps)
        message.position = [0.0] * len(names) if position is None else list(map(float, position))
        message.velocity, message.effort = list(map(float, velocity)), list(map(float, effort))
        self.publisher.publish(message)
        return message.header.stamp.sec

    def ask(self, names, position=None, velocity=(), effort=()):
        """Return the leg states of one message by leg, or None if it gave none.

        A good message follows it; its answer tells that the first one has been dealt with.
        """
        stamp = self.send(names, position, velocity, effort)
        ends = set()
        while not ends & self.states.keys():  # best effort: a message may be lost
            ends.add(self.send(RIGHT_REAR))
            with suppress(AssertionError):
                wait_for(lambda: ends & self.states.keys(), timeout=0.5)
        found = self.states.get(stamp)
        return found and {leg.leg: leg for leg in found.legs}

    def value(self, key):
        """Return a value of the diagnostics published after this call."""
        self.diagnostics = None
        status = wait_for(lambda: self.diagnostics)
        return {v.key: v.value for v in status.values}.get(key, "")

    def dropped(self):
        """Return how many joint states the node has left out, or heard to be lost."""
        return int(self.value("dropped: joint_states") or 0)


def numbers_of(vector):
    """Return a point or vector of geometry_msgs as numbers."""
    return [vector.x, vector.y, vector.z]


RIGHT_REAR = [f"right_rear_crank_{k}" for k in (1, 2, 3)]
LEFT_FRONT = [f"left_front_crank_{k}" for k in (1, 2, 3)]
JOINTS = [0.1, -0.05, 0.08]


@pytest.fixture(scope="module")
def stream(suite):
    return Stream(suite.client.node)


def test_all_values_equal_the_library(stream, hexapod):
    leg = hexapod.legs["left_front"]
    rates, efforts = [0.3, -0.2, 0.1], [75.0, -30.0, 0.0]
    state = stream.ask(LEFT_FRONT, JOINTS, rates, efforts)["left_front"]
    posture = leg.mechanism.forward(JOINTS)
    jacobian = leg.mechanism.jacobian(posture)
    lower, upper = leg.effort_limits.T
    same = {"rtol": 1e-12, "atol": 1e-12}
    mount = leg.mount
    foot = mount.to_base(posture.foot_position)
    np.testing.assert_allclose(numbers_of(state.foot_position), foot, **same)
    velocity = mount.vectors_to_base(jacobian @ rates)
    np.testing.assert_allclose(numbers_of(state.foot_velocity), velocity, **same)
    force = mount.vectors_to_base(np.linalg.solve(jacobian.T, np.negative(efforts)))
    np.testing.assert_allclose(numbers_of(state.ground_force), force, rtol=1e-9)
    assert state.contact == (LegState.ON_THE_GROUND if force[2] >= 10.0 else LegState.IN_THE_AIR)
    np.testing.assert_allclose(state.condition_number, condition_number(jacobian), **same)
    np.testing.assert_allclose(state.rated_friction, rated_friction(jacobian), **same)
    np.testing.assert_allclose(state.rated_friction_full, rated_friction_full(jacobian), **same)
    wanted = load_capacity(jacobian, lower, upper, 0.4).capacity
    np.testing.assert_allclose(state.load_capacity, wanted, **same)
    assert state.utilisation == 0.5
    assert state.status == PointStatus.OK
    assert list(state.joint_positions) == JOINTS


def test_without_velocity_and_effort_their_values_are_unknown(stream):
    state = stream.ask(LEFT_FRONT, JOINTS)["left_front"]
    assert np.isnan(numbers_of(state.foot_velocity)).all()
    assert np.isnan(numbers_of(state.ground_force)).all()
    assert state.contact == LegState.CONTACT_UNKNOWN
    assert math.isnan(state.utilisation)
    assert state.load_capacity > 0.0


def test_all_legs_come_in_the_order_of_the_description(stream, hexapod):
    names = [joint for leg in reversed(hexapod.legs.values()) for joint in leg.joint_names]
    positions = np.random.default_rng(3).uniform(-0.1, 0.1, len(names))
    states = stream.ask(names, positions)
    assert list(states) == list(hexapod.legs)
    for name, leg in hexapod.legs.items():
        joints = [positions[names.index(joint)] for joint in leg.joint_names]
        foot = leg.mount.to_base(leg.mechanism.forward(joints).foot_position)
        np.testing.assert_allclose(numbers_of(states[name].foot_position), foot, atol=1e-12)


def test_the_header_has_the_stamp_of_the_joint_states_and_the_base_frame(stream, hexapod):
    stream.ask(LEFT_FRONT)
    message = list(stream.states.values())[-1]
    assert message.header.frame_id == hexapod.base_frame


def test_joints_are_found_by_name_in_any_order(stream):
    state = stream.ask(LEFT_FRONT[::-1], JOINTS[::-1])["left_front"]
    assert list(state.joint_positions) == JOINTS


def test_other_joints_are_ignored(stream):
    names = ["arm_1", LEFT_FRONT[0], "wheel", *LEFT_FRONT[1:], "gripper"]
    states = stream.ask(names, [9.0, JOINTS[0], math.nan, *JOINTS[1:], math.inf])
    assert list(states) == ["left_front"]
    assert list(states["left_front"].joint_positions) == JOINTS


def test_a_message_of_another_robot_gives_nothing(stream):
    assert stream.ask(["arm_1", "arm_2"], [0.0, 1.0]) is None
    assert stream.ask([], []) is None


def test_joint_states_of_another_robot_are_told_until_its_own_come(stream, suite):
    # a robot that is read anew has had no joint states yet
    assert set_parameter(stream.node, "statics", "robot", "hexapod").successful
    stream.send(["arm_1", "arm_2"])
    told = wait_for(lambda: stream.value("joint_states of another robot"))
    assert "name no joint of hexapod but arm_1, arm_2" in told
    assert stream.diagnostics.level == DiagnosticStatus.WARN
    assert list(stream.ask(LEFT_FRONT)) == ["left_front"]
    wait_for(lambda: not stream.value("joint_states of another robot"))


def test_one_joint_a_message_updates_its_leg(stream):
    whole = stream.ask(LEFT_FRONT, JOINTS)["left_front"]
    for joint, position in zip(LEFT_FRONT[:-1], JOINTS[:-1], strict=True):
        stream.send([joint], [position])
    state = stream.ask(LEFT_FRONT[-1:], JOINTS[-1:])["left_front"]
    assert state.foot_position == whole.foot_position
    assert state.load_capacity == whole.load_capacity


def test_a_leg_that_lacks_a_joint_is_not_updated_and_named(stream):
    names = LEFT_FRONT[:2] + RIGHT_REAR
    assert list(stream.ask(names)) == ["right_rear"]
    assert LEFT_FRONT[2] in stream.value("leg not updated: left_front")
    assert list(stream.ask(LEFT_FRONT)) == ["left_front"]
    assert stream.value("leg not updated: left_front") == ""


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_position_that_is_not_finite_is_invalid_input_for_its_leg_only(stream, bad):
    states = stream.ask([*LEFT_FRONT, *RIGHT_REAR], [bad, *[0.0] * 5])
    assert states["left_front"].status == PointStatus.INVALID_INPUT
    assert np.isnan(numbers_of(states["left_front"].foot_position)).all()
    assert math.isnan(states["left_front"].load_capacity)
    assert states["right_rear"].status == PointStatus.OK


def test_a_pose_beyond_the_joint_limits_has_a_foot_but_no_capacity(stream):
    state = stream.ask(LEFT_FRONT, [0.4, 0.4, 0.0])["left_front"]
    assert state.status == PointStatus.JOINT_LIMIT
    assert np.isfinite(numbers_of(state.foot_position)).all()
    assert math.isnan(state.load_capacity)


@pytest.mark.parametrize(
    ("names", "fields"),
    [
        ([*LEFT_FRONT, LEFT_FRONT[0]], {}),
        (["arm", "arm", *LEFT_FRONT], {}),
        (LEFT_FRONT, {"position": [0.0, 0.0]}),
        (LEFT_FRONT, {"position": []}),
        (LEFT_FRONT, {"position": [0.0] * 4}),
        (LEFT_FRONT, {"velocity": [0.0]}),
        (LEFT_FRONT, {"effort": [0.0] * 2}),
        ([], {"position": [1.0]}),
    ],
    ids=[
        *("joint twice", "other joint twice", "too few", "none", "too many"),
        *("velocity", "effort", "no names"),
    ],
)
def test_a_malformed_message_is_refused_and_counted(stream, names, fields):
    before = int(stream.value("refused: joint_states") or 0)
    assert stream.ask(names, **fields) is None
    assert int(stream.value("refused: joint_states")) == before + 1
    assert stream.value("last error").startswith("joint_states: ")


def test_a_zero_effort_limit_and_stress_are_told(stream, suite):
    suite.client.set_effort_limits("left_front", LEFT_FRONT[:1], [50.0])
    try:
        state = stream.ask(LEFT_FRONT, JOINTS, effort=[75.0, 0.0, 0.0])["left_front"]
        assert state.utilisation == 1.5
    finally:
        suite.client.set_effort_limits("left_front", LEFT_FRONT[:1], [150.0])


def test_more_friction_never_lowers_the_load_capacity(stream, suite):
    slippery = stream.ask(LEFT_FRONT, JOINTS)["left_front"].load_capacity
    node = suite.client.node
    assert set_parameter(node, "statics", "friction_coefficient", 0.9).successful
    try:
        assert stream.ask(LEFT_FRONT, JOINTS)["left_front"].load_capacity >= slippery
    finally:
        assert set_parameter(node, "statics", "friction_coefficient", 0.4).successful
    assert stream.ask(LEFT_FRONT, JOINTS)["left_front"].load_capacity == slippery


def test_loads_count_against_the_gravity_that_the_node_is_told(stream, suite, hexapod):
    node, pitched = suite.client.node, [3.0, 0.0, -9.3]
    assert not set_parameter(node, "statics", "gravity", [0.0, 0.0, 0.0]).successful
    assert set_parameter(node, "statics", "gravity", pitched).successful
    try:
        state = stream.ask(LEFT_FRONT, JOINTS)["left_front"]
    finally:
        assert set_parameter(node, "statics", "gravity", [0.0, 0.0, -9.80665]).successful
    feet = hexapod.legs["left_front"].mechanism.forward(JOINTS).foot_position
    found = suite.client.query_footholds("left_front", feet, 0.4, gravity=pitched)
    np.testing.assert_allclose(state.load_capacity, found.load_capacity, rtol=1e-6)
    level = suite.client.query_footholds("left_front", feet, 0.4)
    assert abs(found.load_capacity - level.load_capacity) > 1.0


def test_the_rate_of_states_can_be_limited(stream, suite):
    node = suite.client.node
    stream.ask(LEFT_FRONT)
    assert set_parameter(node, "statics", "state_rate_limit", 1e-4).successful
    try:
        stamps = [stream.send(LEFT_FRONT, JOINTS) for _ in range(20)]
        end = stream.send(RIGHT_REAR[::-1])  # joints in another order are another stream
        wait_for(lambda: end in stream.states)
        assert not any(stamp in stream.states for stamp in stamps)
    finally:
        assert set_parameter(node, "statics", "state_rate_limit", 0.0).successful


@pytest.mark.parametrize("pause", [0.0, 0.0025], ids=["burst", "stream"])
def test_every_message_is_answered_or_counted_as_dropped(stream, pause):
    before, lost = stream.dropped(), stream.lost
    stamps = set()
    for _ in range(500):
        stamps.add(stream.send(LEFT_FRONT, JOINTS))
        time.sleep(pause)
    stream.ask(LEFT_FRONT)  # what comes later tells what was lost
    missing = len(stamps - stream.states.keys())
    wait_for(lambda: missing <= stream.dropped() - before + stream.lost - lost)


def test_a_flood_is_left_out_counted_and_over_when_it_ends(stream, suite):
    message = JointState(name=LEFT_FRONT, position=JOINTS)
    message.header.stamp.sec = next(_stamps)
    flood = serialize_message(message)
    before = stream.dropped()
    while stream.dropped() == before:
        for _ in range(20_000):
            stream.publisher.publish(flood)
    footholds = suite.client.query_footholds("left_front", [-0.1, 0.0, -0.65], 0.4, load=100.0)
    assert footholds.load_capacity > 100.0
    assert stream.ask(LEFT_FRONT, JOINTS)["left_front"].status == PointStatus.OK
    assert suite.nodes.ended() == {}


def test_bytes_that_are_no_message_are_refused(stream):
    before = int(stream.value("refused: joint_states") or 0)
    whole = serialize_message(JointState(name=LEFT_FRONT, position=JOINTS))
    stream.publisher.publish(whole[: len(whole) // 2])
    wait_for(lambda: int(stream.value("refused: joint_states") or 0) == before + 1)
    assert "cannot be decoded" in stream.value("last error")
    assert stream.ask(LEFT_FRONT, JOINTS)["left_front"].status == PointStatus.OK


def test_stamps_that_do_not_increase_are_answered_and_counted(stream):
    before = int(stream.value("out of order inputs"))
    stamp = stream.send(LEFT_FRONT, JOINTS)
    wait_for(lambda: stamp in stream.states)
    del stream.states[stamp]
    message = JointState(name=LEFT_FRONT, position=JOINTS)
    message.header.stamp.sec = stamp
    stream.publisher.publish(message)
    wait_for(lambda: stamp in stream.states)
    assert int(stream.value("out of order: joint_states")) == before + 1


def test_diagnostics_tell_rate_latency_and_health(stream, suite):
    for _ in range(3):
        stream.ask(LEFT_FRONT)
    assert float(stream.value("worst callback latency [ms]")) >= 0.0
    assert float(stream.value("input rate [Hz]")) >= 0.0
    assert stream.value("internal faults") == "0"
    wait_for(lambda: stream.value("x") == "" and stream.diagnostics.level == DiagnosticStatus.OK)
    assert stream.diagnostics.hardware_id == "hexapod"
    assert suite.nodes.ended() == {}
