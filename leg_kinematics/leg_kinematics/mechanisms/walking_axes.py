# SPDX-License-Identifier: Apache-2.0
"""The axes in which paper 000 describes a leg, x to the right and y forward, and the leg frame.

The leg frame follows REP-103: x forward, y left, z up. A mechanism whose equations keep the paper's
axes converts with these functions where its kernels load feet and store vectors, and nowhere else.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray
from leg_kinematics.kernels.kernel import inlined


@inlined
def in_leg_frame(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a vector, given in the paper's axes, in the leg frame."""
    return y, -x, z


@inlined
def in_walking_axes(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a vector, given in the leg frame, in the paper's axes."""
    return -y, x, z


def leg_vectors(vectors: ArrayLike) -> FloatArray:
    """Return vectors (..., 3), given in the paper's axes, in the leg frame."""
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    return np.stack([y, -x, z], axis=-1)


def walking_vectors(vectors: ArrayLike) -> FloatArray:
    """Return vectors (..., 3), given in the leg frame, in the paper's axes."""
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    return np.stack([-y, x, z], axis=-1)
