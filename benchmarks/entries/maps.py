# SPDX-License-Identifier: Apache-2.0
"""Index map of the whole workspace with a million points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from harness import Goal, Row, Settings, Timing, measure, timed_row
from workload import CONTACT, hexapod_leg

from leg_kinematics import Mechanism
from leg_statics.maps import CAPACITY_LAYER, grid_shape, supported_layers, volume_map

THREADS = 2
WARM_UP_RESOLUTION = 0.05  # [m]
CONSTRAINT_LAYERS = ("constraint_force", "constraint_moment")


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the time of the map with all layers, with fewer, and by planes in two threads."""
    leg = hexapod_leg()
    mechanism = leg.mechanism
    wanted = settings.count(1_000_000, 20_000)
    resolution = resolution_of(mechanism, wanted)
    shape = grid_shape(mechanism, resolution)
    count = int(np.prod(shape))
    layers = supported_layers(mechanism)

    def whole(names: Sequence[str], spacing: float = resolution, threads: int = 1) -> None:
        for _ in volume_map(leg, spacing, layers=names, threads=threads, contact=CONTACT):
            pass

    def timed(names: Sequence[str], threads: int = 1) -> Timing:
        return measure(partial(whole, names, threads=threads), settings, warm_up=False)

    whole(layers, WARM_UP_RESOLUTION)

    note = f"{count:,} points, {1e3 * resolution:.2f} mm apart"
    goal = None if settings.quick else Goal(1.0)
    yield timed_row(f"volume_map, all {len(layers)} layers", timed(layers), note=note)
    free = [name for name in layers if name not in CONSTRAINT_LAYERS]
    yield timed_row("volume_map, without constraint indices", timed(free), note=note)
    yield timed_row("volume_map, load capacity", timed([CAPACITY_LAYER]), note=note)

    both = timed(layers, THREADS)
    yield timed_row(f"volume_map, all {len(layers)} layers, {THREADS} threads", both, goal, note)


def resolution_of(mechanism: Mechanism, count: int) -> float:
    """Return the coarsest spacing, to 1 %, whose grid has at least `count` points [m]."""
    resolution = 0.1
    while np.prod(grid_shape(mechanism, resolution)) < count:
        resolution *= 0.99
    return resolution
