# SPDX-License-Identifier: Apache-2.0
"""YAML documents whose mistakes are all told with file, line, key, value and what is allowed.

They come from other people and other machines, so what reading one may cost has bounds.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any

import jsonschema
from ruamel.yaml.error import MarkedYAMLError

from leg_kinematics.bounded_yaml import MOST_CHARACTERS, load_yaml
from leg_kinematics.errors import DescriptionError
from leg_kinematics.files import read_text

MOST_MISTAKES = 20  # that are told
LONGEST_VALUE = 120  # characters of a value that are told

NAME = {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]*$", "maxLength": 100}
# What others name: joints and frames of a robot, which may be one of several in a tree of frames.
FOREIGN_NAME = {
    "type": "string",
    "pattern": "^[A-Za-z0-9_.-]+(/[A-Za-z0-9_.-]+)*$",
    "maxLength": 100,
}
NUMBER = {"type": "number"}
PAIR = {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2}
VECTOR = {"type": "array", "items": NUMBER, "minItems": 3, "maxItems": 3}


def _is_number(_: Any, value: Any) -> bool:
    """Whether a value is a finite number; JSON Schema knows no NaN or infinity."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    number: Any = value
    return bool(abs(number) <= sys.float_info.max)  # also of integers that no float can hold


def _unique(validator: Any, unique: bool, items: Any, _: Any) -> Iterator[Any]:
    """Check `uniqueItems` of scalars; the library compares all pairs of what has no order."""
    listed = items if validator.is_type(items, "array") else []
    scalars = [item for item in listed if isinstance(item, (str, Real))]
    if unique and len(set(scalars)) < len(scalars):
        yield jsonschema.ValidationError(f"{_shown(items)} has equal items")


_Validator: Any = jsonschema.validators.extend(  # type: ignore[no-untyped-call]
    jsonschema.Draft202012Validator,
    {"uniqueItems": _unique},
    type_checker=jsonschema.Draft202012Validator.TYPE_CHECKER.redefine("number", _is_number),
)


def mapping_schema(properties: Mapping[str, Any], required: Sequence[str]) -> dict[str, Any]:
    """Schema of a mapping with these keys and no others."""
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(required),
        "additionalProperties": False,
    }


def named_schema(schema: Mapping[str, Any], most: int = 1000) -> dict[str, Any]:
    """Schema of a mapping from at least one and at most `most` names to `schema`."""
    return {
        "type": "object",
        "minProperties": 1,
        "maxProperties": most,
        "propertyNames": NAME,
        "additionalProperties": schema,
    }


class Document:
    """A parsed YAML file.

    Attributes:
        path: Its file.
        text: Its text.
        root: Its content.
    """

    def __init__(self, path: Path, text: str | None = None) -> None:
        """Parse a file; duplicate keys are errors.

        Args:
            path: The file, for messages too.
            text: Its text; None to read it from the file.

        Raises:
            DescriptionError: If it cannot be read or parsed, or is too large.
        """
        self.path = path
        self.text = read_text(path, MOST_CHARACTERS) if text is None else text
        try:
            self.root: Any = load_yaml(self.text)
        except MarkedYAMLError as error:
            mark = error.problem_mark
            where = f"{path}:{mark.line + 1}" if mark else str(path)
            problem = _cut(str(error.problem or error.context))
            raise DescriptionError(f"{where}: {problem}") from None
        except Exception as error:  # of dates, numbers and tags that are none
            raise DescriptionError(f"{path}: {_cut(str(error))}") from None

    def node(self, *where: Any) -> Any:
        """Return the part of the document at a path of keys."""
        part = self.root
        for key in where:
            part = part[key]
        return part

    def check(self, schema: Mapping[str, Any], *where: Any) -> None:
        """Check the part at `where` against a JSON schema.

        Raises:
            DescriptionError: With one line for every mistake.
        """
        errors = _Validator(schema).iter_errors(self.node(*where))
        mistakes = sorted(errors, key=lambda e: list(map(str, e.path)))
        told = [str(self.error(_message(e), *where, *e.absolute_path)) for e in mistakes]
        lines = list(dict.fromkeys(told))  # each missing key is an error that names them all
        if len(lines) > MOST_MISTAKES:
            lines[MOST_MISTAKES:] = [f"{self.path}: {len(lines) - MOST_MISTAKES} more mistakes"]
        if lines:
            raise DescriptionError("\n".join(lines))

    def error(self, message: str, *where: Any) -> DescriptionError:
        """Return an error about the part at `where`, with file, line and path of keys."""
        line: int | None = None
        part: Any = self.root
        for key in where:
            try:
                place = part.lc  # of ruamel.yaml: line and column of keys and items
                position = place.value(key) if isinstance(part, Mapping) else place.item(key)
                line, part = position[0] + 1, part[key]
            except (AttributeError, KeyError, IndexError, TypeError):
                break
        place = f"{self.path}:{line}" if line is not None else str(self.path)
        keys = _cut(".".join(map(str, where))) or "document"
        return DescriptionError(f"{place}: {keys}: {message}")


def _message(error: Any) -> str:
    """Say in one line what the value was and what is allowed."""
    value = _shown(error.instance)
    limit = error.validator_value
    if error.validator == "additionalProperties" and error.schema.get("properties") is not None:
        allowed = list(error.schema["properties"])
        unknown = ", ".join(repr(str(k)) for k in error.instance if k not in allowed)
        return f"unknown key {_cut(unknown)}; allowed: {', '.join(allowed)}"
    if error.validator == "required":
        return f"missing key {', '.join(repr(k) for k in limit if k not in error.instance)}"
    if error.validator == "enum":
        return f"{value} is not one of: {', '.join(map(str, limit))}"
    if error.validator == "exclusiveMinimum":
        return f"{value} must be > {limit}"
    if error.validator == "minimum":
        return f"{value} must be >= {limit}"
    if error.validator == "maximum":
        return f"{value} must be <= {limit}"
    if error.validator == "maxProperties":
        return f"{len(error.instance)} entries; allowed: at most {limit}"
    if error.validator == "type":
        return f"{value} is not a {({'number': 'finite number'}).get(limit, limit)}"
    if error.validator == "oneOf" and "description" in error.schema:
        return f"{value} must be {error.schema['description']}"
    return _cut(str(error.message).replace(repr(error.instance), value))


def _shown(value: Any) -> str:
    """Return a value as it is told: not all of a long one."""
    return _cut(repr(value))


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}…"


def shared_files(package: str, folder: str, suffix: str) -> dict[str, Path]:
    """Return the files that a package ships, by their stem.

    Looks into installed workspaces (AMENT_PREFIX_PATH, then the prefix of this Python) and into the
    source tree; an earlier one hides a later one.
    """
    return {
        file.stem: file
        for share in reversed(list(_share_folders(package)))
        for file in sorted((share / folder).glob(f"*{suffix}"))
    }


def _share_folders(package: str) -> Iterator[Path]:
    prefixes = [*filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))]
    for prefix in (*prefixes, sys.prefix):
        yield Path(prefix, "share", package)
    source = {"leg_bringup": "config"}.get(package, package)
    yield Path(__file__).parents[2] / source
