# SPDX-License-Identifier: Apache-2.0
"""Footholds from position to verdict: kinematics, Jacobians, rated friction and capacity."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from harness import Goal, Row, Settings, measure, measure_beside, missing_row, ratio_row, timed_row
from peers.pinocchio_leg import PinocchioLeg
from peers.solvers import Clarabel
from workload import BATCH, CONTACT, FRICTION, hexapod_leg, neighbours, reachable_positions

from leg_kinematics.arrays import FloatArray
from leg_kinematics.robot import Leg
from leg_statics.footholds import evaluate_footholds

THREADS = 2


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the evaluation by one thread and two, and the chain of peers."""
    leg = hexapod_leg()
    mechanism = leg.mechanism
    feet = reachable_positions(mechanism)
    mirrored = hexapod_leg("left_front")
    mirrored_feet = reachable_positions(mirrored.mechanism)

    def evaluate(part: FloatArray, of: Leg = leg) -> object:
        return evaluate_footholds(of, part, CONTACT)

    ours = measure(lambda: evaluate(feet), settings, BATCH)
    yield timed_row("evaluate_footholds", ours, Goal(350e-9), f"batch of {BATCH:,}")
    mirror = measure(lambda: evaluate(mirrored_feet, mirrored), settings, BATCH)
    yield timed_row("evaluate_footholds, mirrored leg", mirror, note=f"batch of {BATCH:,}")
    halves = np.array_split(feet, THREADS)
    with ThreadPoolExecutor(THREADS) as pool:
        both = measure(lambda: list(pool.map(evaluate, halves)), settings, BATCH)
    yield timed_row(
        "evaluate_footholds, two threads", both, Goal(180e-9), "half of the batch in each thread"
    )

    try:
        peer = Chain(leg.effort_limits, PinocchioLeg(leg.geometry))
    except ImportError as error:
        yield missing_row("pinocchio + clarabel", error)
        return
    few = feet[: settings.peer_points]
    starts = peer.leg.configuration(mechanism.inverse(neighbours(mechanism, few)))
    tasks = list(zip(few, starts, strict=True))
    settings.show("checking pinocchio + clarabel")
    found = np.array([peer.evaluate(*task) for task in tasks])
    wanted = evaluate_footholds(leg, few, CONTACT)
    np.testing.assert_allclose(found[:, 0], wanted.load_capacity, rtol=1e-6)
    np.testing.assert_allclose(found[:, 1], wanted.rated_friction, rtol=1e-6, atol=1e-9)
    times = measure_beside(
        lambda task: peer.evaluate(*task), tasks, lambda: evaluate(feet), BATCH, settings
    )
    yield timed_row(
        "pinocchio + clarabel", times[0], note="capacity and rated friction equal within 1e-6"
    )
    yield ratio_row("pinocchio + clarabel / evaluate_footholds", times)


class Chain:
    """Pinocchio for the pose and its Jacobians, Clarabel for the capacity."""

    def __init__(self, effort_limits: FloatArray, leg: PinocchioLeg) -> None:
        self.leg = leg
        self._solver = Clarabel(effort_limits[:, 0], effort_limits[:, 1], FRICTION)

    def evaluate(self, foot: FloatArray, start: FloatArray) -> tuple[float, float]:
        """Return load capacity and rated friction."""
        jacobian, _ = self.leg.jacobians(self.leg.solve(foot, start))
        inverse = np.linalg.inv(jacobian)  # rows: efforts, columns: forces
        force = inverse.T @ inverse[:, 2]  # of the unit efforts that maximise F_z
        return self._solver.capacity(jacobian), abs(force[0] / force[2])
