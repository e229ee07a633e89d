# SPDX-License-Identifier: Apache-2.0
"""Condition number of Jacobians, equation (3) of paper 000: ratio of the singular values."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.kernels.kernel import inlined, kernel, scalar


@scalar
def largest_eigenvalue(xx: float, yy: float, zz: float, xy: float, yz: float, zx: float) -> float:
    """Return the largest eigenvalue of a symmetric 3x3 matrix (trigonometric closed form)."""
    mean = (xx + yy + zz) / 3.0
    off = xy * xy + yz * yz + zx * zx
    dx, dy, dz = xx - mean, yy - mean, zz - mean
    p = math.sqrt((dx * dx + dy * dy + dz * dz + 2.0 * off) / 6.0)
    if p == 0.0:
        return mean
    determinant = (
        dx * (dy * dz - yz * yz) - xy * (xy * dz - yz * zx) + zx * (xy * yz - dy * zx)
    ) / (p * p * p)
    half = min(1.0, max(-1.0, 0.5 * determinant))
    return mean + 2.0 * p * math.cos(math.acos(half) / 3.0)


@scalar
def triangular_norm(xx: float, yx: float, yy: float, zx: float, zy: float, zz: float) -> float:
    """Return the 2-norm (largest singular value) of a lower triangular 3x3 matrix."""
    return math.sqrt(
        largest_eigenvalue(
            xx * xx,
            yx * yx + yy * yy,
            zx * zx + zy * zy + zz * zz,
            xx * yx,
            yx * zx + yy * zy,
            zx * xx,
        )
    )


@inlined
def row_factors(m: Sequence[Sequence[float]]) -> tuple[float, float, float, float, float, float]:
    """Return the lower triangle L of M = L Q with orthonormal Q (modified Gram-Schmidt).

    Rows are x, y, z: zz is the part of the z row that the x and y rows leave over, and so on.
    """
    xx = math.sqrt(m[0][0] ** 2 + m[0][1] ** 2 + m[0][2] ** 2)
    ax, bx, cx = m[0][0] / xx, m[0][1] / xx, m[0][2] / xx
    yx = ax * m[1][0] + bx * m[1][1] + cx * m[1][2]
    zx = ax * m[2][0] + bx * m[2][1] + cx * m[2][2]
    ay, by, cy = m[1][0] - yx * ax, m[1][1] - yx * bx, m[1][2] - yx * cx
    az, bz, cz = m[2][0] - zx * ax, m[2][1] - zx * bx, m[2][2] - zx * cx
    yy = math.sqrt(ay * ay + by * by + cy * cy)
    ay, by, cy = ay / yy, by / yy, cy / yy
    zy = ay * az + by * bz + cy * cz
    az, bz, cz = az - zy * ay, bz - zy * by, cz - zy * cy
    return xx, yx, yy, zx, zy, math.sqrt(az * az + bz * bz + cz * cz)


@scalar
def condition_of_point(matrix: FloatArray) -> float:
    """Return the condition number of a 3x3 matrix, for use inside other kernels."""
    for value in matrix.flat:
        if not math.isfinite(value):
            return math.nan
    # ||M|| ||M^-1||, both from the triangle: the smallest eigenvalue of M M^T has lost its digits.
    xx, yx, yy, zx, zy, zz = row_factors(matrix)
    inverse_norm = triangular_norm(
        1.0 / xx,
        -yx / (xx * yy),
        1.0 / yy,
        (yx * zy - zx * yy) / (xx * yy * zz),
        -zy / (yy * zz),
        1.0 / zz,
    )
    product = triangular_norm(xx, yx, yy, zx, zy, zz) * inverse_norm
    return product if math.isfinite(product) else math.inf


@kernel("(n,n)->()", "f8[:,:], f8[:]")
def _condition_number(matrix, result):
    result[0] = condition_of_point(matrix)


def condition_number(jacobian: ArrayLike) -> FloatArray:
    """Condition number k = sigma_max / sigma_min of J (...,), (3); infinite at a singularity.

    Args:
        jacobian: (..., 3, 3), or any other (..., t, n).
    """
    j = as_array("jacobian", jacobian)
    if j.shape[-2:] == (3, 3):
        return _condition_number(j)
    finite = np.asarray(np.isfinite(j).all(axis=(-2, -1)))
    return np.where(finite, np.linalg.cond(np.where(finite[..., None, None], j, 0.0)), np.nan)
