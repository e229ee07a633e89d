# SPDX-License-Identifier: Apache-2.0
"""Colours of values, verdicts and utilisations, as red, green and blue from 0 to 1."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray
from leg_statics.footholds import Verdict

Colour = tuple[float, float, float]

GREY: Colour = (0.5, 0.5, 0.5)
# Viridis at equal steps, from the lowest value to the highest.
VIRIDIS = np.array(
    [
        [0.267, 0.005, 0.329],
        [0.230, 0.322, 0.546],
        [0.128, 0.567, 0.551],
        [0.369, 0.789, 0.383],
        [0.993, 0.906, 0.144],
    ]
)
# From an idle joint over half of its limit to all of it.
EFFORT = np.array([[0.35, 0.55, 0.75], [0.95, 0.85, 0.35], [0.85, 0.15, 0.1]])
BEYOND_LIMIT: Colour = (0.45, 0.0, 0.35)
# Why a foothold is not feasible; the feasible ones have the colour of what they carry.
VERDICTS: dict[Verdict, Colour] = {
    Verdict.REACH: (0.75, 0.75, 0.75),
    Verdict.JOINT_RANGE: (0.6, 0.6, 0.6),
    Verdict.PASSIVE_JOINT: (0.45, 0.45, 0.45),
    Verdict.SINGULAR: (0.1, 0.1, 0.1),
    Verdict.INVALID_INPUT: (0.1, 0.1, 0.1),
    Verdict.FRICTION: (0.85, 0.45, 0.75),
    Verdict.EFFORT: (0.85, 0.15, 0.1),
}


def of_values(values: FloatArray) -> FloatArray:
    """Return a colour (..., 3) for each value: viridis over the finite ones, grey for NaN."""
    finite = values[np.isfinite(values)]
    low, high = (finite.min(), finite.max()) if len(finite) else (0.0, 1.0)
    with np.errstate(invalid="ignore"):
        share = np.clip((values - low) / max(high - low, 1e-12), 0.0, 1.0)
    return np.where(np.isnan(values)[..., None], GREY, _between(VIRIDIS, share))


def of_utilisation(shares: ArrayLike) -> FloatArray:
    """Return a colour (..., 3) for each share of an effort limit; grey where it is not known."""
    used = np.asarray(shares, dtype=np.float64)
    ramp = _between(EFFORT, np.clip(used, 0.0, 1.0))
    ramp = np.where((used > 1.0 + 1e-9)[..., None], BEYOND_LIMIT, ramp)
    return np.where(np.isnan(used)[..., None], GREY, ramp)


def of_footholds(verdicts: ArrayLike, capacity: FloatArray) -> FloatArray:
    """Return a colour (..., 3) for each candidate: that of its capacity, or of why it fails."""
    verdict = np.asarray(verdicts)
    found = of_values(np.where(verdict == Verdict.FEASIBLE, capacity, np.nan))
    for reason, colour in VERDICTS.items():
        found[verdict == reason] = colour
    return found


def _between(ramp: FloatArray, shares: FloatArray) -> FloatArray:
    """Return colours (..., 3) at shares of a ramp of equal steps."""
    steps = np.linspace(0.0, 1.0, len(ramp))
    return np.stack([np.interp(shares, steps, column) for column in ramp.T], axis=-1)
