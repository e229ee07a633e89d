# SPDX-License-Identifier: Apache-2.0
"""The papers' mechanisms, written as robot models and read back, agree with their closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from papers_as_models import BLUEPRINTS, REACH, common_modes, load_model, moves

from leg_kinematics import MECHANISMS, Posture, Status
from leg_statics import joint_efforts, load_capacity

POSES = 2000
EFFORTS = 100.0
FORCE, MOMENT = np.array([3.0, -4.0, 10.0]), np.array([0.1, 0.2, -0.3])


def without_limits(mechanism):
    """Return a mechanism whose joints may stand anywhere."""
    wide = {"angle": (-math.pi, math.pi), "length": (-2.0, 2.0)}
    return replace(
        mechanism,
        joint_ranges=tuple(wide[joint.dimension] for joint in mechanism.joints),
        passive_joint_ranges=tuple(wide[e.dimension] for e in mechanism.excursions),
    )


MODES = [
    (without_limits(MECHANISMS[name]()), mode, posture)
    for name in BLUEPRINTS
    for mode, posture in common_modes(without_limits(MECHANISMS[name]())).items()
]


def poses(mechanism, mode, start):
    """Return postures of a mode in the ranges of its model, those farthest from singularities."""
    n = len(mechanism.joints)
    reach = math.pi if n == 1 else REACH[mechanism.name]
    for part in (1.0, 0.3, 0.1):
        spread = np.random.default_rng(5).uniform(-part * reach, part * reach, (5 * POSES, n))
        posture = mechanism.forward(start.joint_positions + spread, mode)
        posture = Posture(*(field[posture.status == Status.OK] for field in posture))
        if len(posture.status) >= POSES:
            break
    values = np.linalg.svd(mechanism.jacobian(posture)[:, :3], compute_uv=False)
    steep = values[:, 0] + (1.0 / values[:, min(n, 3) - 1] if n > 1 else 0.0)
    return Posture(*(field[np.argsort(steep)[:POSES]] for field in posture))


@pytest.mark.parametrize(
    ("mechanism", "mode", "start"), MODES, ids=[f"{m.name} {mode}" for m, mode, _ in MODES]
)
def test_a_model_agrees_with_the_closed_form(tmp_path, mechanism, mode, start):
    leg = load_model(tmp_path, mechanism, start)
    model, wanted = leg.mechanism, poses(mechanism, mode, start)
    found, twist = model.forward_with_twist(moves(mechanism, wanted))
    ok = found.status == Status.OK
    assert len(ok) == POSES
    assert ok.mean() > 0.99
    wanted, found = (Posture(*(field[ok] for field in p)) for p in (wanted, found))
    foot, jacobian = wanted.foot_position[:, :3], mechanism.jacobian(wanted)[:, :3]
    close = {"rtol": 0, "atol": 1e-7}
    np.testing.assert_allclose(leg.mount.to_base(found.foot_position), foot, rtol=0, atol=1e-9)
    size = np.maximum(1.0, np.abs(jacobian).max(axis=(1, 2), keepdims=True))
    np.testing.assert_allclose(twist[ok, :3] / size, jacobian / size, **close)
    angular = mechanism.angular_jacobian(wanted)
    np.testing.assert_allclose(twist[ok, 3:], angular, rtol=1e-6, atol=1e-6)

    passive = {joint.name: k for k, joint in enumerate(mechanism.passive_joints)}
    ways = mechanism.passive_joint_positions(wanted)
    ways = ways - mechanism.passive_joint_positions(mechanism.initial_posture)
    there = model.passive_joint_positions(found)
    shared = [k for k, joint in enumerate(model.passive_joints) if joint.name in passive]
    assert shared
    for k in shared:
        turns = (there[:, k] - ways[:, passive[model.passive_joints[k].name]]) / (2.0 * math.pi)
        np.testing.assert_allclose(turns, np.round(turns), **close)

    efforts = joint_efforts(twist[ok, :3], twist[ok, 3:], FORCE, MOMENT)
    wanted_efforts = joint_efforts(jacobian, angular, FORCE, MOMENT)
    np.testing.assert_allclose(efforts, wanted_efforts, rtol=1e-6, atol=1e-6)
    limits = np.full(len(model.joints), EFFORTS)
    capacities = [load_capacity(j, -limits, limits, 0.5) for j in (twist[ok, :3], jacobian)]
    shares = [1.0 / c.capacity for c in capacities]  # of the limits, by a load of 1 N
    np.testing.assert_allclose(*shares, rtol=1e-6, atol=1e-12)

    if len(model.joints) == 1:
        back = model.inverse(found.foot_position)
        again = model.forward(back.joint_positions).foot_position
        np.testing.assert_allclose(again, found.foot_position, rtol=0, atol=1e-6)
    if len(model.joints) == 3:
        back = model.inverse(leg.mount.to_leg(foot))
        np.testing.assert_array_equal(back.status, Status.OK)
        np.testing.assert_allclose(back.joint_positions, moves(mechanism, wanted), **close)
