# SPDX-License-Identifier: Apache-2.0
"""The weight of a leg's own links: efforts that hold it, a part of the bias of every load problem.

It counts wherever the masses of a leg are known, and nowhere else: the papers give none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_matching
from leg_kinematics.mechanism import Mechanism, Posture
from leg_kinematics.robot import Leg
from leg_kinematics.status import Status

GRAVITY = 9.80665  # [m/s²]
LEVEL_GRAVITY = (0.0, 0.0, -GRAVITY)  # in the frame of a level body


def level_gravity(leg: Leg) -> tuple[float, float, float]:
    """Return gravity in the frame of a leg whose body is level [m/s²]."""
    return gravity_below(leg.mount.vertical)


def gravity_below(vertical: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return gravity where a unit vector points upwards [m/s²]."""
    x, y, z = vertical
    return -GRAVITY * x, -GRAVITY * y, -GRAVITY * z


def weight_efforts(mechanism: Mechanism, posture: Posture, gravity: ArrayLike) -> FloatArray:
    """Return the efforts that hold a leg's own links (..., n) [N.m or N].

    They are zero if the masses are not known (`Mechanism.has_masses`), and where a posture is not
    OK.

    Args:
        mechanism: The leg's mechanism.
        posture: Its postures (...).
        gravity: Acceleration of gravity in the leg frame (..., 3) [m/s²].

    Raises:
        ShapeError: If gravity does not fit.
    """
    vector = as_matching("gravity", gravity, (3,), np.shape(posture.status))
    if not mechanism.has_masses:
        return np.zeros(np.shape(posture.joint_positions))
    efforts = mechanism.holding_efforts(posture, vector)
    return np.where(np.asarray(posture.status == Status.OK)[..., None], efforts, 0.0)
