# SPDX-License-Identifier: Apache-2.0
"""The files of a recording: which they are, and what each of them holds, damaged or not."""

from __future__ import annotations

import re
import sqlite3
import stat
import tempfile
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from functools import lru_cache
from pathlib import Path, PurePath
from typing import NamedTuple

from leg_msgs_py.recordings.errors import BagError, McapDamageError
from leg_msgs_py.recordings.mcap_index import McapIndex
from leg_msgs_py.recordings.mcap_scan import MAGIC as MCAP_MAGIC
from leg_msgs_py.recordings.mcap_scan import Channel, McapScan
from leg_msgs_py.recordings.unpacking import unpack_file
from rosbags.interfaces import (
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    Qos,
)
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.rosbag2.metadata import parse_qos
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

MOST_METADATA = 2**18  # bytes; more is not read, as if a recorder had left none
MOST_QOS = 2**13  # characters of what a topic's publishers offered
SUFFIXES = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")
SQLITE_MAGIC = b"SQLite format 3\0"
FORMATS = {
    "ros2msg": MessageDefinitionFormat.MSG,
    "ros2idl": MessageDefinitionFormat.IDL,
    "omgidl": MessageDefinitionFormat.IDL,
}
NO_DEFINITION = MessageDefinition(MessageDefinitionFormat.NONE, "")


class Topic(NamedTuple):
    """A topic of a recording.

    Attributes:
        name: Its name.
        type: Type of its messages, such as "sensor_msgs/msg/JointState".
        definition: Definition of the type; its format is NONE if the recording has none.
        qos: Quality of service that the publishers offered; empty if it was not recorded.
    """

    name: str
    type: str
    definition: MessageDefinition = NO_DEFINITION
    qos: tuple[Qos, ...] = ()


def find_files(path: Path) -> tuple[list[Path], int | None]:
    """Return the files of a recording, and how many messages its metadata tells."""
    if path.exists() and not path.is_dir():
        if not path.name.endswith(SUFFIXES):
            raise BagError(f"{path}: no recording; allowed: a folder, or {', '.join(SUFFIXES)}")
        return [path], None
    if not path.is_dir():
        raise BagError(f"{path} does not exist")
    listed, expected = [], None
    # A recorder that was killed leaves no metadata, or half of it.
    with suppress(OSError, ValueError, YAMLError, KeyError, TypeError, RecursionError, BagError):
        check_regular(path / "metadata.yaml")
        with (path / "metadata.yaml").open(encoding="utf-8") as file:
            text = file.read(MOST_METADATA)
        metadata = YAML(typ="safe").load(text)["rosbag2_bagfile_information"]
        listed = [path / PurePath(name).name for name in metadata["relative_file_paths"]]
        expected = int(metadata["message_count"])
    found = sorted((f for f in path.iterdir() if f.name.endswith(SUFFIXES)), key=_natural)
    files = [*listed, *(file for file in found if file not in listed)]
    if not files:
        raise BagError(f"{path}: no recording; it has no file {', '.join(SUFFIXES)}")
    return files, expected


def _natural(file: Path) -> list[tuple[int, str]]:
    """Return a key that puts walk_9.mcap before walk_10.mcap."""
    return [(int(part or 0), text) for text, part in re.findall(r"(\D*)(\d*)", file.name)]


@contextmanager
def plain_file(file: Path) -> Iterator[tuple[Path, str]]:
    """Give a file without compression, of a damaged one what comes before the damage.

    With it comes what is wrong, unless that shows in the file without compression.
    """
    if file.suffix != ".zstd" or not file.is_file():
        yield file, ""
        return
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder, file.stem)
        fault = unpack_file(file, plain)
        yield plain, f"the file {fault}" if fault else ""


def check_regular(file: Path) -> None:
    """Raise a BagError if a file is a pipe or a device, which may never end, or a folder.

    Raises:
        OSError: If there is no such file.
    """
    if not stat.S_ISREG(file.stat().st_mode):
        raise BagError(f"{file}: is no regular file")


class BagFile:
    """One open file of a recording; as it stands, one of which nothing can be read.

    Attributes:
        topics: Its topics.
        counts: Messages by topic.
        span: Times of the first and of the last message [ns]; empty if there is none.
        damage: What is wrong with it; "" for a sound file.
    """

    def __init__(self, damage: str = "") -> None:
        self.topics: Sequence[Topic] = ()
        self.counts: Counter[str] = Counter()
        self.span: Sequence[int] = ()
        self.damage = damage

    def messages(self, topics: Collection[str]) -> Iterator[tuple[Topic, int, bytes]]:
        """Yield the messages of topics: topic, time [ns] and data."""
        return iter(())

    def close(self) -> None:
        """Close the file."""


def open_file(file: Path) -> BagFile:
    """Open a file by its index, or if it has none, from the front."""
    try:
        check_regular(file)
        with file.open("rb") as stream:
            magic = stream.read(len(SQLITE_MAGIC))
    except (OSError, BagError) as error:
        return BagFile(str(error))
    indexed: type[BagFile]
    torn: type[_Torn]
    if magic.startswith(MCAP_MAGIC):
        indexed, torn = _IndexedMcap, _TornMcap
    elif magic == SQLITE_MAGIC:
        indexed, torn = _Sqlite, _TornSqlite
    else:
        return BagFile("its magic is that of no recording" if magic else "it is empty")
    try:
        return indexed(file)
    except Exception as error:  # readers raise all sorts of them at damaged content
        return torn(file, str(error) or type(error).__name__)


class _IndexedMcap(BagFile):
    """An mcap file with a sound index."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self._index = McapIndex(file)
        _check_profile(self._index.profile)
        self._topics = {number: _topic(c) for number, c in self._index.channels.items()}
        self.topics = list(self._topics.values())
        for number, topic in self._topics.items():
            self.counts[topic.name] += self._index.counts.get(number, 0)
        self.span = self._index.span

    def messages(self, topics: Collection[str]) -> Iterator[tuple[Topic, int, bytes]]:
        chosen = {number for number, topic in self._topics.items() if topic.name in topics}
        for number, time, data in self._index.messages(chosen) if chosen else ():
            yield self._topics[number], time, data


class _Sqlite(BagFile):
    """A database that is whole."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        _check_offers(file)
        self._reader = Reader(file)
        self._reader.open()
        self._topics = {
            c.id: Topic(c.topic, c.msgtype, c.msgdef, tuple(c.ext.offered_qos_profiles))
            for c in self._reader.connections
            if isinstance(c.ext, ConnectionExtRosbag2)
        }
        self.topics = list(self._topics.values())
        for connection in self._reader.connections:
            self.counts[connection.topic] += connection.msgcount
        if self._reader.message_count:
            self.span = (self._reader.start_time, self._reader.end_time - 1)

    def messages(self, topics: Collection[str]) -> Iterator[tuple[Topic, int, bytes]]:
        chosen = [c for c in self._reader.connections if c.topic in topics]
        if chosen:  # the reader takes none for all
            for connection, time, data in self._reader.messages(chosen):
                yield self._topics[connection.id], time, data

    def close(self) -> None:
        self._reader.close()


def _check_offers(file: Path) -> None:
    """Raise a BagError if the YAML of a topic is longer than its reader should be given."""
    with closing(_database(file)) as database:
        names = {row[1] for row in database.execute("PRAGMA table_info(topics)")}
        if "offered_qos_profiles" in names:
            query = "SELECT max(length(offered_qos_profiles)) FROM topics"
            longest = database.execute(query).fetchone()[0] or 0
            if longest > MOST_QOS:
                raise BagError(f"a topic offers {longest} characters; allowed: {MOST_QOS}")


def _database(file: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{file.absolute().as_uri()}?immutable=1", uri=True)


def _check_profile(profile: str) -> None:
    if profile != "ros2":
        raise McapDamageError(f"its profile is {profile!r}; allowed: 'ros2'")


class _Torn(BagFile, ABC):
    """A file that is read from the front: only reading it shows what is in it.

    Args:
        file: The file.
        reason: Why it cannot be read by its index.
    """

    def __init__(self, file: Path, reason: str) -> None:
        super().__init__()
        self._file = file
        self._topics: dict[int, Topic] = {}
        for topic, time, _ in self._read():
            self.counts[topic.name] += 1
            first, last = self.span or (time, time)
            self.span = (min(time, first), max(time, last))
        self.damage = self.damage or reason
        self.topics = list(self._topics.values())

    def messages(self, topics: Collection[str]) -> Iterator[tuple[Topic, int, bytes]]:
        return (found for found in self._read() if found[0].name in topics)

    @abstractmethod
    def _read(self) -> Iterator[tuple[Topic, int, bytes]]:
        """Yield all messages before the damage, and note topics and damage."""


class _TornMcap(_Torn):
    """An mcap file without a sound index."""

    def _read(self) -> Iterator[tuple[Topic, int, bytes]]:
        scan = McapScan(self._file)
        try:
            for number, time, data in scan.messages():
                _check_profile(scan.profile)
                if number not in self._topics:
                    if number not in scan.channels:
                        raise McapDamageError(f"a message of the unknown channel {number}")
                    self._topics[number] = _topic(scan.channels[number])
                yield self._topics[number], time, data
        except McapDamageError as error:
            self.damage = str(error)


class _TornSqlite(_Torn):
    """A database of which pages are missing."""

    def _read(self) -> Iterator[tuple[Topic, int, bytes]]:
        with closing(_database(self._file)) as database:
            try:
                database.execute("PRAGMA writable_schema = ON")  # tolerates that pages are missing
                for number, name, kind in database.execute("SELECT id, name, type FROM topics"):
                    self._topics[number] = Topic(name, kind)
                # In the order of writing, in which the pages come one after the other.
                query = "SELECT topic_id, timestamp, data FROM messages NOT INDEXED"
                for number, time, data in database.execute(query):
                    if number not in self._topics or not isinstance(data, bytes):
                        raise sqlite3.DatabaseError("a row of the messages is garbled")
                    yield self._topics[number], time, data
            except sqlite3.Error as error:
                self.damage = str(error)


def _topic(channel: Channel) -> Topic:
    """Return a topic of an mcap file."""
    form = FORMATS.get(channel.encoding, MessageDefinitionFormat.NONE)
    definition = MessageDefinition(form, channel.definition)
    return Topic(channel.topic, channel.type, definition, _offers(channel.qos[:MOST_QOS]))


@lru_cache
def _offers(text: str) -> tuple[Qos, ...]:
    """Return what publishers offered; nothing if the YAML is not as rosbag2 writes it."""
    with suppress(ReaderError, LookupError, TypeError, ValueError, RecursionError):
        return tuple(parse_qos(text))
    return ()
