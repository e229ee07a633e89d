# SPDX-License-Identifier: Apache-2.0
"""Checks of arguments that are no arrays: numbers, names, and objects of this suite."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from leg_kinematics.arrays import as_array
from leg_kinematics.errors import KindError, ShapeError, ValueRangeError


def require(name: str, value: object, kind: type) -> None:
    """Raise a KindError if an argument is not of a kind.

    Args:
        name: Name of the argument.
        value: The argument.
        kind: Its class.
    """
    if not isinstance(value, kind):
        raise KindError(f"{name} must be a {kind.__name__}, got {type(value).__name__}")


def as_number(name: str, value: Any) -> float:
    """Return a finite number.

    Raises:
        ShapeError: If it is not one number.
        ValueRangeError: If it is not finite.
    """
    array = as_array(name, value)
    if array.ndim:
        raise ShapeError(f"{name} must be one number, got shape {array.shape}")
    number = float(array)
    if not math.isfinite(number):
        raise ValueRangeError(f"{name} must be finite, got {number}")
    return number


def as_count(name: str, value: Any, most: int) -> int:
    """Return a whole number from 1 to `most`.

    Raises:
        ShapeError: If it is not one number.
        ValueRangeError: If it is not whole or out of range.
    """
    number = as_number(name, value)
    if not number.is_integer() or not 1 <= number <= most:
        raise ValueRangeError(f"{name} must be a whole number >= 1 and <= {most}, got {number:g}")
    return int(number)


def as_names(name: str, value: Iterable[str]) -> tuple[str, ...]:
    """Return names.

    Raises:
        KindError: If they are no sequence of texts, or one text by itself.
    """
    names: tuple[Any, ...] = ()
    try:
        names = tuple(value)
    except TypeError:
        pass
    else:
        if not isinstance(value, str) and all(isinstance(each, str) for each in names):
            return names
    raise KindError(f"{name} must be a sequence of names, got {value!r:.100}")
