"""YAML documents whose mistakes are all told with file, line, key, value and what is allowed."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any

import jsonschema
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from leg_kinematics.errors import DescriptionError

NAME = {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]*$"}
NUMBER = {"type": "number"}
PAIR = {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2}
VECTOR = {"type": "array", "items": NUMBER, "minItems": 3, "maxItems": 3}

# JSON Schema knows no NaN or infinity; in these documents a number is a finite number.
_Validator: Any = jsonschema.validators.extend(  # type: ignore[no-untyped-call]
    jsonschema.Draft202012Validator,
    type_checker=jsonschema.Draft202012Validator.TYPE_CHECKER.redefine(
        "number",
        lambda _, x: isinstance(x, Real) and not isinstance(x, bool) and math.isfinite(x),
    ),
)


def mapping_schema(properties: Mapping[str, Any], required: Sequence[str]) -> dict[str, Any]:
    """Schema of a mapping with these keys and no others."""
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(required),
        "additionalProperties": False,
    }


def named_schema(schema: Mapping[str, Any]) -> dict[str, Any]:
    """Schema of a non-empty mapping from names to `schema`."""
    return {
        "type": "object",
        "minProperties": 1,
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
            DescriptionError: If it cannot be read or parsed.
        """
        self.path = path
        try:
            self.text = path.read_text(encoding="utf-8") if text is None else text
            self.root: Any = YAML(typ="rt").load(self.text)
        except MarkedYAMLError as error:
            mark = error.problem_mark
            where = f"{path}:{mark.line + 1}" if mark else str(path)
            raise DescriptionError(f"{where}: {error.problem or error.context}") from None
        except OSError as error:
            raise DescriptionError(f"{path}: {error.strerror}") from None
        except (YAMLError, UnicodeDecodeError, RecursionError) as error:
            raise DescriptionError(f"{path}: {error}") from None

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
        lines = [
            str(self.error(_message(e), *where, *e.absolute_path))
            for e in sorted(errors, key=lambda e: list(map(str, e.path)))
        ]
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
        return DescriptionError(f"{place}: {'.'.join(map(str, where)) or 'document'}: {message}")


def _message(error: Any) -> str:
    """Say in one line what the value was and what is allowed."""
    value = error.instance
    if error.validator == "additionalProperties" and error.schema.get("properties") is not None:
        allowed = list(error.schema["properties"])
        unknown = ", ".join(repr(str(k)) for k in value if k not in allowed)
        return f"unknown key {unknown}; allowed: {', '.join(allowed)}"
    if error.validator == "required":
        missing = ", ".join(repr(k) for k in error.validator_value if k not in value)
        return f"missing key {missing}"
    if error.validator == "enum":
        return f"{value!r} is not one of: {', '.join(map(str, error.validator_value))}"
    if error.validator == "exclusiveMinimum":
        return f"{value!r} must be > {error.validator_value}"
    if error.validator == "minimum":
        return f"{value!r} must be >= {error.validator_value}"
    if error.validator == "type":
        wanted = {"number": "finite number"}.get(error.validator_value, error.validator_value)
        return f"{value!r} is not a {wanted}"
    if error.validator == "oneOf" and "description" in error.schema:
        return f"{value!r} must be {error.schema['description']}"
    return str(error.message)


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
