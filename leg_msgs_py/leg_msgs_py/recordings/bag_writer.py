# SPDX-License-Identifier: Apache-2.0
"""A new recording, written without ROS."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from leg_msgs_py.recordings.bag_files import Topic
from leg_msgs_py.recordings.definitions import message_definition
from leg_msgs_py.recordings.errors import BagError
from rosbags.interfaces import (
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
    StoragePlugin,
    Writer,
    WriterError,
)
from rosbags.typesys.store import Typestore

FOREVER = QosTime(9223372036, 854775807)  # how rosbag2 writes a duration without end


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
