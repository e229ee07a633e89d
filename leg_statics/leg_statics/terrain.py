# SPDX-License-Identifier: Apache-2.0
"""Terrain: heights over a grid, its slopes and edges, and what a leg carries on every cell.

    ground = survey(HeightMap(points, 0.03), Surface(fit_radius=2))
    found = foothold_map(leg, ground, Contact(0.4, load=300.0), pose)
    found.score   # (ny, nx): 0 = no foothold, 1 = the best there can be, NaN = unknown

z of the map is up. What is not known, NaN, stays unknown: no height is made up.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from leg_kinematics.arguments import require
from leg_kinematics.arrays import FloatArray, as_array, as_non_negative
from leg_kinematics.errors import ShapeError, ValueRangeError
from leg_kinematics.robot import BASE, Leg, Mount
from leg_statics.contact import Contact
from leg_statics.footholds import evaluate_footholds
from leg_statics.weight import gravity_below

DIRECTIONS = ((0, 1), (1, 0), (1, 1), (1, -1))  # in which steps are looked for
MOST_CELLS = 1_000_000
SAMPLES = 500  # points at which the spacing is looked at
LEAST_CELLS = 3  # that a plane is fitted to
LEAST_SPREAD = 0.05  # of these cells across their line, in cells


class HeightMap(NamedTuple):
    """Ground over a grid, in a frame whose z is up.

    Attributes:
        points: Point of each cell (ny, nx, 3) [m]; z is NaN where it is unknown.
        resolution: Spacing of the grid [m].
        normal: Normals, out of the ground and of any length (ny, nx, 3); NaN where they are
            unknown, None if all are.
        friction: Friction coefficients (ny, nx); NaN where they are unknown, None if all are.
    """

    points: FloatArray
    resolution: float
    normal: FloatArray | None = None
    friction: FloatArray | None = None


class Surface(NamedTuple):
    """How a map is looked at.

    Attributes:
        fit_radius: Cells around a cell to whose heights its plane is fitted: (2 r + 1)² of them.
        edge_height: Height of a step that is an edge [m].
        steepest: Slope beyond which there is no foothold [rad].
        edge_margin: Distance from edges that a foothold must have [m].
        ample_margin: Distance from edges that takes nothing from a score [m].
    """

    fit_radius: int = 1
    edge_height: float = 0.05
    steepest: float = 0.7
    edge_margin: float = 0.03
    ample_margin: float = 0.1


class Survey(NamedTuple):
    """What a map tells about the ground; NaN where it is unknown.

    Attributes:
        points: Point of each cell (ny, nx, 3) [m].
        normal: Unit normals (ny, nx, 3).
        slope: Angle from level (ny, nx) [rad].
        edge_distance: Distance to the next edge, that of what is known included (ny, nx) [m].
        friction: Friction coefficients (ny, nx); None if all are unknown.
        score: What slope and edges leave of a score, 0 to 1 (ny, nx).
    """

    points: FloatArray
    normal: FloatArray
    slope: FloatArray
    edge_distance: FloatArray
    friction: FloatArray | None
    score: FloatArray

    @property
    def known(self) -> NDArray[np.bool_]:
        """Where all is known that a foothold needs (ny, nx)."""
        return np.isfinite(self.score)


class FootholdMap(NamedTuple):
    """What the cells of a map are worth to a leg; NaN where they are unknown.

    Attributes:
        verdict: `Verdict` of each cell (ny, nx).
        load_capacity: Greatest load (ny, nx) [N]; NaN as well where the leg has no posture.
        friction_margin: Friction beyond the rated friction (ny, nx); NaN as the load capacity.
        margin: How far a feasible cell is from failing (ny, nx), see `Footholds.margin`.
        score: 0 = no foothold, 1 = the best there can be (ny, nx): the least of the margin and of
            what slope and edges leave.
        weight_counted: Whether the actuators hold the leg's own weight, too.
    """

    verdict: FloatArray
    load_capacity: FloatArray
    friction_margin: FloatArray
    margin: FloatArray
    score: FloatArray
    weight_counted: bool


def gridded(
    points: ArrayLike,
    resolution: float = 0.0,
    *,
    normal: ArrayLike | None = None,
    friction: ArrayLike | None = None,
    most: int = MOST_CELLS,
) -> HeightMap:
    """Return points in any order as a map: each cell has the highest point in it, as it is.

    Args:
        points: Points (N, 3), in a frame whose z is up [m]; those that are not finite are left out.
        resolution: Spacing of the grid [m]; 0 for that of the points, if they are on a grid.
        normal: Their normals (N, 3).
        friction: Their friction coefficients (N,).
        most: Cells that a map may have.

    Raises:
        ShapeError: If shapes do not fit.
        ValueRangeError: If the resolution is out of range, or makes too many cells.
    """
    places = as_array("points", points, 3)
    if places.ndim != 2:
        raise ShapeError(f"points must have shape (N, 3), got {places.shape}")
    good = np.isfinite(places).all(axis=-1)
    told = places[good]
    spacing = float(as_non_negative("resolution", resolution)) or _spacing(told)
    if not spacing < np.inf:
        raise ValueRangeError(f"resolution must be finite and >= 0, got {resolution}")
    low, high = (told.min(axis=0), told.max(axis=0)) if len(told) else np.zeros((2, 3))
    extent = (high[:2] - low[:2]) / spacing
    if (np.round(extent) + 1.0).prod() > most:
        raise ValueRangeError(
            f"resolution: a map of {high[0] - low[0]:.3g} m by {high[1] - low[1]:.3g} m in steps "
            f"of {spacing:.3g} m has too many cells; allowed: at most {most}"
        )
    nx, ny = np.round(extent).astype(int) + 1 if len(told) else (0, 0)
    column, row = np.round((told[:, :2] - low[:2]) / spacing).astype(int).T
    order = np.lexsort((told[:, 2], row * nx + column))  # the highest of a cell comes last
    cell = (row[order], column[order])
    x, y = low[0] + spacing * np.arange(nx), low[1] + spacing * np.arange(ny)
    table = np.full((ny, nx, 3), np.nan)
    table[..., 0], table[..., 1] = x, y[:, None]
    table[cell] = told[order]

    def spread(name: str, values: ArrayLike | None, *axes: int) -> FloatArray | None:
        if values is None:
            return None
        array = as_array(name, values, *axes)
        if len(array) != len(places):
            raise ShapeError(f"{name} must have length {len(places)}, got {len(array)}")
        everywhere = np.full((ny, nx, *axes), np.nan)
        everywhere[cell] = array[good][order]
        return everywhere

    return HeightMap(table, spacing, spread("normal", normal, 3), spread("friction", friction))


def _spacing(points: FloatArray) -> float:
    """Return the usual distance of points to the next one, seen from above [m]."""
    if len(points) < 2:
        return 1.0  # of a single cell
    some = points[:: max(1, len(points) // SAMPLES), :2]
    distance, _ = KDTree(points[:, :2]).query(some, k=2)
    apart = distance[:, 1][distance[:, 1] > 0.0]
    return float(np.median(apart)) if len(apart) else 1.0


def survey(height_map: HeightMap, surface: Surface = Surface()) -> Survey:  # noqa: B008
    """Return normals, slopes and edges of a map.

    Normals that the map does not tell are those of planes fitted to the cells around, as many as
    are known. A cell is an edge if a neighbour is unknown, or a step higher than `edge_height`.

    Raises:
        ShapeError: If shapes do not fit.
        ValueRangeError: If the resolution or a number of the surface is out of range.
    """
    require("height_map", height_map, HeightMap)
    require("surface", surface, Surface)
    points = as_array("points", height_map.points, 3)
    if points.ndim != 3:
        raise ShapeError(f"points must have shape (ny, nx, 3), got {points.shape}")
    resolution = float(as_non_negative("resolution", height_map.resolution))
    if not 0.0 < resolution < np.inf:
        raise ValueRangeError(f"resolution must be finite and > 0, got {resolution}")
    for name in Surface._fields:
        as_non_negative(name, getattr(surface, name))
    known = np.asarray(np.isfinite(points).all(axis=-1))
    normal = _fitted_normals(points, known, surface.fit_radius)
    if height_map.normal is not None:
        normal = _unit(as_array("normal", height_map.normal, *points.shape))
    normal[~known | ~(normal[..., 2] > 0.0)] = np.nan
    slope = np.arccos(np.minimum(normal[..., 2], 1.0))
    edge_distance = _edge_distance(points, normal, resolution, surface.edge_height)
    friction = height_map.friction
    score = np.fmax(np.minimum(_flatness(slope, surface), _room(edge_distance, surface)), 0.0)
    score[np.isnan(slope)] = np.nan
    if friction is not None:
        friction = as_array("friction", friction)
        if friction.shape != known.shape:
            raise ShapeError(f"friction must have shape {known.shape}, got {friction.shape}")
        score[~(friction >= 0.0)] = np.nan
    return Survey(points, normal, slope, edge_distance, friction, score)


def foothold_map(leg: Leg, ground: Survey, contact: Contact, base: Mount = BASE) -> FootholdMap:
    """Return what every cell of a map is worth to a leg.

    Args:
        leg: The leg; its foot must be a point in space.
        ground: The ground, in the frame of the map.
        contact: Required load and moments, and friction where the map tells none; vectors in the
            frame of the map, whose z is up unless `gravity` tells.
        base: Where the base frame is in the frame of the map.

    Raises:
        KindError: If it is no leg, ground or contact.
        NotSupportedError: If the mechanism's end is no point foot.
        ValueRangeError: If a value of the contact is out of range.
    """
    require("leg", leg, Leg)
    require("ground", ground, Survey)
    require("contact", contact, Contact)
    mount, known = leg.mount.within(base), ground.known
    turned = contact.turned(mount.vectors_to_leg)
    gravity = gravity_below(mount.vertical) if turned.gravity is None else turned.gravity
    found = evaluate_footholds(
        leg,
        mount.to_leg(ground.points[known]),
        turned._replace(
            friction=contact.friction if ground.friction is None else ground.friction[known],
            normal=mount.vectors_to_leg(ground.normal[known]),
            gravity=gravity,
        ),
    )
    margin = found.margin
    score = np.clip(np.minimum(margin, ground.score[known]), 0.0, 1.0)
    score[np.isnan(margin)] = 0.0
    return FootholdMap(
        _spread(found.verdict, known),
        _spread(found.load_capacity, known),
        _spread(found.friction_margin, known),
        _spread(margin, known),
        _spread(score, known),
        found.weight_counted,
    )


def _spread(values: NDArray[Any], known: NDArray[np.bool_]) -> FloatArray:
    """Return values of the known cells over the map; NaN elsewhere."""
    everywhere = np.full(known.shape, np.nan)
    everywhere[known] = values
    return everywhere


def _fitted_normals(points: FloatArray, known: NDArray[np.bool_], radius: int) -> FloatArray:
    """Return normals of planes z = a + b x + c y, fitted to what is known around (ny, nx, 3).

    They are NaN where there are too few cells, or they stand in a line.
    """
    size = 2 * int(radius) + 1
    middle = points[known].mean(axis=0) if known.any() else np.zeros(3)
    x, y, z = np.moveaxis(np.where(known[..., None], points - middle, 0.0), -1, 0)

    def total(values: FloatArray) -> FloatArray:
        rows = ndimage.convolve1d(values, np.ones(size), axis=0, mode="constant")
        return np.asarray(ndimage.convolve1d(rows, np.ones(size), axis=1, mode="constant"))

    count = total(known.astype(np.float64))
    with np.errstate(divide="ignore", invalid="ignore"):
        mx, my, mz = (total(values) / count for values in (x, y, z))
        xx, xy, yy, xz, yz = (
            total(a * b) / count - ma * mb
            for a, b, ma, mb in (
                *((x, x, mx, mx), (x, y, mx, my), (y, y, my, my)),
                *((x, z, mx, mz), (y, z, my, mz)),
            )
        )
        determinant = xx * yy - xy * xy
        b, c = (yy * xz - xy * yz) / determinant, (xx * yz - xy * xz) / determinant
        flat = determinant < (LEAST_SPREAD * 0.5 * (xx + yy)) ** 2  # the cells stand in a line
    normal = _unit(np.stack([-b, -c, np.ones_like(b)], axis=-1))
    normal[flat | (count < LEAST_CELLS)] = np.nan
    return normal


def _edge_distance(
    points: FloatArray, normal: FloatArray, resolution: float, edge_height: float
) -> FloatArray:
    """Return the distance of each cell to the next edge (ny, nx) [m]; NaN where it is unknown.

    Across a step the difference of heights to one side and to the other differs by its height,
    along a slope it does not.
    """
    unknown = ~np.isfinite(normal[..., 2])
    heights = np.where(unknown, np.nan, points[..., 2])
    ny, nx = heights.shape
    padded = np.pad(heights, 1, constant_values=np.inf)  # of the land beyond nothing is said
    edge = unknown.copy()
    for i, j in DIRECTIONS:
        ahead, behind = (
            padded[1 + k * i : 1 + k * i + ny, 1 + k * j : 1 + k * j + nx] for k in (1, -1)
        )
        with np.errstate(invalid="ignore"):
            step = np.abs(ahead - 2.0 * heights + behind)
        edge |= ~(step <= edge_height) & ~np.isinf(step)
    if not edge.any():
        return np.where(unknown, np.nan, np.inf)
    distance = resolution * ndimage.distance_transform_edt(~edge)
    return np.where(unknown, np.nan, distance)


def _flatness(slope: FloatArray, surface: Surface) -> FloatArray:
    """Return what a slope leaves of a score, 1 where it is level and 0 at the steepest."""
    if surface.steepest == 0.0:
        return np.where(slope > 0.0, 0.0, 1.0)
    return 1.0 - slope / surface.steepest


def _room(edge_distance: FloatArray, surface: Surface) -> FloatArray:
    """Return what an edge leaves of a score, 0 within the margin and 1 where it is far."""
    ample = max(surface.ample_margin, surface.edge_margin)
    with np.errstate(invalid="ignore"):
        share = edge_distance / ample if ample > 0.0 else np.ones_like(edge_distance)
        return np.where(edge_distance < surface.edge_margin, 0.0, np.minimum(share, 1.0))


def _unit(vectors: FloatArray) -> FloatArray:
    """Return vectors of length 1 along others."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
