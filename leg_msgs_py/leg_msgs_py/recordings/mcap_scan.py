# SPDX-License-Identifier: Apache-2.0
"""Read an MCAP file from the front, without its index, as far as it is sound.

A recorder that was killed, a full disk or a bad copy leave a file without its end, which readers
that go by the index refuse. What stands before the damage is whole all the same, even in the chunk
that is torn: decompressors give what they have. The format is described at mcap.dev/spec.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from leg_msgs_py.recordings.errors import McapDamageError
from leg_msgs_py.recordings.unpacking import LARGEST, most_unpacked, unpack

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 1, 2, 3, 4, 5, 6, 15
NEEDED = {HEADER, SCHEMA, CHANNEL, MESSAGE, CHUNK}  # the others are skipped unread
NO_RECORD = 0  # no opcode, but what a hole in a file is read as


class Channel(NamedTuple):
    """A topic in an MCAP file.

    Attributes:
        topic: Its name.
        type: Type of its messages, such as "sensor_msgs/msg/JointState".
        encoding: How the type is defined, such as "ros2msg".
        definition: The definition.
        qos: Offered quality of service as YAML; "" if it was not recorded.
    """

    topic: str
    type: str
    encoding: str
    definition: str
    qos: str


class McapScan:
    """One pass through an MCAP file.

    Args:
        path: The file.

    Attributes:
        profile: What the file says that it holds, "ros2" for a recording of ROS 2.
        channels: Topics met so far, by their number.
    """

    def __init__(self, path: Path) -> None:
        self.profile = ""
        self.channels: dict[int, Channel] = {}
        self._path = path
        self._room = most_unpacked(path.stat().st_size)  # for what chunks have yet to unpack
        self._schemas: dict[int, tuple[str, str, str]] = {}

    def messages(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield channel number, log time [ns] and data of every message before the damage.

        Raises:
            McapDamageError: Where the damage begins; not if the file is whole.
        """
        with self._path.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise McapDamageError("it does not begin like an MCAP file")
            size = os.fstat(stream.fileno()).st_size
            whole = yield from self._messages(stream, size)
            if not whole:
                raise McapDamageError(f"the file ends at byte {size} without a footer")

    def _messages(
        self, stream: BinaryIO, end: int
    ) -> Generator[tuple[int, int, bytes], None, bool]:
        """Yield the messages of a file or of a chunk; return whether it has the mark of its end."""
        while (start := stream.tell()) < end:
            opcode, size = record_head(stream)
            left = end - stream.tell()
            if opcode in (DATA_END, FOOTER):
                return True
            if opcode == NO_RECORD:
                raise McapDamageError(f"there is no record at byte {start}")
            if opcode not in NEEDED:
                stream.seek(min(size, left), io.SEEK_CUR)
            elif size > LARGEST:
                raise McapDamageError(f"a record at byte {start} claims {size} bytes")
            elif opcode == CHUNK:
                if isinstance(stream, io.BytesIO):
                    raise McapDamageError(f"there is a chunk within a chunk at byte {start}")
                yield from self.chunk(stream.read(min(size, left)), start)
            elif size <= left:
                yield from self.note(opcode, stream.read(size), start)
            if size > left:
                raise McapDamageError(f"the record at byte {start} is cut off")
        return False

    def chunk(self, chunk: bytes, start: int) -> Iterator[tuple[int, int, bytes]]:
        """Yield the messages of a chunk before its damage, as `messages` does.

        Args:
            chunk: The record of the chunk.
            start: Where in the file it begins, for what is told.

        Raises:
            McapDamageError: Where the damage begins.
        """
        content, fault = _unpacked(chunk, min(self._room, LARGEST))
        self._room -= len(content)
        try:
            yield from self._messages(io.BytesIO(content), len(content))
        except McapDamageError as error:
            fault = fault or f"is garbled: {error}"
        if fault:
            raise McapDamageError(f"the chunk at byte {start} {fault}")

    def note(self, opcode: int, content: bytes, start: int) -> Iterator[tuple[int, int, bytes]]:
        """Take up a record; yield it if it is a message."""
        try:
            if opcode == MESSAGE:
                channel, _, log_time, _ = struct.unpack_from("<HIQQ", content)
                yield channel, log_time, content[22:]
            elif opcode == HEADER:
                self.profile = Fields(content).text()
            elif opcode == SCHEMA:
                fields = Fields(content)
                number = fields.number("<H")
                self._schemas[number] = (fields.text(), fields.text(), fields.text())
            elif opcode == CHANNEL:
                fields = Fields(content)
                number, schema = fields.number("<H"), fields.number("<H")
                topic, _ = fields.text(), fields.text()
                qos = fields.mapping().get("offered_qos_profiles", "")
                unknown = ("", "", "")
                self.channels[number] = Channel(topic, *self._schemas.get(schema, unknown), qos)
        except (struct.error, UnicodeDecodeError) as error:
            raise McapDamageError(f"the record at byte {start} is garbled: {error}") from None


def record_head(stream: BinaryIO) -> tuple[int, int]:
    """Return opcode and size of the record that begins here."""
    start = stream.tell()
    head = stream.read(9)
    if len(head) < 9:
        raise McapDamageError(f"the record at byte {start} is cut off")
    opcode, size = struct.unpack("<BQ", head)
    return opcode, size


def _unpacked(chunk: bytes, most: int) -> tuple[bytes, str]:
    """Return the records of a chunk, as far as they can be had, and what is wrong with it."""
    fields = Fields(chunk)
    try:
        fields.skip(16)
        size, checksum = fields.number("<Q"), fields.number("<I")
        compression = fields.text()
        packed_size = fields.number("<Q")
    except (struct.error, UnicodeDecodeError):
        return b"", "is cut off"
    packed = fields.rest()[:packed_size]
    content, fault = unpack(packed, compression, min(size, most))
    if fault:
        return content, fault
    if len(packed) < packed_size or len(content) < size:
        return content, "is cut off"
    if checksum and zlib.crc32(content) != checksum:
        return b"", "does not match its checksum"
    return content, ""


class Fields:
    """The fields of a record, one after the other; a `struct.error` says that one is cut off."""

    def __init__(self, content: bytes) -> None:
        self._content, self._position = content, 0

    def skip(self, size: int) -> None:
        """Leave bytes out."""
        self._position += size

    def number(self, form: str) -> int:
        """Return a number, by its form of `struct`."""
        value: int = struct.unpack_from(form, self._content, self._position)[0]
        self._position += struct.calcsize(form)
        return value

    def text(self) -> str:
        """Return a text."""
        size = self.number("<I")
        start, self._position = self._position, self._position + size
        if self._position > len(self._content):
            raise struct.error("a text is longer than the record")
        return self._content[start : self._position].decode()

    def counts(self) -> dict[int, int]:
        """Return a mapping of channels to numbers."""
        size = self.number("<I")
        end = self._position + size
        pairs = {}
        while self._position < end:
            key = self.number("<H")
            pairs[key] = self.number("<Q")
        return pairs

    def mapping(self) -> dict[str, str]:
        """Return a mapping of texts."""
        size = self.number("<I")
        end = self._position + size
        pairs = {}
        while self._position < end:
            key = self.text()
            pairs[key] = self.text()
        return pairs

    def rest(self) -> bytes:
        """Return what follows."""
        return self._content[self._position :]
