# SPDX-License-Identifier: Apache-2.0
"""Height maps of point clouds and grid maps, and foothold maps as both.

`grid_map_msgs` has no wheels: a class with its fields stands in for its message, whose parts are
those of `std_msgs` and `geometry_msgs`.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import Pose
from leg_msgs_py.clouds import from_cloud, to_cloud
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Float32MultiArray, Header, MultiArrayDimension, MultiArrayLayout

from leg_kinematics import load_robot
from leg_kinematics.nodes.requests import RequestError
from leg_statics.footholds import Contact, Verdict
from leg_statics.nodes.terrain_messages import (
    NORMAL_FIELDS,
    Layers,
    cloud_heights,
    foothold_cloud,
    foothold_grid,
    grid_heights,
)
from leg_statics.terrain import HeightMap, foothold_map, survey

LAYERS = Layers("elevation", NORMAL_FIELDS, "friction")
LEG = load_robot("hexapod").leg("left_front")
MOST = 10_000


class GridMap(SimpleNamespace):
    """The fields of grid_map_msgs/GridMap."""

    def __init__(self, header=None, layers=(), basic_layers=()):
        info = SimpleNamespace(resolution=0.0, length_x=0.0, length_y=0.0, pose=Pose())
        super().__init__(header=header, layers=list(layers), basic_layers=list(basic_layers))
        self.info, self.data = info, []
        self.outer_start_index = self.inner_start_index = 0


TYPES = SimpleNamespace(GridMap=GridMap)


def slope(ny=12, nx=16, resolution=0.06):
    x, y = -0.5 + resolution * np.arange(nx), -0.3 + resolution * np.arange(ny)
    x, y = np.meshgrid(x, y)
    points = np.stack([x, y, -0.65 + 0.1 * x], axis=-1).astype(np.float32).astype(float)
    points[3, 4, 2] = np.nan
    return HeightMap(points, resolution)


def answer(height_map):
    ground = survey(height_map)
    return ground, foothold_map(LEG, ground, Contact(0.4, load=200.0))


def test_a_cloud_in_any_order_is_its_height_map_with_friction_and_normals():
    heights, random = slope(), np.random.default_rng(1)
    points = heights.points.reshape(-1, 3)
    order = random.permutation(len(points))
    friction = random.random(len(points)).astype(np.float32)
    columns = {"friction": friction, **dict(zip(NORMAL_FIELDS, points.T, strict=True))}
    cloud = to_cloud(Header(), points[order], {k: v[order] for k, v in columns.items()})
    found = cloud_heights(cloud, LAYERS, 0.06, MOST)
    np.testing.assert_array_equal(found.points[..., 2], heights.points[..., 2])
    known = np.isfinite(points[:, 2])
    np.testing.assert_array_equal(found.friction.ravel()[known], friction[known])
    np.testing.assert_array_equal(found.normal.reshape(-1, 3)[known], points[known])


def test_an_organised_cloud_of_doubles_is_read_as_well():
    heights = slope()
    ny, nx = heights.points.shape[:2]
    cloud = PointCloud2(height=ny, width=nx, point_step=24, row_step=24 * nx)
    cloud.fields = [
        PointField(name=name, offset=8 * k, datatype=PointField.FLOAT64, count=1)
        for k, name in enumerate("xyz")
    ]
    cloud.data = heights.points.tobytes()
    found = cloud_heights(cloud, LAYERS, 0.0, MOST)
    assert found.resolution == pytest.approx(0.06, rel=1e-5)
    np.testing.assert_array_equal(found.points[..., 2], heights.points[..., 2])
    assert found.normal is None
    assert found.friction is None


def test_an_empty_cloud_is_an_empty_map():
    found = cloud_heights(to_cloud(Header(), np.empty((0, 3)), {}), LAYERS, 0.0, MOST)
    ground, footholds = answer(found)
    assert len(from_cloud(foothold_cloud(Header(), ground, footholds))[0]) == 0


def test_a_cloud_without_heights_is_told():
    cloud = to_cloud(Header(), np.zeros((2, 3)), {})
    cloud.fields = cloud.fields[:2]
    with pytest.raises(RequestError, match="the cloud has no field z"):
        cloud_heights(cloud, LAYERS, 0.0, MOST)


def test_a_foothold_cloud_has_the_known_cells_within_reach():
    ground, found = answer(slope())
    points, fields = from_cloud(foothold_cloud(Header(), ground, found))
    near = np.isfinite(found.verdict) & (found.verdict != Verdict.REACH)
    assert 0 < len(points) == near.sum()
    np.testing.assert_array_equal(points, ground.points[near])
    for name in ("verdict", "load_capacity", "friction_margin", "score"):
        np.testing.assert_array_equal(fields[name], getattr(found, name)[near].astype(np.float32))


@pytest.mark.parametrize("start", [(0, 0), (5, 3), (15, 11)])
@pytest.mark.parametrize("by_columns", [True, False])
def test_a_grid_map_is_read_from_wherever_its_ring_begins(start, by_columns):
    heights = slope()
    ground, found = answer(heights)
    grid = foothold_grid(TYPES, Header(frame_id="map"), 0.06, ground, found)
    grid.outer_start_index, grid.inner_start_index = start
    for message in grid.data:
        columns, rows = (each.size for each in message.layout.dim)
        matrix = np.array(message.data).reshape(columns, rows).T
        ring = np.roll(matrix, start, axis=(0, 1))
        names, stored = ("column_index", "row_index"), ring.T
        if not by_columns:
            names, stored = names[::-1], ring
        message.layout.dim = [
            MultiArrayDimension(label=name, size=size)
            for name, size in zip(names, stored.shape, strict=True)
        ]
        message.data = stored.ravel().tolist()
    again = grid_heights(grid, LAYERS, MOST)
    np.testing.assert_allclose(again.points, heights.points, atol=1e-6)
    score = grid_heights(grid, Layers("score", NORMAL_FIELDS, "friction"), MOST)
    np.testing.assert_array_equal(score.points[..., 2], found.score.astype(np.float32))


def test_the_first_cell_of_a_grid_map_has_the_largest_x_and_y():
    ground, found = answer(slope())
    grid = foothold_grid(TYPES, Header(), 0.06, ground, found)
    height = np.array(grid.data[grid.layers.index("elevation")].data)
    assert height[0] == np.float32(ground.points[-1, -1, 2])
    assert height[1] == np.float32(ground.points[-1, -2, 2])  # one row on is one cell less in x
    assert (grid.info.length_x, grid.info.length_y) == (16 * 0.06, 12 * 0.06)


def test_friction_and_normals_of_a_grid_map_are_layers():
    ground, found = answer(slope())
    grid = foothold_grid(TYPES, Header(), 0.06, ground, found)
    layers = Layers("elevation", ("slope", "score", "verdict"), "edge_distance")
    again = grid_heights(grid, layers, MOST)
    np.testing.assert_array_equal(again.friction, ground.edge_distance.astype(np.float32))
    np.testing.assert_array_equal(again.normal[..., 2], found.verdict.astype(np.float32))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda grid: grid.layers.__setitem__(0, "z"), "no layer 'elevation'; it has z, verdict"),
        (lambda grid: setattr(grid.info.pose.orientation, "z", 0.7), "orientation is turned"),
        (
            lambda grid: grid.data.__setitem__(
                0,
                Float32MultiArray(
                    data=[0.0] * 5,
                    layout=MultiArrayLayout(dim=[MultiArrayDimension(size=2)] * 2),
                ),
            ),
            r"layer 'elevation' has 5 values; its layout says 2 \* 2",
        ),
    ],
)
def test_a_grid_map_that_is_none_is_told(change, words):
    grid = foothold_grid(TYPES, Header(), 0.06, *answer(slope()))
    change(grid)
    with pytest.raises(RequestError, match=words):
        grid_heights(grid, LAYERS, MOST)
