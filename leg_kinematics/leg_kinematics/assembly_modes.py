# SPDX-License-Identifier: Apache-2.0
"""Assembly modes of closed chains whose parts can each be assembled in two ways."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanism import Mechanism


def flipped_modes(default: str, parts: Sequence[str]) -> tuple[str, ...]:
    """Return the default mode and one for each set of parts assembled the other way round."""
    flips = [
        "+".join(part for part, flip in zip(parts, bits, strict=True) if flip)
        for bits in product((False, True), repeat=len(parts))
    ]
    return (default, *(f"flipped_{name}" for name in flips[1:]))


def mode_signs(mechanism: Mechanism, assembly_mode: str, parts: Sequence[str]) -> FloatArray:
    """Return -1 for each part (parts,) that a mode of `flipped_modes` flips, +1 for the others.

    Raises:
        UnknownNameError: If the mechanism has no such mode.
    """
    index, last = mechanism.mode_index(assembly_mode), len(parts) - 1
    return np.array([-1.0 if index >> (last - k) & 1 else 1.0 for k in range(last + 1)])
