"""Scalar functions that several mechanisms use in their kernels."""

from __future__ import annotations

import math

from leg_kinematics.arrays import FloatArray
from leg_kinematics.kernel import scalar

# A posture that stands exactly on a limit, computed with rounding, is within the limit.
LIMIT_TOLERANCE = 1e-9  # [rad or m]


@scalar
def wrapped(angle: float) -> float:
    """Return the angle in [-pi, pi) that differs by whole turns."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@scalar
def included_angle(first: float, second: float, opposite: float) -> float:
    """Return the angle between two sides of a triangle; NaN if the three do not close."""
    cosine = (first * first + second * second - opposite * opposite) / (2.0 * first * second)
    return math.acos(cosine) if -1.0 <= cosine <= 1.0 else math.nan


@scalar
def swing_plane(x: float, z: float) -> tuple[float, float]:
    """Return the swing about y and zeta < 0 that put (zeta sin swing, y, zeta cos swing) at x, z.

    This is the coordinate pair of legs whose planar mechanism swings sideways as a whole.
    """
    return math.atan2(-x, -z), -math.hypot(x, z)


@scalar
def within(value: float, limits: FloatArray) -> bool:
    """Tell whether lower <= value <= upper, up to rounding."""
    return limits[0] - LIMIT_TOLERANCE <= value <= limits[1] + LIMIT_TOLERANCE
