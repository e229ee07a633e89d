# SPDX-License-Identifier: Apache-2.0
"""The links' own weight: it loads the actuators before any ground does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from leg_kinematics import Leg, Mirrored, Status, load_robot
from leg_kinematics.mechanisms.weighed import BarMass
from leg_statics import Contact, common_step, evaluate_footholds, load_capacity, longest_step
from leg_statics.joint_layout import joint_layout
from leg_statics.leg_state import Surroundings, leg_states
from leg_statics.weight import LEVEL_GRAVITY, level_gravity, weight_efforts

ROBOT = load_robot("solo12")
LEG = ROBOT.leg("FL")
FEET = LEG.mechanism.initial_posture.foot_position + np.random.default_rng(0).uniform(
    -0.05, 0.05, (200, 3)
)
CONTACT = Contact(0.5, load=4.0)


def weightless(leg):
    """Return the same leg with links of mass zero."""
    tree = leg.mechanism.tree
    light = replace(tree, joints=tuple(joint._replace(mass=0.0) for joint in tree.joints))
    return replace(leg, mechanism=replace(leg.mechanism, tree=light))


def test_a_foothold_with_weight_is_one_with_a_bias():
    posture = LEG.mechanism.inverse(FEET)
    assert (posture.status == Status.OK).all()
    bias = LEG.mechanism.holding_efforts(posture, LEVEL_GRAVITY)
    assert np.abs(bias).max() > 0.1
    found = evaluate_footholds(LEG, FEET, CONTACT)
    wanted = evaluate_footholds(weightless(LEG), FEET, CONTACT._replace(bias_efforts=bias))
    np.testing.assert_array_equal(found.verdict, wanted.verdict)
    np.testing.assert_allclose(found.numbers, wanted.numbers, rtol=1e-12, atol=1e-12)
    assert found.weight_counted


def test_a_leg_in_the_air_needs_the_efforts_of_its_weight():
    found = evaluate_footholds(LEG, FEET, Contact(0.5))
    np.testing.assert_allclose(
        found.joint_efforts,
        weight_efforts(LEG.mechanism, found.posture, level_gravity(LEG)),
        rtol=1e-12,
        atol=1e-12,
    )


def test_a_body_on_its_side_loads_other_joints():
    """Turning gravity is turning the whole leg, ground and all, the other way."""
    side = evaluate_footholds(LEG, FEET, Contact(0.5, gravity=(0.0, 9.80665, 0.0)))
    level = evaluate_footholds(LEG, FEET, Contact(0.5))
    least = evaluate_footholds(LEG, FEET, Contact(0.5, gravity=(0.0, 0.0, -1e-12)))
    assert np.abs(side.joint_efforts[:, 0] - level.joint_efforts[:, 0]).min() > 0.01
    np.testing.assert_allclose(least.joint_efforts, 0.0, atol=1e-9)
    each = np.tile([[0.0, 9.80665, 0.0]], (len(FEET), 1))
    again = evaluate_footholds(LEG, FEET, Contact(0.5, gravity=each))
    np.testing.assert_array_equal(again.numbers, side.numbers)


def test_states_and_steps_bear_the_weight():
    posture = LEG.mechanism.inverse(FEET)
    (group,) = joint_layout(ROBOT, LEG.joint_names).groups
    unknown = np.full((len(FEET), 1, 3), np.nan)
    around = Surroundings(0.5, 10.0, np.array(LEVEL_GRAVITY))
    states = leg_states(group, around, posture.joint_positions[:, None], unknown, unknown)
    bias = LEG.mechanism.holding_efforts(posture, LEVEL_GRAVITY)
    wanted = load_capacity(
        LEG.mechanism.jacobian(posture), *LEG.effort_limits.T, 0.5, bias_efforts=bias
    )
    np.testing.assert_allclose(states.load_capacity[:, 0], wanted.capacity, rtol=1e-9)
    heavy = Contact(0.5, load=float(np.median(wanted.capacity)))
    step, light = (
        longest_step(leg, -0.22, heavy, lateral_offset=0.06) for leg in (LEG, weightless(LEG))
    )
    np.testing.assert_array_equal(
        step.load_capacity, evaluate_footholds(LEG, step.positions, heavy).load_capacity
    )
    assert step.length > 1.05 * light.length  # the ground lifts what the actuators would hold
    together = common_step({"FL": LEG}, 0.22, heavy, lateral_offset=0.06)
    np.testing.assert_allclose(together.common_length, step.length, rtol=1e-9)


def test_a_mirrored_leg_bears_the_mirrored_weight():
    mirrored = Leg.of(Mirrored(LEG.mechanism), LEG.effort_limits)
    gravity = np.array([0.3, 2.0, -9.0])
    one = evaluate_footholds(LEG, FEET, Contact(0.5, gravity=tuple(gravity)))
    other = evaluate_footholds(
        mirrored, FEET * [1, -1, 1], Contact(0.5, gravity=tuple(gravity * [1, -1, 1]))
    )
    np.testing.assert_allclose(one.joint_efforts, other.joint_efforts, rtol=1e-12, atol=1e-14)


def test_legs_of_unknown_mass_tell_that_no_weight_is_counted():
    leg = load_robot("hexapod").leg("left_front")
    found = evaluate_footholds(leg, leg.mechanism.initial_posture.foot_position, Contact(0.5))
    assert not found.weight_counted
    np.testing.assert_array_equal(found.joint_efforts, 0.0)


@pytest.mark.parametrize("gravity", [(0.0, 1.0), "down", ((1.0, 2.0, 3.0),) * 7])
def test_gravity_that_does_not_fit_is_told(gravity):
    with pytest.raises(ValueError, match="gravity"):
        evaluate_footholds(LEG, FEET, Contact(0.5, gravity=gravity))


def test_masses_on_bars_of_a_linkage_count():
    bare = load_robot("hexapod").leg("left_front").geometry
    mechanism = replace(bare, bar_masses=(BarMass(("H", "R3"), 3.0), BarMass(("R5", "C"), 2.0)))
    leg = Leg.of(mechanism, (-150.0, 150.0))
    foot = mechanism.initial_posture.foot_position
    found, without = (evaluate_footholds(one, foot, Contact(0.5)) for one in (leg, Leg.of(bare)))
    assert found.weight_counted
    assert not without.weight_counted
    wanted = weight_efforts(mechanism, found.posture, level_gravity(leg))
    np.testing.assert_allclose(found.joint_efforts, wanted, rtol=1e-12, atol=1e-12)
    assert np.abs(wanted).max() > 1.0
