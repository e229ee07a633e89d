# SPDX-License-Identifier: Apache-2.0
"""Scalar functions that several mechanisms use in their kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence

from leg_kinematics.kernels.kernel import inlined, scalar

# A posture that stands exactly on a limit, computed with rounding, is within the limit.
LIMIT_TOLERANCE = 1e-9  # [rad or m]


@inlined
def arctan2(y: float, x: float) -> float:
    """Return the angle of (x, y) like `math.atan2`, within 3e-16 rad and three times as quickly.

    The rational approximation is that of Cephes (S. L. Moshier); NaN for (0, 0).
    """
    small, large = min(abs(y), abs(x)), max(abs(y), abs(x))
    steep = small > 0.66 * large  # then from 45°; chosen without a branch, which would mispredict
    t = (small - large if steep else small) / (small + large if steep else large)
    z = t * t
    p = -8.750608600031904122785e-1 * z - 1.615753718733365076637e1
    p = (p * z - 7.500855792314704667340e1) * z - 1.228866684490136173410e2
    p = p * z - 6.485021904942025371773e1
    q = (z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2
    q = (q * z + 4.328810604912902668951e2) * z + 4.853903996359136964868e2
    q = q * z + 1.945506571482613964425e2
    angle = (0.25 * math.pi if steep else 0.0) + (t + t * z * p / q)
    angle = 0.5 * math.pi - angle if abs(y) > abs(x) else angle
    angle = math.pi - angle if x < 0.0 else angle
    return math.copysign(angle, y)


NEAREST = 6755399441055744.0  # added and taken away again it rounds to the nearest integer
LARGEST_ANGLE = 1e4  # [rad], up to which `cosine_sine` is exact


@scalar
def direction(angle: float) -> tuple[float, float]:
    """Return (cos, sin) of any angle; one of many thousand turns stays on the circle."""
    return math.cos(angle), math.sin(angle)


@inlined
def cosine_sine(angle: float) -> tuple[float, float]:
    """Return (cos, sin) like `math`, within 2e-16 up to 1e4 rad, and quickly in blocks of points.

    Polynomials up to 45° are those of Cephes (S. L. Moshier); whole quarter turns are taken away
    before, in three parts of 90° with bits to spare.
    """
    quarters = (angle * (2.0 / math.pi) + NEAREST) - NEAREST
    x = angle - quarters * 1.57079625129699707031
    x = (x - quarters * 7.54978941586159635335e-8) - quarters * 5.39030285815811905290e-15
    z = x * x
    p = (1.58962301576546568060e-10 * z - 2.50507477628578072866e-8) * z
    p = ((p + 2.75573136213857245213e-6) * z - 1.98412698295895385996e-4) * z
    sine = x + x * z * ((p + 8.33333333332211858878e-3) * z - 1.66666666666666307295e-1)
    p = (-1.13585365213876817300e-11 * z + 2.08757008419747316778e-9) * z
    p = ((p - 2.75573141792967388112e-7) * z + 2.48015872888517045348e-5) * z
    p = (p - 1.38888888888730564116e-3) * z + 4.16666666666665929218e-2
    cosine = 1.0 - 0.5 * z + z * z * p
    quarter = quarters - 4.0 * ((0.25 * quarters + NEAREST) - NEAREST)  # -2, -1, 0, 1 or 2
    odd = abs(quarter) == 1.0
    c, s = sine if odd else cosine, cosine if odd else sine
    c = -c if (quarter == 1.0) | (abs(quarter) == 2.0) else c
    return c, -s if (quarter < 0.0) | (quarter == 2.0) else s


@inlined
def wrapped(angle: float) -> float:
    """Return the angle in [-pi, pi) that differs by whole turns."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@scalar
def included_angle(first: float, second: float, opposite: float) -> float:
    """Return the angle between two sides of a triangle; NaN if the three do not close."""
    cosine = (first * first + second * second - opposite * opposite) / (2.0 * first * second)
    return math.acos(cosine) if -1.0 <= cosine <= 1.0 else math.nan


@scalar
def swing_plane(across: float, z: float) -> tuple[float, float]:
    """Return the swing and zeta < 0 that put (zeta sin swing, zeta cos swing) at (across, z).

    This is the coordinate pair of legs whose planar mechanism swings sideways as a whole.
    """
    return math.atan2(-across, -z), -math.hypot(across, z)


@inlined
def within(value: float, limits: Sequence[float]) -> bool:
    """Tell whether lower <= value <= upper, up to rounding."""
    return (limits[0] - LIMIT_TOLERANCE <= value) & (value <= limits[1] + LIMIT_TOLERANCE)
