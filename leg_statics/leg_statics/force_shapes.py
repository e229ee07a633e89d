# SPDX-License-Identifier: Apache-2.0
"""Shapes of forces at a foot, for drawing: the friction cone and what the actuators can give."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array, as_vectors
from leg_kinematics.errors import NotSupportedError, ValueRangeError
from leg_statics.capacity.problem import effort_room

# Corners of the box of joint efforts, as choices of lower (0) or upper (1), and its edges.
CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))
EDGES = tuple(
    (a, b)
    for a, b in itertools.combinations(range(len(CORNERS)), 2)
    if np.sum(CORNERS[a] != CORNERS[b]) == 1
)


def force_polytope(
    jacobian: ArrayLike, effort_limits: ArrayLike, bias_efforts: ArrayLike = 0.0
) -> FloatArray:
    """Corners of the set of ground reactions that the actuators can hold (8, 3) [N].

    F = J^-T e maps the room that the limits leave for e = Jᵀ F to a parallelepiped with the edges
    `EDGES`.

    Args:
        jacobian: Jacobian of the foot (3, 3).
        effort_limits: Lower and upper effort of each actuator (3, 2) [N.m or N].
        bias_efforts: Efforts that the actuators exert anyway (3,) or one for all [N.m or N].

    Returns:
        NaN at a singularity, where the set is not bounded.
    """
    j = as_array("jacobian", jacobian, 3, 3)
    limits = as_array("effort_limits", effort_limits, 3, 2)
    bias = as_vectors("bias_efforts", bias_efforts, 3)
    up, down = effort_room(limits[:, 0], limits[:, 1], bias, 0.0)
    efforts = np.take_along_axis(np.stack([up, -down]), CORNERS, axis=0)
    if not np.isfinite(j).all() or np.linalg.cond(j) > 1e12:
        return np.full((len(CORNERS), 3), np.nan)
    corners: FloatArray = np.linalg.solve(j.T, efforts.T).T
    return corners


def force_polygon(
    jacobian: ArrayLike, effort_limits: ArrayLike, bias_efforts: ArrayLike = 0.0
) -> FloatArray:
    """Corners of the plane ground reactions that the actuators can hold (k, 2) [N], in order.

    Only those count that push the foot up. A force beyond any use, along which the structure alone
    carries the load, is cut off.

    Args:
        jacobian: The two rows of J of the plane's directions, the vertical one last (2, n).
        effort_limits: Lower and upper effort of each actuator (n, 2) [N.m or N].
        bias_efforts: Efforts that the actuators exert anyway (n,) or one for all, between the
            limits [N.m or N].

    Raises:
        NotSupportedError: If there are fewer than three actuators: the structure alone holds
            forces of any size.
        ValueRangeError: If an actuator can exert nothing in one direction.
    """
    j = as_array("jacobian", jacobian)
    limits = as_array("effort_limits", effort_limits, j.shape[-1], 2)
    if len(limits) < 3:
        raise NotSupportedError("a leg with fewer than three actuators has too few for forces")
    bias = as_vectors("bias_efforts", bias_efforts, len(limits))
    up, down = effort_room(limits[:, 0], limits[:, 1], bias, 0.0)
    if not np.all((up > 0.0) & (down > 0.0)):
        raise ValueRangeError("drawing forces needs effort limits with lower < bias < upper")
    from scipy.spatial import HalfspaceIntersection  # slow to import

    normals, room = np.concatenate([j.T, -j.T]), np.concatenate([up, down])
    largest = 1e3 * np.max(room) / np.max(np.abs(j))
    frame = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    distances = np.concatenate([room, [largest, largest, largest, 0.0]])
    inside = 0.5 * np.min(room) / (np.max(np.abs(j)) + np.finfo(float).tiny)
    halfspaces = np.column_stack([np.concatenate([normals, frame]), -distances])
    corners = HalfspaceIntersection(halfspaces, np.array([0.0, inside])).intersections
    centre = corners.mean(axis=0)
    return np.asarray(corners[np.argsort(np.arctan2(*(corners - centre).T[::-1]))])


def friction_cone(friction: float, normal: ArrayLike, points: int = 32) -> FloatArray:
    """Forces on the rim of the friction cone with unit normal component, all around (points, 3).

    Args:
        friction: Friction coefficient of the ground.
        normal: Normal of the ground (3,), of any length.
        points: Number of points on the rim.
    """
    n = as_array("normal", normal, 3)
    n = n / np.linalg.norm(n)
    across = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    across /= np.linalg.norm(across)
    angle = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)[:, None]
    rim: FloatArray = n + friction * (np.cos(angle) * across + np.sin(angle) * np.cross(n, across))
    return rim
