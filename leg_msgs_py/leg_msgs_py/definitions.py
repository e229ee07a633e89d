"""What a message type is: its class, its full definition and its hash, as they are installed."""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path
from typing import Any, NamedTuple

SEPARATOR = "=" * 80  # between the definitions of a type and of those it holds, as rosbag2 has it


class UnknownTypeError(Exception):
    """A message type is not installed here."""


class Definition(NamedTuple):
    """Definition of a message type.

    Attributes:
        text: The type's .msg file, comments included, and those of the types it holds.
        hash: Its RIHS01 hash.
    """

    text: str
    hash: str


def message_class(type_name: str) -> Any:
    """Return the class of a type such as "sensor_msgs/msg/JointState".

    Raises:
        UnknownTypeError: If it is not installed.
    """
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError, TypeError):
        raise UnknownTypeError(f"message type {type_name} is not installed") from None


def message_definition(type_name: str) -> Definition:
    """Return the definition of an installed type.

    Raises:
        UnknownTypeError: If it is not installed.
    """
    description = json.loads(_read(type_name, ".json"))
    hashes = {each["type_name"]: each["hash_string"] for each in description["type_hashes"]}
    parts = [
        f"{SEPARATOR}\nMSG: {name.replace('/msg/', '/')}\n{_read(name, '.msg')}"
        for name in hashes
        if name != type_name
    ]
    return Definition("\n".join([_read(type_name, ".msg"), *parts]), hashes[type_name])


def _read(type_name: str, suffix: str) -> str:
    """Return the content of one of the files that a package installs for a type."""
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    for prefix in (*prefixes, sys.prefix):
        path = Path(prefix, "share", f"{type_name}{suffix}")
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise UnknownTypeError(f"definition of message type {type_name} is not installed")
