# SPDX-License-Identifier: Apache-2.0
"""Terrain: what is known of it is exact, what is not known stays unknown."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from leg_kinematics import load_robot
from leg_kinematics.errors import KindError, ShapeError, ValueRangeError
from leg_kinematics.robot import Mount
from leg_statics.footholds import Contact, Verdict, evaluate_footholds
from leg_statics.terrain import HeightMap, Surface, foothold_map, gridded, survey
from leg_statics.weight import GRAVITY

ROBOT = load_robot("hexapod")
LEG = ROBOT.leg("left_front")
STEP = 0.05


def grid(height, count=(24, 20), resolution=STEP, origin=(-0.6, -0.5)):
    """Return a map of a function of x and y."""
    ny, nx = count
    x, y = origin[0] + resolution * np.arange(nx), origin[1] + resolution * np.arange(ny)
    x, y = np.meshgrid(x, y)
    return HeightMap(np.stack([x, y, height(x, y) + 0.0 * x], axis=-1), resolution)


def rubble(x, y):
    return 0.05 * np.sin(9.0 * x) * np.cos(7.0 * y)


# --------------------------------------------------------------------------- the ground


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-3.0, 3.0), st.integers(1, 3))
def test_the_normals_of_a_plane_are_its_normal(a, b, c, radius):
    found = survey(grid(lambda x, y: a * x + b * y + c), Surface(fit_radius=radius))
    wanted = np.array([-a, -b, 1.0]) / np.sqrt(a * a + b * b + 1.0)
    np.testing.assert_allclose(found.normal, np.broadcast_to(wanted, found.normal.shape), atol=1e-9)
    np.testing.assert_allclose(found.slope, np.arccos(wanted[2]), atol=1e-7)
    assert np.isinf(found.edge_distance).all()


def test_a_hole_stays_unknown_and_the_plane_around_it_is_the_same():
    tilted = grid(lambda x, y: 0.3 * x - 0.1 * y)
    holes = np.random.default_rng(1).random(tilted.points.shape[:2]) < 0.2
    points = tilted.points.copy()
    points[holes, 2] = np.nan
    found, whole = survey(HeightMap(points, STEP)), survey(tilted)
    assert np.isnan(found.normal[holes]).all()
    assert np.isnan(found.score[holes]).all()
    near = np.isfinite(found.normal[..., 0])
    assert near.sum() > 0.95 * (~holes).sum()
    np.testing.assert_allclose(found.normal[near], whole.normal[near], atol=1e-9)


def test_cells_without_neighbours_or_in_a_line_have_no_normal():
    flat = grid(lambda x, y: 0.0)
    points = flat.points.copy()
    points[..., 2] = np.nan
    points[3, 3, 2] = points[10, :, 2] = 0.0
    assert not survey(HeightMap(points, STEP)).known.any()


def test_a_step_of_the_ground_is_an_edge_at_its_distance_and_a_slope_is_none():
    high = grid(lambda x, y: np.where(x > 0.01, 0.2, 0.0))
    found = survey(high, Surface(edge_height=0.05, edge_margin=0.06, ample_margin=0.2))
    below = np.flatnonzero(high.points[8, :, 0] <= 0.01)
    distance = STEP * (below[-1] - below)
    np.testing.assert_allclose(found.edge_distance[8, below], distance, atol=1e-12)
    assert found.edge_distance[8, below[-1] + 1] == 0.0
    assert (found.score[8][found.edge_distance[8] < 0.06] == 0.0).all()
    steep = survey(grid(lambda x, y: 0.5 * x), Surface(edge_height=0.05))
    assert np.isinf(steep.edge_distance).all()


def test_an_unknown_cell_is_an_edge():
    flat = grid(lambda x, y: 0.0)
    points = flat.points.copy()
    points[12, 10, 2] = np.nan
    found = survey(HeightMap(points, STEP))
    assert found.edge_distance[12, 11] == 0.0
    np.testing.assert_allclose(found.edge_distance[12, 14], 3 * STEP)
    np.testing.assert_allclose(found.edge_distance[15, 10], 2 * STEP)


def test_scores_fall_with_the_slope_and_end_at_the_steepest():
    scores = [
        survey(grid(lambda x, y, a=a: np.tan(a) * x), Surface(steepest=0.5)).score[5, 5]
        for a in (0.0, 0.2, 0.4, 0.49, 0.51, 1.0)
    ]
    np.testing.assert_allclose(scores, [1.0, 0.6, 0.2, 0.02, 0.0, 0.0], atol=1e-9)


def test_normals_and_friction_that_are_told_count_where_they_are_known():
    flat = grid(lambda x, y: 0.0)
    normal = np.broadcast_to([0.3, 0.0, 2.0], flat.points.shape).copy()
    normal[4, 4] = np.nan
    friction = np.full(flat.points.shape[:2], 0.5)
    friction[6, 6] = np.nan
    found = survey(flat._replace(normal=normal, friction=friction))
    np.testing.assert_allclose(found.slope[8, 8], np.arctan(0.15))
    assert np.isnan(found.score[4, 4])
    assert np.isnan(found.score[6, 6])


@pytest.mark.parametrize("count", [(0, 0), (1, 1), (0, 5), (3, 3)])
def test_maps_of_nothing_and_of_little_are_maps(count):
    points = np.full((*count, 3), np.nan)
    found = survey(HeightMap(points, STEP))
    assert found.score.shape == count
    assert np.isnan(foothold_map(LEG, found, Contact(0.4)).score).all()


# --------------------------------------------------------------------------- points


def test_points_of_a_grid_in_any_order_are_that_grid_bit_for_bit():
    whole = grid(rubble)
    friction = np.arange(480.0)
    order = np.random.default_rng(3).permutation(480)
    found = gridded(whole.points.reshape(-1, 3)[order], friction=friction[order])
    assert found.resolution == pytest.approx(STEP)
    np.testing.assert_array_equal(found.points, whole.points)
    np.testing.assert_array_equal(found.friction.ravel(), friction)


def test_missing_points_are_holes_and_of_several_the_highest_counts():
    points = grid(lambda x, y: 0.0, (5, 5), origin=(0.0, 0.0)).points.reshape(-1, 3)
    points = np.concatenate([np.delete(points, 12, axis=0), [[0.052, 0.049, 0.3], [np.nan, 0, 0]]])
    found = gridded(points, STEP)
    assert found.points.shape == (5, 5, 3)
    np.testing.assert_array_equal(np.isnan(found.points[..., 2]), np.eye(25)[12].reshape(5, 5))
    np.testing.assert_array_equal(found.points[1, 1], [0.052, 0.049, 0.3])


def test_no_points_are_an_empty_map_and_points_far_apart_are_told():
    assert gridded(np.empty((0, 3))).points.shape == (0, 0, 3)
    assert survey(gridded([[1.0, 2.0, 3.0]])).score.shape == (1, 1)
    with pytest.raises(ValueRangeError, match=r"resolution: a map of 1e\+04 m .*at most 1000000"):
        gridded([[0.0, 0.0, 0.0], [1e4, 1e4, 0.0]], 0.01)
    with pytest.raises(ShapeError, match="friction must have length 1, got 2"):
        gridded([[0.0, 0.0, 0.0]], friction=[0.1, 0.2])


# --------------------------------------------------------------------------- footholds


def body(position=(0.1, -0.05, 0.62), turn=(0.05, -0.1, 0.4)):
    return Mount(np.array(position), Rotation.from_rotvec(turn).as_matrix())


@pytest.mark.parametrize("name", ["hexapod", "solo12"])
def test_the_answer_of_a_cell_is_that_of_a_query_about_it_bit_for_bit(name):
    robot = load_robot(name)
    leg = next(iter(robot.legs.values()))
    size, load = (1.0, 300.0) if name == "hexapod" else (0.35, 10.0)
    ground = survey(grid(lambda x, y: rubble(x, y) * size, (40, 40), 0.04 * size, (-0.2, -0.3)))
    base = body(position=(0.1 * size, -0.05 * size, 0.62 * size))
    contact = Contact(0.4, load=load, moment=(1.0, 0.0, 0.5))
    found = foothold_map(leg, ground, contact, base)
    mount = leg.mount.within(base)
    assert {Verdict.FEASIBLE, Verdict.REACH} <= set(found.verdict[ground.known].astype(int))
    rows, columns = np.nonzero(found.verdict != Verdict.REACH)
    for i, j in list(zip(rows, columns, strict=True))[::7]:
        one = Contact(
            0.4,
            mount.vectors_to_leg(ground.normal[i, j]),
            load,
            mount.vectors_to_leg(contact.moment),
            gravity=tuple(-GRAVITY * x for x in mount.vertical),
        )
        alone = evaluate_footholds(leg, mount.to_leg(ground.points[i, j]), one)
        assert found.verdict[i, j] == alone.verdict
        np.testing.assert_array_equal(found.load_capacity[i, j], alone.load_capacity)
        np.testing.assert_array_equal(found.friction_margin[i, j], alone.friction_margin)
        wanted = np.clip(min(float(alone.margin), ground.score[i, j]), 0.0, 1.0)
        assert found.score[i, j] == (0.0 if np.isnan(alone.margin) else wanted)


def test_friction_of_the_map_counts_before_that_of_the_contact():
    flat = grid(lambda x, y: -0.65, (30, 30))
    friction = np.where(flat.points[..., 0] > 0.0, 0.0, 0.9)
    slippery = foothold_map(LEG, survey(flat._replace(friction=friction)), Contact(0.4))
    rough = foothold_map(LEG, survey(flat), Contact(0.9))
    left = (flat.points[..., 0] <= 0.0) & np.isfinite(rough.load_capacity)
    np.testing.assert_array_equal(slippery.load_capacity[left], rough.load_capacity[left])
    right = (flat.points[..., 0] > 0.0) & np.isfinite(rough.load_capacity)
    assert (slippery.load_capacity[right] <= rough.load_capacity[right]).all()
    assert (slippery.load_capacity[right] < rough.load_capacity[right]).any()


def test_scores_are_between_0_and_1_and_only_of_feasible_cells():
    ground = survey(grid(rubble, (40, 40)))
    found = foothold_map(LEG, ground, Contact(0.4, load=500.0), body())
    known = np.isfinite(found.score)
    np.testing.assert_array_equal(known, ground.known)
    assert ((found.score[known] >= 0.0) & (found.score[known] <= 1.0)).all()
    assert (found.score[known & (found.verdict != Verdict.FEASIBLE)] == 0.0).all()
    assert found.score[known].max() > 0.1


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"points": np.zeros((4, 3))}, ShapeError, "points must have shape"),
        ({"resolution": 0.0}, ValueRangeError, "resolution must be finite and > 0, got 0"),
        ({"friction": np.zeros((2, 2))}, ShapeError, "friction must have shape"),
        ({"normal": np.zeros((2, 2, 3))}, ShapeError, "normal must have shape"),
    ],
)
def test_misuse_is_told(change, error, words):
    with pytest.raises(error, match=words):
        survey(grid(rubble)._replace(**change))


def test_what_is_no_map_is_told():
    with pytest.raises(KindError, match="height_map"):
        survey(np.zeros((3, 3)))
    with pytest.raises(ValueRangeError, match="steepest"):
        survey(grid(rubble), Surface(steepest=-1.0))
