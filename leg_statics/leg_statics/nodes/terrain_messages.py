# SPDX-License-Identifier: Apache-2.0
"""Height maps of messages, and foothold maps as messages: point clouds and grid maps.

A `grid_map_msgs/GridMap` counts its rows against x and its columns against y, and keeps each layer
as a ring: here it is turned to rows along y and columns along x, both upwards.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from leg_msgs_py.clouds import from_cloud, to_cloud
from std_msgs.msg import Float32MultiArray, MultiArrayDimension, MultiArrayLayout

from leg_kinematics.arrays import FloatArray
from leg_kinematics.nodes.requests import RequestError
from leg_statics.footholds import Verdict
from leg_statics.terrain import FootholdMap, HeightMap, Survey, gridded

NORMAL_FIELDS = ("normal_x", "normal_y", "normal_z")
COLUMN_FIRST = ("column_index", "row_index")  # labels of a layer that is stored by columns


class Layers(NamedTuple):
    """Names of the layers or fields of a map.

    Attributes:
        elevation: Heights, of a grid map.
        normals: Components x, y, z of the normals.
        friction: Friction coefficients.
    """

    elevation: str
    normals: tuple[str, str, str]
    friction: str


def cloud_heights(cloud: Any, layers: Layers, resolution: float, most: int) -> HeightMap:
    """Return the height map of a `sensor_msgs/PointCloud2`, organised or not.

    Raises:
        RequestError: If it has no x, y, z, or too little data.
        ValueRangeError: If it makes too many cells.
    """
    try:
        points, fields = from_cloud(cloud)
    except (ValueError, KeyError) as error:
        raise RequestError(f"point cloud: {error}") from None
    normal = None
    if all(name in fields for name in layers.normals):
        normal = np.stack([fields[name] for name in layers.normals], axis=-1)
    friction = fields.get(layers.friction)
    return gridded(points, resolution, normal=normal, friction=friction, most=most)


def grid_heights(grid: Any, layers: Layers, most: int) -> HeightMap:
    """Return the height map of a `grid_map_msgs/GridMap`.

    Raises:
        RequestError: If the elevation is missing, or layers are not as the map says.
    """
    names, info = list(grid.layers), grid.info
    if layers.elevation not in names:
        raise RequestError(
            f"grid map: no layer {layers.elevation!r}; it has {', '.join(names)} (parameter "
            "elevation_layer)"
        )
    turn = info.pose.orientation
    if abs(turn.x) + abs(turn.y) + abs(turn.z) > 1e-9:
        raise RequestError("grid map: info.pose.orientation is turned; allowed: none")
    start = int(grid.outer_start_index), int(grid.inner_start_index)
    height = _layer(grid, names.index(layers.elevation), start)
    if height.size > most:
        raise RequestError(f"grid map: {height.size} cells; allowed: at most {most}")
    ny, nx = height.shape
    points = np.empty((ny, nx, 3))
    centre = info.pose.position
    points[..., 0] = centre.x + info.resolution * (np.arange(nx) - 0.5 * (nx - 1))
    points[..., 1] = centre.y + info.resolution * (np.arange(ny) - 0.5 * (ny - 1))[:, None]
    points[..., 2] = height
    normal = friction = None
    if all(name in names for name in layers.normals):
        parts = [_layer(grid, names.index(name), start) for name in layers.normals]
        normal = np.stack(parts, axis=-1)
    if layers.friction in names:
        friction = _layer(grid, names.index(layers.friction), start)
    return HeightMap(points, float(info.resolution), normal, friction)


def foothold_cloud(header: Any, ground: Survey, found: FootholdMap) -> Any:
    """Return the known cells within reach as a `sensor_msgs/PointCloud2`."""
    near = np.isfinite(found.verdict) & (found.verdict != Verdict.REACH)
    values = {name: layer[near] for name, layer in _values(ground, found).items()}
    return to_cloud(header, ground.points[near], values)


def foothold_grid(
    types: Any, header: Any, resolution: float, ground: Survey, found: FootholdMap
) -> Any:
    """Return a foothold map as a `grid_map_msgs/GridMap`.

    Args:
        types: The module `grid_map_msgs.msg`.
        header: Frame and time.
        resolution: Spacing of the grid [m].
        ground: The ground.
        found: The foothold map.
    """
    layers: Mapping[str, FloatArray] = {
        "elevation": ground.points[..., 2],
        **_values(ground, found),
    }
    grid = types.GridMap(header=header, layers=list(layers), basic_layers=["elevation"])
    ny, nx = found.score.shape
    grid.info.resolution = resolution
    grid.info.length_x, grid.info.length_y = nx * resolution, ny * resolution
    if found.score.size:
        low, high = ground.points[0, 0, :2], ground.points[-1, -1, :2]
        grid.info.pose.position.x, grid.info.pose.position.y = (0.5 * (low + high)).tolist()
    grid.info.pose.orientation.w = 1.0
    grid.data = [_multi_array(layer) for layer in layers.values()]
    return grid


def _values(ground: Survey, found: FootholdMap) -> dict[str, FloatArray]:
    """Return the layers of a foothold map by name (ny, nx)."""
    return {
        "verdict": found.verdict,
        "load_capacity": found.load_capacity,
        "friction_margin": found.friction_margin,
        "score": found.score,
        "slope": ground.slope,
        "edge_distance": ground.edge_distance,
    }


def _layer(grid: Any, index: int, start: tuple[int, int]) -> FloatArray:
    """Return a layer of a grid map with rows along y and columns along x (ny, nx).

    Raises:
        RequestError: If its size is not what its layout says.
    """
    message = grid.data[index]
    sizes: Sequence[int] = [int(each.size) for each in message.layout.dim]
    numbers = np.array(message.data, dtype=np.float64)
    if len(sizes) != 2 or numbers.size != sizes[0] * sizes[1]:
        raise RequestError(
            f"grid map: layer {grid.layers[index]!r} has {numbers.size} values; its layout says "
            f"{' * '.join(map(str, sizes))}"
        )
    by_columns = message.layout.dim[0].label == COLUMN_FIRST[0]
    stored = numbers.reshape(sizes)
    matrix = np.roll(stored.T if by_columns else stored, [-shift for shift in start], axis=(0, 1))
    return matrix[::-1, ::-1].T


def _multi_array(layer: FloatArray) -> Any:
    """Return a layer (ny, nx) as a grid map keeps it."""
    by_columns = np.ascontiguousarray(layer[::-1, ::-1], dtype=np.float32)
    columns, rows = by_columns.shape
    dimensions = [
        MultiArrayDimension(label=label, size=size, stride=stride)
        for label, size, stride in zip(
            COLUMN_FIRST, (columns, rows), (columns * rows, rows), strict=True
        )
    ]
    return Float32MultiArray(
        layout=MultiArrayLayout(dim=dimensions), data=by_columns.ravel().tolist()
    )
