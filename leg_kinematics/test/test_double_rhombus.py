# SPDX-License-Identifier: Apache-2.0
"""`DoubleRhombus` against its own inverse, finite differences, virtual work and its bar lengths."""

from __future__ import annotations

import math
from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from leg_kinematics import GeometryError, Status, load_robot
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


def test_initial_posture_hangs_straight_down_with_right_angled_rhombi():
    posture = LEG.initial_posture
    assert posture.status == Status.OK
    np.testing.assert_allclose(posture.foot_position, [0, 0, -4 * 0.260 * math.sqrt(0.5)])
    np.testing.assert_allclose(posture.closure, INITIAL_CLOSURE, atol=1e-12)


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


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"lower_crank_angle": math.radians(-45.0)}, "lower cylinder"),
        ({"swing_offset": 0.0}, "swing_offset"),
        ({"swing_offset": math.pi}, "swing cylinder"),
        ({"frame_base": 0.240, "frame_angle": 0.0}, "upper cylinder"),
        ({"frame_angle": 0.0, "upper_crank_angle": math.radians(45.0)}, "upper_crank_angle"),
    ],
)
def test_an_impossible_geometry_names_what_is_wrong(change, named):
    with pytest.raises(GeometryError, match=named):
        DoubleRhombus(**change)


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
