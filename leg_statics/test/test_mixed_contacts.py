# SPDX-License-Identifier: Apache-2.0
"""Candidates of which each has its own cone and direction of load, against a conic solver.

`make contacts` compares ten thousand.
"""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_capacity import BOUNDED, capacity_by_socp

from leg_kinematics import load_robot
from leg_statics.footholds import Contact, Verdict, evaluate_footholds
from leg_statics.weight import weight_efforts

SIZES = {"hexapod": 500.0, "solo12": 15.0}  # of loads [N]
ACCURACY = 1e-6  # of clarabel, as a share of the capacity


def mixed_candidates(robot_name, count, seed):
    """Return a leg, reachable feet, and contacts with slopes and loads in every direction."""
    rng = np.random.default_rng(seed)
    leg = next(iter(load_robot(robot_name).legs.values()))
    lower, upper = leg.mechanism.joint_limits.clip(-3.0, 3.0).T
    posture = leg.mechanism.forward(rng.uniform(lower, upper, (8 * count, 3)))
    feet = posture.foot_position[posture.status == 0][:count]
    assert len(feet) == count
    normal = Rotation.random(count, rng=rng).as_matrix()[:, :, 2]
    tilt = Rotation.from_rotvec(rng.uniform(-0.8, 0.8, (count, 3)))
    size = SIZES[robot_name]
    contact = Contact(
        friction=rng.uniform(0.0, 1.0, count),
        normal=normal,
        load=rng.uniform(0.0, 2.0, count) * size,
        bias_efforts=rng.normal(size=(count, 3)) * 0.01 * size,
        gravity=9.81 * Rotation.random(count, rng=rng).as_matrix()[:, :, 2],
        load_direction=tilt.apply(normal),
    )
    return leg, feet, contact


def disagreements(robot_name, count, seed=1):
    """Return the candidates whose capacity or verdict is not what clarabel says."""
    leg, feet, contact = mixed_candidates(robot_name, count, seed)
    found = evaluate_footholds(leg, feet, contact)
    jacobian = leg.mechanism.jacobian(found.posture)
    bias = contact.bias_efforts + weight_efforts(leg.mechanism, found.posture, contact.gravity)
    lower, upper = leg.effort_limits.T
    wrong = []
    for k in range(count):
        status, capacity = capacity_by_socp(
            *(jacobian[k], lower, upper, contact.friction[k], contact.normal[k]),
            *(contact.load_direction[k], bias[k]),
        )
        capacity = capacity if status == BOUNDED else 0.0  # not held even without load
        near = abs(found.load_capacity[k] - capacity) <= ACCURACY * max(capacity, 1e-3)
        feasible = found.verdict[k] == Verdict.FEASIBLE
        open_ = abs(capacity - contact.load[k]) <= ACCURACY * max(capacity, 1e-3)
        if not near or not (open_ or feasible == (capacity >= contact.load[k])):
            wrong.append((k, status, float(capacity), float(found.load_capacity[k])))
    assert len(set(found.verdict.tolist())) >= 2
    return wrong


@pytest.mark.parametrize("robot", SIZES)
def test_oblique_loads_on_cones_of_their_own_equal_clarabel(robot):
    assert disagreements(robot, 500) == []


if __name__ == "__main__":
    total = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    for name in SIZES:
        differing = disagreements(name, total // len(SIZES), seed=2)
        print(f"{name}: {len(differing)} of {total // len(SIZES)} candidates differ from clarabel")
        print(*differing[:10], sep="\n")
