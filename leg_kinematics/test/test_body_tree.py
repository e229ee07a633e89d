# SPDX-License-Identifier: Apache-2.0
"""The bodies of a leg: where the mechanism stands they stand, too, and their loops close."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mechanism_zoo import ALL, PLAIN, random_joints, varied
from scipy.spatial.transform import Rotation

from leg_kinematics import MECHANISMS, GeometryError, Mirrored, NotSupportedError, UnknownNameError
from leg_kinematics.mechanism import Mechanism

LEGS = ALL | {
    f"{n} {k}": m for n, kind in MECHANISMS.items() for k, m in enumerate(varied(kind, 2))
}
legs = pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)


def placed(tree, q):
    """Return rotations and origins of the bodies, by rotations of scipy."""
    rotations, origins = [Rotation.identity(len(q))], [np.zeros((len(q), 3))]
    for joint, position in zip(tree.joints, q.T, strict=True):
        carrier, axis, offset = rotations[joint.parent], np.array(joint.axis), joint.offset
        move = position[:, None] * axis
        if joint.type == "revolute":
            rotations.append(carrier * Rotation.from_rotvec(move))
            move = np.zeros_like(move)
        else:
            rotations.append(carrier)
        origins.append(origins[joint.parent] + carrier.apply(offset + move))
    return rotations, origins


def solved(leg, mode, count=400):
    """Return joint positions that the leg has a posture for in a mode, and the posture."""
    posture = leg.forward(random_joints(leg, count), mode)
    found = np.isfinite(posture.foot_position).all(axis=-1) & np.isfinite(posture.closure).all(-1)
    return type(posture)(*(field[found] for field in posture))


@legs
def test_in_every_mode_the_loops_of_the_bodies_close_and_the_foot_is_there(leg):
    """Wherever the leg has a posture, which is in its first mode in any case."""
    for mode in leg.assembly_modes:
        posture = solved(leg, mode)
        if not len(posture.status):
            assert mode != leg.assembly_modes[0]
            continue
        tree, q = leg.body_tree(mode), leg.tree_positions(posture)
        rotations, origins = placed(tree, q)

        def at(body, point, rotations=rotations, origins=origins):
            return origins[body] + rotations[body].apply(point)

        for c in tree.coincidences:
            gap = at(c.first, c.first_point) - at(c.second, c.second_point)
            assert np.abs(gap).max() < 1e-9, (mode, c)
        foot = at(tree.foot_body, tree.foot_point)
        np.testing.assert_allclose(foot, posture.foot_position[:, :3], rtol=0, atol=1e-9)


@legs
def test_the_body_of_the_foot_turns_as_the_twist_tells(leg):
    tree, step = leg.body_tree(), 1e-5
    posture = solved(leg, "", 200)
    jacobian = leg.angular_jacobian(posture)
    scale = np.maximum(1.0, np.abs(leg.twist_jacobian(posture)).max(axis=(-2, -1)))
    for k in range(len(leg.joints)):
        ends = []
        for way in (-step, step):
            q = posture.joint_positions.copy()
            q[:, k] += way
            ends.append(placed(tree, leg.tree_positions(leg.forward(q)))[0][tree.foot_body])
        rate = (ends[1] * ends[0].inv()).as_rotvec() / (2.0 * step)
        error = np.abs(rate - jacobian[..., k]).max(axis=1) / scale**3
        assert np.quantile(error, 0.95) < 1e-6


@legs
def test_actuated_joints_keep_their_names_types_and_ranges(leg):
    joints = {joint.name: joint for joint in leg.body_tree().joints}
    for joint, limits in zip(leg.joints, leg.joint_limits, strict=True):
        assert joints[joint.name].type == joint.type
        np.testing.assert_array_equal(joints[joint.name].limits, limits)


@pytest.mark.parametrize("leg", PLAIN.values(), ids=PLAIN)
def test_freedoms_are_those_of_the_actuators(leg):
    """Rank of the loops' equations, by finite differences, and the actuators make all joints."""
    tree, q = leg.body_tree(), leg.tree_positions(solved(leg, "", 50))
    step, n = 1e-6, len(tree.joints)

    def gaps(q):
        rotations, origins = placed(tree, q)
        parts = [
            origins[c.first]
            + rotations[c.first].apply(c.first_point)
            - origins[c.second]
            - rotations[c.second].apply(c.second_point)
            for c in tree.coincidences
        ]
        return np.concatenate([*parts, np.zeros((len(q), 1))], axis=1)

    columns = [(gaps(q + d) - gaps(q - d)) / (2.0 * step) for d in step * np.eye(n)]
    ranks = np.linalg.matrix_rank(np.stack(columns, axis=-1), tol=1e-6)
    assert np.median(ranks) == n - len(leg.joints)


def test_modes_that_turn_a_plate_over_have_another_body():
    leg = PLAIN["six_bar"]
    trees = {mode: leg.body_tree(mode) for mode in ("walking", "flipped_crank", "flipped_rocker")}
    assert trees["flipped_crank"] != trees["walking"]
    assert trees["flipped_rocker"].foot_point == pytest.approx(trees["walking"].foot_point)


def test_a_mode_that_is_none_is_told():
    for leg in PLAIN.values():
        for mechanism in (leg, Mirrored(leg)) if leg.has_point_foot else (leg,):
            with pytest.raises(UnknownNameError, match="assembly mode"):
                mechanism.body_tree("sideways")


def test_a_mode_in_which_the_bars_close_nowhere_is_told():
    leg = PLAIN["theo_jansen"]
    short, turn = replace(leg, link=0.6 * leg.link), np.linspace(0.0, 6.3, 300)[:, None]
    assert np.isfinite(short.forward(turn).foot_position).any()
    assert np.isnan(short.forward(turn, "flipped_upper_rocker").foot_position).all()
    with pytest.raises(GeometryError, match="flipped_upper_rocker"):
        short.body_tree("flipped_upper_rocker")


def test_a_mechanism_that_does_not_tell_its_bodies_says_so():
    class Silent(type(PLAIN["six_bar"])):
        body_tree = Mechanism.body_tree

    leg = Silent()
    assert not leg.offers(Mechanism.body_tree)
    with pytest.raises(NotSupportedError, match="six_bar"):
        leg.tree_positions(leg.initial_posture)
