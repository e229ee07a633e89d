# SPDX-License-Identifier: Apache-2.0
"""Index maps: every index of a leg over a line or plane of the workspace or over all of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Literal, NamedTuple

import numpy as np

from leg_kinematics.arguments import as_count, as_names, as_number, require
from leg_kinematics.arrays import FloatArray, StatusArray
from leg_kinematics.errors import NotSupportedError, UnknownNameError, ValueRangeError
from leg_kinematics.mechanism import Mechanism, Posture
from leg_kinematics.robot import Leg
from leg_kinematics.status import Status
from leg_statics.footholds import Contact, judge_footholds
from leg_statics.indices import find_index, indices_of, supported_indices
from leg_statics.kinematics import Kinematics
from leg_statics.workspace import check_heights, workspace_bounds

CAPACITY_LAYER = "load_capacity"
MOST_POINTS = 20_000_000
MOST_THREADS = 1024
MOST_ALONG_AXIS = 1e9  # beyond, a number of points is not told exactly


class IndexMap(NamedTuple):
    """Values of several layers on a regular grid of the leg frame.

    Attributes:
        x: Grid coordinates along x (nx,) [m].
        y: Grid coordinates along y (ny,) [m].
        height: z of the grid (...,) [m]: that of a plane, (nz,) of a volume.
        layers: Names of the layers (K).
        values: Values (..., ny, nx, K); NaN outside the workspace.
        status: `Status` of each point (..., ny, nx).
    """

    x: FloatArray
    y: FloatArray
    height: FloatArray
    layers: tuple[str, ...]
    values: FloatArray
    status: StatusArray

    @property
    def symbols(self) -> tuple[str, ...]:
        """The literature's symbols of the layers (K)."""
        return tuple(find_layer(name).symbol for name in self.layers)

    @property
    def units(self) -> tuple[str, ...]:
        """SI units of the layers (K)."""
        return tuple(find_layer(name).unit for name in self.layers)

    def layer(self, name: str) -> FloatArray:
        """Return the values of one layer (..., ny, nx)."""
        if not isinstance(name, str) or name not in self.layers:
            raise UnknownNameError("layer", name, self.layers)
        return self.values[..., self.layers.index(name)]


def supported_layers(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of the layers that a map of this mechanism can have."""
    return (*supported_indices(mechanism), CAPACITY_LAYER)


class Layer(NamedTuple):
    """What a layer of a map is.

    Attributes:
        symbol: The literature's symbol.
        unit: SI unit; "1" for a pure number.
        better: Whether a low or a high value is better.
    """

    symbol: str
    unit: str
    better: Literal["low", "high"]


def find_layer(name: str) -> Layer:
    """Return what a layer is.

    Raises:
        UnknownNameError: If there is none of that name.
    """
    if name == CAPACITY_LAYER:
        return Layer("F_n,max", "N", "high")
    index = find_index(name)
    return Layer(index.symbol, index.unit, index.better)


def grid_shape(mechanism: Mechanism, resolution: float) -> tuple[int, int, int]:
    """Return the number of points of a map along z, y and x.

    Raises:
        ValueRangeError: If the resolution is out of range.
    """
    first, last = _grid_range(mechanism, resolution)
    with np.errstate(invalid="ignore"):
        count = np.fmin(last - first + 1.0, MOST_ALONG_AXIS)
    nx, ny, nz = (int(n) for n in count)
    return nz, ny, nx


def best_points(index_map: IndexMap) -> tuple[FloatArray, FloatArray]:
    """Return the best value of each layer (K,) and where it is (K, 3) [m]; NaN if there is none."""
    count = len(index_map.layers)
    values = index_map.values.reshape(-1, count)
    signs = [1.0 if find_layer(name).better == "low" else -1.0 for name in index_map.layers]
    costs = np.where(np.isnan(values), np.inf, values * signs)
    found = np.any(~np.isnan(values), axis=0)
    where = np.argmin(costs, axis=0)
    *plane, y, x = np.unravel_index(where, index_map.status.shape)
    height = np.broadcast_to(index_map.height[tuple(plane)], count)
    positions = np.stack([index_map.x[x], index_map.y[y], height], axis=-1)
    best = values[where, np.arange(count)]
    positions[~found] = np.nan
    return np.where(found, best, np.nan), positions


def plane_map(
    leg: Leg,
    height: float,
    resolution: float,
    *,
    layers: Sequence[str] = (),
    contact: Contact | None = None,
) -> IndexMap:
    """Map the layers over the plane z = height.

    Args:
        leg: The leg; its foot must be a point in space.
        height: z of the plane in the leg frame [m].
        resolution: Grid spacing [m].
        layers: Names of indices, or "load_capacity"; none for all that the mechanism has.
        contact: Ground for the layer "load_capacity".

    Raises:
        UnknownNameError: If a layer does not exist.
        ValueRangeError: If height or resolution are out of range, the height is positive and above
            all that the foot reaches, or the map would be too large.
    """
    height = as_number("height", height)
    names = _layers(leg, layers, contact)
    check_heights(leg.mechanism, height)
    x, y = _axes(leg.mechanism, resolution, 2)
    values, status = _slice(leg, x, y, height, names, contact)
    return IndexMap(x, y, np.array(height), names, values, status)


def line_map(
    leg: Leg,
    y: float,
    height: float,
    resolution: float,
    *,
    layers: Sequence[str] = (),
    contact: Contact | None = None,
) -> IndexMap:
    """Map the layers along the line at y and z = height, which runs in the walking direction.

    Args:
        leg: The leg; its foot must be a point in space.
        y: y of the line in the leg frame [m].
        height: z of the line in the leg frame [m].
        resolution: Grid spacing [m].
        layers: Names of indices, or "load_capacity"; none for all that the mechanism has.
        contact: Ground for the layer "load_capacity".

    Raises:
        UnknownNameError: If a layer does not exist.
        ValueRangeError: If place or resolution are out of range.
    """
    y, height = as_number("y", y), as_number("height", height)
    names = _layers(leg, layers, contact)
    line = np.array([y])
    x, _ = _axes(leg.mechanism, resolution, 2)
    values, status = _slice(leg, x, line, height, names, contact)
    return IndexMap(x, line, np.array(height), names, values, status)


def volume_map(
    leg: Leg,
    resolution: float,
    *,
    layers: Sequence[str] = (),
    contact: Contact | None = None,
    threads: int = 1,
) -> Iterator[IndexMap]:
    """Map the layers over the whole workspace, one plane after the other.

    Args:
        leg: The leg; its foot must be a point in space.
        resolution: Grid spacing [m].
        layers: Names of indices, or "load_capacity"; none for all that the mechanism has.
        contact: Ground for the layer "load_capacity".
        threads: Planes that are computed at the same time.

    Yields:
        The map so far: all planes from the lowest, those not computed yet NaN and UNREACHABLE.
        The arrays are the same each time and are filled in place.

    Raises:
        UnknownNameError: If a layer does not exist.
        ValueRangeError: If the resolution is out of range, or the map would be too large.
    """
    threads = as_count("threads", threads, MOST_THREADS)
    names = _layers(leg, layers, contact)
    x, y, z = _axes(leg.mechanism, resolution, 3)
    shape = (len(z), len(y), len(x))
    values = np.full((*shape, len(names)), np.nan)
    status = np.full(shape, Status.UNREACHABLE, dtype=np.uint8)
    result = IndexMap(x, y, z, names, values, status)

    def compute(height: float) -> tuple[FloatArray, StatusArray]:
        return _slice(leg, x, y, height, names, contact)

    pool = ThreadPoolExecutor(threads)
    try:
        for k, plane in enumerate(pool.map(compute, z.tolist())):
            values[k], status[k] = plane
            yield result
    finally:  # whoever takes no more maps does not wait for those that nobody takes
        pool.shutdown(cancel_futures=True)


def _axes(mechanism: Mechanism, resolution: float, count: int) -> list[FloatArray]:
    """Return the first `count` grid coordinates of a box that holds the workspace.

    Zero is a multiple of the resolution on each, so that it is a grid coordinate if inside.
    """
    first, last = (ends[:count] for ends in _grid_range(mechanism, resolution))
    points = float(np.prod(last - first + 1.0))
    if points > MOST_POINTS:
        raise ValueRangeError(
            f"resolution {resolution} m makes {points:.0f} points; allowed are {MOST_POINTS}"
        )
    return [resolution * np.arange(a, b + 1.0) for a, b in zip(first, last, strict=True)]


def _grid_range(mechanism: Mechanism, resolution: float) -> tuple[FloatArray, FloatArray]:
    """Return the first and last multiple of the resolution along x, y and z."""
    resolution = as_number("resolution", resolution)
    if resolution <= 0.0:
        raise ValueRangeError(f"resolution must be > 0 m, got {resolution}")
    bounds = workspace_bounds(mechanism)
    with np.errstate(over="ignore"):
        first, last = (bounds / resolution).T
    return np.floor(first), np.ceil(last)


def _layers(
    leg: Leg,
    layers: Sequence[str],
    contact: Contact | None,
) -> tuple[str, ...]:
    """Return the layers asked for, or all that can be computed from what is given."""
    require("leg", leg, Leg)
    if contact is not None:
        require("contact", contact, Contact)
    mechanism = leg.mechanism
    if not mechanism.has_point_foot:
        raise NotSupportedError(
            f"mechanism {mechanism.name!r} has {len(mechanism.task_coordinates)} task "
            "coordinates: index maps need a point foot x, y, z"
        )
    layers = as_names("layers", layers)
    if not layers:
        return supported_layers(mechanism) if contact else supported_indices(mechanism)
    for name in layers:
        if name not in supported_layers(mechanism):
            raise UnknownNameError("layer", name, supported_layers(mechanism))
    if CAPACITY_LAYER in layers and contact is None:
        raise ValueRangeError(f"layer {CAPACITY_LAYER!r} needs a contact")
    return layers


def _slice(
    leg: Leg,
    x: FloatArray,
    y: FloatArray,
    height: float,
    names: tuple[str, ...],
    contact: Contact | None,
) -> tuple[FloatArray, StatusArray]:
    """Return values (ny, nx, K) and status (ny, nx) of one plane."""
    y_grid, x_grid = np.meshgrid(y, x, indexing="ij")
    grid = np.stack([x_grid, y_grid, np.full_like(x_grid, height)], axis=-1)
    posture = leg.mechanism.inverse(grid)
    values = np.full((*x_grid.shape, len(names)), np.nan)
    inside = posture.status == Status.OK  # most of a box about the workspace is outside of it
    solved = Posture(*(field[inside] for field in posture))
    values[inside] = layer_values(leg, solved, names, contact)
    return values, posture.status


def layer_values(
    leg: Leg, posture: Posture, names: Sequence[str], contact: Contact | None = None
) -> FloatArray:
    """Return the values of layers (..., K); NaN where a posture's status is not OK.

    Args:
        leg: The leg.
        posture: Its solved postures (...).
        names: Names of K layers.
        contact: Ground for the layer "load_capacity".
    """
    kinematics = Kinematics(leg.mechanism, posture)
    values = np.empty((*np.shape(posture.status), len(names)))
    indices = [name for name in names if name != CAPACITY_LAYER]
    if indices:
        columns = [name != CAPACITY_LAYER for name in names]
        values[..., columns] = indices_of(kinematics, indices)[1]
    if CAPACITY_LAYER in names and contact is not None:
        footholds = judge_footholds(leg, kinematics, contact)
        values[..., names.index(CAPACITY_LAYER)] = footholds.load_capacity
    return values
