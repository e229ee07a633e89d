# SPDX-License-Identifier: Apache-2.0
"""What callers give, as arrays and numbers of requests; and how many values come back for it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from leg_msgs_py.arrays import FloatArray, StatusArray, from_field
from leg_msgs_py.errors import InvalidInputError, TooLargeError
from leg_msgs_py.grounds import one_or_each
from numpy.typing import ArrayLike


class Points(NamedTuple):
    """Points that a request asks about.

    Attributes:
        field: Name of the argument, for messages.
        values: The points (..., k).
        batch: Their leading axes.
    """

    field: str
    values: FloatArray
    batch: tuple[int, ...]

    def check_count(self, limit: int) -> None:
        """Raise a TooLargeError if they are more than `limit`."""
        if (count := math.prod(self.batch)) > limit:
            raise TooLargeError(
                f"{self.field}: {count} points; allowed: at most {limit} at once "
                "(max_points of the client, and parameter max_points of the nodes)"
            )

    def status(self, response: Any, modes: tuple[int, ...] = ()) -> StatusArray:
        """Return the status of every point, checked to be as many as were asked about.

        Args:
            response: A response with the field `status`.
            modes: Axes before those of the points.
        """
        shape = (*modes, *self.batch)
        if len(response.status) != math.prod(shape):
            raise InvalidInputError(
                f"{self.field}: the last axis must be the leg's coordinates, got shape "
                f"{self.values.shape}"
            )
        return from_field(response.status, shape, np.uint8)


def numbers(field: str, values: ArrayLike) -> FloatArray:
    """Return numbers of any shape.

    Raises:
        InvalidInputError: If they are no array of numbers.
    """
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{field} must be an array of numbers: {error}") from None


def points(field: str, values: ArrayLike) -> Points:
    """Return points (..., k).

    Raises:
        InvalidInputError: If they are no array of numbers, or a single number.
    """
    array = numbers(field, values)
    if array.ndim == 0:
        raise InvalidInputError(f"{field} must have shape (..., k), got a single number")
    # (0,) are no points at all, not one point of no coordinates
    return Points(field, array, (0,) if array.shape == (0,) else array.shape[:-1])


def number(field: str, value: Any) -> float:
    """Return a number.

    Raises:
        InvalidInputError: If it is none.
    """
    try:
        return float(value)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{field} must be a number: {error}") from None


def vector(field: str, value: ArrayLike) -> FloatArray:
    """Return one vector (3,).

    Raises:
        InvalidInputError: If it is none.
    """
    array = numbers(field, value)
    if array.shape != (3,):
        raise InvalidInputError(f"{field} must have shape (3,), got {array.shape}")
    return array


def rows(field: str, values: ArrayLike, batch: tuple[int, ...], *trailing: int) -> Any:
    """Return a field with one value for all points, or one for each.

    Raises:
        InvalidInputError: If the values do not fit the points.
    """
    try:
        return one_or_each(numbers(field, values), batch, *trailing)
    except ValueError as error:
        raise InvalidInputError(f"{field}: {error}") from None


def vectors(field: str, values: ArrayLike, batch: tuple[int, ...]) -> FloatArray:
    """Return one vector (3,) for all points, or one for each (..., 3).

    Raises:
        InvalidInputError: If they do not fit the points.
    """
    array = points(field, values).values
    try:
        return array if array.ndim == 1 else np.broadcast_to(array, (*batch, 3))
    except ValueError:
        raise InvalidInputError(
            f"{field} must have shape (3,) or {(*batch, 3)}, got {array.shape}"
        ) from None
