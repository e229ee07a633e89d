# SPDX-License-Identifier: Apache-2.0
"""Shapes that a page draws, in the frame of the map: lines, points, arrows and meshes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from leg_kinematics.arrays import FloatArray


class Lines(NamedTuple):
    """Straight pieces.

    Attributes:
        ends: Both ends of each (s, 2, 3) [m].
        colour: One for all (3,).
        width: Their width [m].
    """

    ends: FloatArray
    colour: FloatArray
    width: float


class Points(NamedTuple):
    """Round points.

    Attributes:
        places: Where they are (m, 3) [m].
        colours: Of each (m, 3).
        size: Their diameter [m].
    """

    places: FloatArray
    colours: FloatArray
    size: float


class Arrows(NamedTuple):
    """Arrows.

    Attributes:
        ends: Foot and head of each (s, 2, 3) [m].
        colour: One for all (3,).
        width: Of their shafts [m].
    """

    ends: FloatArray
    colour: FloatArray
    width: float


class Mesh(NamedTuple):
    """A surface of triangles.

    Attributes:
        vertices: Corners (v, 3) [m].
        faces: Indices of the corners of the triangles (f, 3).
        colour: One for all (3,).
        opacity: From 0 to 1.
    """

    vertices: FloatArray
    faces: NDArray[np.int64]
    colour: FloatArray
    opacity: float


Shape = Lines | Points | Arrows | Mesh


def is_empty(shape: Shape) -> bool:
    """Tell whether there is nothing to draw of a shape."""
    return len(shape[0]) == 0
