# SPDX-License-Identifier: Apache-2.0
"""Recordings of live topics: complete, standard, safe from kills and full disks."""

import re
import shutil
import signal
import subprocess
import sys
import time
from collections import namedtuple
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from leg_msgs.msg import EffortLimits, LegStates
from leg_msgs_py.client import LegClient
from leg_msgs_py.recordings import durable_bag
from leg_msgs_py.recordings.bags import Bag
from leg_msgs_py.recordings.definitions import message_class, message_definition
from leg_msgs_py.recordings.durable_bag import DurableBag
from leg_msgs_py.recordings.errors import RecorderError, UnknownTypeError
from leg_msgs_py.recordings.record import main
from leg_msgs_py.recordings.recorder import matching_qos, recorded_qos
from nodes_support import START_TIMEOUT, wait_for
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.serialization import deserialize_message, serialize_message
from recorder_support import (
    BEST_EFFORT,
    LEGS,
    RELIABLE,
    RecordProcess,
    counts,
    missing,
    numbers,
    published_by,
    report_of,
    sender,
    wait_until_recorded,
)
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from ruamel.yaml import YAML
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from stereo_msgs.msg import DisparityImage

STATES = "leg_msgs/msg/LegStates"
STRING = "std_msgs/msg/String"
TEXT = serialize_message(String(data="x" * 1000))
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


# --------------------------------------------------------------------------- the file


def test_a_recording_names_types_hashes_and_qos_as_rosbag2_does(tmp_path):
    qos = [recorded_qos(qos_profile_sensor_data), recorded_qos(LATCHED)]
    with DurableBag(tmp_path / "walk") as bag:
        bag.put(bag.add_topic("/states", STATES, qos), 5, serialize_message(LegStates()))
    with AnyReader([tmp_path / "walk"]) as reader:
        (connection,) = reader.connections
        assert connection.digest == message_definition(STATES).hash
        assert connection.digest == reader.typestore.hash_rihs01(STATES)
        assert connection.ext.offered_qos_profiles == qos
        (message,) = reader.messages()
        assert reader.deserialize(message[2], STATES).legs == []
    information = YAML(typ="safe").load(tmp_path / "walk" / "metadata.yaml")
    information = information["rosbag2_bagfile_information"]
    assert (information["version"], information["storage_identifier"]) == (9, "mcap")
    assert information["relative_file_paths"] == ["walk_0.mcap"]
    (topic,) = information["topics_with_message_count"]
    assert topic["topic_metadata"]["type_description_hash"] == connection.digest
    assert topic["topic_metadata"]["offered_qos_profiles"][0]["reliability"] == "best_effort"
    content = (tmp_path / "walk" / "walk_0.mcap").read_bytes()
    assert b"topic_type_hash" in content  # of the channel, for readers without metadata.yaml


def test_a_definition_has_the_comments_and_all_types_it_needs():
    text, digest = message_definition(STATES)
    first, *others = text.split("=" * 80)
    assert "# one per leg, in the order of the robot description" in first
    assert [part.split("\n")[1] for part in others] == [
        *("MSG: builtin_interfaces/Time", "MSG: geometry_msgs/Point", "MSG: geometry_msgs/Vector3"),
        *("MSG: leg_msgs/LegState", "MSG: std_msgs/Header"),
    ]
    assert digest.startswith("RIHS01_")


@pytest.mark.parametrize("name", ["leg_msgs/msg/Wing", "no_such_msgs/msg/Leg", "Leg", ""])
def test_an_unknown_type_is_told(name):
    for ask in (message_class, message_definition):
        with pytest.raises(UnknownTypeError, match=f"message type {name} is not installed"):
            ask(name)


def test_a_recording_without_messages_is_whole(tmp_path):
    with DurableBag(tmp_path / "nothing"):
        pass
    with AnyReader([tmp_path / "nothing"]) as reader:
        assert list(reader.messages()) == []


def test_what_exceeds_the_queue_is_dropped_and_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(durable_bag, "WRITE_PERIOD", 600.0)  # nothing is written before the end
    fitting = 100_000 // (len(TEXT) + durable_bag.MESSAGE_OVERHEAD)
    with DurableBag(tmp_path / "fast", queue_size=100_000) as bag:
        topic = bag.add_topic("/text", STRING, [])
        for k in range(500):
            bag.put(topic, k, TEXT)
    assert (topic.written, topic.dropped) == (fitting, 500 - fitting)
    assert Bag(tmp_path / "fast").counts["/text"] == fitting


def test_a_folder_that_exists_or_cannot_be_made_is_told(tmp_path):
    with pytest.raises(RecorderError, match=f"{tmp_path} exists; a recording needs a new folder"):
        DurableBag(tmp_path).__enter__()
    (tmp_path / "file").touch()
    with pytest.raises(RecorderError, match=r"cannot make .*/file/walk: Not a directory"):
        DurableBag(tmp_path / "file" / "walk").__enter__()


def test_a_disk_that_gets_full_ends_the_recording_which_is_whole(tmp_path, monkeypatch):
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(durable_bag.shutil, "disk_usage", lambda path: usage(2**20))
    bag = DurableBag(tmp_path / "walk")
    topic = bag.add_topic("/text", STRING, [])
    bag.put(topic, 1, TEXT)
    bag.__enter__()
    wait_for(lambda: bag.failure)
    bag.put(topic, 2, TEXT)
    with pytest.raises(RecorderError, match=r"is full: 1 MiB left; what was recorded is whole"):
        bag.__exit__(None, None, None)
    assert (topic.written, topic.dropped) == (1, 1)
    with AnyReader([tmp_path / "walk"]) as reader:
        assert reader.message_count == 1


WRITE_TOO_MUCH = """
import resource, sys, time
from leg_msgs_py.recordings.durable_bag import DurableBag
from leg_msgs_py.recordings.errors import RecorderError
resource.setrlimit(resource.RLIMIT_FSIZE, (3_000_000, 3_000_000))
try:
    with DurableBag(sys.argv[1]) as bag:
        topic = bag.add_topic("/text", "std_msgs/msg/String", [])
        for k in range(1, 100_000):
            bag.put(topic, k, bytes(1000))
            if bag.failure:
                break
            time.sleep(1e-4)
except RecorderError as error:
    print(topic.written + topic.dropped == k, error)
"""


def test_what_was_written_before_the_disk_failed_is_kept(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", WRITE_TOO_MUCH, tmp_path / "walk"],
        capture_output=True,
        text=True,
        timeout=START_TIMEOUT,
    )
    assert done.stderr == ""
    assert done.stdout.startswith(f"True cannot write {tmp_path / 'walk'}: File too large; all but")
    times = [message.time for message in Bag(tmp_path / "walk").messages()]
    assert len(times) > 2000
    assert times == [*range(1, len(times) + 1)]


# --------------------------------------------------------------------------- the command


def recording_legs(folder):
    return RecordProcess(folder / "walk", "--topics", "/leg_*", "/diagnostics")


def lost_by_topic(output):
    """Return how many messages of a topic the command says that the middleware lost."""
    told = re.findall(r"(/\S+) .*\n +(\d+) lost by the middleware", output)
    return {topic: int(count) for topic, count in told}


def assert_recorded_or_counted(folder, sent, published, output):
    """Check that what is not recorded is counted as lost, and nothing else.

    On a busy machine the middleware loses some; that it loses none otherwise shows `make soak`.
    """
    lost = lost_by_topic(output)
    recorded, lacking = counts(folder), missing(folder, sent)
    for topic in LEGS:
        *_, count = lacking.get(topic, (0,))
        assert count <= lost.get(topic, 0) <= published - recorded[topic], output


def test_a_recording_of_six_legs_is_whole_and_tells_its_health(tmp_path):
    folder = tmp_path / "walk"
    with recording_legs(tmp_path) as record, sender(100.0, 2.0, LEGS) as sending:
        sent = report_of(sending)["sent"]
        wait_until_recorded(record)
        wait_for(lambda: counts(folder)["/diagnostics"])
        output = record.stop()
        assert record.process.returncode == 0
        assert_recorded_or_counted(folder, sent, published_by(sending), output)
    assert "dropped:" not in output
    bag = Bag(folder)
    assert (bag.damages, bag.expected) == ({}, bag.counts.total())
    assert bag.topics[BEST_EFFORT[0]].qos[0].reliability == QosReliability.BEST_EFFORT
    assert bag.topics[RELIABLE[0]].qos[0].reliability == QosReliability.RELIABLE
    # the recorder's own diagnostics are in the recording, too
    *_, status = (
        status
        for message in bag.messages(["/diagnostics"])
        for status in deserialize_message(message.data, DiagnosticArray).status
        if status.name == "/leg_recorder: recording"
    )
    values = {value.key: value.value for value in status.values}
    assert values["dropped messages"] == "0"
    is_well = values["messages lost by the middleware"] == "0"
    assert status.level == (DiagnosticStatus.OK if is_well else DiagnosticStatus.WARN)


def test_every_message_of_1_khz_is_recorded_or_counted_as_lost(tmp_path):
    with recording_legs(tmp_path) as record, sender(1000.0, 2.0, LEGS) as sending:
        sent = report_of(sending)["sent"]
        wait_until_recorded(record)
        output = record.stop()
        assert_recorded_or_counted(tmp_path / "walk", sent, published_by(sending), output)
    assert "dropped:" not in output


def test_what_is_recorded_is_on_the_disk_in_less_than_a_second(tmp_path, monkeypatch):
    clock = SimpleNamespace(now=0.0, monotonic=lambda: clock.now)
    monkeypatch.setattr(durable_bag, "time", clock)
    with DurableBag(tmp_path / "walk") as bag:
        topic = bag.add_topic("/text", STRING, [])
        bag.put(topic, 1, TEXT)
        wait_for(lambda: topic.written == 1)
        assert not counts(tmp_path / "walk")
        clock.now += 1.0 - durable_bag.WRITE_PERIOD
        wait_for(lambda: counts(tmp_path / "walk")["/text"] == 1)


def test_a_recording_that_someone_removes_ends_with_a_line(tmp_path, monkeypatch):
    monkeypatch.setattr(durable_bag, "FLUSH_PERIOD", 0.1)
    bag = DurableBag(tmp_path / "walk").__enter__()
    bag.put(bag.add_topic("/text", STRING, []), 1, TEXT)
    shutil.rmtree(tmp_path / "walk")
    wait_for(lambda: bag.failure)
    assert bag.size == 0
    with pytest.raises(RecorderError, match="No such file or directory; nothing is kept"):
        bag.__exit__()


def test_a_kill_loses_nothing_that_is_on_the_disk(tmp_path):
    folder = tmp_path / "walk"
    with recording_legs(tmp_path) as record, sender(500.0, 2.0, LEGS[:1]) as sending:
        wait_for(lambda: counts(folder)[LEGS[0]])
        kept = list(Bag(folder).messages())
        record.stop(signal.SIGKILL)
        report_of(sending)
    bag = Bag(folder)
    assert bag.damages.keys() == {"walk_0.mcap"}
    found = list(bag.messages())
    assert found[: len(kept)] == kept
    assert [message.time for message in found] == sorted(message.time for message in found)


def test_what_the_middleware_loses_is_counted(tmp_path, node):
    folder = tmp_path / "walk"
    publisher = node.create_publisher(JointState, LEGS[0], qos_profile_sensor_data)
    message = JointState()

    def send():
        message.header.stamp.sec += 1
        publisher.publish(message)
        return message.header.stamp.sec

    def last():
        return max(numbers(folder).get(LEGS[0], [0]))

    with recording_legs(tmp_path) as record:
        wait_for(lambda: send() and last())
        record.process.send_signal(signal.SIGSTOP)
        for _ in range(10_000):  # more than is kept for a process that does not listen
            flood = send()
        record.process.send_signal(signal.SIGCONT)
        wait_for(lambda: send() and last() > flood)
        output = record.stop()
    node.destroy_publisher(publisher)
    (found,) = numbers(folder).values()
    lost = lost_by_topic(output)[LEGS[0]]
    lacking = len({*range(min(found), max(found))} - {*found})
    assert 0 < lacking <= lost <= message.header.stamp.sec - len(found)


@pytest.fixture(scope="module")
def node():
    with LegClient() as client:
        yield client.node


def test_topics_are_recorded_whenever_and_however_they_appear(tmp_path, node):
    latched = node.create_publisher(EffortLimits, "/early/effort_limits", LATCHED)
    latched.publish(EffortLimits(joint_names=["knee"]))
    with RecordProcess(tmp_path / "walk", "--topics", "/early/*", "/late") as record:
        wait_for(latched.get_subscription_count)
        late = node.create_publisher(String, "/late", qos_profile_sensor_data)
        other = node.create_publisher(String, "/later", 10)
        wait_for(late.get_subscription_count)
        while record.size() < 50_000:  # what is sent before both sides are connected is lost
            late.publish(String(data="x" * 10_000))
            time.sleep(0.01)
        assert other.get_subscription_count() == 0
        output = record.stop(signal.SIGTERM)
        assert record.process.returncode == 0
    for publisher in (latched, late, other):
        node.destroy_publisher(publisher)
    bag = Bag(tmp_path / "walk")
    assert bag.topics.keys() == {"/early/effort_limits", "/late"}
    assert bag.topics["/early/effort_limits"].qos[0].durability == QosDurability.TRANSIENT_LOCAL
    (message,) = bag.messages(["/early/effort_limits"])
    assert bag.decode(message).joint_names == ["knee"]
    assert f"1 of {bag.topics['/early/effort_limits'].type}" in output


def test_what_cannot_be_recorded_is_told(tmp_path, node):
    (tmp_path / "stereo_msgs").mkdir()
    (tmp_path / "stereo_msgs" / "__init__.py").touch()  # hides the package from the recorder
    publisher = node.create_publisher(String, "/name", 10)
    strange = node.create_publisher(DisparityImage, "/strange", 10)
    names = ("--topics", "/name", "/strange")
    with (
        RecordProcess(tmp_path / "walk", *names, PYTHONPATH=str(tmp_path)) as record,
        LegClient() as late,
    ):
        wait_for(publisher.get_subscription_count)
        late.node.create_publisher(EffortLimits, "/name", 10)
        unreliable = node.create_publisher(String, "/name", qos_profile_sensor_data)
        shown = "".join(record.process.stderr.readline() for _ in range(4))
        output = record.stop()
        assert record.process.returncode == 0
    for each in (publisher, strange, unreliable):
        node.destroy_publisher(each)
    for remark in (
        "/name: a publisher that came later offers less than the first ones",
        "/name: only its messages of std_msgs/msg/String are recorded, not of leg_msgs/msg/Effort",
        "/strange: message type stereo_msgs/msg/DisparityImage is not installed; not recorded",
    ):
        assert remark in shown
        assert remark in output


def test_a_recording_ends_after_its_duration(tmp_path):
    arguments = ("--duration", "0.2", "--topics", "/of/nobody")
    with RecordProcess(tmp_path / "walk", *arguments) as record:
        assert re.match(rf"{tmp_path / 'walk'}: 0 messages in \d+\.\d s, ", record.wait())
        assert record.process.returncode == 0
    assert (tmp_path / "walk" / "metadata.yaml").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--topics", "joint_states"], "--topics: 'joint_states' must begin with / (or with *)"),
        (["--duration", "0"], "--duration must be a number > 0, got 0"),
        (["--queue", "nan"], "--queue must be a number > 0, got nan"),
        (["--queue", "inf"], "--queue must be a number > 0, got inf"),
    ],
)
def test_wrong_arguments_are_told(arguments, message, capsys):
    assert main(arguments) == 1
    assert capsys.readouterr().err == f"record: {message}\n"


def test_a_recording_that_cannot_begin_is_told(tmp_path):
    with RecordProcess(tmp_path) as record:
        assert record.wait() == ""
        assert f"record: {tmp_path} exists; a recording needs a new folder\n" in record.errors
        assert record.process.returncode == 1


# --------------------------------------------------------------------------- quality of service


def test_the_recorder_asks_for_what_every_publisher_offers():
    reliable, latched = QoSProfile(depth=10), LATCHED
    for offered, reliability, durability in (
        ([reliable], "RELIABLE", "VOLATILE"),
        ([latched, latched], "RELIABLE", "TRANSIENT_LOCAL"),
        ([reliable, latched], "RELIABLE", "VOLATILE"),
        ([reliable, qos_profile_sensor_data], "BEST_EFFORT", "VOLATILE"),
    ):
        asked = matching_qos(offered)
        assert asked.reliability == ReliabilityPolicy[reliability]
        assert asked.durability == DurabilityPolicy[durability]
