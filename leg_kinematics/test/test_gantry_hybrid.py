# SPDX-License-Identifier: Apache-2.0
"""`GantryHybrid` against its own inverse, finite differences, statics and the paper's example."""

from __future__ import annotations

import math
from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from leg_kinematics import GeometryError, ShapeError, Status, load_robot
from leg_kinematics.mechanisms.gantry_hybrid import GantryHybrid

ARM = GantryHybrid()
UNLIMITED = {
    "joint_ranges": ((-2.0, 2.0),) * 4,
    "passive_joint_ranges": (*((-math.pi, math.pi),) * 8, (-2.0, 2.0)),
}
# Joint limits belong to the initial mode; an arm without them shows what the equations allow.
FREE = GantryHybrid(**UNLIMITED)
# Another one of the same kind, with nothing symmetric: its bars may lean to the same side.
ODD = GantryHybrid(
    platform_half_width=0.080,
    slide_a_start=0.170,
    slide_b_start=0.120,
    slide_c_start=-0.060,
    rail_c_left=0.170,
    platform_arm=0.130,
    shaft_base_left=0.060,
    shaft_platform_left=-0.040,
    bar_a_length=0.300,
    bar_b_length=0.260,
    rod_c_length=0.310,
    **UNLIMITED,
)

arms = pytest.mark.parametrize("arm", [ARM, ODD], ids=["paper", "odd"])
arms_and_modes = pytest.mark.parametrize(
    ("arm", "mode"), [(arm, mode) for arm in (FREE, ODD) for mode in arm.assembly_modes]
)


def example(t):
    """The paper's motion: position, velocity and acceleration of x, y, z, beta."""
    w, tilt, zero = math.pi, math.radians(5.0), np.zeros_like(t)
    s, c = np.sin(w * t), np.cos(w * t)
    return (
        np.stack([-0.01 * t, 0.01 * t, 0.250 + 0.002 * s, tilt * s], axis=-1),
        np.stack([zero - 0.01, zero + 0.01, 0.002 * w * c, tilt * w * c], axis=-1),
        np.stack([zero, zero, -0.002 * w**2 * s, -tilt * w**2 * s], axis=-1),
    )


def example_input(t):
    """The paper's input shaft: theta, theta', theta''."""
    a = math.radians(120.0)
    return a * np.sin(2 * t), 2 * a * np.cos(2 * t), -4 * a * np.sin(2 * t)


TIME = np.linspace(0.0, 5.0, 1001)


def random_tasks(count, seed, mirrored=False):
    """Platform positions in and around the workspace."""
    rng = np.random.default_rng(seed)
    low, high = [-0.25, -0.2, 0.02, -1.2], [0.25, 0.2, 0.30, 1.2]
    task = rng.uniform(low, high, (count, 4))
    if mirrored:
        task[:, 2] *= rng.choice([-1.0, 1.0], count)
        task[:, 3] = rng.uniform(-math.pi, math.pi, count)
    return task


def chosen(posture, mask):
    return type(posture)(*(field[mask] for field in posture))


def workspace_postures(arm, count=60_000, seed=1):
    """Postures with status OK at random places of the workspace."""
    posture = arm.inverse(random_tasks(count, seed))
    return chosen(posture, posture.status == Status.OK)


def well_conditioned(arm, posture, limit=30.0):
    """Postures away from singularities, where finite differences keep their digits."""
    size = np.maximum(
        np.abs(arm.jacobian(posture)).max(axis=(-2, -1)),
        np.abs(arm.inverse_jacobian(posture)).max(axis=(-2, -1)),
    )
    return chosen(posture, size < limit)


def points_of(linkage, *names):
    return (linkage.points[..., linkage.names.index(name), :] for name in names)


# --------------------------------------------------------------------------- the paper's example


def test_initial_posture_is_the_start_of_the_example():
    posture = ARM.initial_posture
    assert posture.status == Status.OK
    np.testing.assert_allclose(posture.foot_position, [0.0, 0.0, 0.250, 0.0], atol=6e-6)


def test_the_example_starts_and_ends_where_it_should():
    posture = ARM.inverse(example(np.array([0.0, 5.0]))[0])
    np.testing.assert_allclose(
        1e3 * posture.joint_positions,
        [[0.0006, 0.0, -0.0006, -0.0024], [-49.9994, 50.0, -50.0006, -50.0024]],
        atol=5.1e-5,
    )


def test_the_example_is_within_all_limits():
    assert np.all(ARM.inverse(example(TIME)[0]).status == Status.OK)


def test_the_greatest_slide_speeds_of_the_example():
    position, velocity, _ = example(np.linspace(0.0, 5.0, 20_001))
    rates = np.einsum("nij,nj->ni", ARM.inverse_jacobian(ARM.inverse(position)), velocity)
    np.testing.assert_allclose(
        1e3 * np.abs(rates).max(axis=0), [41.97, 10.0, 41.97, 139.2], atol=0.05
    )


def test_speeds_and_accelerations_of_the_example_are_derivatives_of_its_displacements():
    t, step = np.linspace(0.0, 5.0, 501), 1e-4

    def rates(t):
        position, velocity, _ = example(t)
        return np.einsum("nij,nj->ni", ARM.inverse_jacobian(ARM.inverse(position)), velocity)

    position, velocity, acceleration = example(t)
    q = [ARM.inverse(example(t + s)[0]).joint_positions for s in (-step, step)]
    np.testing.assert_allclose(rates(t), (q[1] - q[0]) / (2 * step), atol=1e-6)
    ours = ARM.inverse_acceleration(ARM.inverse(position), velocity, acceleration)
    np.testing.assert_allclose(ours, (rates(t + step) - rates(t - step)) / (2 * step), atol=1e-6)


# --------------------------------------------------------------------------- position


@arms_and_modes
def test_both_ways_round_in_every_assembly_mode(arm, mode):
    inverse = arm.inverse(random_tasks(40_000, 4, mirrored=True), mode)
    bars_lean_alike = ("s1" in mode) != ("s3" in mode)
    if arm is FREE and bars_lean_alike:  # equal bars then move in parallel
        assert set(inverse.status) == {Status.SINGULAR, Status.UNREACHABLE}
        return
    ok = inverse.status == Status.OK
    assert ok.sum() > 400
    forward = arm.forward(inverse.joint_positions[ok], mode)
    np.testing.assert_array_equal(forward.status, Status.OK)
    # An error of 1e-16 in the slides is magnified by J; at random poses J can be large.
    scale = np.maximum(1.0, np.abs(arm.jacobian(forward)).max(axis=(-2, -1)))
    error = np.abs(forward.foot_position - inverse.foot_position[ok]).max(axis=-1)
    assert np.max(error / scale) < 1e-9
    assert np.max(error[scale < 100.0]) < 1e-9


def test_each_mode_is_a_different_solution():
    """Eight ways to lean the bars at one pose, four poses for one set of slides."""
    posture = ODD.inverse([0.02, 0.0, 0.24, 0.1])
    slides = {
        tuple(np.round(ODD.inverse([0.02, 0.0, 0.24, 0.1], mode).joint_positions, 9))
        for mode in ODD.assembly_modes
    }
    poses = {
        tuple(np.round(ODD.forward(posture.joint_positions, mode).foot_position, 9))
        for mode in ODD.assembly_modes
    }
    assert len(slides) == 8
    assert len(poses) == 4
    answering = [m for m in ODD.assembly_modes if ODD.inverse(posture.foot_position, m).status == 0]
    assert len(answering) == 8


def test_the_default_signs_are_the_printed_ones_of_the_start():
    """(5) +, (12) -, (13) +, (14) +, and (10) as printed."""
    x, _, z, beta = task = np.array([0.01, 0.0, 0.24, 0.05])
    g = ARM
    s1 = -math.sqrt(g.bar_a_length**2 - z**2) + g.slide_a_start + x - g.platform_half_width
    s3 = math.sqrt(g.bar_b_length**2 - z**2) - g.slide_b_start + x + g.platform_half_width
    d, e = g.rail_c_left, g.platform_arm
    squared = (e * math.cos(beta) - d) ** 2 + (z + e * math.sin(beta)) ** 2
    s4 = math.sqrt(g.rod_c_length**2 - squared) + x - g.slide_c_start
    posture = ARM.inverse(task)
    np.testing.assert_allclose(posture.joint_positions, [s1, 0.0, s3, s4], atol=1e-15)
    w1, w2 = 2 * e * d, 2 * e * z
    w3 = d**2 + (x - g.slide_c_start - s4) ** 2 + z**2 + e**2 - g.rod_c_length**2
    root = math.hypot(w1, w2)
    assert math.asin(w1 / root) - math.asin(w3 / root) == pytest.approx(beta, abs=1e-12)
    np.testing.assert_allclose(ARM.forward([s1, 0.0, s3, s4]).foot_position, task, atol=1e-12)


# --------------------------------------------------------------------------- velocity


@arms
def test_inverse_jacobian_equals_finite_differences(arm):
    posture = well_conditioned(arm, workspace_postures(arm))
    task, step = posture.foot_position, 1e-5
    inverse_jacobian = arm.inverse_jacobian(posture)
    scale = np.maximum(1.0, np.abs(inverse_jacobian).max(axis=(-2, -1)))
    for k, dx in enumerate(step * np.eye(4)):
        f = [arm.inverse(task + s * dx).joint_positions for s in (-2, -1, 1, 2)]
        difference = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)
        error = np.abs(inverse_jacobian[..., k] - difference).max(axis=-1)
        assert np.nanmax(error / scale**5) < 1e-6


@arms_and_modes
def test_the_jacobians_are_inverse_to_each_other(arm, mode):
    posture = arm.inverse(random_tasks(20_000, 5, mirrored=True), mode)
    posture = well_conditioned(arm, chosen(posture, posture.status == Status.OK), 1e3)
    product = arm.jacobian(posture) @ arm.inverse_jacobian(posture)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(4), product.shape), atol=1e-9)


# --------------------------------------------------------------------------- acceleration


def random_rates(count, seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.1, 0.1, (count, 4)), rng.uniform(-1.0, 1.0, (count, 4))


@arms
def test_accelerations_are_inverse_to_each_other(arm):
    posture = well_conditioned(arm, workspace_postures(arm))
    rates, accelerations = random_rates(len(posture.status), 6)
    velocity = np.einsum("nij,nj->ni", arm.jacobian(posture), rates)
    task = arm.acceleration(posture, rates, accelerations)
    back = arm.inverse_acceleration(posture, velocity, task)
    scale = np.maximum(1.0, np.abs(task).max(axis=-1))
    assert np.max(np.abs(back - accelerations).max(axis=-1) / scale) < 1e-9


@arms
def test_accelerations_equal_the_influence_coefficients(arm):
    """(25), and (26) with the outer G and the transposed G that the print lacks."""
    posture = well_conditioned(arm, workspace_postures(arm))
    rates, accelerations = random_rates(len(posture.status), 7)
    h, j, g = (f(posture) for f in (arm.second_order_influence, arm.jacobian, arm.inverse_jacobian))
    in_joints = np.swapaxes(j, -1, -2)[:, None] @ h @ j[:, None]
    bend = np.einsum("ni,nkij,nj->nk", rates, in_joints, rates)
    expected = np.einsum("nij,nj->ni", j, accelerations - bend)
    scale = np.maximum(1.0, np.abs(expected).max(axis=-1, keepdims=True))
    ours = arm.acceleration(posture, rates, accelerations)
    np.testing.assert_allclose(ours / scale, expected / scale, atol=1e-9)
    expected = np.einsum("ni,nkij,nj->nk", rates, h, rates)
    expected += np.einsum("nij,nj->ni", g, accelerations)
    scale = np.maximum(1.0, np.abs(expected).max(axis=-1, keepdims=True))
    ours = arm.inverse_acceleration(posture, rates, accelerations)
    np.testing.assert_allclose(ours / scale, expected / scale, atol=1e-9)


@arms
def test_influence_coefficients_equal_differences_of_the_inverse_jacobian(arm):
    posture = well_conditioned(arm, workspace_postures(arm), 10.0)
    task, step = posture.foot_position, 1e-5
    influence = arm.second_order_influence(posture)
    for k, dx in enumerate(step * np.eye(4)):
        ends = [arm.inverse_jacobian(arm.inverse(task + s * dx)) for s in (-2, -1, 1, 2)]
        difference = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step)
        error = np.abs(influence[..., k] - difference).max(axis=(-2, -1))
        assert np.nanmax(error / np.maximum(1.0, np.abs(influence).max(axis=(1, 2, 3)))) < 1e-6


# --------------------------------------------------------------------------- statics and geometry


@arms
def test_slide_forces_balance_the_load_bar_by_bar(arm):
    """Power is conserved, told by statics alone.

    Bars and rod push along themselves in X, Z and about the hinge A'B'; each slide's drive bears
    the X of its bar's push, and E bears all of Y.
    """
    posture = well_conditioned(arm, workspace_postures(arm))
    count = len(posture.status)
    rng = np.random.default_rng(3)
    force, moment = rng.normal(size=(count, 3)), 0.1 * rng.normal(size=count)
    o, a1, a2, b1, b2, c1, c2 = points_of(
        arm.linkage(posture), "O''", "A'", "A''", "B'", "B''", "C'", "C''"
    )
    rows = []
    for end, start in ((a1, a2), (b1, b2), (c1, c2)):
        push = (end - start) / np.linalg.norm(end - start, axis=-1, keepdims=True)
        about_x = np.cross(end - o, push)[:, 0]
        rows.append(np.stack([push[:, 0], push[:, 2], about_x], axis=-1))
    balance = np.stack(rows, axis=-1)
    # The rod's push has a Y too, but it is the carriage that bears it.
    load = np.stack([force[:, 0], force[:, 2], moment], axis=-1)
    pushes = np.linalg.solve(balance, -load[..., None])[..., 0]
    drives = pushes * balance[:, 0]
    expected = np.stack([drives[:, 0], -force[:, 1], drives[:, 1], drives[:, 2]], axis=-1)
    wrench = np.concatenate([force, moment[:, None]], axis=-1)
    efforts = -np.einsum("nij,ni->nj", arm.jacobian(posture), wrench)
    np.testing.assert_allclose(efforts, expected, atol=1e-9)


@arms
def test_every_bar_keeps_its_length_and_slides_have_theirs(arm):
    posture = workspace_postures(arm)
    linkage, rest = arm.linkage(posture), arm.linkage(arm.initial_posture).points
    q = np.abs(posture.joint_positions).T
    moving = {
        ("O", "O'"): q[1],
        ("A", "A''"): q[0],
        ("B", "B''"): q[2],
        ("C", "C''"): q[3],
        ("F", "F'"): arm.auxiliary_chain.length(posture.foot_position),
    }
    for bar in linkage.bars:
        for i, j in pairwise(bar):
            length = np.linalg.norm(linkage.points[:, i] - linkage.points[:, j], axis=-1)
            ends = linkage.names[i], linkage.names[j]
            expected = moving.get(ends, np.linalg.norm(rest[i] - rest[j]))
            np.testing.assert_allclose(length, expected, atol=1e-12, err_msg=str(ends))
    (platform,) = points_of(linkage, "O''")
    np.testing.assert_allclose(platform, posture.foot_position[:, :3], atol=1e-15)


@arms
def test_excursions_are_those_of_the_angles_between_the_bars(arm):
    posture = workspace_postures(arm)
    start = arm.initial_posture

    def angles(posture):
        o, a1, a2, b1, b2, c1, c2, f1, f2 = points_of(
            arm.linkage(posture), "O''", "A'", "A''", "B'", "B''", "C'", "C''", "F", "F'"
        )
        bar_a, bar_b, rod, arm_, shaft = a1 - a2, b1 - b2, c1 - c2, c1 - o, f2 - f1
        rod_along = np.arctan2(rod[..., 2], rod[..., 1])
        normal = np.cross(np.broadcast_to([1.0, 0.0, 0.0], arm_.shape), arm_)
        length = np.linalg.norm(shaft, axis=-1)

        def bend(axis):
            sine = np.linalg.norm(np.cross(shaft, axis), axis=-1)
            return np.arctan2(sine, np.sum(shaft * axis, axis=-1))

        return np.stack(
            [
                np.arctan2(bar_a[..., 2], bar_a[..., 0]),
                np.arctan2(bar_b[..., 2], bar_b[..., 0]),
                np.arctan2(arm_[..., 2], arm_[..., 1]),
                rod_along,
                rod_along - np.arctan2(arm_[..., 2], arm_[..., 1]),
                np.arcsin(rod[..., 0] / arm.rod_c_length),
                bend(np.array([0.0, 0.0, 1.0])),
                bend(normal),
                length,
            ],
            axis=-1,
        )

    expected = angles(posture) - angles(start)
    expected[..., :8] = angle_between(expected[..., :8], 0.0)
    np.testing.assert_allclose(arm.passive_joint_excursions(posture), expected, atol=1e-9)


# --------------------------------------------------------------------------- status


@pytest.mark.parametrize(
    ("task", "what"),
    [
        ([0.0, 0.0, 0.255, 0.0], "n1 = n2 = 0"),
        ([0.0, 0.0, 0.0, 1.0], "z = 0"),
        ([0.0, 0.0, -0.24, 0.0], "z < 0"),
        ([0.0, 0.0, 0.15, math.atan2(-0.15, 0.2)], "m2 = 0"),
        ([0.0, 0.0, 0.15, -1.0], "m2 beyond 0"),
    ],
)
def test_singular_positions(task, what):
    posture = FREE.inverse(task)
    assert posture.status == Status.SINGULAR, what
    assert np.isfinite(posture.joint_positions).all()


def test_a_rod_across_its_rail_is_singular():
    """k = 0: choose z so that C' is just L3 away from the rail."""
    beta = 0.3
    forward = ARM.platform_arm * math.cos(beta) - ARM.rail_c_left
    rise = math.sqrt(ARM.rod_c_length**2 - forward**2)
    z = rise - ARM.platform_arm * math.sin(beta)
    assert FREE.inverse([0.0, 0.0, z - 1e-6, beta]).status == Status.OK
    at_the_end = FREE.inverse([0.0, 0.0, z, beta]).status
    assert at_the_end in (Status.SINGULAR, Status.UNREACHABLE)  # rounding decides
    assert FREE.inverse([0.0, 0.0, z + 1e-6, beta]).status == Status.UNREACHABLE


def test_slides_that_bring_equal_bars_together_are_singular():
    gap = 2.0 * (ARM.slide_a_start - ARM.platform_half_width)
    together = FREE.forward([gap, 0.0, 0.0, 0.0])
    assert together.status == Status.SINGULAR
    crossed = FREE.forward([gap + 0.05, 0.0, 0.0, 0.0])
    assert crossed.status == Status.SINGULAR
    assert FREE.forward([gap - 1e-3, 0.0, 0.0, 0.0]).status == Status.OK


@pytest.mark.parametrize("q", [[-0.5, 0, 0, 0], [0, 0, 0.5, 0], [0, 0, 0, 0.4], [0, 0, 0, -0.4]])
def test_slides_that_do_not_reach_the_platform_are_unreachable(q):
    posture = FREE.forward(q)
    assert posture.status == Status.UNREACHABLE
    assert np.isnan(posture.foot_position).all()
    assert FREE.inverse([0.0, 0.0, 0.256, 0.0]).status == Status.UNREACHABLE


# --------------------------------------------------------------------------- shapes and misuse


def test_any_leading_axes_come_back():
    task = workspace_postures(ARM).foot_position[:10].reshape(2, 5, 4)
    batch = ARM.inverse(task)
    single, none = ARM.inverse(task[1, 2]), ARM.inverse(np.empty((0, 4)))
    for posture, leading in ((batch, (2, 5)), (single, ()), (none, (0,))):
        assert ARM.inverse_jacobian(posture).shape == (*leading, 4, 4)
        assert ARM.second_order_influence(posture).shape == (*leading, 4, 4, 4)
        assert ARM.inverse_acceleration(posture, np.zeros(4), np.zeros(4)).shape == (*leading, 4)
        angle = ARM.auxiliary_chain.output_angle(posture.foot_position, 0.3)
        assert np.shape(angle) == leading
    rates = np.zeros((7, 1, 1, 4))
    assert ARM.acceleration(batch, rates, np.zeros((5, 4))).shape == (7, 2, 5, 4)


@pytest.mark.parametrize("bad", [[1.0, 2.0, 3.0], [[1.0], [2.0]], "abc", [[None, "x", 1, 2]], 1.0])
def test_a_wrong_shape_names_the_argument(bad):
    posture = ARM.inverse([[0.0, 0.0, 0.25, 0.0]] * 3)
    with pytest.raises(ShapeError, match="task_accelerations"):
        ARM.inverse_acceleration(posture, np.zeros(4), bad)
    with pytest.raises(ShapeError, match="position"):
        ARM.auxiliary_chain.output_angle(bad, 0.0)


def test_rates_that_do_not_fit_the_posture_are_told():
    posture = ARM.inverse([[0.0, 0.0, 0.25, 0.0]] * 3)
    with pytest.raises(ShapeError, match="joint_accelerations"):
        ARM.acceleration(posture, np.zeros(4), np.zeros((2, 4)))
    with pytest.raises(ShapeError, match="input_angle"):
        ARM.auxiliary_chain.output_angle(posture.foot_position, np.zeros(2))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"bar_a_length": 0.04, "bar_b_length": 0.04}, "do not reach"),
        ({"rod_c_length": 0.05}, "do not reach"),
        ({"platform_half_width": 0.15025}, "singular"),
        ({"slide_c_start": 0.0}, "slide_c_start"),
    ],
)
def test_an_impossible_geometry_names_what_is_wrong(change, named):
    with pytest.raises(GeometryError, match=named):
        GantryHybrid(**change)


any_points = hnp.arrays(
    np.float64,
    hnp.array_shapes(max_dims=2, max_side=4).map(lambda s: (*s, 4)),
    elements=st.floats(width=64, allow_nan=True, allow_infinity=True) | st.floats(-0.4, 0.4),
)


@settings(max_examples=300, deadline=None)
@given(any_points, st.sampled_from(ARM.assembly_modes), st.sampled_from([ARM, FREE, ODD]))
def test_what_only_this_arm_tells_takes_any_floats(points, mode, arm):
    leading = points.shape[:-1]
    for posture in (arm.inverse(points, mode), arm.forward(points, mode)):
        values = np.concatenate(
            [
                arm.inverse_jacobian(posture).reshape(*leading, 16),
                arm.second_order_influence(posture).reshape(*leading, 64),
                arm.inverse_acceleration(posture, np.full(4, 0.1), np.full(4, 0.2)),
            ],
            axis=-1,
        )
        answered = np.isfinite(values).all(axis=-1)
        assert not np.any((posture.status == Status.OK) & ~answered)
        arm.auxiliary_chain.output_angle(posture.foot_position, 0.5)


# --------------------------------------------------------------------------- auxiliary chain

CHAIN = ARM.auxiliary_chain


def unit(vector):
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def driven_pin(pin, shaft, sense):
    """Pin of the driven fork: perpendicular to the driving pin and to the driven shaft."""
    return sense * unit(np.cross(shaft, pin))


def vector_model(chain, task, theta):
    """Output angle from the four pins of the two joints, by vectors alone."""
    x, _, z, beta = np.moveaxis(task, -1, 0)
    zero, one = np.zeros_like(x), np.ones_like(x)
    cb, sb = np.cos(beta), np.sin(beta)
    y_axis = np.stack([zero, cb, sb], axis=-1)
    z_axis = np.stack([zero, -sb, cb], axis=-1)
    joint = np.stack([x, chain.platform_offset * cb, z + chain.platform_offset * sb], axis=-1)
    middle = unit(joint - np.stack([zero, chain.base_offset * one, zero], axis=-1))
    middle *= np.sign(z)[..., None]  # below the carriage the input shaft points down
    pin = np.stack([-np.sin(theta), np.cos(theta), zero], axis=-1)
    fork = driven_pin(pin, middle, 1.0)  # the far fork of the middle shaft is parallel
    out = driven_pin(fork, z_axis, -1.0)
    return np.arctan2(-out[..., 0], np.sum(out * y_axis, axis=-1))


def random_shafts(count=5000, seed=9):
    rng = np.random.default_rng(seed)
    task = rng.uniform([-0.15, -0.1, 0.15, -0.5], [0.15, 0.1, 0.30, 0.5], (count, 4))
    return task, rng.uniform(-3.1, 3.1, count)


def angle_between(first, second):
    return (first - second + math.pi) % (2 * math.pi) - math.pi


@pytest.mark.parametrize(
    ("start", "ratio"), [("in the plane", 1.0 / math.cos(0.4)), ("across it", math.cos(0.4))]
)
def test_one_universal_joint_has_the_tangent_relation(start, ratio):
    """The oracle is itself right: with the driving pin in the plane of the shafts at zero,
    tan(out) = tan(in) / cos(bend); with it across the plane, tan(out) = tan(in) cos(bend)."""
    bend = 0.4
    theta = np.linspace(-1.5, 1.5, 61)
    turn = theta if start == "in the plane" else theta - 0.5 * math.pi
    pin = np.stack([-np.sin(turn), np.cos(turn), np.zeros_like(turn)], axis=-1)  # about z
    shaft = np.array([0.0, math.sin(bend), math.cos(bend)])
    out = driven_pin(pin, shaft, 1.0)
    zero = driven_pin(pin[30], shaft, 1.0)
    turned = np.arctan2(out @ np.cross(shaft, zero), out @ zero)
    np.testing.assert_allclose(np.tan(turned), np.tan(theta) * ratio, atol=1e-12)


def test_output_angle_equals_the_vector_model():
    task, theta = random_shafts()
    gamma = CHAIN.output_angle(task, theta)
    np.testing.assert_allclose(
        angle_between(gamma, vector_model(CHAIN, task, theta)), 0.0, atol=1e-12
    )
    odd = ODD.auxiliary_chain
    np.testing.assert_allclose(
        angle_between(odd.output_angle(task, theta), vector_model(odd, task, theta)), 0, atol=1e-12
    )


@pytest.mark.parametrize("still", [0, 3], ids=["x = 0", "beta = 0"])
def test_the_papers_relation_is_exact_in_the_plane_and_without_tilt(still):
    task, theta = random_shafts()
    task[:, still] = 0.0
    np.testing.assert_allclose(
        CHAIN.approximate_output_angle(task, theta), CHAIN.output_angle(task, theta), atol=1e-14
    )


def test_parallel_platforms_turn_the_output_as_the_input():
    task, theta = random_shafts()
    task[:, 3] = 0.0
    rng = np.random.default_rng(10)
    velocity = rng.normal(size=(len(task), 4)) * [0.1, 0.1, 0.1, 0.0]
    motion = CHAIN.output_motion(task, velocity, velocity, theta, 3.0, -2.0)
    np.testing.assert_allclose(motion.angle, theta, atol=1e-14)
    np.testing.assert_allclose(motion.velocity, 3.0, atol=1e-12)
    np.testing.assert_allclose(motion.acceleration, -2.0, atol=1e-10)
    bends = CHAIN.bends(task)
    np.testing.assert_allclose(bends[:, 0], bends[:, 1], atol=1e-15)


def test_equal_bends_in_one_plane_turn_the_output_as_the_input():
    """Not only with parallel shafts: with x = 0, tilted so that they make a W."""
    z = 0.250
    beta = 2.0 * math.atan((CHAIN.base_offset - CHAIN.platform_offset) / z)
    task = np.array([0.0, 0.0, z, beta])
    bends = CHAIN.bends(task)
    assert bends[0] == pytest.approx(bends[1], abs=1e-12)
    assert bends[0] > 0.05
    theta = np.linspace(-3.0, 3.0, 25)
    np.testing.assert_allclose(CHAIN.output_angle(task, theta), theta, atol=1e-12)


def test_the_papers_relation_is_off_by_less_than_0_9_degrees_on_the_example():
    task, theta = example(TIME)[0], example_input(TIME)[0]
    off = CHAIN.output_angle(task, theta) - CHAIN.approximate_output_angle(task, theta)
    assert np.degrees(np.abs(off).max()) == pytest.approx(0.753, abs=0.002)
    every = np.linspace(-math.pi, math.pi, 361)
    off = CHAIN.output_angle(task[:, None], every)
    off = off - CHAIN.approximate_output_angle(task[:, None], every)
    assert 0.85 < np.degrees(np.abs(off).max()) <= 0.9


def test_bends_are_those_of_the_corrected_cosines():
    task, _ = random_shafts()
    x, _, z, beta = task.T
    ee, tip = CHAIN.base_offset, CHAIN.platform_offset
    squared = x**2 + (tip * np.cos(beta) - ee) ** 2 + (z + tip * np.sin(beta)) ** 2
    length = CHAIN.length(task)
    np.testing.assert_allclose(length**2, squared, atol=1e-15)
    cosines = [z + tip * np.sin(beta), z * np.cos(beta) + ee * np.sin(beta)]
    np.testing.assert_allclose(np.cos(CHAIN.bends(task)), np.stack(cosines, -1) / length[:, None])


def test_the_output_follows_the_input_over_whole_turns():
    task = np.array([0.05, 0.0, 0.25, 0.2])
    theta = np.linspace(-20.0, 20.0, 4001)
    gamma = CHAIN.output_angle(task, theta)
    assert np.abs(gamma - theta).max() < 0.2
    assert np.all(np.diff(gamma) > 0.0)


@pytest.mark.parametrize("kind", ["output_motion", "approximate_output_motion"])
def test_output_motion_equals_finite_differences(kind):
    step = 1e-4

    def motion(t):
        return getattr(CHAIN, kind)(*example(t), *example_input(t))

    before, now, after = motion(TIME - step), motion(TIME), motion(TIME + step)

    def rate(name):
        return (getattr(after, name) - getattr(before, name)) / (2 * step)

    np.testing.assert_allclose(now.velocity, rate("angle"), atol=1e-6)
    np.testing.assert_allclose(now.acceleration, rate("velocity"), atol=1e-5)
    np.testing.assert_allclose(now.angular_acceleration, rate("angular_velocity"), atol=1e-5)


def test_angular_velocity_is_that_of_the_output_fork():
    step = 1e-5

    def frame(t):
        task, gamma = example(t)[0], CHAIN.output_motion(*example(t), *example_input(t)).angle
        cb, sb, cg, sg = np.cos(task[:, 3]), np.sin(task[:, 3]), np.cos(gamma), np.sin(gamma)
        zero = np.zeros_like(cb)
        rows = [[cg, -sg, zero], [cb * sg, cb * cg, -sb], [sb * sg, sb * cg, cb]]
        return np.moveaxis(np.array(rows), -1, 0)

    skew = (frame(TIME + step) - frame(TIME - step)) / (2 * step)
    skew = skew @ np.swapaxes(frame(TIME), -1, -2)
    omega = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
    ours = CHAIN.output_motion(*example(TIME), *example_input(TIME)).angular_velocity
    np.testing.assert_allclose(ours, omega, atol=1e-6)


def test_a_joint_that_would_bend_by_90_degrees_has_no_output():
    motion = CHAIN.output_motion([0.0, 0.0, 0.010, -1.2], np.zeros(4), np.zeros(4), 0.5, 1.0, 0.0)
    assert np.isnan(motion.angle)
    assert np.isnan(motion.angular_velocity[1:]).all()


def test_the_mirror_image_below_the_carriage_turns_alike():
    task, theta = random_shafts()
    flipped = task * [1.0, 1.0, -1.0, -1.0]
    np.testing.assert_allclose(CHAIN.bends(flipped), CHAIN.bends(task), atol=1e-14)
    np.testing.assert_allclose(
        angle_between(CHAIN.output_angle(flipped, theta), vector_model(CHAIN, flipped, theta)),
        0.0,
        atol=1e-12,
    )


# --------------------------------------------------------------------------- description


def test_the_shipped_gantry_has_the_default_arm():
    robot = load_robot(Path(__file__).parents[2] / "config" / "robots" / "gantry.yaml")
    assert list(robot.legs) == ["arm"]
    leg = robot.leg("")
    assert leg.joint_names == ("arm_s1", "arm_s2", "arm_s3", "arm_s4")
    for name in (f.name for f in fields(GantryHybrid)):
        np.testing.assert_allclose(getattr(leg.geometry, name), getattr(ARM, name))
    task, _, _ = example(TIME)
    assert np.all(leg.mechanism.inverse(task).status == Status.OK)
    assert leg.mount.to_base(task[0, :3])[2] < leg.mount.position[2]
