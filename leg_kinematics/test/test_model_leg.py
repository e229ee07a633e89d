# SPDX-License-Identifier: Apache-2.0
"""Legs of robot models: every solution, loops that stay closed, mistakes that are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanism_zoo import joint_distance, random_joints
from model_legs import FIVE_BAR, MEET, SERIAL, five_bar, joint, serial_leg, urdf

from leg_kinematics import DescriptionError, GeometryError, Status, load_robot
from leg_kinematics.mechanisms.leg_of_tree import leg_of_tree
from leg_kinematics.mechanisms.newton_leg import NewtonLeg
from leg_kinematics.mechanisms.serial_leg import SerialLeg
from leg_kinematics.model.leg_tree import Foot, leg_tree
from leg_kinematics.model.postures import loop_state

GRAVITY = np.array([0.4, -0.3, -9.7])


def open_by(leg, posture):
    """Return how far the loops of postures are open [m]."""
    q = leg._all_joints(posture)
    return max(np.abs(loop_state(leg.tree, one)[0]).max() for one in q)


# --------------------------------------------------------------------------- three in a row


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["meet", "parallel", "behind"]))
def test_every_solution_of_a_random_leg_is_one_of_the_modes(seed, kind):
    """Axes 1 and 2 meet, or are parallel, or axes 2 and 3 do; else as they come."""
    rng = np.random.default_rng(seed)
    axes, places = rng.normal(size=(3, 3)), rng.uniform(-0.3, 0.3, (4, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    if kind == "meet":
        places[1] = rng.uniform(-0.2, 0.2) * axes[0] + rng.uniform(-0.2, 0.2) * axes[1]
    if kind == "parallel":
        axes[1] = axes[0]
    if kind == "behind":
        axes[2] = axes[1]
    text = [" ".join(map(repr, row.tolist())) for row in (*axes, *places)]
    tree = urdf(
        *('<link name="b"/>', '<link name="l1"/>', '<link name="l2"/>', '<link name="l3"/>'),
        *(joint(f"j{k}", ("b", "l1", "l2")[k], f"l{k + 1}", text[3 + k], axis=text[k],
                kind="continuous") for k in range(3)),
    )  # fmt: skip
    start = rng.uniform(-2.0, 2.0, 3).tolist()
    assembly = {"initial": dict(zip(("j0", "j1", "j2"), start, strict=True))}
    leg = leg_of_tree(leg_tree(tree, "b", Foot("l3", tuple(places[3]))), assembly=assembly)
    assert isinstance(leg, SerialLeg)
    q = random_joints(leg, 300, seed)
    one_mode = np.zeros(len(q), dtype=int)
    for mode in leg.assembly_modes:
        posture = leg.forward(q, mode)
        found = leg.inverse(posture.foot_position, mode)
        ok = posture.status == Status.OK
        one_mode += ok
        near = joint_distance(leg, found.joint_positions[ok], q[ok])
        steep = np.abs(np.linalg.pinv(leg.jacobian(posture)[ok])).max(axis=(1, 2), initial=1.0)
        assert np.all(near <= 1e-9 * (1.0 + steep**2))
        assert not ((found.status == Status.OK) & np.isnan(found.joint_positions).any(axis=1)).any()
    assert np.mean(one_mode == 1) > 0.99
    assert one_mode.max() == 1


def test_newtons_method_finds_what_the_closed_form_does():
    leg = replace(serial_leg(), joint_ranges=((-0.8, 0.9), (-1.2, 1.0), (0.3, 2.4)))
    other = NewtonLeg(
        leg.tree, leg.actuated, leg.postures, leg.joint_ranges, leg.passive_joint_ranges
    )
    q = random_joints(leg, 2000, beyond=0.05)
    foot = leg.forward(q).foot_position
    one, two = leg.inverse_with_twist(foot), other.inverse_with_twist(foot)
    ok = one[0].status == Status.OK
    np.testing.assert_array_equal(two[0].status == Status.OK, ok)
    assert ok.sum() > 1000
    np.testing.assert_allclose(
        one[0].joint_positions[ok], two[0].joint_positions[ok], rtol=0, atol=1e-8
    )
    np.testing.assert_allclose(one[1][ok], two[1][ok], rtol=0, atol=1e-8)
    np.testing.assert_allclose(
        leg.holding_efforts(one[0], GRAVITY)[ok],
        other.holding_efforts(two[0], GRAVITY)[ok],
        rtol=0, atol=1e-8,
    )  # fmt: skip


# --------------------------------------------------------------------------- loops


def test_loops_stay_closed_and_answers_do_not_depend_on_the_batch():
    leg = five_bar()
    feet = leg.forward(random_joints(leg, 3000)).foot_position
    found = leg.inverse(feet)
    ok = found.status == Status.OK
    assert ok.sum() > 1500
    assert open_by(leg, type(found)(*(field[ok] for field in found))) <= 1e-10
    order = np.random.default_rng(1).permutation(len(feet))
    again = leg.inverse(feet[order])
    np.testing.assert_array_equal(again.joint_positions, found.joint_positions[order])


def test_a_path_never_changes_the_branch():
    leg = five_bar()
    start = leg.initial_posture.foot_position
    rng = np.random.default_rng(2)
    corners = leg.forward(random_joints(leg, 60)).foot_position
    corners = corners[np.isfinite(corners).all(axis=1)]
    t = np.linspace(0.0, 1.0, 400)[:, None]
    for corner in corners[rng.permutation(len(corners))[:30]]:
        posture = leg.inverse(start + t * (corner - start))
        ok = posture.status == Status.OK
        q = leg._all_joints(posture)
        both = ok[1:] & ok[:-1]
        steep = np.abs(np.linalg.pinv(leg.jacobian(posture)[ok])).max()
        step = np.linalg.norm(corner - start) / 399
        assert np.abs(np.diff(q, axis=0))[both].max() <= 20.0 * (1.0 + steep) * step


@pytest.mark.parametrize("make", [serial_leg, five_bar])
def test_holding_efforts_are_the_slope_of_the_potential_energy(make):
    leg = make()
    posture = leg.forward(random_joints(leg, 300))
    posture = type(posture)(*(field[posture.status == Status.OK] for field in posture))
    step = 1e-5

    def energy(q):
        where = leg.forward(q)
        links = {j.name: k for k, j in enumerate(leg.tree.joints)}
        assert len(links) == len(leg.tree.joints)
        return potential(leg, leg._all_joints(where))

    efforts = leg.holding_efforts(posture, GRAVITY)
    for k in range(len(leg.joints)):
        dq = step * np.eye(len(leg.joints))[k]
        slope = (energy(posture.joint_positions + dq) - energy(posture.joint_positions - dq)) / (
            2 * step
        )
        known = np.isfinite(slope)
        assert known.sum() > 100
        np.testing.assert_allclose(efforts[known, k], slope[known], rtol=1e-5, atol=1e-5)


def potential(leg, q):
    """Return the potential energy (m,) of all links, body by body."""
    total = np.zeros(len(q))
    for i, row in enumerate(q):
        turns, origins = [np.eye(3)], [np.zeros(3)]
        for j, value in zip(leg.tree.joints, row, strict=True):
            x, y, z = j.axis
            K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            R = np.eye(3) + np.sin(value) * K + (1 - np.cos(value)) * K @ K
            origins.append(origins[j.parent] + turns[j.parent] @ j.offset)
            turns.append(turns[j.parent] @ R)
            total[i] -= j.mass * GRAVITY @ (origins[-1] + turns[-1] @ j.centre)
    return total


# --------------------------------------------------------------------------- what makes no leg


def closed(closure):
    return replace(FIVE_BAR, closures=(closure,))


WRONG_LEGS = {
    "no such foot": (lambda: leg_tree(SERIAL, "base", Foot("paw")), "unknown link 'paw'.*toe"),
    "foot not below": (lambda: leg_tree(SERIAL, "shin", Foot("base")), "not below 'shin'"),
    "foot on the base": (lambda: leg_tree(SERIAL, "shin", Foot("toe")), "no joint moves 'toe'"),
    "too few actuators": (
        lambda: leg_of_tree(leg_tree(closed(MEET), "base", Foot("shin")), ["hip", "thigh"]),
        "3 freedom.*2 actuated",
    ),
    "too many actuators": (
        lambda: leg_of_tree(
            leg_tree(closed(MEET), "base", Foot("shin")), ["hip", "thigh", "crank", "knee"]
        ),
        "3 freedom.*4 actuated",
    ),
    "a loop that does not close": (
        lambda: leg_of_tree(leg_tree(closed(MEET._replace(first_points=np.array([[0, 0.3, 0.0]]))),
                                   "base", Foot("shin"))),
        "loops do not close",
    ),
    "an unknown joint": (
        lambda: leg_of_tree(leg_tree(SERIAL, "base", Foot("toe")), ["ankel"]),
        "no joint 'ankel'.*knee",
    ),
    "straight": (
        lambda: leg_of_tree(leg_tree(SERIAL, "base", Foot("shin", (0.0, 0.0, -0.3))),
                          assembly={"initial": {"knee": 0.0}}),
        "singular",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("make", "message"), WRONG_LEGS.values(), ids=WRONG_LEGS)
def test_what_makes_no_leg_is_told(make, message):
    with pytest.raises((DescriptionError, GeometryError, KeyError), match=message):
        make()


WRONG_FILES = {
    "unknown type": ('type="revolute"', 'type="floating"', "floating.*revolute, continuous"),
    "missing link": ('child link="b"', 'child link="c"', "names link 'c'.*a, b"),
    "missing limit": ("<limit ", "<limt ", "needs <limit"),
    "reversed limit": ('lower="-1"', 'lower="3"', "lower 3.0 must be < upper"),
    "a word": ('upper="1"', 'upper="much"', "upper='much'"),
    "NaN": ('upper="1"', 'upper="nan"', "finite"),
    "two numbers": ('xyz="0 0 1"', 'xyz="0 1"', "3 finite"),
    "no axis": ('axis xyz="0 1 0"', 'axis xyz="0 0 0"', "must not be zero"),
    "coupled": ("<axis", '<mimic joint="k"/><axis', "mimic"),
    "no XML": ("</robot>", "</robt>", "no XML"),
    "circle": ('parent link="a"', 'parent link="b"', "own parent"),
    "an entity": ("<robot", '<!DOCTYPE r [<!ENTITY e "x">]><robot', "entity"),
}
GOOD = (
    '<robot name="r"><link name="a"/><link name="b"/>\n'
    '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 1"/>'
    '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="2"/></joint></robot>'
)


@pytest.mark.parametrize(("old", "new", "message"), WRONG_FILES.values(), ids=WRONG_FILES)
def test_a_mistake_in_a_urdf_is_told_with_its_line(tmp_path, old, new, message):
    assert old in GOOD
    (tmp_path / "r.urdf").write_text(GOOD.replace(old, new, 1))
    robot = tmp_path / "r.yaml"
    robot.write_text("name: r\nbase_frame: a\nmodel: {file: r.urdf}\nlegs:\n  leg: {foot: b}\n")
    with pytest.raises(DescriptionError, match=rf"(?s)r.urdf:[12]: .*{message}"):
        load_robot(robot)


def test_a_shipped_quadruped_is_read_from_its_urdf():
    robot = load_robot("solo12")
    assert list(robot.legs) == ["FL", "FR", "HL", "HR"]
    leg = robot.leg("FL")
    assert leg.joint_names == ("FL_HAA", "FL_HFE", "FL_KFE")
    np.testing.assert_array_equal(leg.mount.position, [0.1946, 0.0875, 0.0])
    np.testing.assert_array_equal(leg.effort_limits, [[-2.7, 2.7]] * 3)
    assert leg.mechanism.mass == pytest.approx(2 * 0.14853845 + 0.03070001 + 0.00693606)
    feet = [robot.leg(n).mechanism.initial_posture.foot_position for n in ("FL", "FR")]
    np.testing.assert_allclose(feet[0] * [1, -1, 1], feet[1], atol=1e-15)
