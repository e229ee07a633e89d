# SPDX-License-Identifier: Apache-2.0
"""Actuator efforts that hold a foot against the ground: equations (5)-(7) of paper 000.

The papers' F_C and M_C are what the foot exerts. Throughout the suite a wrench is what the ground
applies to the foot (F_z > 0 for a standing leg); the sign changes here, and only here.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arrays import FloatArray, as_array, as_matching
from leg_kinematics.errors import ShapeError
from leg_kinematics.kernels.kernel import inlined, kernel, scalar
from leg_kinematics.kernels.vectors import cross


def joint_efforts(
    jacobian: FloatArray,
    angular_jacobian: FloatArray,
    force: ArrayLike,
    moment: ArrayLike = (0.0, 0.0, 0.0),
) -> FloatArray:
    """Efforts that hold a ground reaction: tau = -(J^T F + J_omega^T M), equation (6).

    Hard ground transmits a force only; soft ground, in which the foot sinks, a moment as well.

    Args:
        jacobian: J of v = J q' (..., 3, n); rows after the third, the orientation of a
            manipulator, are left to J_omega.
        angular_jacobian: J_omega of omega = J_omega q' (..., 3, n).
        force: Ground reaction on the foot (..., 3) [N].
        moment: Moment of the ground on the foot (..., 3) [N.m].

    Returns:
        Joint efforts (..., n) [N.m, N for a prismatic joint].

    Raises:
        ShapeError: If shapes do not fit.
    """
    jacobian = as_array("jacobian", jacobian)
    if jacobian.ndim < 2 or jacobian.shape[-2] < 3:
        raise ShapeError(f"jacobian must have shape (..., 3, n), got {jacobian.shape}")
    batch, n = jacobian.shape[:-2], jacobian.shape[-1]
    angular = as_matching("angular_jacobian", angular_jacobian, (3, n), batch)
    f = as_matching("force", force, (3,), batch)
    m = as_matching("moment", moment, (3,), batch)
    return -(
        np.einsum("...in,...i->...n", jacobian[..., :3, :], f)
        + np.einsum("...in,...i->...n", angular, m)
    )


def utilisation(
    efforts: ArrayLike, effort_limits: ArrayLike
) -> tuple[FloatArray, NDArray[np.int32]]:
    """Share of the effort limits that is used: 1 is at the limit of the worst joint.

    Args:
        efforts: Joint efforts (..., n) [N.m or N].
        effort_limits: Lower (≤ 0) and upper (≥ 0) effort of each joint (..., n, 2).

    Returns:
        Largest ratio of effort to limit over the joints (...,), infinite for any effort of a joint
        whose limit is zero, NaN where an effort is NaN; and the index of that joint (...,), -1
        where no joint exerts anything or the efforts are NaN.

    Raises:
        ShapeError: If shapes do not fit.
    """
    tau = as_array("efforts", efforts)
    if tau.ndim == 0:
        raise ShapeError("efforts must have shape (..., n), got ()")
    limits = as_matching("effort_limits", effort_limits, (tau.shape[-1], 2), tau.shape[:-1])
    worst, joint = _utilisation(tau, limits)
    return worst, joint


@scalar
def utilisation_of_point(
    efforts: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[float, int]:
    """Return the utilisation of one point and its joint, for use inside other kernels."""
    worst, joint = 0.0, -1
    for k in range(len(efforts)):
        if math.isnan(efforts[k]):
            return math.nan, -1
        share = share_of_limits(efforts[k], 0.0, lower[k], upper[k])
        if share > worst:
            worst, joint = share, k
    return worst, joint


@inlined
def share_of_limits(effort: float, reserve: float, lower: float, upper: float) -> float:
    """Return the share of its limits that a joint uses when its effort may vary by a reserve."""
    highest, lowest = effort + reserve, effort - reserve
    above = highest / abs(upper) if highest > 0.0 else 0.0
    below = -lowest / abs(lower) if lowest < 0.0 else 0.0
    return below if below > above else above


@kernel("(n),(n,k)->(),()", "f8[:], f8[:,:], f8[:], i4[:]")
def _utilisation(efforts, limits, worst, joint):  # type: ignore[no-untyped-def]
    worst[0], joint[0] = utilisation_of_point(efforts, limits[:, 0], limits[:, 1])


@inlined
def worst_moment_effort(column, vertical):  # type: ignore[no-untyped-def]
    """Return the largest effort of a joint for a unit moment that is horizontal: equation (27).

    Args:
        column: The joint's column of J_omega.
        vertical: Unit vector to which the moment is perpendicular.
    """
    x, y, z = cross(vertical, column)
    return math.sqrt(x * x + y * y + z * z)


@kernel("(d,n)->(n)", "f8[:,:], f8[:]")
def _worst_moment_efforts(angular, efforts):  # type: ignore[no-untyped-def]
    for k in range(efforts.shape[0]):
        column = angular[0, k], angular[1, k], angular[2, k]
        efforts[k] = worst_moment_effort(column, (0.0, 0.0, 1.0))


def worst_moment_efforts(angular_jacobian: FloatArray) -> FloatArray:
    """Largest effort of each joint for a unit moment in the horizontal plane: equation (27).

    The moment's direction is the one that is worst for the joint; a leg that swings about two axes
    takes no moment about the vertical one (paper 000, after equation (7)).

    Args:
        angular_jacobian: J_omega of omega = J_omega q' (..., 3, n).

    Returns:
        Efforts (..., n), per unit moment.
    """
    efforts: FloatArray = _worst_moment_efforts(angular_jacobian)
    return efforts
