# SPDX-License-Identifier: Apache-2.0
"""Compare messages with those expected, within tolerances, and tell readably where they differ.

    assert_same(outputs, expected, {"legs.load_capacity": Tolerance(relative=1e-9)})

Both are mappings from topics to messages. A field is named by its path, without the indices of
arrays: `legs.load_capacity` is that of all legs; a `*` stands for anything.
"""

from __future__ import annotations

import array
import itertools
from collections import Counter
from collections.abc import Collection, Hashable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

Messages = Mapping[str, Sequence[Any]]
SHOWN = 30  # differences listed by `report`


class Tolerance(NamedTuple):
    """How far a number may be off: |got - expected| <= absolute + relative * |expected|.

    Attributes:
        absolute: In the unit of the field.
        relative: Share of the expected value.
    """

    absolute: float = 0.0
    relative: float = 0.0


EXACT = Tolerance()


class Difference(NamedTuple):
    """One value that is not as expected.

    Attributes:
        topic: Topic of the message.
        message: Its number among the expected messages of the topic, or if it was not expected,
            among those that came; from 0.
        field: Path of the field, such as "legs[2].foot_position[0]"; "message" if a whole message
            is missing or too much, "order" if the messages came in another one.
        expected: Value expected.
        got: Value that came.
    """

    topic: str
    message: int
    field: str
    expected: Any
    got: Any

    @property
    def size(self) -> float | None:
        """Return got - expected; None if these are no numbers."""
        if isinstance(self.expected, Real) and isinstance(self.got, Real):
            return float(self.got) - float(self.expected)
        return None


def assert_same(
    got: Messages,
    expected: Messages,
    tolerances: Mapping[str, Tolerance] | None = None,
    ignore: Collection[str] = (),
) -> None:
    """Check that messages are as expected.

    Args:
        got: Messages by topic.
        expected: Messages by topic; other topics are not looked at.
        tolerances: Tolerances by pattern of the field's path; the first pattern that fits counts.
            Without one, numbers must be equal. NaN equals NaN.
        ignore: Patterns of fields that are not compared.

    Raises:
        AssertionError: With a table of the differences.
    """
    __tracebackhide__ = True
    if found := differences(got, expected, tolerances, ignore):
        raise AssertionError(report(found, sum(map(len, expected.values()))))


def differences(
    got: Messages,
    expected: Messages,
    tolerances: Mapping[str, Tolerance] | None = None,
    ignore: Collection[str] = (),
) -> list[Difference]:
    """Return where messages are not as expected; arguments as of `assert_same`.

    Messages that have a header are matched by its stamp, so that one that is missing is told as
    missing, and does not put the others out of step; messages with the same stamp, and those
    without a header, are matched by their order.
    """
    rules = _Rules(tolerances or {}, ignore)
    return [
        difference
        for topic, messages in expected.items()
        for difference in _topic_differences(topic, got.get(topic, ()), messages, rules)
    ]


def report(found: Sequence[Difference], compared: int) -> str:
    """Return differences as a table.

    Args:
        found: The differences.
        compared: How many messages were expected.
    """
    head = ("topic", "message", "field", "expected", "got", "difference")
    rows = [
        (d.topic, str(d.message), d.field, _shown(d.expected), _shown(d.got), _size(d))
        for d in found[:SHOWN]
    ]
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    table = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (head, *rows)
    ]
    messages = len({(d.topic, d.message) for d in found})
    title = f"{len(found)} differences, in {messages} of {compared} messages:"
    more = [f"... and {len(found) - SHOWN} more"] if len(found) > SHOWN else []
    return "\n".join([title, *table, *more])


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else repr(value)


def _size(difference: Difference) -> str:
    return "" if difference.size is None else f"{difference.size:.3g}"


# --------------------------------------------------------------------------- messages


def _topic_differences(
    topic: str, got: Sequence[Any], expected: Sequence[Any], rules: _Rules
) -> Iterator[Difference]:
    stamped = all(hasattr(message, "header") for message in (*got, *expected))
    came = {key: k for k, key in enumerate(_keys(got, stamped))}
    wanted = {key: k for k, key in enumerate(_keys(expected, stamped))}
    for key, k in wanted.items():
        if key not in came:
            yield Difference(topic, k, "message", _name(expected[k]), "nothing")
            continue
        pair = expected[k], got[came[key]]
        if type(pair[0]) is not type(pair[1]):
            yield Difference(topic, k, "message", *(type(each).__name__ for each in pair))
            continue
        for field, one, other in _field_differences(*pair, "", "", rules):
            yield Difference(topic, k, field, one, other)
    for key, k in came.items():
        if key not in wanted:
            yield Difference(topic, k, "message", "nothing", _name(got[k]))
    order = [wanted[key] for key in came if key in wanted]
    for before, after in itertools.pairwise(order):
        if after < before:
            yield Difference(topic, after, "order", f"before {before}", f"after {before}")


def _keys(messages: Sequence[Any], stamped: bool) -> Iterator[Hashable]:
    """Yield what tells messages of a topic apart: the stamp and the how-many-eth with it."""
    seen: Counter[Hashable] = Counter()
    for message in messages:
        stamp = (message.header.stamp.sec, message.header.stamp.nanosec) if stamped else None
        yield stamp, seen[stamp]
        seen[stamp] += 1


def _name(message: Any) -> str:
    if not hasattr(message, "header"):
        return "a message"
    return f"stamp {message.header.stamp.sec}.{message.header.stamp.nanosec:09}"


# --------------------------------------------------------------------------- fields


class _Rules:
    """Which fields are compared, and how exactly."""

    def __init__(self, tolerances: Mapping[str, Tolerance], ignore: Collection[str]) -> None:
        self._tolerances = tolerances
        self._ignore = ignore

    def ignores(self, path: str) -> bool:
        return any(fnmatchcase(path, pattern) for pattern in self._ignore)

    def tolerance(self, path: str) -> Tolerance:
        fitting = (t for pattern, t in self._tolerances.items() if fnmatchcase(path, pattern))
        return next(fitting, EXACT)


def _field_differences(
    expected: Any, got: Any, path: str, place: str, rules: _Rules
) -> Iterator[tuple[str, Any, Any]]:
    """Yield place, expected value and value that came, where they differ.

    Args:
        expected: Value of a field, or a whole message.
        got: What came instead.
        path: Names of the fields that lead to it.
        place: The same with the indices of arrays.
        rules: Which fields are compared, and how exactly.
    """
    if path and rules.ignores(path):
        return
    if hasattr(expected, "get_fields_and_field_types"):
        for name in expected.get_fields_and_field_types():
            below = (f"{path}.{name}".lstrip("."), f"{place}.{name}".lstrip("."))
            values = (getattr(expected, name), getattr(got, name))
            yield from _field_differences(*values, *below, rules)
    elif isinstance(expected, (array.array, np.ndarray, list, tuple)):
        if len(expected) != len(got):
            yield place, f"{len(expected)} values", f"{len(got)} values"
            return
        if isinstance(expected, array.array) and expected.tobytes() == got.tobytes():
            return  # pictures and clouds are large
        for k, pair in enumerate(zip(expected, got, strict=True)):
            yield from _field_differences(*pair, path, f"{place}[{k}]", rules)
    elif not _is_close(expected, got, rules.tolerance(path)):
        yield place, _plain(expected), _plain(got)


def _is_close(expected: Any, got: Any, tolerance: Tolerance) -> bool:
    if not isinstance(expected, Real) or not isinstance(got, Real):
        return bool(expected == got)
    one, other = float(expected), float(got)
    if expected == got or (one != one and other != other):
        return True
    return abs(other - one) <= tolerance.absolute + tolerance.relative * abs(one) < np.inf


def _plain(value: Any) -> Any:
    """Return a value without numpy's dress."""
    return value.item() if isinstance(value, np.generic) else value
