# SPDX-License-Identifier: Apache-2.0
"""The inputs that the entries share: one leg of the hexapod and random poses of it."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from leg_kinematics import Leg, Status, load_robot
from leg_kinematics.arrays import FloatArray
from leg_statics.footholds import Contact
from leg_statics.workspace import workspace_bounds

SEED = 20170721
BATCH = 10_000
FRICTION = 0.4  # the low end of cement
CONTACT = Contact(friction=FRICTION, load=300.0)


@lru_cache
def hexapod_leg(name: str = "right_front") -> Leg:
    """Return a leg of the shipped hexapod; those on the right are not mirrored."""
    return load_robot("hexapod").legs[name]


def reachable_positions(mechanism: Any, count: int = BATCH) -> FloatArray:
    """Return foot positions spread evenly over the workspace (count, 3) [m], always the same."""
    random = np.random.default_rng(SEED)
    lower, upper = workspace_bounds(mechanism).T
    found = np.empty((0, 3))
    while len(found) < count:
        draw = random.uniform(lower, upper, (2 * count + 100, 3))
        found = np.concatenate([found, draw[mechanism.inverse(draw).status == Status.OK]])
    return found[:count]


def neighbours(mechanism: Any, positions: FloatArray, distance: float = 0.01) -> FloatArray:
    """Return a reachable position at most `distance` from each, to start iterations from."""
    random = np.random.default_rng(SEED + 1)
    result = positions.copy()
    missing = np.ones(len(positions), dtype=bool)
    while missing.any():
        step = random.normal(size=(missing.sum(), 3))
        step /= np.linalg.norm(step, axis=-1, keepdims=True)
        step *= distance * random.uniform(0.5, 1.0, (len(step), 1))
        result[missing] = positions[missing] + step
        missing = mechanism.inverse(result).status != Status.OK
    return result
