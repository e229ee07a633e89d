# SPDX-License-Identifier: Apache-2.0
"""Recordings are read in whatever shape they come: packed, split, cut off, corrupt."""

import itertools
import shutil
import tracemalloc
from pathlib import Path

import make_golden_bags
import numpy as np
import pytest
from backports import zstd
from leg_msgs_py.recordings.bag_writer import BagWriter
from leg_msgs_py.recordings.bags import Bag
from leg_msgs_py.recordings.definitions import message_definition
from leg_msgs_py.recordings.errors import BagError
from make_golden_bags import JOINT_STATE
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from sensor_msgs.msg import JointState

BAGS = Path(__file__).parent / "bags"
TRIPOD = BAGS / "hexapod_tripod"
TROT = BAGS / "quadruped_trot"
TRIPOD_FILE = TRIPOD / "hexapod_tripod.mcap"


def rewritten(
    path,
    storage=StoragePlugin.MCAP,
    compression=CompressionMode.NONE,
    part=slice(None),
    definitions=True,
    source=TRIPOD,
):
    """Write a part of a recording in another form."""
    bag = Bag(source)
    writer = Writer(path, version=9, storage_plugin=storage)
    writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections = {
            topic.name: writer.add_connection(
                topic.name,
                topic.type,
                msgdef=topic.definition.data if definitions else "",
                rihs01=bag.types.hash_rihs01(topic.type),
                offered_qos_profiles=topic.qos,
            )
            for topic in bag.topics.values()
        }
        for message in list(bag.messages())[part]:
            writer.write(connections[message.topic], message.time, message.data)
    return path


@pytest.fixture(scope="module")
def tripod():
    return list(Bag(TRIPOD).messages())


@pytest.fixture(scope="module")
def trot():
    return list(Bag(TROT).messages())


def test_the_generator_makes_the_recordings_that_are_shipped(tmp_path):
    make_golden_bags.make_bags(tmp_path)
    for shipped in sorted(BAGS.iterdir()):
        made, kept = Bag(tmp_path / shipped.name), Bag(shipped)
        assert made.topics == kept.topics
        pairs = zip(made.messages(), kept.messages(), strict=True)
        assert all(one._replace(data=b"") == other._replace(data=b"") for one, other in pairs)
        for one, other in zip(
            made.messages(["/joint_states"]), kept.messages(["/joint_states"]), strict=True
        ):
            if one.data == other.data:
                continue
            one, other = made.decode(one), kept.decode(other)
            assert one.header == other.header
            assert one.name == other.name
            for field in ("position", "velocity", "effort"):
                np.testing.assert_allclose(
                    getattr(one, field), getattr(other, field), rtol=0.0, atol=0.05
                )


def test_the_golden_recordings_are_small():
    for bag in BAGS.iterdir():
        assert sum(file.stat().st_size for file in bag.iterdir()) < 150_000


def test_another_library_reads_the_same_from_a_golden_recording(tripod):
    with AnyReader([TRIPOD]) as reader:
        found = [(c.topic, time, data) for c, time, data in reader.messages()]
        hashes = {c.msgtype: c.digest for c in reader.connections}
    assert found == [(message.topic, message.time, message.data) for message in tripod]
    bag = Bag(TRIPOD)
    assert bag.expected == bag.counts.total() == len(tripod)
    assert (bag.start, bag.end) == (tripod[0].time, tripod[-1].time)
    for topic in bag.topics.values():
        assert bag.types.hash_rihs01(topic.type) == message_definition(topic.type).hash
    assert all(hashes[name] in ("", message_definition(name).hash) for name in hashes)


def test_only_the_topics_asked_for_are_read(tripod):
    wrenches = list(Bag(TRIPOD).messages(["/left_front/wrench"]))
    assert wrenches == [m for m in tripod if m.topic == "/left_front/wrench"]
    assert list(Bag(TRIPOD).messages(["/none"])) == []


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("compression", list(CompressionMode))
def test_all_storages_and_compressions_read_the_same(tmp_path, trot, storage, compression):
    if (storage, compression) == (StoragePlugin.SQLITE3, CompressionMode.STORAGE):
        pytest.skip("sqlite3 has no compression of its own")
    path = rewritten(tmp_path / "bag", storage, compression, source=TROT)
    for bag in (Bag(path), Bag(next(file for file in path.iterdir() if file.suffix != ".yaml"))):
        assert list(bag.messages()) == trot
        assert not bag.damages
        assert bag.topics == Bag(TROT).topics
    (path / "metadata.yaml").unlink()
    assert list(Bag(path).messages()) == trot


def test_parts_are_read_in_the_order_of_their_numbers_with_and_without_metadata(tmp_path, trot):
    whole = tmp_path / "whole"
    whole.mkdir()
    edges = np.linspace(0, len(trot), 12).astype(int)
    for k, (first, last) in enumerate(itertools.pairwise(edges)):
        part = rewritten(tmp_path / f"part_{k}", part=slice(first, last), source=TROT)
        shutil.copy(part / f"part_{k}.mcap", whole / f"walk_{k}.mcap")
    assert list(Bag(whole).messages()) == trot

    names = [f"whole/walk_{k}.mcap" for k in reversed(range(11))]
    (whole / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n"
        f"  relative_file_paths: [{', '.join(names)}]\n"
        f"  message_count: {len(trot)}\n"
    )
    bag = Bag(whole)
    assert [file.name for file in bag.files] == [f"walk_{k}.mcap" for k in reversed(range(11))]
    assert bag.expected == len(trot)

    (whole / "walk_3.mcap").unlink()
    found = list(Bag(whole).messages())
    assert len(found) == len(trot) - (edges[4] - edges[3])


def test_memory_does_not_grow_with_the_recording(tmp_path):
    def peak(path, count):
        noise = np.random.default_rng(1)
        with BagWriter(path) as writer:
            writer.add_topic("/images", "std_msgs/msg/String")
            for k in range(count):
                writer.write("/images", k, noise.bytes(50_000))
        bag = Bag(path)
        tracemalloc.start()
        assert sum(1 for _ in bag.messages()) == count
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    assert peak(tmp_path / "long", 400) < 1.2 * peak(tmp_path / "short", 80)


def test_a_definition_of_another_kind_does_not_hide_the_recording(tmp_path):
    source = Bag(TRIPOD)
    strange = f"{'=' * 80}\nACTION: leg_msgs/action/SearchGeometry\nfloat64 x\n---\n---\n"
    topic = source.topics["/joint_states"]
    topic = topic._replace(definition=topic.definition._replace(data=strange))
    with BagWriter(tmp_path / "bag") as writer:
        writer.copy_topic(topic, source.types)
        for message in source.messages(["/joint_states"]):
            writer.write(message.topic, message.time, message.data)
    bag = Bag(tmp_path / "bag")
    assert bag.topics["/joint_states"].definition.data == strange
    assert bag.types.hash_rihs01(JOINT_STATE) == message_definition(JOINT_STATE).hash
    assert all(len(bag.decode(message).name) == 18 for message in bag.messages())


def test_types_without_a_definition_are_the_installed_ones(tmp_path):
    path = rewritten(tmp_path / "bag", definitions=False)
    bag = Bag(path)
    message = next(bag.messages(["/joint_states"]))
    assert bag.decode(message).name[0] == "left_front_crank_1"
    assert bag.types.hash_rihs01(JOINT_STATE) == message_definition(JOINT_STATE).hash


# --------------------------------------------------------------------------- damage


@pytest.mark.parametrize("compression", [CompressionMode.NONE, CompressionMode.STORAGE])
@pytest.mark.parametrize("kept", [0.3, 0.6, 0.99, -1])
def test_a_file_that_is_cut_off_is_read_up_to_the_cut(tmp_path, tripod, compression, kept):
    path = rewritten(tmp_path / "bag", compression=compression)
    file = path / "bag.mcap"
    content = file.read_bytes()
    file.write_bytes(content[: round(kept * len(content)) if kept > 0 else kept])
    bag = Bag(path)
    found = list(bag.messages())
    assert found == tripod[: len(found)]
    least = {0.3: 0.2, 0.6: 0.5}.get(kept, 1.0)
    assert least * len(tripod) <= len(found)
    damage = bag.damages["bag.mcap"]
    assert damage.messages == len(found) == bag.counts.total()
    assert damage.reason
    assert bag.expected == len(tripod)


def test_a_compressed_file_that_is_cut_off_is_read_up_to_the_cut(tmp_path, tripod):
    path = rewritten(tmp_path / "bag", compression=CompressionMode.FILE)
    file = path / "bag.mcap.zstd"
    content = file.read_bytes()
    file.write_bytes(content[: len(content) * 2 // 3])
    bag = Bag(path)
    found = list(bag.messages())
    assert len(tripod) // 4 < len(found) < len(tripod)
    assert found == tripod[: len(found)]
    assert bag.damages


def test_a_database_that_is_cut_off_is_read_up_to_the_cut(tmp_path, tripod):
    path = rewritten(tmp_path / "bag", StoragePlugin.SQLITE3)
    file = path / "bag.db3"
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])
    bag = Bag(path)
    found = list(bag.messages())
    assert len(tripod) // 4 < len(found) < len(tripod)
    assert found == tripod[: len(found)]
    assert bag.damages["bag.db3"].messages == len(found)


def test_a_corrupt_chunk_ends_a_file_but_not_the_recording(tmp_path, tripod):
    folder = tmp_path / "walk"
    folder.mkdir()
    content = bytearray(TRIPOD_FILE.read_bytes())
    middle = len(content) // 4
    content[middle : middle + 2000] = b"\xff" * 2000
    (folder / "walk_0.mcap").write_bytes(content)
    shutil.copy(TRIPOD_FILE, folder / "walk_1.mcap")
    bag = Bag(folder)
    found = list(bag.messages())
    assert found[-len(tripod) :] == tripod
    assert list(bag.damages) == ["walk_0.mcap"]


def test_a_file_without_its_index_is_read_in_full(tmp_path, tripod):
    file = tmp_path / "walk.mcap"
    content = TRIPOD_FILE.read_bytes()
    file.write_bytes(content[:-37])  # the footer, which tells where the index is
    bag = Bag(file)
    assert list(bag.messages()) == tripod


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("walk.mcap", b"", "empty"),
        ("walk.mcap", b"no recording", "magic"),
        ("walk.db3", b"no recording" * 100, "magic"),
        ("walk.db3", b"SQLite format 3\0" * 100, "database"),
        ("walk.txt", b"no recording", "allowed: a folder, or .mcap"),
        ("walk.mcap", b"\x89MCAP0\r\n", "without a footer"),
        ("walk.mcap.zstd", zstd.compress(b"no recording"), "magic"),
        ("walk.mcap.zstd", b"no recording", "empty"),
    ],
)
def test_what_is_no_recording_is_told_in_one_line(tmp_path, name, content, told):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(BagError) as caught:
        Bag(file)
    message = str(caught.value)
    assert told in message
    assert name in message
    assert "\n" not in message


def test_a_folder_without_recording_and_a_missing_one_are_told(tmp_path):
    with pytest.raises(BagError, match="it has no file"):
        Bag(tmp_path)
    with pytest.raises(BagError, match="does not exist"):
        Bag(tmp_path / "missing")


@pytest.mark.parametrize("filled", list(itertools.product([0, 1, 3], repeat=4)))
def test_messages_are_decoded_as_ros_serialises_them(tmp_path, filled):
    names, *numbers = filled
    message = JointState(name=["joint"] * names)
    fields = ("position", "velocity", "effort")
    for field, count in zip(fields, numbers, strict=True):
        setattr(message, field, [1.0] * count)
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/joint_states", JOINT_STATE)
        writer.write("/joint_states", 1, serialize_message(message))
    bag = Bag(tmp_path / "bag")
    (found,) = map(bag.decode, bag.messages())
    assert found.name == message.name
    for field, count in zip(fields, numbers, strict=True):
        np.testing.assert_array_equal(getattr(found, field), [1.0] * count)


def test_garbage_in_a_message_is_told_and_the_next_one_is_read():
    bag = Bag(BAGS / "hexapod_faults")
    messages = list(bag.messages(["/joint_states"]))
    lengths = [len(message.data) for message in messages]
    garbled = messages.pop(int(np.argmin(lengths)))
    with pytest.raises(BagError, match="/joint_states: no sensor_msgs/msg/JointState"):
        bag.decode(garbled)
    assert all(bag.decode(message).header.stamp.sec for message in messages)


def test_a_writer_never_overwrites(tmp_path):
    (tmp_path / "bag").mkdir()
    with pytest.raises(BagError, match="exists already"):
        BagWriter(tmp_path / "bag")
