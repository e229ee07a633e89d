# SPDX-License-Identifier: Apache-2.0
"""Legs of robot models, serial and with a loop, against Newton's method with Pinocchio."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from harness import Goal, Row, Settings, measure, measure_beside, missing_row, ratio_row, timed_row
from peers.pinocchio_five_bar import PinocchioFiveBar
from workload import BATCH

from leg_kinematics import Status, load_robot
from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanism import Mechanism
from leg_statics.footholds import Contact, evaluate_footholds

ROBOTS = Path(__file__).resolve().parents[1] / "robots"
NEAR = 0.008  # m, from a foot to the posture that a peer starts from


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the inverse of a serial leg, its footholds with weight, a loop's inverse, the peer."""
    serial = load_robot("solo12").leg("FL")
    feet = feet_of(serial.mechanism)
    batch = f"batch of {BATCH:,}"
    inverse = measure(lambda: serial.mechanism.inverse(feet), settings, BATCH)
    yield timed_row("inverse, three joints in a row", inverse, Goal(500e-9), batch)
    contact = Contact(0.5, load=8.0)
    footholds = measure(lambda: evaluate_footholds(serial, feet, contact), settings, BATCH)
    yield timed_row("evaluate_footholds with weight", footholds, Goal(800e-9), batch)

    closed = load_robot(ROBOTS / "five_bar.yaml").leg("leg")
    mechanism, ends = closed.mechanism, feet_of(closed.mechanism)
    ours = measure(lambda: mechanism.inverse_with_twist(ends), settings, BATCH)
    yield timed_row("inverse_with_twist, five-bar", ours, Goal(4e-6), batch)
    try:
        peer = PinocchioFiveBar(ROBOTS / "five_bar.urdf")
    except ImportError as error:
        yield missing_row("pinocchio, five-bar", error)
        return
    few = ends[: settings.peer_points]
    rng = np.random.default_rng(4)
    around = mechanism.inverse(few + rng.uniform(-NEAR, NEAR, few.shape))
    posture, twist = mechanism.inverse_with_twist(few)
    chosen = around.status == Status.OK
    starts = np.concatenate([around.joint_positions, around.closure], axis=-1)[chosen]
    tasks = list(zip(closed.mount.to_base(few)[chosen], starts, strict=True))
    settings.show("checking pinocchio")
    answers = [peer.solve(*task) for task in tasks]
    joints = posture.joint_positions[chosen]
    np.testing.assert_allclose([q[:3] for q, _ in answers], joints, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose([j for _, j in answers], twist[chosen, :3], rtol=0.0, atol=1e-6)
    times = measure_beside(
        lambda task: peer.solve(*task),
        tasks,
        lambda: mechanism.inverse_with_twist(ends),
        BATCH,
        settings,
    )
    yield timed_row(
        "pinocchio, five-bar", times[0], note="Newton in Python, start within 8 mm; equal 1e-6"
    )
    yield ratio_row("pinocchio / inverse_with_twist", times, Goal(40.0, at_least=True))


def feet_of(mechanism: Mechanism) -> FloatArray:
    """Return feet that a leg reaches (BATCH, 3)."""
    rng, found = np.random.default_rng(3), [np.empty((0, 3))]
    while sum(map(len, found)) < BATCH:
        lower, upper = np.clip(mechanism.joint_limits, -1.5, 1.5).T
        posture = mechanism.forward(rng.uniform(lower, upper, (BATCH, len(lower))))
        found.append(posture.foot_position[posture.status == Status.OK])
    return np.concatenate(found)[:BATCH]
