# SPDX-License-Identifier: Apache-2.0
"""The message types of a recording, as it defines them or as they are installed."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from contextlib import suppress
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from leg_msgs_py.recordings.bag_files import Topic
from leg_msgs_py.recordings.definitions import (
    SEPARATOR,
    SERVICE_MARK,
    message_definition,
    service_of_event,
)
from leg_msgs_py.recordings.errors import BagError, UnknownTypeError
from rosbags.interfaces import MessageDefinitionFormat, Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)
from rosbags.typesys.store import Typestore

PADDING = 8
MOST_CHARACTERS = 2**20  # of all definitions of a recording
MOST_FIELDS = 2000  # of a type with all the types of its fields
MOST_ELEMENTS = 10**6  # of a field of fixed size
FIELD = re.compile(r"^[ \t]*[A-Za-z][^#\n\[]*(?:\[<?=?(\d{0,18}))?", re.MULTILINE)
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


def installed_types(names: Iterable[str]) -> Typestore:
    """Return message types as they are installed, with the types that their fields have.

    Raises:
        UnknownTypeError: If one is not installed.
    """
    types = get_typestore(Stores.EMPTY)
    for name in names:
        types.register(_types_of_text(message_definition(name).text, name))
    return types


def decoded(types: Typestore, data: bytes, name: str) -> Any:
    """Return a message of a type, serialised by whichever library.

    The one of ROS leaves up to `PADDING` bytes more at the end for every list that is empty.

    Raises:
        Exception: Of any type, if the content does not fit the type.
    """
    try:
        return types.deserialize_cdr(data, name)
    except SerdeError:
        kind = types.get_msgdef(name)
        decode = kind.deserialize_cdr_le if data[1] else kind.deserialize_cdr_be
        message, end = decode(data[4:], 0, kind.cls, types)
        if len(data) - 4 - end > PADDING * _empty_lists(message):
            raise
        return message


def _empty_lists(part: Any) -> int:
    """Return how many lists of a message are empty."""
    if is_dataclass(part):
        return sum(_empty_lists(getattr(part, field.name)) for field in fields(part))
    if isinstance(part, list) and part:
        return sum(map(_empty_lists, part))
    return int(isinstance(part, (list, np.ndarray)) and not len(part))


def bag_types(topics: Collection[Topic]) -> tuple[Typestore, dict[str, str]]:
    """Return the types that a recording defines, and for those it does not, the installed ones.

    Returns:
        The types, and why definitions of others were not read, by their names.

    Raises:
        BagError: If it defines a type in two ways.
    """
    types, refused = get_typestore(Stores.EMPTY), _refused_types(topics)
    for topic in topics:
        defined = {}
        if topic.type not in refused:
            # what one topic says in another way shall not hide the others
            with suppress(TypesysError, RecursionError):
                defined = _defined_types(topic)
        try:
            types.register(defined)
        except TypesysError as error:
            raise BagError(f"{topic.name}: {error}") from None
    for topic in topics:
        if topic.type not in types.fielddefs and topic.type not in refused:
            with suppress(UnknownTypeError):  # it can be copied, but not decoded
                installed = installed_types([topic.type]).fielddefs
                types.register({k: v for k, v in installed.items() if k not in types.fielddefs})
    return types, refused


def _refused_types(topics: Iterable[Topic]) -> dict[str, str]:
    """Return the types whose definitions would keep the parser for more than seconds, and why.

    It takes a fifth of a millisecond for a line, and what decodes a field is compiled.
    """
    refused: dict[str, str] = {}
    characters = 0
    for definition, topic in {topic.definition: topic for topic in topics}.items():
        sizes = [int(size or 0) for size in FIELD.findall(definition.data)]
        characters += len(definition.data)
        for count, what, most in (
            (len(sizes), "fields", MOST_FIELDS),
            (max(sizes, default=0), "elements of a field", MOST_ELEMENTS),
            (characters, "characters of definitions", MOST_CHARACTERS),
        ):
            if count > most:
                reason = f"its definition has {count} {what}; allowed: at most {most}"
                refused.setdefault(topic.type, reason)
    return refused


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
