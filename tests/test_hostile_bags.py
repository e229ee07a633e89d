# SPDX-License-Identifier: Apache-2.0
"""Recordings that are made to do harm, or broken by one bit: read in bounds, and told."""

import os
import struct
import tracemalloc
from contextlib import suppress
from pathlib import Path

import pytest
from backports import zstd
from leg_msgs_py.recordings.bag_types import MOST_ELEMENTS, MOST_FIELDS
from leg_msgs_py.recordings.bag_writer import BagWriter
from leg_msgs_py.recordings.bags import Bag
from leg_msgs_py.recordings.errors import BagError
from leg_msgs_py.recordings.mcap_scan import CHANNEL, CHUNK, HEADER, MAGIC, MESSAGE, SCHEMA
from leg_msgs_py.recordings.unpacking import LARGEST, most_unpacked

MEGABYTE = 2**20
ZEROS = zstd.compress(bytes(64 * MEGABYTE))  # some kilobytes
STRING = b"\0\1\0\0\6\0\0\0hello\0"


def text(value: str | bytes) -> bytes:
    """Return a text as records hold it."""
    content = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(content)) + content


def record(opcode: int, content: bytes) -> bytes:
    """Return a record of an mcap file."""
    return struct.pack("<BQ", opcode, len(content)) + content


def chunk(packed: bytes, size: int, compression: str = "zstd") -> bytes:
    """Return a chunk that claims a size of what it unpacks to."""
    head = struct.pack("<QQQI", 0, 0, size, 0) + text(compression)
    return record(CHUNK, head + struct.pack("<Q", len(packed)) + packed)


def message(data: bytes = STRING, time: int = 1) -> bytes:
    """Return the record of a message."""
    return record(MESSAGE, struct.pack("<HIQQ", 1, 0, time, time) + data)


def mcap(*records: bytes, definition: str = "string data\n", kind: str = "std_msgs/msg/String"):
    """Return an mcap file with one topic and these records, without a summary."""
    schema = struct.pack("<H", 1) + text(kind) + text("ros2msg") + text(definition)
    channel = struct.pack("<HH", 1, 1) + text("/said") + text("cdr") + struct.pack("<I", 0)
    head = [record(HEADER, text("ros2") + text("")), record(SCHEMA, schema)]
    return b"".join([MAGIC, *head, record(CHANNEL, channel), *records])


def told(file: Path) -> tuple[int, str]:
    """Return how many messages are read from a file, and what is told of its damage."""
    tracemalloc.start()
    try:
        bag = Bag(file)
        count = sum(1 for _ in bag.messages())
        assert tracemalloc.get_traced_memory()[1] < 3 * LARGEST
    finally:
        tracemalloc.stop()
    return count, "; ".join(damage.reason for damage in bag.damages.values())


# --------------------------------------------------------------------------- bombs


def test_a_chunk_that_unpacks_to_more_than_it_claims_is_read_up_to_there(tmp_path):
    file = tmp_path / "walk.mcap"
    first = zstd.compress(message())
    for size in (1000, 2**33):
        file.write_bytes(mcap(chunk(first, len(message())), chunk(ZEROS * 100, size), message()))
        count, reason = told(file)
        assert count == 1
        assert "the chunk at byte" in reason


def test_chunks_unpack_to_so_much_in_all(tmp_path):
    file = tmp_path / "walk.mcap"
    packed = zstd.compress(message(bytes(200 * MEGABYTE)))
    bomb = chunk(packed, 200 * MEGABYTE + len(message(b"")))
    file.write_bytes(mcap(bomb, bomb, bomb))
    count, reason = told(file)
    most = most_unpacked(file.stat().st_size)
    assert count == most // (200 * MEGABYTE)
    assert "unpacks to more than" in reason


def test_a_chunk_within_a_chunk_and_holes_are_told(tmp_path):
    file = tmp_path / "walk.mcap"
    inner = chunk(zstd.compress(message()), len(message()))
    file.write_bytes(mcap(message(), chunk(zstd.compress(inner), len(inner))))
    assert told(file)[1].endswith("there is a chunk within a chunk at byte 0")
    file.write_bytes(mcap(message(), bytes(50 * MEGABYTE)))
    count, reason = told(file)
    assert count == 1
    assert "there is no record at byte" in reason


def test_a_compressed_file_is_unpacked_so_far_and_no_further(tmp_path):
    file = tmp_path / "walk.mcap.zstd"
    file.write_bytes(zstd.compress(mcap(message())) + ZEROS * 96)  # 6 GiB
    count, reason = told(file)
    assert count == 1
    assert f"the file unpacks to more than {most_unpacked(file.stat().st_size)} bytes" in reason


def test_a_compressed_message_is_unpacked_so_far_and_no_further(tmp_path):
    file = tmp_path / "walk.mcap"
    packed = zstd.compress(bytes(LARGEST + 1))
    file.write_bytes(mcap(message(zstd.compress(STRING)), message(packed)))
    count, reason = told(file)
    assert count == 1
    assert f"a message unpacks to more than {LARGEST} bytes" in reason


def test_what_shrinks_a_thousandfold_is_read_all_the_same(tmp_path):
    nothing = message(STRING[:4] + text(b" " * 20 * MEGABYTE + b"\0"))  # a map of nothing
    packed = zstd.compress(nothing)
    assert len(packed) < len(nothing) / 1000
    file = tmp_path / "walk.mcap"
    file.write_bytes(mcap(*[chunk(packed, len(nothing))] * 10, record(15, bytes(4))))
    assert told(file)[0] == 10


# --------------------------------------------------------------------------- definitions


@pytest.mark.parametrize(
    ("definition", "words"),
    [
        (
            "".join(f"float64 f{k}\n" for k in range(200_000)),
            f"200000 fields; allowed: at most {MOST_FIELDS}",
        ),
        (
            "Nothing[4000000000] x\n" + "=" * 80 + "\nMSG: some_msgs/Nothing\n",
            f"4000000000 elements of a field; allowed: at most {MOST_ELEMENTS}",
        ),
        ("# nothing\n" * 500_000, "5000000 characters of definitions"),
    ],
)
def test_a_definition_without_end_is_not_read_and_does_not_hide_the_recording(
    tmp_path, definition, words
):
    file = tmp_path / "walk.mcap"
    file.write_bytes(mcap(message(), definition=definition, kind="some_msgs/msg/Endless"))
    bag = Bag(file)
    (found,) = bag.messages()
    assert found.data == STRING
    with pytest.raises(BagError, match=words):
        bag.decode(found)


# --------------------------------------------------------------------------- no files


def test_pipes_are_refused_unread(tmp_path):
    folder = tmp_path / "walk"
    folder.mkdir()
    os.mkfifo(folder / "metadata.yaml")
    (folder / "walk_0.mcap").write_bytes(mcap(message()))
    for name in ("walk_1.mcap", "walk_2.db3", "walk_3.mcap.zstd"):
        os.mkfifo(folder / name)
    bag = Bag(folder)
    assert [m.data for m in bag.messages()] == [STRING]
    reasons = {name: damage.reason for name, damage in bag.damages.items()}
    assert all("is no regular file" in reasons[f"walk_{k}.{form}"] for k, form in
               ((1, "mcap"), (2, "db3"), (3, "mcap.zstd")))  # fmt: skip
    with pytest.raises(BagError, match="is no regular file"):
        Bag(folder / "walk_1.mcap")
    with pytest.raises(BagError, match="is no regular file"):
        Bag(folder / "walk_3.mcap.zstd")


# --------------------------------------------------------------------------- one bit


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A small recording with an index, in compressed chunks, and its messages."""
    folder = tmp_path_factory.mktemp("small") / "walk"
    with BagWriter(folder) as writer:
        writer.add_topic("/said", "std_msgs/msg/String")
        for k in range(5):
            writer.write("/said", k, STRING)
    return (folder / "walk.mcap").read_bytes()


@pytest.mark.parametrize("part", range(8))
def test_one_flipped_bit_costs_messages_and_nothing_else(tmp_path, small, part):
    file = tmp_path / "walk.mcap"
    for at in range(part, len(small), 16):
        content = bytearray(small)
        content[at] ^= 1 << (at // 16 % 8)
        file.write_bytes(content)
        try:
            bag = Bag(file)
        except BagError:
            continue
        found = list(bag.messages())
        assert len(found) <= 5
        for each in found:
            with suppress(BagError):  # and nothing else
                bag.decode(each)
