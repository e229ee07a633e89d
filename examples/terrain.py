# SPDX-License-Identifier: Apache-2.0
"""A map of terrain: rectangular patches of ground at different heights, read from a YAML file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.documents import NAME, NUMBER, PAIR, Document, mapping_schema, named_schema
from leg_kinematics.files import existing_path
from leg_statics.grounds import Grounds, load_grounds

GROUND = {"height": NUMBER, "ground": NAME}
SCHEMA = mapping_schema(
    {
        "base": mapping_schema(GROUND, ["height", "ground"]),
        "patches": named_schema(
            mapping_schema({"x": PAIR, "y": PAIR, **GROUND}, ["x", "y", "height", "ground"])
        ),
    },
    ["base"],
)
STEP_TOLERANCE = 1e-3  # heights that differ by less are one level [m]
RIM_POINTS = 8  # at which the ground around a foot is looked at


@dataclass(frozen=True)
class Patch:
    """A rectangle of level ground.

    Attributes:
        name: Its name.
        x: Range along x [m].
        y: Range along y [m].
        height: Its z [m].
        ground: Name of its kind of ground.
        friction: Friction coefficient to count on there, for pictures and for the worst of several.
    """

    name: str
    x: tuple[float, float]
    y: tuple[float, float]
    height: float
    ground: str
    friction: float

    def holds(self, points: FloatArray) -> NDArray[np.bool_]:
        """Tell for points (..., 2 or more) whether they lie on the rectangle."""
        x, y = points[..., 0], points[..., 1]
        inside = (self.x[0] <= x) & (x <= self.x[1]) & (self.y[0] <= y) & (y <= self.y[1])
        return np.asarray(inside)


@dataclass(frozen=True)
class Terrain:
    """Patches over a base.

    Attributes:
        patches: The base, which is endless, and then the patches in the order of the file.
    """

    patches: tuple[Patch, ...]

    def at(self, points: ArrayLike) -> NDArray[np.int64]:
        """Return the index of the patch at points (..., 2 or more) of the map [m]."""
        xy = np.asarray(points, dtype=np.float64)
        index = np.zeros(xy.shape[:-1], dtype=np.int64)
        for k, patch in enumerate(self.patches[1:], start=1):
            index[patch.holds(xy)] = k
        return index

    def height(self, points: ArrayLike) -> FloatArray:
        """Return the height of the ground at points (..., 2 or more) [m]."""
        return np.array([patch.height for patch in self.patches])[self.at(points)]

    def under_foot(self, points: ArrayLike, radius: float) -> NDArray[np.int64]:
        """Return the patch that counts for a foot of some radius at points (..., 2 or more).

        That is the smoothest one that the foot touches; -1 where it would stand on an edge.
        """
        xy = as_array("points", np.asarray(points)[..., :2], 2)
        angles = np.linspace(0.0, 2.0 * np.pi, RIM_POINTS, endpoint=False)
        rim = radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        touched = self.at(xy[..., None, :] + np.concatenate([np.zeros((1, 2)), rim]))
        heights = np.array([patch.height for patch in self.patches])[touched]
        frictions = np.array([patch.friction for patch in self.patches])[touched]
        smoothest = np.argmin(frictions, axis=-1)[..., None]
        patch = np.take_along_axis(touched, smoothest, axis=-1)[..., 0]
        return np.where(np.ptp(heights, axis=-1) < STEP_TOLERANCE, patch, -1)


def load_terrain(source: str | os.PathLike[str], grounds: Grounds | None = None) -> Terrain:
    """Load a terrain file.

    Args:
        source: Path of the YAML file.
        grounds: Grounds that it may name; by default the shipped ones.

    Raises:
        DescriptionError: If the file is missing or wrong, with file, line, key and what is allowed.
    """
    document = Document(existing_path("terrain file", source))
    document.check(SCHEMA)
    known = (grounds or load_grounds()).by_name
    everywhere = {"x": (-np.inf, np.inf), "y": (-np.inf, np.inf)}
    entries: dict[tuple[str, ...], Any] = {("base",): {**document.root["base"], **everywhere}}
    for name, entry in document.root.get("patches", {}).items():
        entries["patches", str(name)] = entry
    patches = []
    for where, entry in entries.items():
        ground = str(entry["ground"])
        if ground not in known:
            raise document.error(f"{ground!r} is not one of: {', '.join(known)}", *where, "ground")
        for axis in ("x", "y"):
            low, high = entry[axis]
            if not low < high:
                message = f"{[low, high]}: the first end must be < the second"
                raise document.error(message, *where, axis)
        x, y = ((float(low), float(high)) for low, high in (entry["x"], entry["y"]))
        friction = known[ground].friction_low
        patches.append(Patch(where[-1], x, y, float(entry["height"]), ground, friction))
    return Terrain(tuple(patches))
