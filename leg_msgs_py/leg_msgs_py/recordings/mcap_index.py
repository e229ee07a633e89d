# SPDX-License-Identifier: Apache-2.0
"""Read an MCAP file by its index, which tells what is in it and where."""

from __future__ import annotations

import heapq
import itertools
import os
import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from leg_msgs_py.recordings.errors import McapDamageError
from leg_msgs_py.recordings.mcap_scan import (
    CHANNEL,
    CHUNK,
    FOOTER,
    HEADER,
    MAGIC,
    SCHEMA,
    Channel,
    Fields,
    McapScan,
    record_head,
)
from leg_msgs_py.recordings.unpacking import LARGEST

CHUNK_INDEX, STATISTICS, SUMMARY_OFFSET = 8, 11, 14
FOOTER_SIZE = 9 + 20 + len(MAGIC)


class _Chunk(NamedTuple):
    """A chunk: time of its first message [ns], where it begins, and the channels in it, if told."""

    first: int
    start: int
    channels: Collection[int]


class McapIndex:
    """An MCAP file with a summary at its end.

    Args:
        path: The file.

    Attributes:
        counts: Number of messages by the number of their topic.
        span: Times of the first and of the last message [ns]; empty if there is none.

    Raises:
        McapDamageError: If the file has no summary, or not a whole one.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._scan = McapScan(path)
        self._chunks: list[_Chunk] = []
        self.counts: dict[int, int] = {}
        self.span: tuple[int, ...] = ()
        with path.open("rb") as stream:
            try:
                self._read_header(stream)
                self._read_summary(stream)
            except (struct.error, UnicodeDecodeError) as error:
                raise McapDamageError(f"the summary is garbled: {error}") from None

    @property
    def profile(self) -> str:
        """What the file says that it holds."""
        return self._scan.profile

    @property
    def channels(self) -> dict[int, Channel]:
        """All its topics by their number."""
        return self._scan.channels

    def messages(self, chosen: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield channel number, log time [ns] and data of messages in the order of their times.

        Args:
            chosen: Numbers of their topics.

        Raises:
            McapDamageError: Where the file is damaged, after the messages before that.
        """
        if not self._chunks:
            yield from (m for m in McapScan(self._path).messages() if m[0] in chosen)
            return
        scan = McapScan(self._path)  # which counts what it unpacks
        held: list[tuple[int, int, tuple[int, int, bytes]]] = []
        order, size, fault = itertools.count(), 0, None
        with self._path.open("rb") as stream:
            for chunk in sorted(self._chunks):
                while held and held[0][0] < chunk.first:
                    message = heapq.heappop(held)[2]
                    size -= len(message[2])
                    yield message
                if chunk.channels and not any(number in chosen for number in chunk.channels):
                    continue
                try:
                    for message in _messages(scan, stream, chunk.start):
                        if message[0] in chosen:
                            heapq.heappush(held, (message[1], next(order), message))
                            size += len(message[2])
                    if size > LARGEST:
                        raise McapDamageError(
                            f"{size} bytes in chunks of the same time; allowed: {LARGEST}"
                        )
                except McapDamageError as error:
                    fault = error
                    break
        while held:
            yield heapq.heappop(held)[2]
        if fault:
            raise fault

    def _read_header(self, stream: BinaryIO) -> None:
        if stream.read(len(MAGIC)) != MAGIC:
            raise McapDamageError("it does not begin like an MCAP file")
        opcode, content = _record(stream)
        if opcode != HEADER:
            raise McapDamageError("it has no header")
        list(self._scan.note(opcode, content, len(MAGIC)))

    def _read_summary(self, stream: BinaryIO) -> None:
        size = os.fstat(stream.fileno()).st_size
        end = size - FOOTER_SIZE
        stream.seek(max(0, end))
        opcode, content = _record(stream)
        if opcode != FOOTER or stream.read() != MAGIC:
            raise McapDamageError(f"the file ends at byte {size} without a footer")
        stream.seek(Fields(content).number("<Q") or end)
        chunks = -1
        while (start := stream.tell()) < end:
            opcode, content = _record(stream)
            fields = Fields(content)
            if opcode in (SCHEMA, CHANNEL):
                list(self._scan.note(opcode, content, start))
            elif opcode == CHUNK_INDEX:
                first, _ = fields.number("<Q"), fields.number("<Q")
                place, _ = fields.number("<Q"), fields.number("<Q")
                self._chunks.append(_Chunk(first, place, tuple(fields.counts())))
            elif opcode == STATISTICS:
                count = fields.number("<Q")
                fields.skip(2 + 4 + 4 + 4)
                chunks = fields.number("<I")
                span = fields.number("<Q"), fields.number("<Q")
                self.span, self.counts = span if count else (), fields.counts()
        if chunks != len(self._chunks) or not set(self.counts) <= set(self.channels):
            raise McapDamageError("it has no whole summary")


def _record(stream: BinaryIO) -> tuple[int, bytes]:
    """Return opcode and content of the record that begins here."""
    start = stream.tell()
    opcode, size = record_head(stream)
    if size > LARGEST:
        raise McapDamageError(f"a record at byte {start} claims {size} bytes")
    content = stream.read(size)
    if len(content) < size:
        raise McapDamageError(f"the record at byte {start} is cut off")
    return opcode, content


def _messages(scan: McapScan, stream: BinaryIO, start: int) -> Iterator[tuple[int, int, bytes]]:
    """Yield the messages of the chunk that begins at a byte."""
    stream.seek(start)
    opcode, content = _record(stream)
    if opcode != CHUNK:
        raise McapDamageError(f"there is no chunk at byte {start}")
    yield from scan.chunk(content, start)
