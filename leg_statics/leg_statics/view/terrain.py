# SPDX-License-Identifier: Apache-2.0
"""Ground to stand on: heights over a grid, their normals, and where a line of sight meets them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.errors import UnknownNameError

CELLS = 48  # along each side of the terrains that have a name
SIGHT_STEPS = 400  # of a line of sight across the grid, before its end is refined
REFINEMENTS = 40


@dataclass(frozen=True)
class Terrain:
    """Heights over a regular grid, with flat pieces between: two triangles a cell.

    Outside the grid the ground goes on as at its border.

    Attributes:
        x: Coordinates of the columns, increasing (m,) [m].
        y: Coordinates of the rows, increasing (k,) [m].
        z: Heights (k, m) [m].
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray

    def height(self, points: ArrayLike) -> FloatArray:
        """Return the height of the ground at points (..., 2 or more) [m]."""
        return self._plane(points)[0]

    def normal(self, points: ArrayLike) -> FloatArray:
        """Return the unit normal of the ground at points (..., 2 or more), upwards (..., 3)."""
        _, slope_x, slope_y = self._plane(points)
        normal = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)
        unit: FloatArray = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
        return unit

    def on_ground(self, points: ArrayLike) -> FloatArray:
        """Return points (..., 2 or more) put on the ground (..., 3) [m]."""
        xy = np.asarray(points, dtype=np.float64)[..., :2]
        return np.concatenate([xy, self.height(xy)[..., None]], axis=-1)

    def seen(self, origin: ArrayLike, direction: ArrayLike) -> FloatArray | None:
        """Return where a line of sight first meets the grid (3,) [m]; None if it does not.

        Args:
            origin: Where it starts, above the ground (3,) [m].
            direction: Its direction (3,), of any length.
        """
        start, along = as_array("origin", origin, 3), as_array("direction", direction, 3)
        along = along / np.linalg.norm(along)
        low = np.array([self.x[0], self.y[0], self.z.min() - 1e-6])
        high = np.array([self.x[-1], self.y[-1], self.z.max() + 1e-6])
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort([(low - start) / along, (high - start) / along], axis=0)
        ends = np.where(np.isnan(ends), [[-np.inf], [np.inf]], ends)
        enters, leaves = max(0.0, float(ends[0].max())), float(ends[1].min())
        if not enters <= leaves:
            return None

        def below(distance: ArrayLike) -> FloatArray:
            points = start + np.asarray(distance)[..., None] * along
            return self.height(points) - points[..., 2]

        distances = np.linspace(enters, leaves, SIGHT_STEPS)
        met = np.flatnonzero(below(distances) >= 0.0)
        if not len(met):
            return None
        before, after = distances[max(met[0] - 1, 0)], distances[met[0]]
        for _ in range(REFINEMENTS):
            middle = 0.5 * (before + after)
            before, after = (before, middle) if below(middle) >= 0.0 else (middle, after)
        return self.on_ground(start + after * along)

    def triangles(self) -> tuple[FloatArray, NDArray[np.int64]]:
        """Return the vertices (k m, 3) [m] and the triangles between them (t, 3)."""
        xx, yy = np.meshgrid(self.x, self.y)
        corner = np.arange(xx.size).reshape(xx.shape)
        a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
        faces = np.stack([np.stack([a, b, d], -1), np.stack([a, d, c], -1)])
        return np.stack([xx, yy, self.z], axis=-1).reshape(-1, 3), faces.reshape(-1, 3)

    def _plane(self, points: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return height and slopes along x and y at points (..., 2 or more)."""
        xy = np.asarray(points, dtype=np.float64)[..., :2]
        column, across = _cell(self.x, xy[..., 0])
        row, along = _cell(self.y, xy[..., 1])
        width, depth = self.x[column + 1] - self.x[column], self.y[row + 1] - self.y[row]
        a, b = self.z[row, column], self.z[row, column + 1]
        c, d = self.z[row + 1, column], self.z[row + 1, column + 1]
        right = across >= along  # the triangle a b d, else a d c
        rise_x, rise_y = np.where(right, b - a, d - c), np.where(right, d - b, c - a)
        return a + across * rise_x + along * rise_y, rise_x / width, rise_y / depth


def _cell(grid: FloatArray, values: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the index of the cell of each value, and where in it the value is, from 0 to 1."""
    index = np.clip(np.searchsorted(grid, values, side="right") - 1, 0, len(grid) - 2)
    share = (values - grid[index]) / (grid[index + 1] - grid[index])
    return index, np.clip(share, 0.0, 1.0)


def _level(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.zeros_like(x + y)


def _slope(x: FloatArray, y: FloatArray) -> FloatArray:
    return 0.12 * x + 0.0 * y


def _steps(x: FloatArray, y: FloatArray) -> FloatArray:
    return 0.12 * np.round(1.6 * x) + 0.0 * y


def _rough(x: FloatArray, y: FloatArray) -> FloatArray:
    waves = np.sin(5.1 * x + 0.3) * np.cos(4.3 * y) + 0.5 * np.sin(9.7 * y - 6.1 * x)
    return np.asarray(0.06 * waves)


# Heights for places, both as shares of the height of the robot's legs.
SHAPES: dict[str, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "level": _level,
    "slope": _slope,
    "steps": _steps,
    "rough": _rough,
}


def make_terrain(name: str, reach: float, unit: float) -> Terrain:
    """Return a terrain by its name.

    Args:
        name: One of `SHAPES`.
        reach: Half of the length of its sides [m].
        unit: Height of the robot's legs, by which it is scaled [m].

    Raises:
        UnknownNameError: If there is none of that name.
    """
    if name not in SHAPES:
        raise UnknownNameError("terrain", name, SHAPES)
    along = np.linspace(-reach, reach, CELLS + 1)
    x, y = np.meshgrid(along / unit, along / unit)
    return Terrain(along, along, unit * SHAPES[name](x, y))
