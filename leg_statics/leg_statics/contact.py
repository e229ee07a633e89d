# SPDX-License-Identifier: Apache-2.0
"""Contacts: what a foot stands on and what it has to bear there."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arguments import require
from leg_kinematics.arrays import (
    FloatArray,
    as_array,
    as_non_negative,
    as_vectors,
    common_batch,
)
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.robot import Leg
from leg_statics.capacity.problem import (
    ANY_MOMENT,
    LOAD,
    MOMENT,
    MU,
    NORMAL,
    OF_CONTACT,
    VERTICAL,
    check_directions,
    check_normals,
)
from leg_statics.weight import level_gravity


class Contact(NamedTuple):
    """What a foot stands on and what it has to bear.

    Every field broadcasts with the candidates. A contact of plain numbers and tuples is quickest
    if it is used again.

    Attributes:
        friction: Friction coefficient mu of the ground (...,), 0 to infinity; on a slope, infinity
            stands for 1e8.
        normal: Normal of the ground in the leg frame, out of it and upwards, of any length
            (..., 3); None = level.
        load: Required component of the ground's force in the direction of the load (...,) [N].
        moment: Moment that the ground applies to the foot (..., 3) [N.m]; zero on hard ground.
        any_direction_moment: Magnitude of a moment of unknown direction, across that of the load,
            that must be borne on top (...,) [N.m]: the worst case over directions, equation (27).
        bias_efforts: Efforts that the actuators exert anyway (..., n) or one for all, on top of
            those that hold the leg's own weight if its masses are known [N.m or N].
        gravity: Acceleration of gravity in the leg frame (..., 3) [m/s²]; None = that of a level
            body.
        load_direction: Direction in which loads count, of any length (..., 3); None = against
            gravity.
    """

    friction: ArrayLike
    normal: ArrayLike | None = None
    load: ArrayLike = 0.0
    moment: ArrayLike = (0.0, 0.0, 0.0)
    any_direction_moment: ArrayLike = 0.0
    bias_efforts: ArrayLike = 0.0
    gravity: ArrayLike | None = None
    load_direction: ArrayLike | None = None

    def under(self, gravity: ArrayLike) -> Contact:
        """Return the same with the directions that are not given, under a given gravity."""
        down = as_array("gravity", gravity if self.gravity is None else self.gravity, 3)
        up = np.negative(down)
        return self._replace(
            normal=up if self.normal is None else self.normal,
            gravity=down,
            load_direction=up if self.load_direction is None else self.load_direction,
        )

    def spread(self) -> Contact:
        """Return the same for several points of each candidate, along a last axis (..., m)."""
        return self._replace(
            friction=np.expand_dims(self.friction, -1),
            normal=_spread(self.normal),
            load=np.expand_dims(self.load, -1),
            moment=np.expand_dims(self.moment, -2),
            any_direction_moment=np.expand_dims(self.any_direction_moment, -1),
            bias_efforts=np.expand_dims(self.bias_efforts, -2)
            if np.ndim(self.bias_efforts)
            else self.bias_efforts,
            gravity=_spread(self.gravity),
            load_direction=_spread(self.load_direction),
        )

    def turned(self, turn: Callable[[ArrayLike], FloatArray]) -> Contact:
        """Return the same in another frame, into which `turn` takes vectors (..., 3)."""
        normal, gravity, direction = (
            None if vectors is None else turn(vectors)
            for vectors in (self.normal, self.gravity, self.load_direction)
        )
        return self._replace(
            normal=normal, moment=turn(self.moment), gravity=gravity, load_direction=direction
        )


def _spread(vectors: ArrayLike | None) -> FloatArray | None:
    """Return vectors (..., 3), if there are any, with an axis more before the last."""
    return None if vectors is None else np.expand_dims(vectors, -2)


def contact_rows(contact: Contact, leg: Leg) -> FloatArray:
    """Return all that a contact says of a point in one row (..., 12 + n)."""
    gravity, n = level_gravity(leg), len(leg.effort_limits)
    try:
        return _known_row(contact, gravity, n)
    except TypeError:  # arrays have no hash
        return _joined(_arrays(contact, gravity, n), n)


@lru_cache
def _known_row(contact: Contact, gravity: tuple[float, ...], n: int) -> FloatArray:
    """Return the row of a contact that cannot change, kept for the next call."""
    return _joined(_arrays(contact, gravity, n), n)


def _arrays(contact: Contact, gravity: ArrayLike, n: int) -> Contact:
    """Return a contact with all directions whose fields are arrays."""
    require("contact", contact, Contact)
    contact = contact.under(gravity)
    return Contact(
        as_array("friction", contact.friction),
        as_array("normal", cast(ArrayLike, contact.normal), 3),
        as_array("load", contact.load),
        as_array("moment", contact.moment, 3),
        as_array("any_direction_moment", contact.any_direction_moment),
        as_vectors("bias_efforts", contact.bias_efforts, n),
        as_array("gravity", cast(ArrayLike, contact.gravity), 3),
        as_array("load_direction", cast(ArrayLike, contact.load_direction), 3),
    )


def leading_shapes(contact: Contact, leg: Leg) -> dict[str, tuple[int, ...]]:
    """Return the leading axes of the fields of a contact, by name."""
    return _leading_shapes(_arrays(contact, level_gravity(leg), len(leg.effort_limits)))


def _leading_shapes(contact: Any) -> dict[str, tuple[int, ...]]:
    """Return the same of a contact of arrays."""
    return {
        "friction": contact.friction.shape,
        "normal": contact.normal.shape[:-1],
        "load": contact.load.shape,
        "moment": contact.moment.shape[:-1],
        "any_direction_moment": contact.any_direction_moment.shape,
        "bias_efforts": contact.bias_efforts.shape[:-1],
        "gravity": contact.gravity.shape[:-1],
        "load_direction": contact.load_direction.shape[:-1],
    }


def _joined(contact: Contact, n: int) -> FloatArray:
    """Return the fields of a contact of arrays beside each other."""
    batch = common_batch(_leading_shapes(contact).values())
    row = np.empty((OF_CONTACT + n, *batch[::-1])).T  # each field in one piece of memory
    row[..., MU] = contact.friction
    row[..., NORMAL:VERTICAL] = contact.normal
    row[..., VERTICAL:LOAD] = contact.load_direction
    row[..., LOAD] = contact.load
    row[..., MOMENT:ANY_MOMENT] = contact.moment
    row[..., ANY_MOMENT] = contact.any_direction_moment
    row[..., OF_CONTACT:] = contact.bias_efforts
    return row


def check_contact(contact: Contact, leg: Leg) -> None:
    """Raise a ValueRangeError for a value that is out of range."""
    contact = _arrays(contact, level_gravity(leg), len(leg.effort_limits))
    check_directions("gravity", np.asarray(contact.gravity))
    check_directions("load_direction", np.asarray(contact.load_direction))
    check_normals(np.asarray(contact.normal), np.asarray(contact.load_direction))
    for name in ("friction", "load", "any_direction_moment"):
        as_non_negative(name, getattr(contact, name))
    for name in ("load", "moment", "any_direction_moment", "bias_efforts", "gravity"):
        array = np.asarray(getattr(contact, name))
        if not np.isfinite(array).all():
            raise ValueRangeError(
                f"{name} must be finite, got {array[~np.isfinite(array)].flat[0]}"
            )
