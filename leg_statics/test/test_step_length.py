# SPDX-License-Identifier: Apache-2.0
"""Step length against brute force, and the paper's finding about smooth ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from leg_kinematics import Leg, NotSupportedError, ShapeError, ValueRangeError, load_robot
from leg_kinematics.robot import Mount
from leg_statics.footholds import Contact, Verdict, evaluate_footholds
from leg_statics.grounds import load_grounds
from leg_statics.published.paper_000 import STEP, legs
from leg_statics.step_length import Criterion, _brackets, common_step, longest_step

LEGS = {stage: Leg.of(mechanism, (-60.0, 60.0)) for stage, mechanism in legs().items()}
LEG = LEGS["optimised"]
GROUNDS = load_grounds().by_name


def brute_force(direction, height, offset, contact, spacing=1e-4):
    """Longest run of feasible points of a fine sampling."""
    left = np.array([-direction[1], direction[0], 0.0])
    s = np.arange(-1.0, 1.0, spacing)
    points = offset * left + np.array([0, 0, height]) + s[:, None] * np.asarray(direction)
    feasible = evaluate_footholds(LEG, points, contact).feasible
    edges = np.flatnonzero(np.diff(np.concatenate([[0], feasible.astype(int), [0]])))
    starts, ends = edges[::2], edges[1::2]
    if not len(starts):
        return 0.0, np.nan, np.nan
    longest = np.argmax(ends - starts)
    return (
        spacing * (ends - starts - 1)[longest],
        s[starts[longest]],
        s[ends[longest] - 1],
    )


@pytest.mark.parametrize("height", [-0.72, -0.6, -0.5])
@pytest.mark.parametrize("offset", [0.0, 0.08])
@pytest.mark.parametrize("direction", [(0.0, 1.0, 0.0), (0.6, 0.8, 0.0), (1.0, 0.0, 0.0)])
def test_the_step_equals_brute_force(height, offset, direction):
    contact = Contact(0.3, load=180.0)
    step = longest_step(LEG, height, contact, lateral_offset=offset, direction=direction)
    length, start, end = brute_force(direction, height, offset, contact)
    assert step.length == pytest.approx(length, abs=2e-4)
    if length:
        assert step.start @ np.asarray(direction) == pytest.approx(start, abs=2e-4)
        assert step.end @ np.asarray(direction) == pytest.approx(end, abs=2e-4)


def test_the_ends_are_feasible_and_a_tenth_of_a_millimetre_further_they_are_not():
    heights = np.linspace(-0.72, -0.45, 10)
    contact = Contact(0.3, load=180.0)
    step = longest_step(LEG, heights, contact)
    found = step.length > 0.0
    assert found.sum() > 5
    ahead = np.array([1e-4, 0.0, 0.0])
    for ends, outward, limits in (
        (step.start, -ahead, step.start_limit),
        (step.end, ahead, step.end_limit),
    ):
        inside = evaluate_footholds(LEG, ends[found], contact)
        outside = evaluate_footholds(LEG, (ends + outward)[found], contact)
        assert inside.feasible.all()
        np.testing.assert_array_equal(outside.verdict, limits[found])
        assert not outside.feasible.any()


def test_every_point_of_the_profile_carries_the_load():
    step = longest_step(LEG, [-0.65, -0.55], Contact(0.3, load=180.0))
    assert step.positions.shape == (2, 21, 3)
    assert np.all(step.load_capacity >= 180.0)
    np.testing.assert_allclose(step.positions[:, 0], step.start)
    np.testing.assert_allclose(step.positions[:, -1], step.end)
    np.testing.assert_allclose(step.end - step.start, step.length[:, None] * [1, 0, 0], atol=1e-12)


@pytest.mark.parametrize("stage", LEGS)
@pytest.mark.parametrize("criterion", Criterion)
def test_the_smoother_the_ground_the_shorter_the_step(stage, criterion):
    heights = np.linspace(-0.85, -0.5, 15)
    load = 250.0 if criterion == Criterion.CAPACITY else 0.0
    steps = [
        longest_step(LEGS[stage], heights, Contact(mu, load=load), criterion=criterion)
        for mu in (0.05, 0.08, 0.2, 0.4, 0.6, 0.9)
    ]
    lengths = np.stack([step.length for step in steps])
    assert np.all(np.diff(lengths, axis=0) >= -1e-5)
    assert np.any(lengths[0] < 0.6 * lengths[-1])
    assert lengths[0].max() < lengths[-1].max()


@pytest.mark.parametrize("stage", LEGS)
def test_a_step_of_300_mm_fits_on_cement_before_and_after_the_optimisation(stage):
    heights = np.linspace(-0.9, -0.45, 19)
    contact = Contact(GROUNDS["cement"].friction_low)
    step = longest_step(LEGS[stage], heights, contact, criterion=Criterion.RATED_FRICTION)
    assert step.length.max() > STEP
    ice = Contact(GROUNDS["ice"].friction_low)
    on_ice = longest_step(LEGS[stage], heights, ice, criterion=Criterion.RATED_FRICTION)
    assert on_ice.length.max() < STEP  # what fits on ice at its smoothest is shorter


def test_the_papers_criterion_asks_for_mu_e_along_the_whole_stance():
    contact = Contact(0.25)
    step = longest_step(LEG, -0.62, contact, criterion=Criterion.RATED_FRICTION)
    assert np.nanmax(step.rated_friction) <= 0.25 + 1e-5
    assert Verdict.FRICTION in (step.start_limit, step.end_limit)


def test_heights_are_a_batch():
    heights = np.array([[-0.7, -0.65], [-0.55, -0.1]])
    contact = Contact(0.3, load=150.0)
    together = longest_step(LEG, heights, contact)
    assert together.length.shape == (2, 2)
    for index in np.ndindex(2, 2):
        one = longest_step(LEG, heights[index], contact)
        assert one.length == pytest.approx(together.length[index], abs=1e-9)
    assert together.length[1, 1] == 0.0
    assert np.isnan(together.start[1, 1]).all()


def test_walking_backwards_swaps_the_ends():
    contact = Contact(0.3, load=150.0)
    there = longest_step(LEG, -0.6, contact)
    back = longest_step(LEG, -0.6, contact, direction=(-2.0, 0.0, 0.0))
    np.testing.assert_allclose(there.start, back.end, atol=3e-6)
    assert there.length == pytest.approx(back.length, abs=5e-6)


def test_the_common_step_is_the_shortest():
    robot = load_robot("hexapod")
    contact = Contact(0.4, load=300.0)
    heights = [0.5, 0.6]
    common = common_step(robot.legs, heights, contact, lateral_offset=0.05)
    lengths = np.array([step.length for step in common.steps.values()])
    assert list(common.steps) == list(robot.legs)
    np.testing.assert_array_equal(common.common_length, lengths.min(axis=0))
    # lateral offset counts to the left of the direction: inward for a leg, outward for its mirror
    left, right = common.steps["left_front"], common.steps["right_front"]
    mirror = common_step(
        robot.legs,
        heights,
        contact,
        lateral_offset=lambda leg: -0.05 if leg.mirrored else 0.05,
    )
    np.testing.assert_allclose(
        mirror.steps["left_front"].length, mirror.steps["right_front"].length, atol=5e-6
    )
    assert left.length.shape == right.length.shape == (2,)


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-0.2, 0.2), st.floats(2.6e-4, 2e-3)), min_size=1, max_size=4),
    st.floats(0.0, 1e-3),
)
def test_no_stance_spans_a_gap_longer_than_a_quarter_of_a_millimetre(gaps, shift):
    def is_feasible(line, s):
        s, _ = np.broadcast_arrays(s, line)
        inside = np.abs(s - shift) < 0.2
        for start, length in gaps:
            inside &= ~((start <= s) & (s <= start + length))
        return inside

    lines = np.arange(3)
    good, bad = _brackets(is_feasible, lines, 0.5)
    assert np.all(is_feasible(lines, good))
    assert not np.any(is_feasible(lines, bad))
    rear, front = good[:, 0]
    for start, length in gaps:
        assert front < start + length or start < rear
    np.testing.assert_array_equal(good, good[:, :1].repeat(3, axis=1))


def test_the_step_of_a_tilted_leg_is_level_and_bears_its_load_against_gravity():
    contact = Contact(0.35, load=180.0)
    for degrees in (0.05, 15.0):
        tilt = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
        mount = Mount(np.array([0.3, 0.1, 0.02]), tilt)
        leg = replace(LEG, mount=mount)
        step = common_step({"leg": leg}, 0.55, contact, lateral_offset=0.05).steps["leg"]
        assert step.length > 0.05
        ends = mount.to_base(np.stack([step.start, step.end]))
        np.testing.assert_allclose(ends[:, 2], -0.55, atol=1e-12)
        np.testing.assert_allclose(ends[:, 1], 0.1 + 0.05, atol=1e-12)
        up = mount.vectors_to_leg([0.0, 0.0, 1.0])
        told = contact._replace(normal=up, gravity=-np.asarray(up))
        found = evaluate_footholds(LEG, step.positions, told)
        assert found.feasible.all()
        np.testing.assert_allclose(found.load_capacity, step.load_capacity, rtol=1e-12)
        ahead = mount.vectors_to_leg([1e-4, 0.0, 0.0])
        behind = evaluate_footholds(LEG, step.start - ahead, told).verdict
        before = evaluate_footholds(LEG, step.end + ahead, told).verdict
        assert behind == step.start_limit != Verdict.FEASIBLE
        assert before == step.end_limit != Verdict.FEASIBLE


def test_a_leg_without_rated_friction_has_no_step_by_it():
    leg = load_robot("walker").leg("left_front_inner")
    with pytest.raises(NotSupportedError, match="RATED_FRICTION"):
        longest_step(leg, -0.05, Contact(0.4), criterion=Criterion.RATED_FRICTION)


def test_a_height_with_a_forgotten_sign_is_refused_and_one_that_is_too_low_has_no_step():
    with pytest.raises(ValueRangeError, match=r"height must be negative below .* got 0.6"):
        longest_step(LEG, [-0.6, 0.6], Contact(0.4))
    assert longest_step(LEG, -6.0, Contact(0.4)).length == 0.0


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"direction": (0.0, 0.0, 0.0)}, "direction"),
        ({"direction": (0.0, 1.0, 0.5)}, "direction"),
        ({"direction": (np.nan, 1.0, 0.0)}, "direction"),
        ({"lateral_offset": np.inf}, "lateral_offset"),
    ],
)
def test_bad_arguments_are_named(arguments, named):
    with pytest.raises(ValueRangeError, match=named):
        longest_step(LEG, -0.6, Contact(0.4), **arguments)
    with pytest.raises(ValueRangeError, match="height"):
        longest_step(LEG, np.nan, Contact(0.4))
    with pytest.raises(ShapeError, match="direction"):
        longest_step(LEG, -0.6, Contact(0.4), direction=(0.0, 1.0))
