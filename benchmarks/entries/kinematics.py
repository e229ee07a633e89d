# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics of the parallel-driving leg against Newton's method with Pinocchio."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from harness import Goal, Row, Settings, measure, measure_beside, missing_row, ratio_row, timed_row
from peers.pinocchio_leg import PinocchioLeg
from workload import BATCH, hexapod_leg, neighbours, reachable_positions


def rows(settings: Settings) -> Iterator[Row]:
    """Yield inverse kinematics, what else the mechanism computes, and the peer."""
    mechanism = hexapod_leg().mechanism
    feet = reachable_positions(mechanism)
    posture = mechanism.inverse(feet)
    mirrored = hexapod_leg("left_front").mechanism
    mirrored_feet = reachable_positions(mirrored)
    batch = f"batch of {BATCH:,}"

    ours = measure(lambda: mechanism.inverse(feet), settings, BATCH)
    yield timed_row("inverse", ours, Goal(250e-9), batch)
    for name, function in {
        "inverse, mirrored leg": lambda: mirrored.inverse(mirrored_feet),
        "inverse_with_twist": lambda: mechanism.inverse_with_twist(feet),
        "forward": lambda: mechanism.forward(posture.joint_positions),
        "jacobian": lambda: mechanism.jacobian(posture),
    }.items():
        yield timed_row(name, measure(function, settings, BATCH), note=batch)

    try:
        peer = PinocchioLeg(hexapod_leg().geometry)
    except ImportError as error:
        yield missing_row("pinocchio", error)
        return
    few = feet[: settings.peer_points]
    starts = peer.configuration(mechanism.inverse(neighbours(mechanism, few)))
    tasks = list(zip(few, starts, strict=True))
    settings.show("checking pinocchio")
    angles = [peer.crank_angles(peer.solve(*task)) for task in tasks]
    np.testing.assert_allclose(angles, posture.joint_positions[: len(few)], rtol=0.0, atol=1e-6)
    times = measure_beside(
        lambda task: peer.solve(*task), tasks, lambda: mechanism.inverse(feet), BATCH, settings
    )
    yield timed_row(
        "pinocchio", times[0], note="Newton on 9 loop equations from a pose 5-10 mm off; equal 1e-6"
    )
    yield ratio_row("pinocchio / inverse", times, Goal(100.0, at_least=True))
