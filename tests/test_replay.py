# SPDX-License-Identifier: Apache-2.0
"""Recordings played into live nodes give what the library gives; the kit tells what differs."""

import math
import threading
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3
from leg_msgs.msg import LegState, LegStates
from leg_msgs_py.arrays import to_field
from leg_msgs_py.recordings import replay_flow as player
from leg_msgs_py.recordings.bag_writer import BagWriter, offered_qos
from leg_msgs_py.recordings.bags import Bag
from leg_msgs_py.recordings.comparison import Tolerance, assert_same, differences, report
from leg_msgs_py.recordings.errors import ReplayError
from leg_msgs_py.recordings.recorder import spin
from leg_msgs_py.recordings.replay import Replay, read_messages
from make_golden_bags import FAULTS, GARBLED
from node_processes import NodeProcesses
from nodes_support import PATIENCE, START_TIMEOUT, wait_for
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from leg_kinematics import Status, load_robot
from leg_statics.capacity.problem import load_capacity
from leg_statics.efforts import utilisation
from leg_statics.indices import evaluate_indices, supported_indices
from leg_statics.joint_stream import JointStateError, JointStream
from leg_statics.recordings.bag_judge import BagJudge, Topics
from leg_statics.recordings.judged_bag import JudgedBag
from leg_statics.weight import LEVEL_GRAVITY

pytest_plugins = ["leg_msgs_py.recordings.pytest_replay"]

BAGS = Path(__file__).parent / "bags"
FRICTION = 0.4  # the default of the statics node
STATES = "/statics/leg_states"
REFUSED = ("repeated name", "too few positions", "no names", "another robot")
SAME = {"*": Tolerance(absolute=1e-12, relative=1e-12)}


# --------------------------------------------------------------------------- the same numbers


def judged_offline(path, robot, folder):
    """Return the leg states that the offline judge finds in a recording."""
    bag = Bag(path)
    judge = BagJudge(bag, robot, FRICTION, Topics())
    with JudgedBag(folder, bag, robot, STATES) as copy:
        for message in bag.messages(["/joint_states"]):
            judge.take(message)
        copy.add(judge.judge())
    return read_messages(folder, [STATES])


def point(numbers):
    return Point(**dict(zip("xyz", map(float, numbers), strict=True)))


def vector(numbers):
    return Vector3(**dict(zip("xyz", map(float, numbers), strict=True)))


def contact_of(force):
    """Return the contact that a force in a level leg frame tells."""
    return LegState.ON_THE_GROUND if force[2] >= 10.0 else LegState.IN_THE_AIR


def states_by_elementary_calls(robot, messages):
    """Return the leg states of a walk, leg by leg from the functions of the library."""
    states = [
        LegStates(
            header=Header(stamp=m.header.stamp, frame_id=robot.base_frame),
            gravity=vector(LEVEL_GRAVITY),
        )
        for m in messages
    ]
    for leg in robot.legs.values():
        columns = [messages[0].name.index(joint) for joint in leg.joint_names]
        q, rates, efforts = (
            np.array([getattr(message, field) for message in messages])[:, columns]
            for field in ("position", "velocity", "effort")
        )
        mechanism, limits = leg.mechanism, leg.effort_limits
        posture = mechanism.forward(q)
        assert (posture.status == Status.OK).all()
        jacobian = mechanism.jacobian(posture)
        indices = {
            name: evaluate_indices(mechanism, posture, [name])[1][:, 0]
            for name in supported_indices(mechanism)
        }
        capacity = load_capacity(jacobian, limits[:, 0], limits[:, 1], FRICTION).capacity
        used, _ = utilisation(efforts, limits)
        forces = np.linalg.solve(np.swapaxes(jacobian, -1, -2), -efforts[..., None])[..., 0]
        mount = leg.mount
        for k, message in enumerate(states):
            message.legs.append(
                LegState(
                    leg=leg.name,
                    joint_positions=to_field(q[k]),
                    foot_position=point(mount.to_base(posture.foot_position[k])),
                    foot_velocity=vector(mount.vectors_to_base(jacobian[k] @ rates[k])),
                    ground_force=vector(mount.vectors_to_base(forces[k])),
                    contact=contact_of(forces[k]),
                    condition_number=float(indices["condition_number"][k]),
                    load_capacity=float(capacity[k]),
                    rated_friction=float(indices["rated_friction"][k]),
                    rated_friction_full=float(indices["rated_friction_full"][k]),
                    utilisation=float(used[k]),
                )
            )
    return states


def test_a_hexapod_in_tripod_gait_is_judged_the_same_live_offline_and_directly(
    replay, suite, hexapod, tmp_path
):
    joints = read_messages(BAGS / "hexapod_tripod", ["/joint_states"])["/joint_states"]
    live = replay.play(BAGS / "hexapod_tripod", rate=math.inf, patience=PATIENCE)
    assert_same(live, {STATES: states_by_elementary_calls(hexapod, joints)}, SAME)
    assert_same(live, judged_offline(BAGS / "hexapod_tripod", hexapod, tmp_path / "judged"))


def test_a_trotting_quadruped_is_judged_the_same_live_offline_and_directly(tmp_path):
    quadruped = load_robot("quadruped")
    joints = read_messages(BAGS / "quadruped_trot", ["/joint_states"])["/joint_states"]
    with NodeProcesses("quadruped", names=["statics"], namespace="trot"), Replay("trot") as replay:
        live = replay.play(
            BAGS / "quadruped_trot", rate=math.inf, timeout=START_TIMEOUT, patience=PATIENCE
        )
    assert_same(live, {STATES: states_by_elementary_calls(quadruped, joints)}, SAME)
    assert_same(live, judged_offline(BAGS / "quadruped_trot", quadruped, tmp_path / "judged"))


def test_faults_are_judged_the_same_live_offline_and_directly_and_stop_nothing(
    replay, suite, hexapod, tmp_path
):
    stream = JointStream(hexapod, FRICTION)
    bag, expected, refused = Bag(BAGS / "hexapod_faults"), [], 0
    for k, message in enumerate(bag.messages(["/joint_states"])):
        if k == GARBLED:
            continue
        joints = bag.decode(message)
        try:
            states = stream.read(
                tuple(joints.name), joints.position, joints.velocity, joints.effort
            )
        except JointStateError:
            refused += 1
            continue
        if states.legs:
            expected.append(message_of(joints.header.stamp, hexapod, states))
    assert refused + bag.counts["/joint_states"] - len(expected) > len(FAULTS)
    live = replay.play(BAGS / "hexapod_faults", rate=math.inf)
    assert_same(live, {STATES: expected})
    assert_same(live, judged_offline(BAGS / "hexapod_faults", hexapod, tmp_path / "judged"))
    assert suite.nodes.ended() == {}


def message_of(stamp, robot, states):
    """Return the message of leg states."""
    fields = zip(*states[1:], strict=True)
    stamp = Time(sec=stamp.sec, nanosec=stamp.nanosec)
    return LegStates(
        header=Header(stamp=stamp, frame_id=robot.base_frame),
        gravity=vector(LEVEL_GRAVITY),
        legs=[
            LegState(
                leg=leg,
                joint_positions=to_field(joints),
                status=int(status),
                foot_position=point(robot.legs[leg].mount.to_base(foot)),
                foot_velocity=vector(robot.legs[leg].mount.vectors_to_base(velocity)),
                ground_force=vector(robot.legs[leg].mount.vectors_to_base(force)),
                contact=int(contact),
                condition_number=float(condition),
                load_capacity=float(capacity),
                rated_friction=float(mu),
                rated_friction_full=float(mu_full),
                utilisation=float(used),
            )
            for leg, row in zip(states.legs, fields, strict=True)
            for joints, status, foot, velocity, force, contact, *numbers in [row]
            for condition, capacity, mu, mu_full, used in [numbers]
        ],
    )


# --------------------------------------------------------------------------- player


class Echo(Node):
    """Publishes what it receives, and notes it, also what it receives of /clock."""

    def __init__(self, context, **options):
        super().__init__("echo", context=context, **options)
        self.received, self.clock, self.ended = [], [], threading.Event()
        self.thread = threading.Thread(target=spin, args=(self, self.ended.is_set))
        output = self.create_publisher(JointState, "/echo", 1000)

        def receive(data):
            self.received.append(data)
            output.publish(data)

        self.create_subscription(
            JointState, "/walk/joint_states", receive, qos_profile_sensor_data, raw=True
        )
        self.create_subscription(Clock, "/clock", self.tick, 1000)
        self.thread.start()

    def tick(self, message):
        self.clock.append(10**9 * message.clock.sec + message.clock.nanosec)

    def close(self):
        self.ended.set()
        self.thread.join()
        self.destroy_node()


@contextmanager
def echoing(**options):
    """Run an echo in a thread."""
    context = Context()
    rclpy.init(context=context)
    echo = Echo(context, **options)
    try:
        yield echo
    finally:
        echo.close()
        context.try_shutdown()


def write_walk(path, count=50, period=0.02, topic="/walk/joint_states"):
    """Record joint states with the numbers 1 to count as stamps."""
    with BagWriter(path) as bag:
        bag.add_topic(topic, "sensor_msgs/msg/JointState", offered_qos(5, reliable=False))
        for k in range(1, count + 1):
            message = JointState(name=["knee"], position=[float(k)])
            message.header.stamp.sec = k
            bag.write(topic, 10**18 + round(1e9 * period * k), serialize_message(message))
    return path


def test_a_node_gets_every_message_byte_for_byte_and_in_order(replay, tmp_path):
    path = write_walk(tmp_path / "walk", count=500)
    with echoing() as echo:
        outputs = replay.play(
            path, ["/walk/joint_states"], ["/echo"], rate=math.inf, patience=PATIENCE
        )
    assert echo.received == [m.data for m in Bag(path).messages()]
    assert [message.header.stamp.sec for message in outputs["/echo"]] == [*range(1, 501)]


def test_a_node_without_parameters_is_played_to_as_well(replay, tmp_path):
    path = write_walk(tmp_path / "walk")
    with echoing(start_parameter_services=False):
        outputs = replay.play(path, ["/walk/joint_states"], ["/echo"], rate=10.0, patience=PATIENCE)
    assert outputs["/echo"][-1].header.stamp.sec == 50


def test_messages_are_due_when_they_were_recorded_divided_by_the_rate(monkeypatch):
    clock = SimpleNamespace(now=1000.0, monotonic=lambda: clock.now)
    clock.sleep = lambda pause: setattr(clock, "now", clock.now + pause)
    monkeypatch.setattr(player, "time", clock)
    pace = player.Pace(10.0)
    for second in (0, 1, 3):
        pace.wait_until(10**18 + second * 10**9)
        assert clock.now == pytest.approx(1000.0 + second / 10.0)
    clock.now += 5.0  # late: the next one is due at once
    pace.wait_until(10**18 + 4 * 10**9)
    assert clock.now == pytest.approx(1005.3)


def test_a_recording_sets_the_clock(replay, tmp_path):
    path = write_walk(tmp_path / "walk", count=21, period=0.1)
    with echoing() as echo:
        replay.play(
            path, ["/walk/joint_states"], ["/echo"], rate=10.0, clock=True, patience=PATIENCE
        )
        wait_for(lambda: echo.clock[-1] == 10**18 + 21 * 10**8)
    assert echo.clock[0] == 10**18 + 10**8
    steps = np.diff(echo.clock)
    assert 0 < steps.min() <= steps.max() <= 10_000_000


def test_a_node_that_ends_meanwhile_is_told(replay, tmp_path):
    path = write_walk(tmp_path / "walk", count=5000, period=1.0)
    with echoing() as echo:
        end = threading.Thread(target=lambda: (wait_for(lambda: echo.received), echo.close()))
        end.start()
        with pytest.raises(ReplayError, match=r"/echo: its node ended after \d+ messages"):
            replay.play(path, ["/walk/joint_states"], ["/echo"], rate=5.0)
        end.join()


def test_a_missing_topic_is_told_with_those_there_are(replay):
    with pytest.raises(ReplayError, match=r"no topic '/imu'; it has .*/joint_states"):
        replay.play(BAGS / "hexapod_tripod", ["/imu"])
    with pytest.raises(ReplayError, match="rate must be > 0, got 0"):
        replay.play(BAGS / "hexapod_tripod", rate=0)


def test_missing_nodes_are_told(replay, tmp_path):
    with pytest.raises(ReplayError, match="nobody publishes /nothing"):
        replay.play(BAGS / "hexapod_tripod", collect=["/nothing"], timeout=0.1)
    path = write_walk(tmp_path / "walk", topic="/of/nobody")
    with pytest.raises(ReplayError, match="nobody subscribes to /of/nobody"):
        replay.play(path, ["/of/nobody"], [], timeout=0.1)


def test_a_recording_with_another_definition_of_a_type_is_refused(replay, tmp_path):
    with Writer(tmp_path / "old", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        text = "string data\nint32 years"
        types = get_typestore(Stores.EMPTY)
        types.register(get_types_from_msg(text, "std_msgs/msg/String"))
        topic = writer.add_connection("/name", "std_msgs/msg/String", typestore=types)
        writer.write(topic, 1, b"\0\1\0\0")
    with pytest.raises(ReplayError, match="/name: std_msgs/msg/String is recorded with another"):
        read_messages(tmp_path / "old", ["/name"])


def test_a_garbled_message_is_told():
    with pytest.raises(ReplayError, match=f"message {GARBLED} of /joint_states is no sensor_msgs"):
        read_messages(BAGS / "hexapod_faults", ["/joint_states"])


# --------------------------------------------------------------------------- comparison


def walk_states(count=4, **changes):
    """Return leg states with the numbers from 1 as stamps."""
    messages = []
    for k in range(1, count + 1):
        leg = LegState(leg="left", load_capacity=100.0 * k, rated_friction=math.nan, **changes)
        messages.append(LegStates(header=Header(stamp=Time(sec=k)), legs=[leg, leg]))
    return messages


def test_equal_messages_do_not_differ_and_nan_equals_nan():
    assert_same({STATES: walk_states(), "/other": [String()]}, {STATES: walk_states()})


def test_a_difference_tells_topic_number_field_values_and_size():
    got = walk_states()
    got[2].legs[1] = LegState(leg="left", load_capacity=300.5, rated_friction=math.nan)
    with pytest.raises(AssertionError) as caught:
        assert_same({STATES: got}, {STATES: walk_states()})
    title, head, row = str(caught.value).splitlines()
    assert title == "1 differences, in 1 of 4 messages:"
    assert head.split() == ["topic", "message", "field", "expected", "got", "difference"]
    assert row.split() == [STATES, "2", "legs[1].load_capacity", "300.0", "300.5", "0.5"]


def test_tolerances_hold_for_the_fields_they_name():
    got = walk_states(foot_position=Point(z=1e-7))
    got[3].legs[0].load_capacity = 400.3  # of both legs: they are one object
    args = {STATES: got}, {STATES: walk_states()}
    fields = {d.field for d in differences(*args)}
    assert fields == {
        *("legs[0].foot_position.z", "legs[1].foot_position.z"),
        *("legs[0].load_capacity", "legs[1].load_capacity"),
    }
    feet = {"*.foot_position.*": Tolerance(absolute=1e-6)}
    assert {d.field for d in differences(*args, feet)} == {
        *("legs[0].load_capacity", "legs[1].load_capacity")
    }
    assert differences(*args, {**feet, "legs.load_capacity": Tolerance(relative=1e-3)}) == []
    assert differences(*args, feet, ignore=["legs.load_capacity"]) == []
    assert len(differences(*args, {**feet, "*": Tolerance(relative=1e-4)})) == 2


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_no_tolerance_takes_what_is_not_finite_for_a_number(bad):
    got = walk_states()
    got[0].legs[0].load_capacity = bad
    assert differences({STATES: got}, {STATES: walk_states()}, {"*": Tolerance(1e9, 1e9)})


def test_a_missing_message_is_told_and_the_others_stay_in_step():
    got = walk_states()
    del got[1]
    (found,) = differences({STATES: got}, {STATES: walk_states()})
    assert found == (STATES, 1, "message", "stamp 2.000000000", "nothing")
    (found,) = differences({STATES: walk_states()}, {STATES: got})
    assert found == (STATES, 1, "message", "nothing", "stamp 2.000000000")
    assert [d.field for d in differences({}, {STATES: got})] == ["message"] * 3


def test_messages_out_of_order_are_told():
    got = walk_states()
    got[1], got[2] = got[2], got[1]
    (found,) = differences({STATES: got}, {STATES: walk_states()})
    assert found == (STATES, 1, "order", "before 2", "after 2")


def test_messages_without_stamps_are_matched_by_their_order():
    got, expected = ([String(data=text) for text in texts] for texts in ("abc", "abd"))
    (found,) = differences({"/name": got}, {"/name": expected})
    assert found == ("/name", 2, "data", "d", "c")


def test_arrays_of_other_lengths_differ_as_a_whole():
    got, expected = ([JointState(position=[1.0] * n)] for n in (2, 3))
    (found,) = differences({"/joint_states": got}, {"/joint_states": expected})
    assert found[2:] == ("position", "3 values", "2 values")


def test_messages_of_other_types_differ_as_a_whole():
    (found,) = differences({"/a": [JointState()]}, {"/a": [LegStates()]})
    assert found[2:] == ("message", "LegStates", "JointState")


def test_a_long_report_is_cut_and_says_so():
    got, expected = ([JointState(position=[x] * 100)] for x in (0.0, 1.0))
    lines = report(differences({"/a": got}, {"/a": expected}), 1).splitlines()
    assert lines[0] == "100 differences, in 1 of 1 messages:"
    assert lines[-1] == "... and 70 more"
    assert len(lines) == 33
