"""`DoubleRhombus` against its own inverse, finite differences, virtual work and its bar lengths."""

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

from leg_kinematics import GeometryError, ShapeError, Status, UnknownNameError, load_robot
from leg_kinematics.mechanism import Mechanism
from leg_kinematics.mechanisms.double_rhombus import INITIAL_CLOSURE, DoubleRhombus
from leg_kinematics.mirrored import Mirrored

LEG = DoubleRhombus()
# Joint limits belong to the initial mode; a leg without them shows what the equations allow.
FREE = DoubleRhombus(
    joint_ranges=((0.0, 2.0),) * 3, passive_joint_ranges=((-math.pi, math.pi),) * 10
)
# Another leg of the same kind, with nothing symmetric or right-angled about it.
ODD = DoubleRhombus(
    upper_crank_arm=0.060,
    lower_crank_arm=0.050,
    frame_post=0.210,
    frame_base=0.280,
    rhombus_side=0.240,
    frame_angle=math.radians(82.0),
    upper_crank_angle=math.radians(135.0),
    lower_crank_angle=math.radians(25.0),
    swing_body_arm=0.130,
    swing_leg_arm=0.070,
    swing_offset=math.radians(65.0),
    joint_ranges=((0.0, 2.0),) * 3,
)

legs = pytest.mark.parametrize("leg", [LEG, ODD, Mirrored(LEG)], ids=["paper", "odd", "mirrored"])


def foot_at(phi, radius, psi_s=0.0):
    """Foot of swing phi, radius OI and side swing psi_s."""
    x, z = -radius * np.sin(phi), -radius * np.cos(phi)
    return np.stack(np.broadcast_arrays(x, -z * np.sin(psi_s), z * np.cos(psi_s)), axis=-1)


def workspace_postures(leg, count=60_000, seed=1):
    """Postures with status OK at random feet around the paper's workspace."""
    rng = np.random.default_rng(seed)
    phi, psi_s = rng.uniform(-0.6, 0.6, (2, count))
    posture = leg.inverse(foot_at(phi, rng.uniform(0.4, 1.0, count), psi_s))
    ok = posture.status == Status.OK
    return type(posture)(*(field[ok] for field in posture))


def points_of(linkage, *names):
    return (linkage.points[..., linkage.names.index(name), :] for name in names)


def test_offers_the_mechanism_protocol():
    members = {n for n in dir(Mechanism) if not n.startswith("_")}
    for mechanism in (LEG, Mirrored(LEG)):
        assert [name for name in members if not hasattr(mechanism, name)] == []


def test_initial_posture_hangs_straight_down_with_right_angled_rhombi():
    posture = LEG.initial_posture
    assert posture.status == Status.OK
    np.testing.assert_allclose(posture.foot_position, [0, 0, -4 * 0.260 * math.sqrt(0.5)])
    np.testing.assert_allclose(posture.closure, INITIAL_CLOSURE, atol=1e-12)
    np.testing.assert_allclose(LEG.passive_joint_positions(posture), 0.0, atol=1e-12)


def test_the_reconstructed_varphi_makes_the_crank_triangles_mirror_images():
    o, a, b, c, d = points_of(LEG.linkage(LEG.initial_posture), "O", "A", "B", "C", "D")

    def angle(p, q):
        return math.acos((p - o) @ (q - o) / np.linalg.norm(p - o) / np.linalg.norm(q - o))

    assert math.degrees(angle(a, b)) == pytest.approx(60.0, abs=0.01)
    assert math.degrees(angle(d, c)) == pytest.approx(60.0, abs=1e-9)
    assert np.linalg.norm(b - o) / np.linalg.norm(c - o) == pytest.approx(1.1, abs=0.001)


def test_the_default_strokes_cover_the_papers_workspace():
    phi, radius, psi_s = np.meshgrid(
        np.radians(np.linspace(-30, 30, 61)),
        np.linspace(0.500, 0.950, 91),
        np.radians(np.linspace(-25, 25, 11)),
    )
    assert np.all(LEG.inverse(foot_at(phi, radius, psi_s)).status == Status.OK)


def test_positive_phi_is_backward_and_positive_side_swing_towards_the_body():
    back = LEG.inverse(foot_at(0.2, 0.7))
    assert back.foot_position[0] < 0.0
    inward = LEG.inverse(foot_at(0.0, 0.7, 0.2))
    assert inward.foot_position[1] > 0.0
    (pin,) = points_of(LEG.linkage(inward), "K")
    assert pin[1] > 0.0


@legs
def test_forward_undoes_inverse(leg):
    posture = workspace_postures(leg)
    assert len(posture.status) > 10_000
    forward = leg.forward(posture.joint_positions)
    np.testing.assert_array_equal(forward.status, Status.OK)
    np.testing.assert_allclose(forward.foot_position, posture.foot_position, atol=1e-9)
    np.testing.assert_allclose(forward.closure, posture.closure, atol=1e-9)


@legs
def test_inverse_undoes_forward(leg):
    reached = workspace_postures(leg).joint_positions
    low, high = reached.min(axis=0), reached.max(axis=0)
    q = np.random.default_rng(2).uniform(low, high, (60_000, 3))
    posture = leg.forward(q)
    ok = posture.status == Status.OK
    assert ok.sum() > 10_000
    back = leg.inverse(posture.foot_position[ok])
    np.testing.assert_array_equal(back.status, Status.OK)
    np.testing.assert_allclose(back.joint_positions, q[ok], atol=1e-9)
    np.testing.assert_allclose(back.closure, posture.closure[ok], atol=1e-9)


@legs
def test_jacobian_equals_finite_differences(leg):
    posture = workspace_postures(leg, 6000)
    q, jacobian, step = posture.joint_positions, leg.jacobian(posture), 1e-5
    for k, dq in enumerate(step * np.eye(3)):
        f = [leg.forward(q + s * dq).foot_position for s in (-2, -1, 1, 2)]
        difference = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)
        error = np.abs(jacobian[..., k] - difference).max(axis=-1)
        scale = np.maximum(1.0, np.abs(jacobian).max(axis=(-2, -1)))
        assert np.nanmax(error / scale**5) < 1e-6  # differences lose digits at steep poses
        assert np.isfinite(error).mean() > 0.99


def foot_frame(leg, posture):
    """Rotation of the paper's frame UIW: W along IO, third axis across the swung plane."""
    o, i, a, f = points_of(leg.linkage(posture), "O", "I", "A", "F")
    w = (o - i) / np.linalg.norm(o - i, axis=-1, keepdims=True)
    across = np.cross(a - o, f - o)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    return np.stack([np.cross(w, across), w, across], axis=-1)


@legs
def test_angular_jacobian_equals_the_rotation_of_the_foot_frame(leg):
    posture = workspace_postures(leg, 6000)
    q, jacobian, step = posture.joint_positions, leg.angular_jacobian(posture), 1e-5
    rotation = foot_frame(leg, posture)
    for k, dq in enumerate(step * np.eye(3)):
        r = [foot_frame(leg, leg.forward(q + s * dq)) for s in (-2, -1, 1, 2)]
        rate = (r[0] - 8 * r[1] + 8 * r[2] - r[3]) / (12 * step)
        skew = rate @ np.swapaxes(rotation, -1, -2)
        omega = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
        error = np.abs(jacobian[..., k] - omega).max(axis=-1)
        scale = np.maximum(1.0, np.abs(leg.jacobian(posture)).max(axis=(-2, -1)))
        assert np.nanmax(error / scale**5) < 1e-6
        assert np.isfinite(error).mean() > 0.99


def test_planar_jacobian_is_the_planar_part_of_the_jacobian():
    posture = workspace_postures(LEG)
    jacobian, psi_s = LEG.jacobian(posture), posture.closure[:, 2]
    planar = LEG.planar_jacobian(posture)
    up = np.stack([np.zeros_like(psi_s), -np.sin(psi_s), np.cos(psi_s)], axis=-1)
    np.testing.assert_array_equal(planar[:, 0], jacobian[:, 0, :2])
    np.testing.assert_allclose(
        planar[:, 1], np.einsum("ni,nik->nk", up, jacobian[:, :, :2]), atol=1e-12
    )


def test_cylinder_forces_balance_the_load_joint_by_joint():
    """Power is conserved, told by statics alone.

    I = 2 (E + F), so a force at I loads F and E with twice itself each. The moment about O of each
    cylinder's force at its crank must balance that of the load at the crank's other end.
    """
    posture = workspace_postures(LEG)
    posture = LEG.inverse(posture.foot_position * [1, 0, 1])
    rng = np.random.default_rng(3)
    load = rng.normal(size=(len(posture.status), 3)) * [1, 0, 1]
    efforts = np.einsum("nik,ni->nk", LEG.jacobian(posture), load)
    a, b, c, d, e, f = points_of(LEG.linkage(posture), *"ABCDEF")

    def moment(arm, force):  # about -y
        return arm[:, 0] * force[:, 2] - arm[:, 2] * force[:, 0]

    for pin, anchor, corner, effort in ((a, b, f, efforts[:, 0]), (d, c, e, efforts[:, 1])):
        direction = (pin - anchor) / np.linalg.norm(pin - anchor, axis=-1, keepdims=True)
        np.testing.assert_allclose(
            moment(pin, effort[:, None] * direction), moment(2 * corner, load), atol=1e-12
        )


def test_a_side_load_is_carried_by_the_swing_cylinder_alone():
    posture = workspace_postures(LEG)
    psi_s = posture.closure[:, 2]
    across = np.stack([np.zeros_like(psi_s), np.cos(psi_s), np.sin(psi_s)], axis=-1)
    efforts = np.einsum("nik,ni->nk", LEG.jacobian(posture), across)
    np.testing.assert_allclose(efforts[:, :2], 0.0, atol=1e-12)
    k, pin, i = points_of(LEG.linkage(posture), "K", "L", "I")
    push = efforts[:, 2:] * (pin - k) / np.linalg.norm(pin - k, axis=-1, keepdims=True)
    np.testing.assert_allclose(np.cross(pin, push)[:, 0], np.cross(i, across)[:, 0], atol=1e-12)


@legs
def test_every_bar_keeps_its_length_and_cylinders_have_theirs(leg):
    posture = workspace_postures(leg, 6000)
    linkage, rest = leg.linkage(posture), leg.linkage(leg.initial_posture).points
    cylinders = (("A", "B"), ("C", "D"), ("K", "L"))
    for bar in linkage.bars:
        for i, j in pairwise(bar):
            length = np.linalg.norm(linkage.points[:, i] - linkage.points[:, j], axis=-1)
            ends = linkage.names[i], linkage.names[j]
            if ends in cylinders:
                expected = posture.joint_positions[:, cylinders.index(ends)]
            else:
                expected = np.full_like(length, np.linalg.norm(rest[i] - rest[j]))
            np.testing.assert_allclose(length, expected, atol=1e-12, err_msg=str(ends))
    (foot,) = points_of(linkage, "I")
    np.testing.assert_allclose(foot, posture.foot_position, atol=1e-12)


@legs
def test_cranks_and_crossed_bars_are_rigid(leg):
    linkage = leg.linkage(workspace_postures(leg, 6000))
    rest = leg.linkage(leg.initial_posture)
    for p, q in ("AF", "DE", "OB", "BC", "FJ", "EH"):
        length = np.linalg.norm(np.subtract(*points_of(linkage, p, q)), axis=-1)
        np.testing.assert_allclose(
            length, np.linalg.norm(np.subtract(*points_of(rest, p, q))), atol=1e-12
        )


def test_mirrored_leg_is_the_mirror_image():
    points = workspace_postures(LEG).foot_position
    there, here = LEG.inverse(points), Mirrored(LEG).inverse(points * [1, -1, 1])
    np.testing.assert_array_equal(here.status, there.status)
    np.testing.assert_array_equal(here.joint_positions, there.joint_positions)
    rates = np.array([0.3, -0.2, 0.5])
    v, v_here = LEG.jacobian(there) @ rates, Mirrored(LEG).jacobian(here) @ rates
    np.testing.assert_array_equal(v_here, v * [1, -1, 1])


@pytest.mark.parametrize("mode", LEG.assembly_modes)
def test_both_ways_round_in_every_assembly_mode(mode):
    rng = np.random.default_rng(4)
    count = 40_000
    foot = foot_at(*rng.uniform([[-1.5], [0.05], [-1.2]], [[1.5], [1.03], [1.2]], (3, count)))
    inverse = FREE.inverse(foot, mode)
    ok = inverse.status == Status.OK
    if mode == "flipped_upper+lower":  # such postures have the foot above the hip
        assert not ok.any()
        return
    forward = FREE.forward(inverse.joint_positions[ok], mode)
    # nearer than this to a dead centre or a stretched leg, square roots lose half of the digits
    sound = np.abs(FREE.jacobian(forward)).max(axis=(-2, -1)) < 100.0
    assert sound.sum() > 100
    np.testing.assert_array_equal(forward.status[sound], Status.OK)
    np.testing.assert_allclose(forward.foot_position[sound], foot[ok][sound], atol=1e-9)
    np.testing.assert_allclose(forward.closure[sound], inverse.closure[ok][sound], atol=1e-9)


def test_a_foot_has_one_posture_for_each_side_of_the_rhombus():
    foot = workspace_postures(LEG, 6000).foot_position
    solved = {mode: FREE.inverse(foot, mode) for mode in FREE.assembly_modes}
    for name, posture in solved.items():
        same = solved["flipped_rhombus" if "rhombus" in name else "initial"]
        np.testing.assert_array_equal(posture.joint_positions, same.joint_positions)
    statuses = np.array([posture.status for posture in solved.values()])
    np.testing.assert_array_equal(np.sum(statuses == Status.OK, axis=0), 2)


def test_cylinders_have_four_postures_told_apart_by_modes():
    q = workspace_postures(LEG, 6000).joint_positions
    solved = [FREE.forward(q, mode) for mode in FREE.assembly_modes]
    ok = np.array([posture.status == Status.OK for posture in solved])
    assert np.all(ok[0])
    assert np.all(ok.sum(axis=0) <= 4)  # others have the foot above the hip
    feet = np.where(ok[..., None], [posture.foot_position for posture in solved], np.nan)
    for i in range(8):
        for j in range(i):
            distance = np.linalg.norm(feet[i] - feet[j], axis=-1)
            assert not np.any(distance < 1e-3)


@pytest.mark.parametrize(
    ("foot", "status"),
    [
        (foot_at(0.1, 0.7), Status.OK),
        (foot_at(0.0, 1.0401), Status.UNREACHABLE),
        (foot_at(0.0, 1.04), Status.SINGULAR),  # stretched: theta = 0
        ([0.0, 0.0, 0.0], Status.SINGULAR),  # folded flat: theta = 90°
        ([0.5, 0.0, 0.0], Status.SINGULAR),  # on the axis of the side swing
        (foot_at(0.0, 0.97), Status.PASSIVE_JOINT_LIMIT),
        (foot_at(0.0, 0.7, 0.5), Status.JOINT_LIMIT),
        ([0.0, 0.0, math.nan], Status.INVALID_INPUT),
        ([0.0, math.inf, 0.0], Status.INVALID_INPUT),
        ([1e300, 1e300, 1e300], Status.UNREACHABLE),
    ],
)
def test_status_tells_why(foot, status):
    assert LEG.inverse(foot).status == status


def test_beyond_a_dead_centre_is_singular():
    """Swing the planar leg far back and forth: l2 and l4 pass their dead centres one by one."""
    phi = np.linspace(-1.5, 1.5, 3001)
    posture = FREE.inverse(foot_at(phi, 0.735))
    l2, l4 = posture.joint_positions[:, 0], posture.joint_positions[:, 1]
    singular = posture.status == Status.SINGULAR
    falling, rising = np.gradient(l2, phi) < 0.0, np.gradient(l4, phi) > 0.0
    away = np.abs(np.diff(singular, prepend=singular[0])) == 0
    np.testing.assert_array_equal(singular[away], ~(falling & rising)[away])
    assert 0.1 < singular.mean() < 0.5


@pytest.mark.parametrize(
    "q", [[0.2907, 0.3, 0.15], [0.3, 0.3501, 0.15], [0.3, 0.3, 0.0299], [0.3, 0.3, -0.15]]
)
def test_cylinders_that_do_not_close_are_unreachable(q):
    posture = FREE.forward(q)
    assert posture.status == Status.UNREACHABLE
    assert np.isnan(posture.foot_position).all()


def test_a_pose_on_the_stroke_limit_is_ok_and_one_beyond_is_not():
    limit = LEG.joint_limits[2, 1]
    at = LEG.forward([0.32, 0.29, limit])
    beyond = LEG.forward([0.32, 0.29, limit + 1e-6])
    assert at.status == Status.OK
    assert LEG.inverse(at.foot_position).status == Status.OK
    assert beyond.status == Status.JOINT_LIMIT
    assert np.isfinite(beyond.foot_position).all()


def test_passive_joints_limit_the_workspace():
    rng = np.random.default_rng(5)
    posture = LEG.forward(rng.uniform(*LEG.joint_limits.T, (20_000, 3)))
    excursion, limits = LEG.passive_joint_positions(posture), LEG.passive_joint_limits
    over = ((excursion < limits[:, 0]) | (excursion > limits[:, 1])).any(axis=-1)
    solved = np.isin(posture.status, (Status.OK, Status.PASSIVE_JOINT_LIMIT))
    np.testing.assert_array_equal(over[solved], posture.status[solved] == 3)
    assert 0.1 < over[solved].mean() < 0.9


def test_one_shape_rule():
    foot = workspace_postures(LEG, 6000).foot_position[:10].reshape(2, 5, 3)
    batch = LEG.inverse(foot)
    assert batch.joint_positions.shape == (2, 5, 3)
    assert batch.status.shape == (2, 5)
    single = LEG.inverse(foot[1, 2])
    assert single.status.shape == ()
    np.testing.assert_array_equal(single.joint_positions, batch.joint_positions[1, 2])
    for posture, leading in ((batch, (2, 5)), (single, ()), (LEG.inverse(np.empty((0, 3))), (0,))):
        assert LEG.jacobian(posture).shape == (*leading, 3, 3)
        assert LEG.angular_jacobian(posture).shape == (*leading, 3, 3)
        assert LEG.planar_jacobian(posture).shape == (*leading, 2, 2)
        assert LEG.passive_joint_positions(posture).shape == (*leading, 10)
        assert LEG.linkage(posture).points.shape == (*leading, 13, 3)


@pytest.mark.parametrize("bad", [[1.0, 2.0], [[1.0], [2.0]], "abc", [[None, "x", 1]], 1.0])
def test_a_wrong_shape_names_the_argument(bad):
    with pytest.raises(ShapeError, match="foot_position"):
        LEG.inverse(bad)
    with pytest.raises(ShapeError, match="joint_positions"):
        LEG.forward(bad)


def test_an_unknown_mode_lists_the_modes():
    with pytest.raises(UnknownNameError, match="flipped_rhombus"):
        LEG.inverse([0.0, 0.0, -0.7], "upside_down")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"rhombus_side": -0.2}, "rhombus_side"),
        ({"upper_crank_arm": 0.0}, "upper_crank_arm"),
        ({"frame_post": math.nan}, "frame_post"),
        ({"lower_crank_angle": math.inf}, "lower_crank_angle"),
        ({"lower_crank_angle": math.radians(-45.0)}, "lower cylinder"),
        ({"swing_offset": 0.0}, "swing_offset"),
        ({"swing_offset": math.pi}, "swing cylinder"),
        ({"frame_base": 0.240, "frame_angle": 0.0}, "upper cylinder"),
        ({"frame_angle": 0.0, "upper_crank_angle": math.radians(45.0)}, "upper_crank_angle"),
        ({"joint_ranges": ((0.3, 0.2),) * 3}, "joint_ranges"),
        ({"joint_ranges": ((0.2, 0.3),) * 2}, "joint_ranges"),
        ({"passive_joint_ranges": ((0.0, math.nan),) * 10}, "passive_joint_ranges"),
    ],
)
def test_an_impossible_geometry_names_what_is_wrong(change, named):
    with pytest.raises(GeometryError, match=named):
        DoubleRhombus(**change)


any_points = hnp.arrays(
    np.float64,
    hnp.array_shapes(max_dims=2, max_side=4).map(lambda s: (*s, 3)),
    elements=st.floats(width=64, allow_nan=True, allow_infinity=True) | st.floats(-1.1, 1.1),
)


@settings(max_examples=300, deadline=None)
@given(any_points, st.sampled_from(LEG.assembly_modes), st.sampled_from([LEG, FREE, ODD]))
def test_a_batch_call_takes_any_floats(points, mode, leg):
    for posture in (leg.inverse(points, mode), leg.forward(points, mode)):
        values = np.concatenate(
            [
                *(posture.joint_positions, posture.closure, posture.foot_position),
                leg.passive_joint_positions(posture),
                leg.jacobian(posture).reshape(*points.shape[:-1], 9),
                leg.angular_jacobian(posture).reshape(*points.shape[:-1], 9),
            ],
            axis=-1,
        )
        answered = np.isfinite(values).all(axis=-1)
        assert not np.any((posture.status == Status.OK) & ~answered)
        bad_input = ~np.isfinite(points).all(axis=-1)
        np.testing.assert_array_equal(posture.status == Status.INVALID_INPUT, bad_input)


@settings(max_examples=200, deadline=None)
@given(
    *[
        hnp.arrays(np.float64, 7, elements=st.floats(low, high))
        for low, high in DoubleRhombus.joint_ranges
    ]
)
def test_forward_and_inverse_agree_on_any_cylinders(l2, l4, q3):
    q = np.stack([l2, l4, q3], axis=-1)
    posture = LEG.forward(q)
    ok = posture.status == Status.OK
    back = LEG.inverse(posture.foot_position[ok])
    np.testing.assert_allclose(back.joint_positions, q[ok], atol=1e-9)


def test_the_shipped_quadruped_has_the_default_leg_four_times():
    robot = load_robot(Path(__file__).parents[2] / "config" / "robots" / "quadruped.yaml")
    assert list(robot.legs) == ["left_front", "left_rear", "right_front", "right_rear"]
    for name, leg in robot.legs.items():
        assert leg.mirrored == name.startswith("left")
        for field in (f.name for f in fields(DoubleRhombus)):
            np.testing.assert_allclose(getattr(leg.geometry, field), getattr(LEG, field))
        (pin,) = points_of(leg.mechanism.linkage(leg.mechanism.initial_posture), "K")
        inward = leg.mount.vectors_to_base(pin)  # to where the body is
        assert np.sign(inward[1]) == -np.sign(leg.mount.position[1])
