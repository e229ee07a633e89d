"""`ParallelDrive` against the paper, finite differences, its own inverse and its bar lengths."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from leg_kinematics import GeometryError, ParallelDrive, ShapeError, Status, UnknownNameError
from leg_kinematics.mechanism import Mechanism
from leg_kinematics.mechanisms.walking_axes import walking_vectors
from leg_kinematics.mirrored import Mirrored

INITIAL = ParallelDrive()
OPTIMISED = ParallelDrive(drive_lever=0.140, parallelogram_link=0.330, shank_length=0.320)
NATURAL = ParallelDrive(crank_zero=np.radians(-34.825), center_crank_zero=np.radians(-101.176))
BOX = float(INITIAL.joint_limits[0, 1])

legs = pytest.mark.parametrize(
    "leg", [INITIAL, OPTIMISED, Mirrored(OPTIMISED)], ids=["initial", "optimised", "mirrored"]
)


def box_postures(leg, count=20_000, seed=1):
    """Postures with random cranks over the whole actuator box."""
    q = np.random.default_rng(seed).uniform(-BOX, BOX, (count, 3))
    return q, leg.forward(q)


def test_offers_the_mechanism_protocol():
    members = {n for n in dir(Mechanism) if not n.startswith("_")}
    for mechanism in (INITIAL, Mirrored(INITIAL)):
        assert [name for name in members if not hasattr(mechanism, name)] == []


def test_initial_pose_has_the_published_coordinates():
    linkage = INITIAL.linkage(INITIAL.initial_posture)
    hip_in_p = np.array([0.0, 0.190, -0.055])
    in_p = 1e3 * (walking_vectors(linkage.points) + hip_in_p)
    points = dict(zip(linkage.names, in_p, strict=True))
    published = {
        "U1": (138, 161.8, -117.6),
        "U2": (-138, 161.8, -117.6),
        "U3": (0, -55.1, -262.3),
        "G": (0, 188.2, -319.6),
        "S": (0, 215.7, -202.8),
        "H": (0, 190, -55),
        "R1": (0, 100.4, -233.8),
        "B": (0, 209.4, -248.8),
        "R2": (0, 397.6, -274.8),
        "C": (0, 106.4, -855.9),
    }
    for name, expected in published.items():
        np.testing.assert_allclose(points[name], expected, atol=0.051, err_msg=name)
    a, _, th1, th2, _ = np.degrees(INITIAL.initial_posture.closure)
    np.testing.assert_allclose([a, th1, th2], [-13.26, -116.61, -7.85], atol=0.005)


def test_natural_zeros_put_the_foot_below_the_hip():
    foot = NATURAL.initial_posture.foot_position
    np.testing.assert_allclose(foot[:2], 0.0, atol=5e-5)
    points = NATURAL.linkage(NATURAL.initial_posture)
    r1, r2 = (points.points[points.names.index(n)] for n in ("R1", "R2"))
    assert abs(r1[2] - r2[2]) < 5e-5  # R1R2 horizontal


@legs
def test_inverse_undoes_forward(leg):
    q, posture = box_postures(leg)
    ok = posture.status == Status.OK
    assert ok.sum() > 10_000
    back = leg.inverse(posture.foot_position)
    np.testing.assert_array_equal(back.status[ok], Status.OK)
    np.testing.assert_allclose(back.joint_positions[ok], q[ok], atol=1e-9)
    np.testing.assert_allclose(back.closure[ok], posture.closure[ok], atol=1e-9)


@legs
def test_forward_undoes_inverse_over_the_whole_workspace(leg):
    _, posture = box_postures(leg)
    reached = posture.foot_position[posture.status == Status.OK]
    low, high = reached.min(axis=0), reached.max(axis=0)
    points = np.random.default_rng(2).uniform(low, high, (60_000, 3))
    inverse = leg.inverse(points)
    ok = inverse.status == Status.OK
    assert ok.sum() > 10_000
    forward = leg.forward(inverse.joint_positions[ok])
    np.testing.assert_array_equal(forward.status, Status.OK)
    np.testing.assert_allclose(forward.foot_position, points[ok], atol=1e-9)


@legs
def test_about_eight_percent_of_the_box_lie_beyond_the_drive_singularity(leg):
    _, posture = box_postures(leg)
    assert 0.06 < np.mean(posture.status == Status.SINGULAR) < 0.10
    assert np.mean(posture.status == Status.UNREACHABLE) == 0.0


def test_forward_never_leaves_the_branch_of_the_initial_pose():
    """Follow straight crank paths from the initial pose: the foot may not jump."""
    rng = np.random.default_rng(3)
    ends = rng.uniform(-BOX, BOX, (300, 3))
    ends = ends[INITIAL.forward(ends).status == Status.OK]
    t = np.linspace(0.0, 1.0, 401)[:, None, None]
    path = INITIAL.forward(t * ends)
    status = path.status
    inside = np.isin(status, (Status.OK, Status.PASSIVE_JOINT_LIMIT)).all(axis=0)
    assert inside.mean() > 0.95
    closure = path.closure[:, inside]
    velocity = np.abs(np.diff(closure, axis=0))
    halved = np.abs(np.diff(path.closure[::2][:, inside], axis=0))
    # a smooth path halves its steps with the sampling; a jump would keep its size
    assert np.all(velocity.max(axis=0) < 0.8 * halved.max(axis=0) + 1e-6)


@legs
def test_jacobian_equals_finite_differences(leg):
    q, posture = box_postures(leg, 3000)
    ok = posture.status == Status.OK
    q, posture = q[ok], leg.forward(q[ok])
    jacobian, step = leg.jacobian(posture), 1e-5
    for k, dq in enumerate(step * np.eye(3)):
        f = [leg.forward(q + s * dq).foot_position for s in (-2, -1, 1, 2)]
        difference = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)
        fine = np.isfinite(difference).all(axis=-1)
        assert fine.mean() > 0.99
        np.testing.assert_allclose(jacobian[fine, :, k], difference[fine], atol=1e-6)


def body_frame(leg, posture):
    """Rotation of the shank R2C: z2 along R2C, x2 across the pantograph's plane."""
    linkage = leg.linkage(posture)
    r2, c, r1 = (linkage.points[..., linkage.names.index(n), :] for n in ("R2", "C", "R1"))
    z = c - r2
    x = np.cross(z, r1 - r2)
    z /= np.linalg.norm(z, axis=-1, keepdims=True)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


@legs
def test_angular_jacobian_equals_the_rotation_of_the_shank(leg):
    q, posture = box_postures(leg, 3000)
    ok = posture.status == Status.OK
    q, posture = q[ok], leg.forward(q[ok])
    jacobian, step = leg.angular_jacobian(posture), 1e-5
    rotation = body_frame(leg, posture)
    for k, dq in enumerate(step * np.eye(3)):
        ends = [body_frame(leg, leg.forward(q + s * dq)) for s in (-1, 1)]
        skew = (ends[1] - ends[0]) / (2 * step) @ np.swapaxes(rotation, -1, -2)
        omega = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
        fine = np.isfinite(omega).all(axis=-1)
        scale = 1.0 + np.abs(jacobian).max(axis=(-2, -1))  # differences lose digits at steep poses
        error = np.abs(jacobian[..., k] - omega).max(axis=-1) / scale**3
        assert error[fine].max() < 1e-6


@legs
def test_every_bar_keeps_its_length(leg):
    _, posture = box_postures(leg, 2000)
    linkage = leg.linkage(posture)
    points = linkage.points[posture.status == Status.OK]
    rest = leg.linkage(leg.initial_posture).points
    moving_pairs = {frozenset(("S", "B"))}  # a bar of the pantograph and the platform's ball
    for bar in linkage.bars:
        for i, j in pairwise(bar):
            if {linkage.names[i], linkage.names[j]} in moving_pairs:
                continue
            length = np.linalg.norm(points[:, i] - points[:, j], axis=-1)
            np.testing.assert_allclose(length, np.linalg.norm(rest[i] - rest[j]), atol=1e-12)
    s, b = (points[:, linkage.names.index(n)] for n in ("S", "B"))
    np.testing.assert_allclose(np.linalg.norm(s - b, axis=-1), 0.0465, atol=1e-12)


def test_mirrored_leg_is_the_mirror_image():
    mirrored = Mirrored(OPTIMISED)
    points = np.random.default_rng(4).uniform([-0.3, -0.3, -0.8], [0.3, 0.3, -0.4], (5000, 3))
    there = OPTIMISED.inverse(points)
    here = mirrored.inverse(points * [1, -1, 1])
    np.testing.assert_array_equal(here.status, there.status)
    np.testing.assert_array_equal(here.joint_positions, there.joint_positions)
    ok = here.status == Status.OK
    rates = np.array([0.3, -0.2, 0.5])
    v, v_here = OPTIMISED.jacobian(there) @ rates, mirrored.jacobian(here) @ rates
    np.testing.assert_array_equal(v_here[ok], v[ok] * [1, -1, 1])


def test_leg_is_symmetric_about_the_plane_y_0():
    points = np.random.default_rng(5).uniform([-0.3, -0.3, -0.9], [0.3, 0.3, -0.5], (5000, 3))
    left, right = INITIAL.inverse(points), INITIAL.inverse(points * [1, -1, 1])
    np.testing.assert_array_equal(left.status, right.status)
    swapped = right.joint_positions[:, [1, 0, 2]]
    np.testing.assert_allclose(left.joint_positions, swapped, atol=1e-12)


def test_every_assembly_mode_closes_the_loops():
    foot = INITIAL.initial_posture.foot_position + np.random.default_rng(6).uniform(
        -0.05, 0.05, (200, 3)
    )
    assert len(INITIAL.assembly_modes) == 16
    solutions = []
    for mode in INITIAL.assembly_modes:
        inverse = INITIAL.inverse(foot, mode)
        solved = np.isfinite(inverse.joint_positions).all(axis=-1)
        solutions.append(inverse.joint_positions)
        back = INITIAL.linkage(inverse)
        rods = [
            np.linalg.norm(
                back.points[solved, back.names.index(f"U{i}")]
                - back.points[solved, back.names.index(f"S{i}")],
                axis=-1,
            )
            for i in (1, 2)
        ]
        np.testing.assert_allclose(rods, 0.220, atol=1e-12)
        np.testing.assert_allclose(
            back.points[solved, back.names.index("C")], foot[solved], atol=1e-12
        )
    both = np.array(solutions)
    assert np.isfinite(both[0]).all()
    for i in range(1, 16):  # another mode is another solution
        differs = np.abs(both[i] - both[0]).max(axis=-1)
        assert np.all(np.isnan(differs) | (differs > 1e-3))


@pytest.mark.parametrize("mode", INITIAL.assembly_modes)
def test_forward_undoes_inverse_in_every_assembly_mode(mode):
    """Joint limits belong to the initial mode; without them the round trip still must close."""
    free = ParallelDrive(
        joint_ranges=((-np.pi, np.pi),) * 3, passive_joint_ranges=((-np.pi, np.pi),) * 9
    )
    points = np.random.default_rng(7).uniform([-0.6, -0.2, -1.2], [0.6, 0.2, -0.2], (4000, 3))
    inverse = free.inverse(points, mode)
    ok = inverse.status == Status.OK
    assert ok.sum() > 300
    forward = free.forward(inverse.joint_positions[ok], mode)
    np.testing.assert_array_equal(forward.status, Status.OK)
    error = np.abs(forward.foot_position - points[ok]).max(axis=-1)
    # far outside the actuator ranges two closures may share a mode: another foot, never a wrong one
    assert np.mean(error < 1e-9) > 0.995
    if mode == "initial":
        assert error.max() < 1e-9


def test_passive_joints_start_at_zero_and_limit_the_workspace():
    np.testing.assert_allclose(
        INITIAL.passive_joint_positions(INITIAL.initial_posture), 0.0, atol=1e-12
    )
    _, posture = box_postures(INITIAL)
    excursion = np.abs(INITIAL.passive_joint_positions(posture))
    over = (excursion > np.radians(45.0)).any(axis=-1)
    solved = np.isin(posture.status, (Status.OK, Status.PASSIVE_JOINT_LIMIT))
    np.testing.assert_array_equal(over[solved], posture.status[solved] == 3)
    assert 0.02 < over[solved].mean() < 0.10


def test_a_pose_on_the_actuator_limit_is_ok_and_one_beyond_is_not():
    at = INITIAL.forward([-BOX, -BOX, 0.0])
    beyond = INITIAL.forward([-BOX - 1e-6, -BOX, 0.0])
    assert at.status == Status.OK
    assert INITIAL.inverse(at.foot_position).status == Status.OK
    assert beyond.status == Status.JOINT_LIMIT
    assert np.isfinite(beyond.foot_position).all()


def test_one_shape_rule():
    q = np.random.default_rng(8).uniform(-0.3, 0.3, (2, 5, 3))
    batch = INITIAL.forward(q)
    assert batch.foot_position.shape == (2, 5, 3)
    assert batch.status.shape == (2, 5)
    single = INITIAL.forward(q[1, 2])
    assert single.status.shape == ()
    np.testing.assert_array_equal(single.foot_position, batch.foot_position[1, 2])
    assert INITIAL.jacobian(batch).shape == (2, 5, 3, 3)
    assert INITIAL.jacobian(single).shape == (3, 3)
    assert INITIAL.forward(np.empty((0, 3))).foot_position.shape == (0, 3)


@pytest.mark.parametrize("bad", [[1.0, 2.0], [[1.0], [2.0]], "abc", [[None, "x", 1]], 1.0])
def test_a_wrong_shape_names_the_argument(bad):
    with pytest.raises(ShapeError, match="foot_position"):
        INITIAL.inverse(bad)
    with pytest.raises(ShapeError, match="joint_positions"):
        INITIAL.forward(bad)


def test_an_unknown_mode_lists_the_modes():
    with pytest.raises(UnknownNameError, match="flipped_knee"):
        INITIAL.inverse([0.0, 0.0, -0.7], "upside_down")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"rod_length": -0.2}, "rod_length"),
        ({"rod_length": 0.0}, "rod_length"),
        ({"thigh_upper": float("nan")}, "thigh_upper"),
        ({"crank_zero": float("inf")}, "crank_zero"),
        ({"rod_length": 0.05}, "rod_length"),
        ({"platform_length": 3.0}, "platform"),
        ({"thigh_upper": 3.0}, "pantograph"),
        ({"joint_ranges": ((0.1, -0.1),) * 3}, "joint_ranges"),
        ({"joint_ranges": ((-0.1, 0.1),) * 2}, "joint_ranges"),
        ({"passive_joint_ranges": ((0.0, float("nan")),) * 9}, "passive_joint_ranges"),
    ],
)
def test_an_impossible_geometry_names_what_is_wrong(change, named):
    with pytest.raises(GeometryError, match=named):
        ParallelDrive(**change)


any_points = hnp.arrays(
    np.float64, hnp.array_shapes(max_dims=2, max_side=4).map(lambda s: (*s, 3)),
    elements=st.floats(width=64, allow_nan=True, allow_infinity=True),
)  # fmt: skip


@settings(max_examples=300, deadline=None)
@given(any_points, st.sampled_from(INITIAL.assembly_modes))
def test_a_batch_call_takes_any_floats(points, mode):
    for posture in (INITIAL.inverse(points, mode), INITIAL.forward(points, mode)):
        values = np.concatenate(
            [posture.joint_positions, posture.closure, posture.foot_position], axis=-1
        )
        answered = np.isfinite(values).all(axis=-1)
        assert not np.any((posture.status == Status.OK) & ~answered)
        bad_input = ~np.isfinite(points).all(axis=-1)
        np.testing.assert_array_equal(posture.status == Status.INVALID_INPUT, bad_input)


@settings(max_examples=200, deadline=None)
@given(
    hnp.arrays(np.float64, (7, 3), elements=st.floats(-0.37, 0.37)),
)
def test_forward_and_inverse_agree_on_any_cranks(q):
    posture = INITIAL.forward(q)
    ok = posture.status == Status.OK
    back = INITIAL.inverse(posture.foot_position[ok])
    conditioning = np.linalg.cond(INITIAL.jacobian(back))
    error = np.abs(back.joint_positions - q[ok]).max(axis=-1, initial=0.0)
    assert np.all(error <= 1e-9 + 1e-13 * conditioning)
