# SPDX-License-Identifier: Apache-2.0
"""What RViz and Foxglove show of a leg: linkage, foot, forces, and a slice of its workspace.

Markers move with the base frame, and have no time: viewers know no transforms of before they came.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanism import Posture
from leg_kinematics.robot import Leg
from leg_kinematics.status import Status
from leg_statics.force_shapes import EDGES, force_polytope, friction_cone
from leg_statics.maps import IndexMap
from leg_statics.view.colours import of_values
from leg_statics.weight import level_gravity, weight_efforts

BAR_WIDTH = 0.008  # m
LINE_WIDTH = 0.003  # m
FOOT_SIZE = 0.03  # m
CONE_HEIGHT = 0.15  # m
FORCE_SCALE = 1e-4  # m per N
STEEL = (0.35, 0.38, 0.42, 1.0)
RED = (0.85, 0.2, 0.15, 1.0)
GREEN = (0.1, 0.6, 0.35, 0.6)
BLUE = (0.15, 0.4, 0.85, 0.8)
GREY = (0.5, 0.5, 0.5, 1.0)


class Scene(NamedTuple):
    """What the markers of one leg show.

    Attributes:
        leg: The leg.
        posture: Its posture.
        friction: Friction coefficient of the ground.
        force_scale: Length of a force [m/N].
    """

    leg: Leg
    posture: Posture
    friction: float
    force_scale: float = FORCE_SCALE


def moving_markers(header: Any, scene: Scene) -> list[Any]:
    """Return what moves with a leg, in the robot's base frame.

    What cannot be drawn in this posture is deleted.
    """
    mechanism, posture = scene.leg.mechanism, scene.posture
    linkage = mechanism.linkage(posture)
    foot = posture.foot_position[:3]
    cone: FloatArray = np.empty((0, 3))
    polytope: FloatArray = np.empty((0, 3))
    if posture.status == Status.OK and mechanism.has_point_foot:
        cone = foot + _cone_lines(scene.friction, scene.leg.mount.vertical)
        jacobian = mechanism.jacobian(posture)
        if jacobian.shape == (3, 3):
            weight = weight_efforts(mechanism, posture, level_gravity(scene.leg))
            corners = force_polytope(jacobian, scene.leg.effort_limits, weight)
            polytope = foot + scene.force_scale * corners[np.ravel(EDGES)]
    shapes = (
        ("linkage", Marker.LINE_LIST, BAR_WIDTH, STEEL, linkage.segments().reshape(-1, 3)),
        ("foot", Marker.SPHERE_LIST, FOOT_SIZE, RED, foot[None]),
        ("friction_cone", Marker.LINE_LIST, LINE_WIDTH, GREEN, cone),
        ("force_polytope", Marker.LINE_LIST, LINE_WIDTH, BLUE, polytope),
    )
    return [
        _marker(header, f"{scene.leg.name}/{name}", kind, size, _points(scene.leg, points), color)
        for name, kind, size, color, points in shapes
    ]


def workspace_marker(header: Any, leg: Leg, index_map: IndexMap, layer: str) -> Any:
    """Return a plane of the workspace, coloured by a layer, in the robot's base frame.

    Points where the layer is not defined are grey, those outside the workspace are left out.
    """
    inside = index_map.status == Status.OK
    points = grid_points(index_map)[inside]
    values = index_map.layer(layer)[inside]
    resolution = float(index_map.x[1] - index_map.x[0]) if len(index_map.x) > 1 else 0.01
    marker = _marker(
        header, workspace_name(leg), Marker.CUBE_LIST, resolution, _points(leg, points), GREY
    )
    marker.scale.z = 0.1 * resolution
    marker.colors = [ColorRGBA(r=r, g=g, b=b, a=0.7) for r, g, b in of_values(values).tolist()]
    return marker


def workspace_name(leg: Leg) -> str:
    """Return the namespace of the marker of a leg's workspace."""
    return f"{leg.name}/workspace"


def deletion(header: Any, name: str) -> Any:
    """Return the marker that takes away what is shown in a namespace."""
    return Marker(header=header, ns=name, action=Marker.DELETE)


def grid_points(index_map: IndexMap) -> FloatArray:
    """Return the grid points of a map (..., ny, nx, 3) [m]."""
    points = np.empty((*index_map.status.shape, 3))
    points[..., 0] = index_map.x
    points[..., 1] = index_map.y[:, None]
    points[..., 2] = index_map.height[..., None, None]
    return points


def _cone_lines(friction: float, normal: Sequence[float]) -> FloatArray:
    """Return the ends of the lines of a friction cone from its apex (2 per line, 3) [m]."""
    rim = friction_cone(min(friction, 10.0), normal)
    rim = CONE_HEIGHT * rim / max(1.0, float(np.linalg.norm(rim[0])) / 2.0)
    rays = np.stack([np.zeros_like(rim[::4]), rim[::4]], axis=1)
    circle = np.stack([rim, np.roll(rim, -1, axis=0)], axis=1)
    return np.concatenate([rays, circle]).reshape(-1, 3)


def _points(leg: Leg, points: FloatArray) -> list[Any]:
    """Return points of the leg frame in the base frame; none if one is not finite."""
    if not np.isfinite(points).all():
        return []
    return [Point(x=x, y=y, z=z) for x, y, z in leg.mount.to_base(points).tolist()]


def _marker(
    header: Any,
    name: str,
    kind: int,
    size: float,
    points: Sequence[Any],
    color: tuple[float, float, float, float],
) -> Any:
    marker = Marker(
        header=header,
        ns=name,
        type=kind,
        action=Marker.ADD if points else Marker.DELETE,
        scale=Vector3(x=size, y=size, z=size),
        color=ColorRGBA(**dict(zip(("r", "g", "b", "a"), color, strict=True))),
        points=list(points),
        frame_locked=True,
    )
    marker.pose.orientation.w = 1.0
    return marker
