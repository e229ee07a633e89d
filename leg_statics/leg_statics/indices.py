# SPDX-License-Identifier: Apache-2.0
"""Performance indices of a leg posture, and the registry by which services and maps name them.

Equations are those of paper 000 (Zhang, Jin, Zhang 2017) where no other paper is named.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from leg_kinematics.arguments import as_names, require
from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.conditioning import condition_number, row_factors
from leg_kinematics.errors import NotSupportedError, ShapeError, UnknownNameError
from leg_kinematics.kernels.kernel import inlined, kernel
from leg_kinematics.mechanism import Mechanism, Posture
from leg_kinematics.status import Status
from leg_statics.efforts import worst_moment_efforts
from leg_statics.kinematics import Kinematics
from leg_statics.planar_force import force_transmission
from leg_statics.workspace import is_spatial_leg

# --------------------------------------------------------------------------- scalar mathematics


@inlined
def force_slopes(jacobian: Sequence[Sequence[float]]) -> tuple[float, float]:
    """Return F_x / F_z and F_y / F_z of the force that attains eta_cF: F = J^-T tau, (17)-(22).

    |F_z| is largest for unit efforts along the third row of J^-T. With J = L Q that row is
    q_z / zz, and the slopes are quotients in L.
    """
    xx, yx, yy, zx, zy, _ = row_factors(jacobian)
    return (yx * zy - zx * yy) / (xx * yy), -zy / yy


@kernel("(n,n)->(),(),()", "f8[:,:], f8[:], f8[:], f8[:]")
def _unit_effort_force(jacobian, capacity, friction, full_friction):
    capacity[0] = 1.0 / row_factors(jacobian)[5]
    x_slope, y_slope = force_slopes(jacobian)
    friction[0] = abs(x_slope)
    full_friction[0] = math.hypot(x_slope, y_slope)


SWEEPS = 30  # a few suffice
PERPENDICULAR = 1e-14  # cosine between columns that counts as 0

# --------------------------------------------------------------------------- functions


def _spatial(jacobian: Any, index: str) -> FloatArray:
    j = as_array("jacobian", jacobian)
    if j.ndim < 2 or j.shape[-2:] != (3, 3):
        raise ShapeError(f"{index} needs a jacobian of shape (..., 3, 3), got {j.shape}")
    return j


def unit_effort_capacity(jacobian: Any) -> FloatArray:
    """eta_cF: largest vertical force for efforts of norm 1 (...,) [N per unit], (17)-(21)."""
    return _unit_effort_force(_spatial(jacobian, "unit_effort_capacity"))[0]


def rated_friction(jacobian: Any) -> FloatArray:
    """mu_e = |F_x / F_z| of the force that attains eta_cF (...,), equation (22).

    Only the component along the walking direction counts, as in the paper: x, which is its y.
    `rated_friction_full` takes both.
    """
    return _unit_effort_force(_spatial(jacobian, "rated_friction"))[1]


def rated_friction_full(jacobian: Any) -> FloatArray:
    """sqrt(F_x² + F_y²) / F_z of the force that attains eta_cF (...,): (22) in the full plane."""
    return _unit_effort_force(_spatial(jacobian, "rated_friction_full"))[2]


def unit_moment_effort(angular_jacobian: FloatArray) -> FloatArray:
    """eta_cM: largest effort of any joint for a unit horizontal moment at the foot, (24)-(28)."""
    return np.max(worst_moment_efforts(angular_jacobian), axis=-1)


@kernel("(n,n)->(n)", "f8[:,:], f8[:]")
def _singular_values(matrix, values):
    """Singular values of a small square matrix by Hestenes' one-sided Jacobi method.

    Columns are rotated until they are perpendicular to each other; their lengths are the values,
    small ones as exact as large ones.
    """
    columns = matrix.copy()
    n = len(values)
    for _ in range(SWEEPS):
        rotated = False
        for i in range(n):
            for j in range(i):
                alpha, beta, gamma = 0.0, 0.0, 0.0
                for k in range(n):
                    alpha += columns[k, i] * columns[k, i]
                    beta += columns[k, j] * columns[k, j]
                    gamma += columns[k, i] * columns[k, j]
                if abs(gamma) <= PERPENDICULAR * math.sqrt(alpha * beta):
                    continue
                rotated = True
                zeta = 0.5 * (beta - alpha) / gamma
                t = math.copysign(1.0, zeta) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
                c = 1.0 / math.sqrt(1.0 + t * t)
                for k in range(n):
                    a, b = columns[k, i], columns[k, j]
                    columns[k, i], columns[k, j] = c * (a - t * b), c * (b + t * a)
        if not rotated:
            break
    for i in range(n):
        square = 0.0
        for k in range(n):
            square += columns[k, i] * columns[k, i]
        values[i] = math.sqrt(square)


def _root_condition(matrix: FloatArray) -> FloatArray:
    """Return sqrt(||A|| ||A^+||) over the non-zero singular values; NaN stays NaN."""
    singular = _singular_values(matrix)
    largest = np.max(singular, axis=-1)
    present = singular > 1e-9 * largest[..., None]
    smallest = np.min(np.where(present, singular, np.inf), axis=-1)
    return np.where(np.isfinite(largest), np.sqrt(largest / smallest), np.nan)


def constraint_force_index(constraint_jacobian: FloatArray) -> FloatArray:
    """k_cf of the force block of J_c^T (...,), equation (31).

    The block has rank 2 (its first row is a pure moment), so the inverse in (31) is read as the
    pseudo-inverse.
    """
    return _root_condition(np.swapaxes(constraint_jacobian[..., :3], -1, -2))


def constraint_moment_index(constraint_jacobian: FloatArray) -> FloatArray:
    """k_cm of the moment block of J_c^T (...,), equation (31); lengths in metres."""
    return _root_condition(np.swapaxes(constraint_jacobian[..., 3:], -1, -2))


# --------------------------------------------------------------------------- registry


@dataclass(frozen=True)
class Index:
    """A performance index: what it is, and how to compute it for a mechanism's postures.

    Attributes:
        name: Name in services, maps and tables.
        symbol: The paper's symbol.
        unit: SI unit, per unit effort where it says so.
        equation: Where it is defined.
        better: Whether a low or a high value is better.
        doc: What it tells.
        compute: Values (...,) of postures.
        supports: Whether a mechanism has what `compute` needs.
    """

    name: str
    symbol: str
    unit: str
    equation: str
    better: Literal["low", "high"]
    doc: str
    compute: Callable[[Kinematics], FloatArray]
    supports: Callable[[Mechanism], bool]


def _square(mechanism: Mechanism) -> bool:
    return len(mechanism.joints) == len(mechanism.task_coordinates)


def _has_constraints(mechanism: Mechanism) -> bool:
    return mechanism.offers(Mechanism.constraint_jacobian)


def _has_planar_part(mechanism: Mechanism) -> bool:
    return mechanism.offers(Mechanism.planar_jacobian)


INDICES: dict[str, Index] = {
    index.name: index
    for index in (
        Index(
            "condition_number",
            "k",
            "1",
            "paper 000 (3)",
            "low",
            "Condition number of the Jacobian: how evenly the foot can move in all directions.",
            lambda k: condition_number(k.jacobian),
            _square,
        ),
        Index(
            "unit_effort_capacity",
            "eta_cF",
            "N per unit effort",
            "paper 000 (21)",
            "high",
            "Largest vertical force at the foot for joint efforts of norm 1.",
            lambda k: unit_effort_capacity(k.jacobian),
            is_spatial_leg,
        ),
        Index(
            "rated_friction",
            "mu_e",
            "1",
            "paper 000 (22)",
            "low",
            "Friction |F_x / F_z| (forward / vertical) that the ground must offer for that force.",
            lambda k: rated_friction(k.jacobian),
            is_spatial_leg,
        ),
        Index(
            "rated_friction_full",
            "mu_e,xy",
            "1",
            "paper 000 (22), both horizontal components",
            "low",
            "Friction sqrt(F_x² + F_y²) / F_z that the ground must offer for that force.",
            lambda k: rated_friction_full(k.jacobian),
            is_spatial_leg,
        ),
        Index(
            "unit_moment_effort",
            "eta_cM",
            "effort per N.m",
            "paper 000 (28)",
            "low",
            "Largest joint effort for a unit horizontal moment at the foot (soft ground).",
            lambda k: unit_moment_effort(k.angular_jacobian),
            is_spatial_leg,
        ),
        Index(
            "constraint_force",
            "k_cf",
            "1",
            "paper 000 (31)",
            "low",
            "How evenly the drive's constraint forces are transmitted.",
            lambda k: constraint_force_index(k.constraint_jacobian),
            _has_constraints,
        ),
        Index(
            "constraint_moment",
            "k_cm",
            "1 (lengths in m)",
            "paper 000 (31)",
            "low",
            "How evenly the drive's constraint moments are transmitted.",
            lambda k: constraint_moment_index(k.constraint_jacobian),
            _has_constraints,
        ),
        Index(
            "planar_force",
            "K_F",
            "N per unit effort",
            "paper 001 (27)",
            "high",
            "Largest foot force in the leg's plane for efforts of norm 1 of its two actuators.",
            lambda k: force_transmission(k.planar_jacobian).largest_force,
            _has_planar_part,
        ),
        Index(
            "planar_imbalance",
            "K_J",
            "1",
            "paper 001 (28)",
            "low",
            "How unevenly the leg's plane is served: 1 - smallest / largest such force.",
            lambda k: force_transmission(k.planar_jacobian).imbalance,
            _has_planar_part,
        ),
    )
}


def find_index(name: str) -> Index:
    """Return a registered index.

    Raises:
        UnknownNameError: If there is none of that name.
    """
    try:
        return INDICES[name]
    except (KeyError, TypeError):  # what has no hash is no name
        raise UnknownNameError("index", name, INDICES) from None


def supported_indices(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of the indices that a mechanism has."""
    require("mechanism", mechanism, Mechanism)
    return tuple(name for name, index in INDICES.items() if index.supports(mechanism))


def evaluate_indices(
    mechanism: Mechanism, posture: Posture, names: Sequence[str] = ()
) -> tuple[tuple[str, ...], FloatArray]:
    """Evaluate indices of postures.

    Args:
        mechanism: The leg's mechanism.
        posture: Solved postures with batch shape (...,).
        names: Names of the indices; none for all that the mechanism has.

    Returns:
        The names (K) and values (..., K); NaN where a posture's status is not OK.

    Raises:
        UnknownNameError: If a name is not registered.
        NotSupportedError: If the mechanism does not have an index.
    """
    require("posture", posture, Posture)
    require("mechanism", mechanism, Mechanism)
    return indices_of(Kinematics(mechanism, posture), as_names("names", names))


def indices_of(
    kinematics: Kinematics, names: Sequence[str] = ()
) -> tuple[tuple[str, ...], FloatArray]:
    """`evaluate_indices` of postures whose Jacobians may be known already."""
    mechanism, posture = kinematics.mechanism, kinematics.posture
    supported = supported_indices(mechanism)
    chosen = tuple(names) or supported
    for name in chosen:
        if find_index(name).name not in supported:
            raise NotSupportedError(
                f"index {name!r} is not defined for mechanism {mechanism.name!r}; "
                f"it has: {', '.join(supported)}"
            )
    values = np.empty((*np.shape(posture.status), len(chosen)))
    for k, name in enumerate(chosen):
        values[..., k] = INDICES[name].compute(kinematics)
    values[np.asarray(posture.status) != Status.OK] = np.nan
    return chosen, values
