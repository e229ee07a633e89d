# SPDX-License-Identifier: Apache-2.0
"""Theo Jansen's linkage over crank angles against pylinkage."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from harness import (
    Goal,
    Row,
    Settings,
    Timing,
    measure,
    measure_beside,
    missing_row,
    ratio_row,
    timed_row,
)
from peers.pylinkage_jansen import POINTS, PylinkageJansen
from workload import BATCH

from leg_kinematics import Linkage
from leg_kinematics.mechanisms.theo_jansen import TheoJansen


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the foot and all points over one turn, and the peer."""
    mechanism = TheoJansen()
    angles = np.linspace(0.0, 2.0 * np.pi, BATCH, endpoint=False)[:, None]
    batch = f"batch of {BATCH:,} crank angles"

    foot = measure(lambda: mechanism.forward(angles), settings, BATCH)
    yield timed_row("forward: foot", foot, Goal(0.15e-6), batch)

    def all_points() -> Linkage:
        return mechanism.linkage(mechanism.forward(angles))

    ours = measure(all_points, settings, BATCH)
    yield timed_row("forward and linkage: all 8 points", ours, Goal(0.15e-6), batch)

    linkage = all_points()
    columns = [linkage.names.index(name) for name in POINTS]
    # in the linkage's plane, whose X is -y, in crank lengths
    plane = linkage.points[:, columns][..., 1:] * (-1.0, 1.0) / mechanism.crank_length
    try:
        peer = PylinkageJansen(mechanism, dict(zip(POINTS, plane[0], strict=True)), BATCH)
    except ImportError as error:
        yield missing_row("pylinkage", error)
        return
    settings.show("checking pylinkage")
    np.testing.assert_allclose(peer.turn(), np.roll(plane, -1, axis=0), atol=1e-8)
    theirs, again = measure_beside(lambda _: peer.turn(), [None], all_points, BATCH, settings)
    theirs = Timing(theirs.median / BATCH, theirs.p95 / BATCH)  # a turn is one call
    yield timed_row("pylinkage step_fast", theirs, note="one turn; equal within 1e-8 cranks")
    yield ratio_row("pylinkage / forward and linkage", (theirs, again))
