# SPDX-License-Identifier: Apache-2.0
"""What a message type is: its class, its full definition and its hash, as they are installed."""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path
from typing import Any, NamedTuple

from leg_msgs_py.recordings.errors import UnknownTypeError

# As rosbag2 has it: what stands between the definitions of a type and of those it holds, and before
# the definition of a service, which stands for that of the service's events.
SEPARATOR = "=" * 80
SERVICE_MARK = "SRV: "
EVENT_SUFFIX = "_Event"


class Definition(NamedTuple):
    """Definition of a message type.

    Attributes:
        text: The type's .msg file, comments included, and those of the types it holds; of the
            events of a service, its .srv file.
        hash: Its RIHS01 hash.
    """

    text: str
    hash: str


def message_class(type_name: str) -> Any:
    """Return the class of a type such as "sensor_msgs/msg/JointState".

    Raises:
        UnknownTypeError: If it is not installed.
    """
    service = service_of_event(type_name)
    module, _, name = (service or type_name).rpartition("/")
    try:
        found = getattr(importlib.import_module(module.replace("/", ".")), name)
        return found.Event if service else found
    except (ImportError, AttributeError, ValueError, TypeError):
        raise UnknownTypeError(f"message type {type_name} is not installed") from None


def message_definition(type_name: str) -> Definition:
    """Return the definition of an installed type.

    Raises:
        UnknownTypeError: If it is not installed.
    """
    service = service_of_event(type_name)
    description = json.loads(_read(service or type_name, ".json"))
    hashes = {each["type_name"]: each["hash_string"] for each in description["type_hashes"]}
    if service is None:
        head = _read(type_name, ".msg")
    else:
        head = f"{SEPARATOR}\n{SERVICE_MARK}{service}\n{_read(service, '.srv')}"
    parts = [
        f"{SEPARATOR}\nMSG: {name.replace('/msg/', '/')}\n{_read(name, '.msg')}"
        for name in hashes
        if name != type_name and "/msg/" in name
    ]
    return Definition("\n".join([head, *parts]), hashes[type_name])


def service_of_event(type_name: str) -> str | None:
    """Return the service whose events have a type; None if it is no such type.

    That of "leg_msgs/srv/QueryFootholds_Event" is "leg_msgs/srv/QueryFootholds".
    """
    is_event = "/srv/" in type_name and type_name.endswith(EVENT_SUFFIX)
    return type_name.removesuffix(EVENT_SUFFIX) if is_event else None


def _read(type_name: str, suffix: str) -> str:
    """Return the content of one of the files that a package installs for a type."""
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    for prefix in (*prefixes, sys.prefix):
        path = Path(prefix, "share", f"{type_name}{suffix}")
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise UnknownTypeError(f"definition of message type {type_name} is not installed")
