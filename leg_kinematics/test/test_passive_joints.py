# SPDX-License-Identifier: Apache-2.0
"""Positions of passive joints against the points of the linkage, closed loops and paths."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mechanism_zoo import ALL, PLAIN, chosen, ok_postures, random_joints, varied

from leg_kinematics import MECHANISMS, Mirrored, Status

UP = np.array([0.0, 0.0, 1.0])
FORWARD = np.array([1.0, 0.0, 0.0])
RIGHT = np.cross(FORWARD, UP)  # about it things turn from forward to up

# Joints of planar parts: the point and the far ends of its two bars.
PLANAR = {
    "parallel_drive": {
        "r1": ("R1", "H", "R2"),
        "r2": ("R2", "R1", "R5"),
        "r3": ("R3", "R1", "R5"),
        "r5": ("R5", "R3", "C"),
    },
    "double_rhombus": {
        "hip_upper_crank": ("O", "C", "F"),
        "hip_lower_crank": ("O", "C", "E"),
        "f": ("F", "O", "G"),
        "e": ("E", "O", "G"),
        "g": ("G", "F", "E"),
        "h": ("H", "G", "I"),
        "j": ("J", "G", "I"),
        "i": ("I", "H", "J"),
        "foot": ("I", "H", "O"),
        "upper_pin_a": ("A", "O", "B"),
        "lower_pin_c": ("C", "O", "D"),
        "lower_pin_d": ("D", "O", "C"),
    },
    "six_bar": {
        "b": ("B", "A", "C"),
        "e": ("E", "A", "F"),
        "d": ("D", "A", "C"),
        "c_coupler": ("C", "D", "B"),
        "c_foot": ("C", "D", "F"),
        "f": ("F", "C", "E"),
    },
    "theo_jansen": {
        "b_upper": ("B", "A", "U"),
        "b_lower": ("B", "A", "C"),
        "d_upper": ("D", "A", "U"),
        "d_lower": ("D", "A", "C"),
        "u": ("U", "D", "B"),
        "c_coupler": ("C", "D", "B"),
        "c_foot": ("C", "D", "F"),
        "l": ("L", "D", "F"),
        "f": ("F", "C", "L"),
    },
}
CRANK_LEGS = ("six_bar", "theo_jansen")

planar_samples = pytest.mark.parametrize(
    "mechanism",
    [m for name in PLANAR for m in (PLAIN[name], *varied(MECHANISMS[name], 2))],
    ids=[f"{name} {k}" for name in PLANAR for k in range(3)],
)


def positions(mechanism, posture):
    """Positions of the passive joints by name."""
    names = [joint.name for joint in mechanism.passive_joints]
    found = mechanism.passive_joint_positions(posture)
    return dict(zip(names, np.moveaxis(found, -1, 0), strict=True))


def bars(mechanism, posture, *names):
    """Vectors from the first of the points to each of the others."""
    linkage = mechanism.linkage(posture)
    points = [linkage.points[..., linkage.names.index(name), :] for name in names]
    return [point - points[0] for point in points[1:]]


def angle_about(axis, first, second):
    """Angle from one vector to another about an axis (...) [rad], of their parts across it."""
    axis = np.broadcast_to(axis, first.shape)
    cross = np.sum(np.cross(first, second) * axis, axis=-1)
    along = np.sum(first * axis, axis=-1) * np.sum(second * axis, axis=-1)
    return np.arctan2(cross, np.sum(first * second, axis=-1) - along)


def assert_same_angle(found, wanted, name):
    turns = (found - wanted) / (2.0 * math.pi)
    np.testing.assert_allclose(turns, np.round(turns), rtol=0, atol=1e-9, err_msg=name)


def plane_normal(mechanism, posture):
    """Unit normal of the plane in which the planar part of a leg moves, to the right."""
    if mechanism.name == "parallel_drive":
        first, second = bars(mechanism, posture, "R1", "R2", "H")
    elif mechanism.name == "double_rhombus":
        first, second = bars(mechanism, posture, "O", "C", "B")
    else:
        return RIGHT
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return normal * np.sign(normal @ RIGHT)[..., None]


@planar_samples
def test_angles_at_the_pins_of_planar_parts_are_those_between_the_bars(mechanism):
    posture = ok_postures(mechanism, 300)
    normal = plane_normal(mechanism, posture)
    # the cranks of one-crank legs turn from forward to down
    normal = -normal if mechanism.name in CRANK_LEGS else normal
    found = positions(mechanism, posture)
    for name, points in PLANAR[mechanism.name].items():
        wanted = angle_about(normal, *bars(mechanism, posture, *points))
        assert_same_angle(found[name], wanted, name)


def assert_universal_joint(found, name, axis, across, start, bar):
    """`along` turns the start about the axis to the bar's projection, `across` that to the bar."""
    assert_same_angle(found[f"{name}_along"], angle_about(axis, start, bar), f"{name} along")
    length = np.linalg.norm(bar, axis=-1)
    wanted = np.arcsin(np.sum(bar * across, axis=-1) / length)
    np.testing.assert_allclose(found[f"{name}_across"], wanted, rtol=0, atol=1e-9)


@pytest.mark.parametrize("leg", [PLAIN["parallel_drive"], *varied(MECHANISMS["parallel_drive"], 2)])
def test_joints_of_the_parallel_drive(leg):
    posture = ok_postures(leg, 300)
    found = positions(leg, posture)
    # crank 1 stands on the right
    for k, end in ((1, "S1"), (2, "S2"), (3, "G")):
        crank, rod = bars(leg, posture, f"U{k}", f"R_D{k}", end)
        assert_universal_joint(found, f"u{k}", RIGHT, RIGHT, -crank, rod)
    (thigh,) = bars(leg, posture, "H", "R1")
    normal = plane_normal(leg, posture)
    forward = np.broadcast_to(FORWARD, thigh.shape)
    assert_same_angle(found["hip_thigh"], angle_about(normal, forward, thigh), "thigh")
    right = np.broadcast_to(RIGHT, normal.shape)
    assert_same_angle(found["hip_swing"], angle_about(FORWARD, right, normal), "swing")


@pytest.mark.parametrize("leg", [PLAIN["double_rhombus"], *varied(MECHANISMS["double_rhombus"], 2)])
def test_joints_of_the_double_rhombus_outside_of_pins_between_two_bars(leg):
    posture = ok_postures(leg, 300)
    found = positions(leg, posture)
    normal = plane_normal(leg, posture)
    (back,) = bars(leg, posture, "C", "O")
    (cylinder,) = bars(leg, posture, "B", "A")
    assert_same_angle(found["upper_pin_b"], angle_about(normal, back, cylinder), "upper_pin_b")
    right = np.broadcast_to(RIGHT, normal.shape)
    assert_same_angle(found["swing_axis"], angle_about(FORWARD, right, normal), "swing_axis")
    for name, points in (("swing_pin_body", ("K", "O", "L")), ("swing_pin_leg", ("L", "O", "K"))):
        wanted = angle_about(FORWARD, *bars(leg, posture, *points))
        assert_same_angle(found[name], wanted, name)


@pytest.mark.parametrize("arm", [PLAIN["gantry_hybrid"], *varied(MECHANISMS["gantry_hybrid"], 2)])
def test_joints_of_the_gantry_manipulator(arm):
    posture = ok_postures(arm, 300)
    found = positions(arm, posture)
    x, y = np.broadcast_to(np.eye(3)[:2, None], (2, len(posture.status), 3))
    for bar, rail, hinge in (("bar_a", "A''", "A'"), ("bar_b", "B''", "B'")):
        (up,) = bars(arm, posture, rail, hinge)
        assert_same_angle(found[f"{bar}_slide"], angle_about(-y, x, up), bar)
        assert_same_angle(found[f"{bar}_hinge"], angle_about(-y, up, x), bar)
    (lever,) = bars(arm, posture, "O''", "C'")
    assert_same_angle(found["platform_hinge"], angle_about(x, y, lever), "platform_hinge")
    (rod,) = bars(arm, posture, "C''", "C'")
    assert_universal_joint(found, "rod_slide", x, x, y, rod)
    np.testing.assert_array_equal(found["rod_platform_across"], -found["rod_slide_across"])
    assert_same_angle(found["rod_platform_along"], angle_about(x, lever, rod), "rod_platform_along")
    (shaft,) = bars(arm, posture, "F", "F'")
    np.testing.assert_allclose(
        found["shaft_sleeve"], np.linalg.norm(shaft, axis=-1), rtol=0, atol=1e-12
    )


# Around a loop of bars, angles of joints add up: one side of each equation turns as the other.
LOOPS = {
    "six_bar": [
        ({"crank": 1, "b": 1}, {"d": 1, "c_coupler": 1}),
        ({"crank": 1, "e": 1}, {"d": 1, "c_foot": 1, "f": 1}),
    ],
    "theo_jansen": [
        ({"crank": 1, "b_lower": 1}, {"d_lower": 1, "c_coupler": 1}),
        ({"crank": 1, "b_upper": 1}, {"d_upper": 1, "u": 1}),
        ({"d_upper": 1, "l": 1}, {"d_lower": 1, "c_foot": 1, "f": 1}),
    ],
    "double_rhombus": [
        ({"hip_upper_crank": 1, "f": 1}, {"hip_lower_crank": 1, "e": 1, "g": -1}),
        ({"hip_upper_crank": 1, "upper_pin_a": 1}, {"upper_pin_b": 1}),
        ({"hip_lower_crank": 1, "lower_pin_d": 1}, {"lower_pin_c": 1}),
        ({"h": 1, "i": 1}, {"g": -1, "j": 1}),
        ({"swing_axis": 1, "swing_pin_leg": 1}, {"swing_pin_body": 1}),
    ],
    "parallel_drive": [({"r1": 1, "r2": 1}, {"r3": 1, "r5": 1})],
    "gantry_hybrid": [
        ({"bar_a_slide": 1, "bar_a_hinge": 1}, {"bar_b_slide": 1, "bar_b_hinge": 1}),
        ({"rod_slide_along": 1}, {"platform_hinge": 1, "rod_platform_along": 1}),
    ],
}


@pytest.mark.parametrize("mechanism", [PLAIN[name] for name in LOOPS], ids=LOOPS)
def test_turns_around_every_loop_add_up(mechanism):
    """Without a jump by a whole turn, however often the crank went round."""
    q = random_joints(mechanism, 2000)
    if mechanism.name in CRANK_LEGS:
        q = np.linspace(-20.0, 20.0, 2001)[:, None]
    posture = mechanism.forward(q)
    posture = chosen(posture, posture.status == Status.OK)
    joints = [joint.name for joint in mechanism.joints]
    found = positions(mechanism, posture)
    found |= dict(zip(joints, posture.joint_positions.T, strict=True))
    for left, right in LOOPS[mechanism.name]:
        sides = [sum(sign * found[name] for name, sign in side.items()) for side in (left, right)]
        difference = sides[0] - sides[1]
        np.testing.assert_allclose(difference, difference[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
def test_positions_start_within_half_a_turn_and_excursions_at_zero(mechanism):
    posture = mechanism.initial_posture
    at_rest = mechanism.passive_joint_positions(posture)
    assert (np.abs(at_rest) <= math.pi).all()
    np.testing.assert_allclose(mechanism.passive_joint_excursions(posture), 0.0, atol=1e-7)


@pytest.mark.parametrize("mechanism", [m for m in ALL.values() if m.passive_joints])
def test_an_excursion_with_the_name_of_a_joint_is_its_way_from_the_initial_posture(mechanism):
    posture = ok_postures(mechanism, 500)
    found, rest = positions(mechanism, posture), positions(mechanism, mechanism.initial_posture)
    excursions = mechanism.passive_joint_excursions(posture)
    shared = [e.name for e in mechanism.excursions if e.name in found]
    assert shared
    for k, excursion in enumerate(mechanism.excursions):
        if excursion.name in found:
            way = found[excursion.name] - rest[excursion.name]
            assert_same_angle(excursions[:, k], way, excursion.name)


@pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
def test_positions_are_continuous_along_paths(mechanism):
    """From the initial posture to random ones; halving the step halves the way, a jump stays."""
    start = mechanism.initial_posture.joint_positions
    ends = ok_postures(mechanism, 150).joint_positions
    if mechanism.name in CRANK_LEGS:
        ends = 10.0 * ends  # over several turns
    t = np.linspace(0.0, 1.0, 1601)[:, None, None]
    path = mechanism.forward(start + t * (ends - start))
    whole = np.isin(path.status, (Status.OK, Status.PASSIVE_JOINT_LIMIT)).all(axis=0)
    assert whole.sum() > 50
    found = mechanism.passive_joint_positions(path)[:, whole]
    fine, coarse = (np.abs(np.diff(p, axis=0)).max(axis=0) for p in (found, found[::2]))
    assert np.all(fine < 0.8 * coarse + 1e-6)


def test_a_mirror_image_has_the_same_joint_positions():
    for mechanism in PLAIN.values():
        if mechanism.has_point_foot:
            mirrored, q = Mirrored(mechanism), ok_postures(mechanism, 50).joint_positions
            np.testing.assert_array_equal(
                mirrored.passive_joint_positions(mirrored.forward(q)),
                mechanism.passive_joint_positions(mechanism.forward(q)),
            )
