# SPDX-License-Identifier: Apache-2.0
"""One point through the public functions: what a planner pays that asks point by point."""

from __future__ import annotations

from collections.abc import Iterator

from harness import Goal, Row, Settings, measure, timed_row
from workload import CONTACT, FRICTION, hexapod_leg, reachable_positions

from leg_statics.capacity.problem import load_capacity
from leg_statics.footholds import evaluate_footholds

GOAL = Goal(10e-6)


def rows(settings: Settings) -> Iterator[Row]:
    """Yield one call of each function."""
    leg = hexapod_leg()
    mechanism = leg.mechanism
    foot = reachable_positions(mechanism)[0]
    posture = mechanism.inverse(foot)
    jacobian = mechanism.jacobian(posture)
    lower, upper = leg.effort_limits.T
    mirrored = hexapod_leg("left_front")
    mirrored_foot = reachable_positions(mirrored.mechanism)[0]
    for name, function, goal in (
        ("inverse", lambda: mechanism.inverse(foot), GOAL),
        ("load_capacity", lambda: load_capacity(jacobian, lower, upper, FRICTION), GOAL),
        (
            "evaluate_footholds",
            lambda: evaluate_footholds(leg, foot, CONTACT),
            GOAL,
        ),
        (
            "evaluate_footholds, mirrored leg",
            lambda: evaluate_footholds(mirrored, mirrored_foot, CONTACT),
            None,
        ),
        ("inverse_with_twist", lambda: mechanism.inverse_with_twist(foot), None),
        ("forward", lambda: mechanism.forward(posture.joint_positions), None),
        ("jacobian", lambda: mechanism.jacobian(posture), None),
    ):
        yield timed_row(name, measure(function, settings), goal, "one point a call")
