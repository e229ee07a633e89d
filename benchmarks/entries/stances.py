# SPDX-License-Identifier: Apache-2.0
"""Load factors and support regions of whole stances against conic and linear solvers."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from harness import Goal, Row, Settings, measure, measure_beside, missing_row, ratio_row, timed_row
from peers.stances import PYRAMID_EXCESS, ClarabelStance, HighsStance
from workload import FRICTION, hexapod_leg, reachable_positions

from leg_kinematics import load_robot
from leg_kinematics.arrays import FloatArray
from leg_statics.stance.region import support_region
from leg_statics.stance.stances import Load, Stance, load_factor
from leg_statics.stance.standing import robot_stance

TRIPOD = ("left_front", "right_middle", "left_rear")
BATCH = 1000
LOAD = Load(60.0)


def stances(names: tuple[str, ...], count: int) -> Stance:
    """Return stances of random feet in reach, all with the same feet in their leg frames."""
    robot = load_robot("hexapod")
    foot = reachable_positions(hexapod_leg().mechanism, 10_000)
    feet = {}
    for k, name in enumerate(names):
        at = foot[k * count : (k + 1) * count] * [
            1.0,
            -1.0 if robot.leg(name).mirrored else 1.0,
            1.0,
        ]
        feet[name] = robot.leg(name).mount.to_base(at)
    return robot_stance(robot, feet, FRICTION)


def one(stance: Stance, k: int) -> Stance:
    """Return one of the stances."""
    return stance._replace(
        position=np.asarray(stance.position)[k], jacobian=np.asarray(stance.jacobian)[k], status=0
    )


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the times of the suite, then of each peer and how many times longer it takes."""
    many = stances(TRIPOD, BATCH)

    def factors(points: Stance = many) -> FloatArray:
        return load_factor(points, LOAD).multiple

    ours = measure(factors, settings, BATCH)
    yield timed_row("load factor, 3 feet", ours, Goal(20e-6), f"batch of {BATCH:,}")
    few = [one(many, k) for k in range(settings.peer_points)]
    exact = np.array([factors(stance) for stance in few])
    looser = np.array(
        [factors(stance._replace(friction=FRICTION * PYRAMID_EXCESS)) for stance in few]
    )
    peers: dict[str, Any] = {"clarabel": ClarabelStance, "highspy": HighsStance}
    for name, peer in peers.items():
        try:
            solver = peer(few[0], LOAD)
        except ImportError as error:
            yield missing_row(name, error)
            continue
        settings.show(f"checking {name}")
        found = np.array([solver.load_factor(stance) for stance in few])
        if name == "clarabel":
            np.testing.assert_allclose(found, exact, rtol=1e-5, atol=1e-7)
        else:
            assert (exact - 1e-6 <= found).all()
            assert (found <= looser + 1e-6).all()
        times = measure_beside(solver.load_factor, few, partial(factors), BATCH, settings)
        note = "same cones; set up once" if name == "clarabel" else "32-sided pyramids, hot start"
        yield timed_row(name, times[0], note=note)
        goal = Goal(10.0, at_least=True) if name == "clarabel" else None
        yield ratio_row(f"{name} / load factor", times, goal)

    standing = one(stances(tuple(load_robot("hexapod").legs), 1), 0)
    region = measure(lambda: support_region(standing, LOAD), settings)
    yield timed_row("support region, 18 directions, 6 feet", region, Goal(0.7e-3))
