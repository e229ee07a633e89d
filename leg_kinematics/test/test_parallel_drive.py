# SPDX-License-Identifier: Apache-2.0
"""`ParallelDrive` against the paper, finite differences, its own inverse and its bar lengths."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from leg_kinematics import GeometryError, ParallelDrive, Status
from leg_kinematics.kernels.settled import UNCERTAIN
from leg_kinematics.mechanisms.parallel_drive_kernels import forward, forward_search
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


def test_a_foot_beyond_the_axis_of_the_swing_is_singular():
    leg = ParallelDrive(
        crank_spacing=0.253916, center_crank_drop=0.065532, center_crank_forward=0.004057,
        crank_length=0.174499, center_crank_length=0.196932, rod_length=0.225516,
        platform_arm=0.060355, platform_length=0.216712, platform_post=0.130797,
        hip_forward=0.193971, hip_drop=0.056293, thigh_upper=0.173065, drive_lever=0.155955,
        drive_lever_offset=0.043394, thigh_lower=0.202789, parallelogram_link=0.333824,
        shank_length=0.359367, crank_zero=-0.480911, center_crank_zero=-1.930405,
    )  # fmt: skip
    posture = leg.forward([0.216, 0.237, -0.289])
    assert posture.status == Status.SINGULAR
    assert posture.foot_position[2] > 0.0  # above the hip, where it does not hang any more
    assert leg.inverse(posture.foot_position).status != Status.OK


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


@pytest.mark.parametrize(("reach", "most"), [(0.36, 0.9), (1.0, 0.2)])
def test_steps_of_a_block_find_what_a_search_for_each_point_finds(reach, most):
    q = np.random.default_rng(4).uniform(-reach, reach, (4000, 3))
    for mode in reversed(INITIAL.assembly_modes):  # the initial one last
        parameters = INITIAL._parameters(mode)
        coordinates, status = forward(parameters, q)
        sure = status != UNCERTAIN
        searched, expected = forward_search(parameters, q[sure])
        np.testing.assert_array_equal(status[sure], expected)
        np.testing.assert_allclose(coordinates[sure], searched, rtol=0.0, atol=1e-12)
    assert np.mean(sure) > most


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


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"rod_length": 0.05}, "rod_length"),
        ({"platform_length": 3.0}, "platform"),
        ({"thigh_upper": 3.0}, "pantograph"),
    ],
)
def test_an_impossible_geometry_names_what_is_wrong(change, named):
    with pytest.raises(GeometryError, match=named):
        ParallelDrive(**change)
