# SPDX-License-Identifier: Apache-2.0
"""Force indices of planar mechanisms with two actuators, by the extreme values of the foot force.

With v = J q' the foot exerts F = N Q by the actuator efforts Q, N = J^-T (paper 001, eq. 22). Over
all unit vectors Q its length has the extreme values sqrt(eig NᵀN) (23)-(26), that is the inverse
singular values of J.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.kernels.kernel import kernel


class ForceTransmission(NamedTuple):
    """Force indices of every point.

    Attributes:
        largest_force: K_F, the longest foot force of unit efforts (...) [1, or 1/m for torques];
            infinite where J is singular.
        imbalance: K_J = 1 - shortest / longest foot force (...) [1]: 0 where all directions are
            alike, 1 where J is singular.
        driving_vector: Unit efforts that exert the longest force, signed so that the foot presses
            down (second component of F <= 0) (..., 2) [1].
    """

    largest_force: FloatArray
    imbalance: FloatArray
    driving_vector: FloatArray


def force_transmission(jacobian: ArrayLike) -> ForceTransmission:
    """Return the force indices K_F (27) and K_J (28) and the driving vector of (25).

    Args:
        jacobian: J of the foot's planar velocity (horizontal, up), columns by actuator (..., 2, 2).

    Returns:
        The indices; NaN where J is not finite or zero.
    """
    return ForceTransmission(*_force_transmission(as_array("jacobian", jacobian, 2, 2)))


@kernel("(i,i)->(),(),(i)", "f8[:,:], f8[:], f8[:], f8[:]")
def _force_transmission(j, largest_force, imbalance, driving_vector):  # type: ignore[no-untyped-def]
    """Singular values of J in closed form; the smallest belongs to the longest force."""
    half_trace = 0.5 * (j[0, 0] ** 2 + j[0, 1] ** 2 + j[1, 0] ** 2 + j[1, 1] ** 2)
    half_difference = 0.5 * (j[0, 0] ** 2 + j[1, 0] ** 2 - j[0, 1] ** 2 - j[1, 1] ** 2)
    product = j[0, 0] * j[0, 1] + j[1, 0] * j[1, 1]
    det = j[0, 0] * j[1, 1] - j[0, 1] * j[1, 0]
    largest_square = half_trace + math.hypot(half_difference, product)
    if not 0.0 < largest_square < math.inf:
        largest_force[0] = imbalance[0] = math.nan
        driving_vector[:] = math.nan
        return
    largest_force[0] = math.sqrt(largest_square) / abs(det)
    imbalance[0] = 1.0 - abs(det) / largest_square
    angle = 0.5 * math.atan2(product, half_difference) + 0.5 * math.pi
    q1, q2 = math.cos(angle), math.sin(angle)
    up = (j[0, 0] * q2 - j[0, 1] * q1) * math.copysign(1.0, det)
    sign = -1.0 if up > 0.0 else 1.0
    driving_vector[0], driving_vector[1] = sign * q1, sign * q2
