"""Rosbag2 recordings without ROS: mcap and sqlite3, split, compressed, damaged or without metadata.

    bag = Bag("walk")
    for message in bag.messages(["/joint_states"]):
        states = bag.decode(message)

Files are opened one after the other, so memory does not grow with the recording. A damaged file is
read up to its damage, which `Bag.damages` then tells. The messages of leg_msgs are those that the
recording defines, or else those installed.
"""

from __future__ import annotations

import os
import re
import shutil
import sqlite3
import tempfile
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from backports import zstd
from leg_msgs_py.recordings.definitions import (
    SEPARATOR,
    SERVICE_MARK,
    UnknownTypeError,
    message_definition,
    service_of_event,
)
from leg_msgs_py.recordings.mcap_scan import MAGIC as MCAP_MAGIC
from leg_msgs_py.recordings.mcap_scan import Channel, McapDamageError, McapScan
from rosbags.interfaces import (
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    Nodetype,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import (
    CompressionFormat,
    CompressionMode,
    Reader,
    ReaderError,
    StoragePlugin,
    Writer,
    WriterError,
)
from rosbags.rosbag2.metadata import parse_qos
from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)
from rosbags.typesys.store import Typestore
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

SLICE = 2**14  # bytes that are decompressed at once: what precedes a fault is kept
SUFFIXES = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")
SQLITE_MAGIC = b"SQLite format 3\0"
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"  # a message in CDR begins otherwise
FORMATS = {
    "ros2msg": MessageDefinitionFormat.MSG,
    "ros2idl": MessageDefinitionFormat.IDL,
    "omgidl": MessageDefinitionFormat.IDL,
}
NO_DEFINITION = MessageDefinition(MessageDefinitionFormat.NONE, "")
EVENT_INFO = "service_msgs/msg/ServiceEventInfo"
# What all service events have. rosbag2 leaves it out of definitions. Where ROS says char here and
# means uint8, the parser understands something else, which has another hash.
EVENT_INFO_TEXT = f"""\
uint8 event_type
builtin_interfaces/Time stamp
uint8[16] client_gid
int64 sequence_number
{SEPARATOR}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
FOREVER = QosTime(9223372036, 854775807)  # how rosbag2 writes a duration without end


class BagError(Exception):
    """A recording, or a message of it, that cannot be read or written; the message says why."""


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


class BagMessage(NamedTuple):
    """A recorded message.

    Attributes:
        topic: Name of its topic.
        type: Its type.
        time: When it was recorded [ns].
        data: Its content, serialised (CDR).
    """

    topic: str
    type: str
    time: int
    data: bytes


class Damage(NamedTuple):
    """Where a file of a recording cannot be read any further.

    Attributes:
        file: Name of the file.
        messages: How many messages were read from it before.
        reason: What is wrong, and where.
    """

    file: str
    messages: int
    reason: str


class Bag:
    """A recording: a folder or a single file.

    Args:
        path: Folder (with or without metadata.yaml) or file: mcap or db3, as it is or with zstd.

    Attributes:
        files: Files in the order of recording.
        topics: Topics by name.
        counts: Number of messages by topic.
        expected: Number of messages that the metadata tells; None without metadata.
        start, end: Times of the first and of the last message [ns]; 0 if there is none.
        damages: Damage found so far, by file.
        types: Types of the messages, to decode and encode with.

    Raises:
        BagError: If it is no recording, or nothing of it can be read.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.files, self.expected = _find_files(self.path)
        self.topics: dict[str, Topic] = {}
        self.counts: Counter[str] = Counter()
        self.damages: dict[str, Damage] = {}
        times: list[int] = []
        for file in self.files:
            with self._opened(file) as part:
                for topic in part.topics:
                    self._add(topic)
                self.counts.update(part.counts)
                times += part.span
                if part.damage:
                    self._note(file, part.counts.total(), part.damage)
        self.start, self.end = min(times, default=0), max(times, default=0)
        if not self.topics:
            reasons = "; ".join(damage.reason for damage in self.damages.values())
            raise BagError(f"{self.path}: nothing can be read: {reasons or 'it has no topics'}")
        self.types = _bag_types(self.topics.values())

    def messages(self, topics: Collection[str] = ()) -> Iterator[BagMessage]:
        """Yield the messages of topics, none for all, in the order of recording.

        Damage ends a file, not the recording: its other files are read, too.
        """
        chosen = set(topics) or set(self.topics)
        for file in self.files:
            count = 0
            with self._opened(file) as part:
                fault = ""
                try:
                    for topic, time, data in part.messages(chosen):
                        yield BagMessage(topic.name, topic.type, time, _decompressed(data))
                        count += 1
                except Exception as error:  # readers raise all sorts of them at damaged content
                    fault = str(error) or type(error).__name__
                if fault or part.damage:
                    self._note(file, count, fault or part.damage)

    def decode(self, message: BagMessage) -> Any:
        """Return a message as an object with its fields as attributes, arrays as numpy arrays.

        Raises:
            BagError: If its type is not known, or its content does not fit the type.
        """
        if message.type not in self.types.fielddefs:
            raise BagError(f"{message.topic}: the type {message.type!r} is not known")
        try:
            return self.types.deserialize_cdr(message.data, message.type)
        except Exception as error:  # the decoders are generated, and garbage takes any way out
            raise BagError(f"{message.topic}: no {message.type}: {error}") from None

    @contextmanager
    def _opened(self, file: Path) -> Iterator[_File]:
        """Open a file of the recording."""
        with _plain_file(file) as plain:
            part = _open(plain)
            try:
                yield part
            finally:
                part.close()

    def _add(self, topic: Topic) -> None:
        known = self.topics.get(topic.name)
        if known is not None and known.type != topic.type:
            raise BagError(
                f"{self.path}: topic {topic.name} has two types, {known.type} and {topic.type}"
            )
        if known is None or known.definition.format == MessageDefinitionFormat.NONE:
            self.topics[topic.name] = topic

    def _note(self, file: Path, count: int, reason: str) -> None:
        self.damages[file.name] = Damage(file.name, count, reason)


# --------------------------------------------------------------------------- writing


class BagWriter:
    """A new recording: a folder with one mcap file in compressed chunks, and its metadata.

    Use it in a `with` statement. Left by an exception, it leaves a file without its end.

    Args:
        path: Folder to make.

    Raises:
        BagError: If the folder exists or cannot be made.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._connections: dict[str, Any] = {}
        try:
            self._writer = Writer(Path(path), version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        except (WriterError, OSError) as error:
            raise BagError(str(error)) from None

    def add_topic(self, name: str, type_name: str, qos: Sequence[Qos] = ()) -> None:
        """Add a topic of an installed type.

        Args:
            name: Name of the topic.
            type_name: Type of its messages, such as "leg_msgs/msg/LegStates".
            qos: Quality of service for players of the recording; see `offered_qos`.

        Raises:
            UnknownTypeError: If the type is not installed.
        """
        definition = message_definition(type_name)
        self._add(name, type_name, definition.text, definition.hash, qos)

    def copy_topic(self, topic: Topic, types: Typestore) -> None:
        """Add a topic of another recording, with the type as it is there.

        Args:
            topic: The topic.
            types: Types of that recording.

        Raises:
            BagError: If the type is not known.
        """
        if topic.type not in types.fielddefs:
            raise BagError(f"{topic.name}: the type {topic.type!r} is not known")
        text = topic.definition.data or types.generate_msgdef(topic.type, ros_version=2)[0]
        self._add(topic.name, topic.type, text, types.hash_rihs01(topic.type), topic.qos)

    def write(self, topic: str, time: int, data: bytes | memoryview) -> None:
        """Write a message.

        Args:
            topic: Name of a topic that was added.
            time: When it was recorded [ns].
            data: Its serialised content (CDR).
        """
        self._writer.write(self._connections[topic], time, data)

    def _add(self, name: str, type_name: str, text: str, rihs01: str, qos: Sequence[Qos]) -> None:
        self._connections[name] = self._writer.add_connection(
            name, type_name, msgdef=text, rihs01=rihs01, offered_qos_profiles=qos
        )

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *error: Any) -> None:
        self._writer.__exit__(*error)


def offered_qos(depth: int = 10, *, reliable: bool = True, latched: bool = False) -> tuple[Qos]:
    """Return a quality of service as publishers offer it.

    Args:
        depth: How many messages are kept for late readers and retransmission.
        reliable: Reliable, or else best effort.
        latched: Whether late subscribers get the last messages (transient local).
    """
    return (
        Qos(
            QosHistory.KEEP_LAST,
            depth,
            QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
            QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
            FOREVER,
            FOREVER,
            QosLiveliness.AUTOMATIC,
            FOREVER,
            False,
        ),
    )


# --------------------------------------------------------------------------- types


def installed_types(names: Iterable[str]) -> Typestore:
    """Return message types as they are installed, with the types that their fields have.

    Raises:
        UnknownTypeError: If one is not installed.
    """
    types = get_typestore(Stores.EMPTY)
    for name in names:
        types.register(_types_of_text(message_definition(name).text, name))
    return types


def _bag_types(topics: Collection[Topic]) -> Typestore:
    """Return the types that a recording defines, and for those it does not, the installed ones.

    Raises:
        BagError: If it defines a type in two ways.
    """
    types = get_typestore(Stores.EMPTY)
    for topic in topics:
        defined = {}
        with suppress(TypesysError):  # what one topic says in another way shall not hide the others
            defined = _defined_types(topic)
        try:
            types.register(defined)
        except TypesysError as error:
            raise BagError(f"{topic.name}: {error}") from None
    for topic in topics:
        if topic.type not in types.fielddefs:
            with suppress(UnknownTypeError):  # it can be copied, but not decoded
                installed = installed_types([topic.type]).fielddefs
                types.register({k: v for k, v in installed.items() if k not in types.fielddefs})
    return types


def _defined_types(topic: Topic) -> Any:
    """Return the types that the definition of a topic holds."""
    form, text = topic.definition
    if not text:
        return {}
    if form == MessageDefinitionFormat.MSG:
        return _types_of_text(text, topic.type)
    if form == MessageDefinitionFormat.IDL:
        parts = re.split(r"^={80}\nIDL: .*\n", text, flags=re.MULTILINE)
        return {
            name: fields
            for part in filter(None, parts)
            for name, fields in get_types_from_idl(part).items()
        }
    return {}


def _types_of_text(text: str, name: str) -> dict[str, Any]:
    """Return the types of the definition of a message, or of a service that stands for its events.

    Raises:
        TypesysError: If it is no such definition.
    """
    service = service_of_event(name)
    if service is None:
        return get_types_from_msg(text, name)
    parts = text.split(f"{SEPARATOR}\n")[1:]
    halves = re.split(r"^---\s*$", parts[0], flags=re.MULTILINE) if parts else []
    if len(halves) != 2 or not parts[0].startswith(SERVICE_MARK):
        raise TypesysError(f"no definition of the service {service}")
    halves[0] = halves[0].partition("\n")[2]
    # The parser knows messages only: of the same package, so that it finds what they refer to.
    alias = service.replace("/srv/", "/msg/")
    found: dict[str, Any] = {}
    for half, kind in zip(halves, ("Request", "Response"), strict=True):
        types = get_types_from_msg(f"{SEPARATOR}\n".join([half, *parts[1:]]), alias)
        found[f"{service}_{kind}"] = types.pop(alias)
        found |= types
    found |= get_types_from_msg(EVENT_INFO_TEXT, EVENT_INFO)
    contents = [
        (kind.lower(), (Nodetype.SEQUENCE, ((Nodetype.NAME, f"{service}_{kind}"), 1)))
        for kind in ("Request", "Response")
    ]
    found[name] = ([], [("info", (Nodetype.NAME, EVENT_INFO)), *contents])
    return found


# --------------------------------------------------------------------------- files


def _find_files(path: Path) -> tuple[list[Path], int | None]:
    """Return the files of a recording, and how many messages its metadata tells."""
    if path.is_file():
        if not path.name.endswith(SUFFIXES):
            raise BagError(f"{path}: no recording; allowed: a folder, or {', '.join(SUFFIXES)}")
        return [path], None
    if not path.is_dir():
        raise BagError(f"{path} does not exist")
    listed, expected = [], None
    # A recorder that was killed leaves no metadata, or half of it.
    with suppress(OSError, ValueError, YAMLError, KeyError, TypeError):
        text = (path / "metadata.yaml").read_text(encoding="utf-8")
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
def _plain_file(file: Path) -> Iterator[Path]:
    """Give a file without compression; of a damaged one, what comes before the damage."""
    if file.suffix != ".zstd" or not file.is_file():
        yield file
        return
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder, file.stem)
        # Cut off or corrupt: what is missing shows in the plain file.
        with suppress(zstd.ZstdError, EOFError), zstd.open(file) as packed, plain.open("wb") as out:
            shutil.copyfileobj(packed, out, SLICE)
        yield plain


def _decompressed(data: bytes) -> bytes:
    """Return a message that may be compressed by itself, as rosbag2's message mode does."""
    return zstd.decompress(data) if data[:4] == ZSTD_MAGIC else data


# --------------------------------------------------------------------------- one file


class _File:
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


def _open(file: Path) -> _File:
    """Open a file by its index, or if it has none, from the front."""
    try:
        return _Sound(file)
    except Exception as error:  # readers raise all sorts of them at damaged content
        reason = str(error) or type(error).__name__
    magic = b""
    with suppress(OSError), file.open("rb") as stream:
        magic = stream.read(len(SQLITE_MAGIC))
    if magic == SQLITE_MAGIC:
        return _TornSqlite(file, reason)
    if magic.startswith(MCAP_MAGIC):
        return _TornMcap(file, reason)
    return _File(reason)


class _Sound(_File):
    """A file that has its index."""

    def __init__(self, file: Path) -> None:
        super().__init__()
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


class _Torn(_File, ABC):
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
                if scan.profile != "ros2":
                    raise McapDamageError(f"its profile is {scan.profile!r}; allowed: 'ros2'")
                if number not in self._topics:
                    self._topics[number] = _topic(scan.channels[number])
                yield self._topics[number], time, data
        except McapDamageError as error:
            self.damage = str(error)


class _TornSqlite(_Torn):
    """A database of which pages are missing."""

    def _read(self) -> Iterator[tuple[Topic, int, bytes]]:
        where = f"{self._file.absolute().as_uri()}?immutable=1"
        with closing(sqlite3.connect(where, uri=True)) as database:
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
    qos: Sequence[Qos] = ()
    with suppress(ReaderError, LookupError, TypeError):
        qos = parse_qos(channel.qos)
    return Topic(
        channel.topic, channel.type, MessageDefinition(form, channel.definition), tuple(qos)
    )
