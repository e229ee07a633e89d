# SPDX-License-Identifier: Apache-2.0
"""A recording in the making: written by a thread of its own, in bounded memory, safe each second.

It needs no ROS:

    with DurableBag("walk") as bag:
        topic = bag.add_topic("/joint_states", "sensor_msgs/msg/JointState", qos=[])
        bag.put(topic, time.time_ns(), data)

What was put more than a second ago is on the disk: a process that is killed, or a power cut, loses
less than that. Such a file lacks its index; up to the last flush it is whole. (If the disk cannot
keep up, what waits in memory is lost as well; `DurableBag.waiting` tells how much that is.)
"""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import cast

from leg_msgs_py.recordings.definitions import Definition, message_definition
from leg_msgs_py.recordings.errors import RecorderError
from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.errors import WriterError
from rosbags.rosbag2.storage_mcap import Channel, McapWriter, write_channel, write_string

WRITE_PERIOD = 0.05  # what came meanwhile is written together [s]
FLUSH_PERIOD = 0.5  # half of what may be lost, so that the disk has the other half to write it [s]
QUEUE_SIZE = 128 * 2**20  # what may wait for a slow disk [B]
MESSAGE_OVERHEAD = 150  # of a waiting message in memory, beside its data [B]
LEAST_FREE = 64 * 2**20  # left on the disk, so that the index can still be written [B]


def file_of(recording: Path) -> Path:
    """Return the file of a recording; rosbag2 reindexes only those with a number in their name."""
    return recording / f"{recording.name}_0.mcap"


@dataclass(eq=False)
class RecordedTopic:
    """A topic of a recording and what became of its messages.

    Attributes:
        name: Its name.
        type: Type of its messages.
        definition: Definition of the type.
        qos: Quality of service that its publishers offer.
        written: Messages written.
        dropped: Messages that came but were not written: the disk was too slow, or failed.
    """

    name: str
    type: str
    definition: Definition
    qos: Sequence[Qos]
    written: int = 0
    dropped: int = 0
    connection: Connection | None = field(default=None, repr=False)


class DurableBag:
    """A rosbag2 recording (mcap) that is being written, as a context manager.

    Args:
        path: Folder to make.
        queue_size: Most that may wait to be written [B]; what exceeds it is dropped and counted.

    Attributes:
        topics: Topics by name.
        failure: Why nothing more can be written; None as long as all is well.
        waiting: What waits in memory to be written [B].

    Raises:
        RecorderError: On entering, if the folder exists or cannot be made; on leaving, if the
            recording ended before. What was written until then is kept.
    """

    def __init__(self, path: str | os.PathLike[str], queue_size: int = QUEUE_SIZE) -> None:
        self.path = Path(path)
        self.topics: dict[str, RecordedTopic] = {}
        self.failure: Exception | None = None
        self.waiting = 0
        self._queue_size = queue_size
        self._queue: deque[tuple[RecordedTopic, int, bytes]] = deque()
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bag writer", daemon=True)

    def __enter__(self) -> DurableBag:
        """Make the folder and its file."""
        try:
            self._writer = _Writer(
                self.path, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP
            )
            self._writer.open()
        except WriterError:
            raise RecorderError(f"{self.path} exists; a recording needs a new folder") from None
        except OSError as error:
            raise RecorderError(f"cannot make {self.path}: {error.strerror}") from None
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write what waits, then the index and the metadata."""
        self._ending.set()
        self._thread.join()
        if self.failure is not None:
            raise self.failure

    @property
    def size(self) -> int:
        """What the file of the recording takes on the disk [B]."""
        with suppress(FileNotFoundError):  # someone has removed it
            return file_of(self.path).stat().st_size
        return 0

    def add_topic(self, name: str, type_name: str, qos: Sequence[Qos]) -> RecordedTopic:
        """Declare a topic; it enters the file with its first message.

        Args:
            name: Its name.
            type_name: Type of its messages, such as "sensor_msgs/msg/JointState".
            qos: Quality of service that its publishers offer.

        Raises:
            UnknownTypeError: If the type is not installed.
        """
        topic = RecordedTopic(name, type_name, message_definition(type_name), qos)
        self.topics[name] = topic
        return topic

    def put(self, topic: RecordedTopic, stamp: int, data: bytes) -> None:
        """Take a message; never waits for the disk.

        Args:
            topic: Its topic.
            stamp: When it was received [ns].
            data: The message, serialised (CDR).
        """
        size = len(data) + MESSAGE_OVERHEAD
        with self._lock:
            if self.failure is not None or self.waiting + size > self._queue_size:
                topic.dropped += 1
            else:
                self.waiting += size
                self._queue.append((topic, stamp, data))

    # ------------------------------------------------------------------ the thread that writes

    def _run(self) -> None:
        """Write until the recording ends, or something ends it."""
        try:
            try:
                self._write_until_the_end()
            except _DiskFullError as error:
                self._fail(RecorderError(f"{error}; what was recorded is whole"))
            self._writer.close()
        except OSError as error:
            kept = "all but the last second is kept, without an index"
            kept = kept if self.size else "nothing is kept"
            self._fail(RecorderError(f"cannot write {self.path}: {error.strerror}; {kept}"))
        except Exception as error:
            self._fail(error)
        finally:
            with suppress(OSError):  # what is in its buffer cannot be written
                self._writer.abort()

    def _write_until_the_end(self) -> None:
        flushed = time.monotonic()
        while not self._ending.wait(WRITE_PERIOD):
            self._write_waiting()
            if time.monotonic() - flushed >= FLUSH_PERIOD:
                flushed = time.monotonic()
                self._check_space()
                self._writer.flush()
        self._write_waiting()

    def _write_waiting(self) -> None:
        for _ in range(len(self._queue)):
            topic, stamp, data = self._queue[0]
            if topic.connection is None:
                topic.connection = self._writer.add_connection(
                    topic.name,
                    topic.type,
                    msgdef=topic.definition.text,
                    rihs01=topic.definition.hash,
                    offered_qos_profiles=topic.qos,
                )
            self._writer.write(topic.connection, stamp, data)
            topic.written += 1
            with self._lock:
                self._queue.popleft()
                self.waiting -= len(data) + MESSAGE_OVERHEAD

    def _check_space(self) -> None:
        free = shutil.disk_usage(self.path).free
        if free < LEAST_FREE:
            raise _DiskFullError(f"the disk of {self.path} is full: {free / 2**20:.0f} MiB left")

    def _fail(self, error: Exception) -> None:
        """Take no more messages, and count those that wait as dropped."""
        with self._lock:
            self.failure = error
            for topic, _, _ in self._queue:
                topic.dropped += 1
            self._queue.clear()
            self.waiting = 0


class _DiskFullError(Exception):
    """So little space is left that the recording has to end while its index can be written."""


# --------------------------------------------------------------------------- the file


class _Storage(McapWriter):
    """An mcap file that can be flushed, and that names hashes and itself as rosbag2 does."""

    def __init__(self, path: Path, compression: CompressionMode) -> None:
        super().__init__(path, compression)
        self.path = self.path.rename(file_of(path))

    def add_connection(self, connection: Connection, offered_qos_profiles: str) -> None:
        """Write a channel."""
        metadata = BytesIO()
        for key, value in (
            ("offered_qos_profiles", offered_qos_profiles),
            ("topic_type_hash", connection.digest),
        ):
            write_string(metadata, key)
            write_string(metadata, value)
        channel = Channel(
            connection.id, connection.msgtype, connection.topic, "cdr", metadata.getvalue()
        )
        self.channels.append(channel)
        self.channel_stats[connection.id] = 0
        write_channel(self.chunk.bio, channel, self.schemas)

    def flush(self) -> None:
        """Bring everything written so far to the disk, as a chunk that can be read."""
        if self.chunk.msgs:
            self.close_chunk()
        self.bio.flush()
        os.fsync(self.bio.fileno())


class _Writer(Writer):
    """Writes a recording whose file can be flushed."""

    STORAGE_PLUGINS = {StoragePlugin.MCAP: _Storage}  # noqa: RUF012 - as in the base class

    def flush(self) -> None:
        """Bring everything written so far to the disk."""
        cast(_Storage, self.storage).flush()
