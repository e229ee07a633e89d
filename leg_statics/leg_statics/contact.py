# SPDX-License-Identifier: Apache-2.0
"""Contacts: what a foot stands on and what it has to bear there."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

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
from leg_statics.capacity.problem import (
    ANY_MOMENT,
    LOAD,
    MOMENT,
    MU,
    NORMAL,
    OF_CONTACT,
    check_normals,
)


class Contact(NamedTuple):
    """What a foot stands on and what it has to bear.

    Every field broadcasts with the candidates. A contact of plain numbers and tuples is quickest
    if it is used again.

    Attributes:
        friction: Friction coefficient mu of the ground (...,), 0 to infinity.
        normal: Normal of the ground in the leg frame (..., 3), of any length.
        load: Required normal load (...,) [N].
        moment: Moment that the ground applies to the foot (..., 3) [N.m]; zero on hard ground.
        any_direction_moment: Magnitude of a horizontal moment of unknown direction that must be
            borne on top (...,) [N.m]: the worst case over directions, equation (27).
        bias_efforts: Efforts that the actuators exert anyway (..., n) or one for all, on top of
            those that hold the leg's own weight if its masses are known [N.m or N].
        gravity: Acceleration of gravity in the leg frame (..., 3) [m/s²]; None for that of a level
            body.
    """

    friction: ArrayLike
    normal: ArrayLike = (0.0, 0.0, 1.0)
    load: ArrayLike = 0.0
    moment: ArrayLike = (0.0, 0.0, 0.0)
    any_direction_moment: ArrayLike = 0.0
    bias_efforts: ArrayLike = 0.0
    gravity: ArrayLike | None = None


def contact_rows(contact: Contact, n: int) -> FloatArray:
    """Return all that a contact says of a point in one row (..., 9 + n)."""
    try:
        return _known_row(contact, n)
    except TypeError:  # arrays have no hash
        return _joined(_arrays(contact, n), n)


@lru_cache
def _known_row(contact: Contact, n: int) -> FloatArray:
    """Return the row of a contact that cannot change, kept for the next call."""
    return _joined(_arrays(contact, n), n)


def _arrays(contact: Contact, n: int) -> Contact:
    """Return a contact whose fields are arrays."""
    require("contact", contact, Contact)
    return Contact(
        as_array("friction", contact.friction),
        as_array("normal", contact.normal, 3),
        as_array("load", contact.load),
        as_array("moment", contact.moment, 3),
        as_array("any_direction_moment", contact.any_direction_moment),
        as_vectors("bias_efforts", contact.bias_efforts, n),
        as_array("gravity", 0.0 if contact.gravity is None else contact.gravity),
    )


def leading_shapes(contact: Contact, n: int) -> dict[str, tuple[int, ...]]:
    """Return the leading axes of the fields of a contact, by name."""
    return _leading_shapes(_arrays(contact, n))


def _leading_shapes(contact: Any) -> dict[str, tuple[int, ...]]:
    """Return the same of a contact of arrays."""
    return {
        "friction": contact.friction.shape,
        "normal": contact.normal.shape[:-1],
        "load": contact.load.shape,
        "moment": contact.moment.shape[:-1],
        "any_direction_moment": contact.any_direction_moment.shape,
        "bias_efforts": contact.bias_efforts.shape[:-1],
    }


def _joined(contact: Contact, n: int) -> FloatArray:
    """Return the fields of a contact of arrays beside each other."""
    batch = common_batch(_leading_shapes(contact).values())
    row = np.empty((OF_CONTACT + n, *batch[::-1])).T  # each field in one piece of memory
    row[..., MU] = contact.friction
    row[..., NORMAL:LOAD] = contact.normal
    row[..., LOAD] = contact.load
    row[..., MOMENT:ANY_MOMENT] = contact.moment
    row[..., ANY_MOMENT] = contact.any_direction_moment
    row[..., OF_CONTACT:] = contact.bias_efforts
    return row


def check_contact(contact: Contact, n: int) -> None:
    """Raise a ValueRangeError for a value that is out of range."""
    contact = _arrays(contact, n)
    check_normals("normal", np.asarray(contact.normal))
    for name in ("friction", "load", "any_direction_moment"):
        as_non_negative(name, getattr(contact, name))
    for name in ("load", "moment", "any_direction_moment", "bias_efforts", "gravity"):
        array = np.asarray(getattr(contact, name))
        if not np.isfinite(array).all():
            raise ValueRangeError(
                f"{name} must be finite, got {array[~np.isfinite(array)].flat[0]}"
            )
