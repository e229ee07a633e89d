# SPDX-License-Identifier: Apache-2.0
"""What a foot stands on, as a gait planner says it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from leg_msgs.msg import Ground as GroundMessage
from leg_msgs_py.arrays import to_field
from leg_msgs_py.errors import InvalidInputError
from numpy.typing import ArrayLike


class Ground(NamedTuple):
    """A ground, or one for each candidate (...,) of a question that allows for that.

    Attributes:
        friction: Name of a ground that the nodes know, such as "cement", or friction coefficients
            (...,).
        normal: Normal of the ground in the frame of the request (..., 3), out of it and upwards, of
            any length; None = level, across gravity.
        high_end: Whether a named ground's friction is the high end of its range, not the low one.
    """

    friction: str | ArrayLike
    normal: ArrayLike | None = None
    high_end: bool = False

    def to_message(self, batch: tuple[int, ...] = ()) -> Any:
        """Return the ground as a `leg_msgs/Ground`.

        Args:
            batch: Leading axes of the candidates, with which arrays broadcast.

        Raises:
            InvalidInputError: If the normal is no vector, or the friction neither name nor number,
                or they do not fit the candidates.
        """
        message = GroundMessage(use_high_end=self.high_end)
        try:
            if isinstance(self.friction, str):
                message.name = self.friction
            else:
                message.friction_coefficients = one_or_each(self.friction, batch)
            if self.normal is not None:
                message.normals = one_or_each(self.normal, batch, 3)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"ground: {error}") from None
        if isinstance(self.friction, str) and not self.friction:
            raise InvalidInputError("ground: got ''; give a name or a friction coefficient")
        return message


def one_or_each(values: ArrayLike, batch: tuple[int, ...], *trailing: int) -> Any:
    """Return values for all points as a field of one row, and others as one with a row a point.

    Args:
        values: Numbers (..., *trailing).
        batch: Leading axes of the points.
        *trailing: Axes of one value.

    Raises:
        ValueError: If they do not broadcast with the points.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.shape == trailing:
        return to_field(array)
    if array.shape[array.ndim - len(trailing) :] != trailing:
        wanted = ", ".join(["...", *map(str, trailing)])
        raise ValueError(f"must have shape ({wanted}), got {array.shape}")
    return to_field(np.broadcast_to(array, (*batch, *trailing)))


def ground_message(ground: Ground | str | ArrayLike | None, batch: tuple[int, ...] = ()) -> Any:
    """Return a ground, its name, its friction coefficients or None as a `leg_msgs/Ground`."""
    if ground is None:
        return GroundMessage()
    return (ground if isinstance(ground, Ground) else Ground(ground)).to_message(batch)
