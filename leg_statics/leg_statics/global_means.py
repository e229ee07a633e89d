"""Means of indices over the workspace: equations (4), (29) and (32) of paper 000.

The paper's integrals run over the foot's workspace W. With dW = |det J| dq they become integrals
over the actuator ranges, where the grid is regular and every point is a pose the leg can take:

    mean = sum(index |det J|) / sum(|det J|)        over the poses of a grid that are OK

Grid points are the mid-points of cells, so that each stands for the same volume of the box.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import NotSupportedError, ValueRangeError
from leg_kinematics.mechanism import Mechanism, Posture
from leg_kinematics.status import Status
from leg_statics.indices import evaluate_indices


class WorkspaceSample(NamedTuple):
    """Postures that fill the workspace, with the volume each stands for.

    Attributes:
        posture: The OK postures of the grid (m,).
        volume: Volume of the foot's workspace that each posture stands for (m,) [m³].
        usable: Share of the actuator box whose poses are OK.
    """

    posture: Posture
    volume: FloatArray
    usable: float


class GlobalMeans(NamedTuple):
    """Means of indices over the workspace.

    Attributes:
        names: Names of the indices (K).
        values: Their volume averages (K,).
        volume: Volume of the workspace [m³].
        usable: Share of the actuator box whose poses are OK.
        points_per_joint: Grid the values were computed on.
        change: Largest relative change of a value or the volume against the next coarser grid;
            NaN if there was none.
    """

    names: tuple[str, ...]
    values: FloatArray
    volume: float
    usable: float
    points_per_joint: int
    change: float


def actuator_grid(mechanism: Mechanism, points_per_joint: int) -> FloatArray:
    """Mid-points of a regular grid over the actuator ranges (points_per_joint^n, n)."""
    if points_per_joint < 1:
        raise ValueRangeError(f"points_per_joint must be >= 1, got {points_per_joint}")
    lower, upper = mechanism.joint_limits.T
    share = (np.arange(points_per_joint) + 0.5) / points_per_joint
    axes = lower + np.outer(share, upper - lower)
    return np.stack(np.meshgrid(*axes.T, indexing="ij"), axis=-1).reshape(-1, len(lower))


def sample_workspace(mechanism: Mechanism, points_per_joint: int) -> WorkspaceSample:
    """Fill the workspace by a grid over the actuator ranges.

    Args:
        mechanism: A leg with as many actuators as task coordinates.
        points_per_joint: Grid points of each actuator.

    Raises:
        NotSupportedError: If the Jacobian is not square, so that there is no volume.
    """
    n = len(mechanism.joints)
    if n != len(mechanism.task_coordinates):
        raise NotSupportedError(
            f"mechanism {mechanism.name!r} has {n} actuators for "
            f"{len(mechanism.task_coordinates)} task coordinates: its workspace has no volume"
        )
    everything = mechanism.forward(actuator_grid(mechanism, points_per_joint))
    ok = everything.status == Status.OK
    posture = Posture(*(field[ok] for field in everything))
    widths = np.diff(mechanism.joint_limits, axis=1)[:, 0] / points_per_joint
    volume = np.abs(np.linalg.det(mechanism.jacobian(posture))) * np.prod(widths)
    return WorkspaceSample(posture, volume, float(np.mean(ok)))


def means_on_grid(
    mechanism: Mechanism, names: Sequence[str] = (), points_per_joint: int = 11
) -> GlobalMeans:
    """Volume averages of indices on one grid: equations (4), (29), (32).

    Args:
        mechanism: The leg's mechanism.
        names: Names of the indices; none for all that the mechanism has.
        points_per_joint: Grid points of each actuator (11 is the published protocol's grid).
    """
    sample = sample_workspace(mechanism, points_per_joint)
    chosen, values = evaluate_indices(mechanism, sample.posture, names)
    volume = float(np.sum(sample.volume))
    with np.errstate(invalid="ignore"):
        means = sample.volume @ values / volume
    return GlobalMeans(chosen, means, volume, sample.usable, points_per_joint, np.nan)


def global_means(
    mechanism: Mechanism,
    names: Sequence[str] = (),
    tolerance: float = 0.005,
    points_per_joint: int = 11,
    largest_grid: int = 88,
) -> GlobalMeans:
    """Volume averages, refined until they change by less than a tolerance.

    Args:
        mechanism: The leg's mechanism.
        names: Names of the indices; none for all that the mechanism has.
        tolerance: Relative change against the next coarser grid to stop at.
        points_per_joint: Grid to start with; each refinement doubles it.
        largest_grid: No grid has more points per joint than this.

    Returns:
        The finest means; `change` tells whether the tolerance was reached.
    """
    means = means_on_grid(mechanism, names, points_per_joint)
    while 2 * means.points_per_joint <= largest_grid:
        finer = means_on_grid(mechanism, names, 2 * means.points_per_joint)
        new = np.append(finer.values, finer.volume)
        change = float(np.max(np.abs(np.append(means.values, means.volume) / new - 1.0)))
        means = finer._replace(change=change)
        if change < tolerance:
            break
    return means
