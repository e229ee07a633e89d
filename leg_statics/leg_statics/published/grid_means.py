# SPDX-License-Identifier: Apache-2.0
"""Means of indices as paper 000 computes them, on one regular grid: equations (4), (29), (32).

    mean = sum(index |det J|) / sum(|det J|)        over the poses of a grid that are OK

How far such a mean is off is not known; `leg_statics.design.averages` tells its error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanism import Mechanism
from leg_statics.indices import evaluate_indices
from leg_statics.workspace import sample_workspace

PROTOCOL_GRID = 11  # points an actuator, cell mid-points


class GridMeans(NamedTuple):
    """Means of indices over the workspace.

    Attributes:
        names: Names of the indices (K).
        values: Their volume averages (K,).
        volume: Volume of the workspace [m³].
        usable: Share of the actuator box whose poses are OK.
    """

    names: tuple[str, ...]
    values: FloatArray
    volume: float
    usable: float


def grid_means(
    mechanism: Mechanism, names: Sequence[str] = (), points_per_joint: int = PROTOCOL_GRID
) -> GridMeans:
    """Return volume averages of indices on one grid.

    Args:
        mechanism: The leg's mechanism.
        names: Names of the indices; none for all that the mechanism has.
        points_per_joint: Grid points of each actuator.
    """
    sample = sample_workspace(mechanism, points_per_joint)
    chosen, values = evaluate_indices(mechanism, sample.posture, names)
    volume = float(np.sum(sample.volume))
    with np.errstate(invalid="ignore"):
        means = sample.volume @ values / volume
    return GridMeans(chosen, means, volume, sample.usable)
