# SPDX-License-Identifier: Apache-2.0
"""What `TheoJansen` and `SixBar` have in common: lengths, rates, passes of the foot, limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from leg_kinematics import GeometryError, Status
from leg_kinematics.geometry import geometry_parameters
from leg_kinematics.mechanisms.six_bar import SixBar
from leg_kinematics.mechanisms.theo_jansen import TheoJansen
from leg_kinematics.mirrored import Mirrored

JANSEN, SIX_BAR = TheoJansen(crank_length=0.02), SixBar(crank_length=0.02)
ODD = TheoJansen(crank_length=0.03, crank_zero=1.1, upper_coupler=3.5, link=2.7, frame_angle=0.1)
# A coupler so short that the crank cannot turn all the way round.
SWINGING = SixBar(coupler=1.9, rocker=1.4, rod=3.5)

legs = pytest.mark.parametrize(
    "leg", [JANSEN, ODD, SIX_BAR, SWINGING], ids=["jansen", "odd", "six_bar", "swinging"]
)
turning = pytest.mark.parametrize("leg", [JANSEN, ODD, SIX_BAR], ids=["jansen", "odd", "six_bar"])

TURN = np.linspace(-math.pi, math.pi, 2000, endpoint=False)[:, None]


def distances(linkage, first, second):
    index = linkage.names.index
    return np.linalg.norm(
        linkage.points[..., index(first), :] - linkage.points[..., index(second), :], axis=-1
    )


def angle_between(first, second):
    return np.abs(np.angle(np.exp(1j * (first - second))))


@legs
def test_every_bar_keeps_its_length_in_every_mode(leg):
    for mode in leg.assembly_modes:
        linkage = leg.linkage(leg.forward(TURN, mode))
        for dyad in leg.dyads:
            for end, bar in zip(dyad.ends, dyad.bars, strict=True):
                found = distances(linkage, dyad.joint, end)
                found = found[np.isfinite(found)]
                wanted = getattr(leg, bar) * leg.crank_length
                np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13)
        for triangle in leg.triangles:
            p, q, tip = triangle.points
            for ends, side in zip(((p, q), (p, tip), (q, tip)), triangle.sides, strict=True):
                found = distances(linkage, *ends)
                found = found[np.isfinite(found)]
                wanted = getattr(leg, side) * leg.crank_length
                np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13)


@legs
def test_crank_and_frame_stand_where_they_should(leg):
    linkage = leg.linkage(leg.forward(TURN))
    index = linkage.names.index
    angle = leg.crank_zero + TURN[:, 0]
    pin = np.stack([-np.cos(angle), 0 * angle, np.sin(angle)], axis=-1) * leg.crank_length
    np.testing.assert_allclose(linkage.points[:, index("B")], pin, atol=1e-15)
    frame = leg.frame_length * leg.crank_length
    pivot = [-frame * math.cos(leg.frame_angle), 0.0, frame * math.sin(leg.frame_angle)]
    np.testing.assert_allclose(linkage.points[0, index("D")], pivot, atol=1e-15)


@turning
def test_the_crank_turns_all_the_way_round_and_the_foot_is_g(leg):
    posture = leg.forward(TURN)
    assert (posture.status == Status.OK).all()
    np.testing.assert_array_equal(posture.foot_position, leg.linkage(posture).points[:, -1])
    np.testing.assert_array_equal(posture.foot_position[:, 1], 0.0)


@legs
def test_inverse_undoes_forward(leg):
    for mode in leg.assembly_modes:
        posture = leg.forward(TURN, mode)
        good = posture.status == Status.OK
        assert good.any() or mode != leg.assembly_modes[0]
        back = leg.inverse(posture.foot_position[good], mode)
        assert (back.status == Status.OK).all()
        np.testing.assert_allclose(
            back.foot_position, posture.foot_position[good], rtol=0, atol=1e-9
        )


@turning
def test_inverse_finds_the_crank_angle(leg):
    back = leg.inverse(leg.forward(TURN).foot_position)
    assert angle_between(back.joint_positions, TURN).max() < 1e-9


@legs
def test_nearest_pass_beats_a_fine_search(leg):
    rng = np.random.default_rng(3)
    points = rng.uniform(-7, 3, (40, 3)) * leg.crank_length
    points[:, 1] *= 0.1
    passes = leg.nearest_crank_angles(points)
    feet = leg.forward(np.linspace(-math.pi, math.pi, 40_000)[:, None]).foot_position
    feet = feet[np.isfinite(feet[:, 0])]
    least = np.linalg.norm(points[:, None] - feet, axis=-1).min(axis=1)
    assert (passes.distances[:, 0] <= least + 1e-12).all()
    there = leg.forward(passes.crank_angles[:, :1]).foot_position
    np.testing.assert_allclose(
        np.linalg.norm(there - points, axis=-1), passes.distances[:, 0], atol=1e-12
    )
    known = np.nan_to_num(passes.distances, nan=np.inf)
    assert (known[:, :-1] <= known[:, 1:]).all()


@turning
def test_crank_angles_at_an_x_are_all_its_passes(leg):
    feet = leg.forward(TURN).foot_position[:, 0]
    x = np.linspace(feet.min() - 0.01, feet.max() + 0.01, 101)
    angles = leg.crank_angles_at(x)
    reached = (x >= feet.min()) & (x <= feet.max())
    ahead = np.append(feet, feet[0])[:, None] > x
    np.testing.assert_array_equal(
        np.isfinite(angles).sum(axis=-1), (ahead[1:] != ahead[:-1]).sum(axis=0)
    )
    assert reached.any()
    found = leg.forward(angles[..., None]).foot_position[..., 0]
    np.testing.assert_allclose((found - x[:, None])[np.isfinite(angles)], 0.0, atol=1e-12)


def test_crank_angles_at_an_x_where_the_crank_only_swings():
    feet = SWINGING.forward(TURN).foot_position[:, 0]
    x = np.linspace(np.nanmin(feet), np.nanmax(feet), 50)[1:-1]
    angles = SWINGING.crank_angles_at(x)
    crossings = (feet[:-1, None] < x) != (feet[1:, None] < x)
    crossings &= np.isfinite(feet[:-1] + feet[1:])[:, None]
    assert (np.isfinite(angles).sum(axis=-1) >= crossings.sum(axis=0)).all()
    found = SWINGING.forward(angles[..., None]).foot_position[..., 0]
    np.testing.assert_allclose((found - x[:, None])[np.isfinite(found)], 0.0, atol=1e-12)


@turning
def test_a_foothold_off_the_curve_is_unreachable(leg):
    foot = leg.forward([0.4]).foot_position
    normal = np.cross(leg.jacobian(leg.forward([0.4]))[:, 0], [0.0, 1.0, 0.0])
    normal /= np.linalg.norm(normal)
    near, far = (foot + k * leg.reach_tolerance * normal for k in (0.99, 1.01))
    assert leg.inverse(near).status == Status.OK
    missed = leg.inverse(far)
    assert missed.status == Status.UNREACHABLE
    assert np.isnan(missed.joint_positions).all()
    assert (
        leg.inverse(foot + np.array([0, 2 * leg.reach_tolerance, 0])).status == Status.UNREACHABLE
    )


@turning
def test_a_whole_turn_is_no_limit_and_less_is(leg):
    assert leg.forward([50.0]).status == Status.OK
    assert replace(leg, joint_ranges=((-np.inf, np.inf),)).forward([50.0]).status == Status.OK
    limited = replace(leg, joint_ranges=((0.0, 1.0),))
    q = np.array([[0.0], [1.0], [1.1], [-0.1]])
    posture = limited.forward(q)
    wanted = [Status.OK, Status.OK, Status.JOINT_LIMIT, Status.JOINT_LIMIT]
    np.testing.assert_array_equal(posture.status, wanted)
    np.testing.assert_array_equal(limited.inverse(posture.foot_position).status, wanted)


@turning
def test_inverse_answers_within_the_range_of_the_crank(leg):
    around = replace(leg, joint_ranges=((10.0, 10.0 + 2 * math.pi),))
    back = around.inverse(leg.forward(TURN).foot_position)
    assert (back.joint_positions >= 10.0 - 1e-9).all()
    assert (back.joint_positions <= 10.0 + 2 * math.pi + 1e-9).all()


def test_a_leg_that_swings_is_unreachable_where_its_bars_do_not_close():
    posture = SWINGING.forward(TURN)
    open_ = posture.status == Status.UNREACHABLE
    assert 0 < open_.sum() < len(TURN)
    assert np.isnan(posture.foot_position[open_]).all()
    assert np.isnan(posture.closure[open_]).all()
    assert np.isfinite(posture.foot_position[~open_]).all()


def test_a_dead_point_is_singular():
    # coupler and rocker are in line where BD is as long as both: cosine law of the triangle ABD
    leg = replace(SWINGING, rod=3.0)
    frame, both = leg.frame_length, leg.coupler + leg.rocker
    dead = leg.frame_angle + math.acos((1.0 + frame**2 - both**2) / (2.0 * frame))
    q = np.array([[dead], [dead - 1e-3], [dead + 1e-3]])
    wanted = [Status.SINGULAR, Status.OK, Status.UNREACHABLE]
    np.testing.assert_array_equal(leg.forward(q).status, wanted)


@turning
@pytest.mark.parametrize("middle", [-2.0, 0.0, 1.2])
def test_a_foot_near_a_pose_within_the_limits_is_reached_within_the_limits(leg, middle):
    """Where the foot curve comes by twice, the nearest pass may be outside, another inside."""
    rng = np.random.default_rng(4)
    limited = replace(leg, joint_ranges=((middle - 1.0, middle + 1.0),))
    q = rng.uniform(middle - 0.9, middle + 0.9, (2000, 1))
    aside = rng.normal(0.0, 0.2 * leg.reach_tolerance, (2000, 3)) * [1, 0, 1]
    wanted = limited.forward(q).foot_position + aside
    near = np.linalg.norm(aside, axis=1) <= leg.reach_tolerance
    posture = limited.inverse(wanted)
    assert np.all(posture.status[near] == Status.OK)
    missed = np.linalg.norm(posture.foot_position - wanted, axis=1)
    assert np.all(missed <= np.linalg.norm(aside, axis=1) + 1e-12)
    outside = limited.inverse(leg.forward([[middle + 2.0]]).foot_position)
    assert outside.status == Status.JOINT_LIMIT


@turning
def test_mirror_image_is_the_leg_itself(leg):
    mirrored, posture = Mirrored(leg), leg.forward(TURN)
    np.testing.assert_array_equal(mirrored.forward(TURN).foot_position, posture.foot_position)
    np.testing.assert_array_equal(mirrored.jacobian(posture), leg.jacobian(posture))


@turning
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"foot_brace": 50.0}, "rigid triangle C-F-G does not close"),
        ({"foot_bar": 1e-9, "foot_brace": 1e-9}, "rigid triangle C-F-G does not close"),
        ({"frame_length": 30.0}, "do not meet in C"),
    ],
)
def test_impossible_geometry_is_named(leg, change, message):
    with pytest.raises(GeometryError, match=message):
        replace(leg, **change)


lengths = st.floats(1e-300, 1e300) | st.floats(0.1, 10.0)


@settings(max_examples=60)
@given(st.data())
def test_any_geometry_raises_a_geometry_error_or_computes(data):
    kind = data.draw(st.sampled_from([TheoJansen, SixBar]))
    names = [f.name for f in geometry_parameters(kind)]
    chosen = data.draw(st.lists(st.sampled_from(names), max_size=3, unique=True))
    try:
        leg = kind(**{name: data.draw(lengths) for name in chosen})
    except GeometryError:
        return
    posture = leg.forward(TURN[::50])
    ok = posture.status == Status.OK
    assert np.isfinite(posture.foot_position[ok]).all()
    assert np.isfinite(posture.closure[ok]).all()


@settings(max_examples=60)
@given(
    hnp.arrays(np.float64, (4, 3), elements=st.floats(allow_nan=True, allow_infinity=True)),
    st.sampled_from([JANSEN, SIX_BAR, SWINGING]),
)
def test_passes_of_arbitrary_numbers_are_found_or_nan(numbers, leg):
    for mode in leg.assembly_modes[:3]:
        passes = leg.nearest_crank_angles(numbers, mode)
        known = np.isfinite(numbers).all(axis=-1)
        missing = np.isnan(passes.crank_angles)
        np.testing.assert_array_equal(missing[known], np.isnan(passes.distances[known]))
        angles = leg.crank_angles_at(numbers, mode)
        assert np.isnan(angles[~np.isfinite(numbers)]).all()
