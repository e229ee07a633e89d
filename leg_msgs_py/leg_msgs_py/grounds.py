# SPDX-License-Identifier: Apache-2.0
"""What a foot stands on, as a gait planner says it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from leg_msgs.msg import Ground as GroundMessage
from leg_msgs_py.errors import InvalidInputError
from numpy.typing import ArrayLike


class Ground(NamedTuple):
    """A ground.

    Attributes:
        friction: Name of a ground that the nodes know, such as "cement", or a friction coefficient.
        normal: Normal of the ground in the frame of the request (3,), out of it and upwards, of any
            length; None = level, the z axis of the robot's base frame.
        high_end: Whether a named ground's friction is the high end of its range, not the low one.
    """

    friction: str | float
    normal: ArrayLike | None = None
    high_end: bool = False

    def to_message(self) -> Any:
        """Return the ground as a `leg_msgs/Ground`.

        Raises:
            InvalidInputError: If the normal is no vector, or the friction neither name nor number.
        """
        message = GroundMessage(use_high_end=self.high_end)
        try:
            if isinstance(self.friction, str):
                message.name = self.friction
            else:
                message.friction_coefficient = float(self.friction)
            if self.normal is not None:
                message.normal = np.asarray(self.normal, dtype=np.float64).reshape(3)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"ground: {error}") from None
        if self.friction == "":
            raise InvalidInputError("ground: got ''; give a name or a friction coefficient")
        return message


def ground_message(ground: Ground | str | float | None) -> Any:
    """Return a ground, its name, its friction coefficient or None as a `leg_msgs/Ground`."""
    if ground is None:
        return GroundMessage()
    return (ground if isinstance(ground, Ground) else Ground(ground)).to_message()
