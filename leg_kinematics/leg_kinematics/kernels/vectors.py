# SPDX-License-Identifier: Apache-2.0
"""Vectors of three numbers for use inside kernels.

They are tuples, or rows of arrays, and no function has a branch: kernels take them in and compute
several points with one instruction.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math

from leg_kinematics.kernels.kernel import inlined


@inlined
def inner(a, b):
    """Return a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def difference(a, b):
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def length(a):
    """Return the length of a vector, without overflow."""
    return math.hypot(math.hypot(a[0], a[1]), a[2])


@inlined
def unit(vector):
    """Return a vector of length 1 along another; NaN if that has no direction."""
    largest = max(abs(vector[0]), abs(vector[1]), abs(vector[2]))
    x, y, z = vector[0] / largest, vector[1] / largest, vector[2] / largest
    per_length = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * per_length, y * per_length, z * per_length


@inlined
def tangents(normal):
    """Return two unit vectors that complete `normal` to right-handed axes (Duff et al. 2017).

    For the normal (0, 0, 1) they are (1, 0, 0) and (0, 1, 0).
    """
    nx, ny, nz = normal[0], normal[1], normal[2]
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return (1.0 + sign * nx * nx * a, sign * b, -sign * nx), (b, sign + ny * ny * a, -ny)
