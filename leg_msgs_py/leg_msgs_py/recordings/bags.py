# SPDX-License-Identifier: Apache-2.0
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
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from leg_msgs_py.recordings.bag_files import (
    BagFile,
    Topic,
    find_files,
    open_file,
    plain_file,
)
from leg_msgs_py.recordings.bag_types import bag_types, decoded
from leg_msgs_py.recordings.errors import BagError
from leg_msgs_py.recordings.unpacking import unpack_message
from rosbags.interfaces import MessageDefinitionFormat


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
        self.files, self.expected = find_files(self.path)
        self.topics: dict[str, Topic] = {}
        self.counts: Counter[str] = Counter()
        self.damages: dict[str, Damage] = {}
        self._faults: dict[str, str] = {}  # why files were not unpacked to their end
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
        self.types, self._refused = bag_types(self.topics.values())

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
                        yield BagMessage(topic.name, topic.type, time, unpack_message(data))
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
            reason = self._refused.get(message.type, "it is defined neither there nor here")
            raise BagError(f"{message.topic}: the type {message.type!r} is not known: {reason}")
        try:
            return decoded(self.types, message.data, message.type)
        except Exception as error:  # the decoders are generated, and garbage takes any way out
            raise BagError(f"{message.topic}: no {message.type}: {error}") from None

    @contextmanager
    def _opened(self, file: Path) -> Iterator[BagFile]:
        """Open a file of the recording."""
        with plain_file(file) as (plain, fault):
            part = open_file(plain)
            if fault:
                self._faults[file.name] = part.damage = fault
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
        self.damages[file.name] = Damage(file.name, count, self._faults.get(file.name, reason))
