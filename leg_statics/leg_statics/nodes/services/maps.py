# SPDX-License-Identifier: Apache-2.0
"""Index maps."""

from __future__ import annotations

from typing import Any

import numpy as np
from leg_msgs.srv import GetIndexMap
from leg_msgs_py.arrays import to_field

from leg_kinematics.errors import NotSupportedError
from leg_kinematics.nodes.frames import LegFrame
from leg_kinematics.nodes.requests import check_count
from leg_kinematics.nodes.service import service
from leg_kinematics.robot import Leg
from leg_statics.map_jobs import MapKey
from leg_statics.maps import CAPACITY_LAYER, grid_shape
from leg_statics.nodes.contacts import is_ground, read_ground
from leg_statics.nodes.hosts import GroundsHost, MapsHost


@service(GetIndexMap)
def get_index_map(host: MapsHost, request: Any, response: Any) -> None:
    """Fill the map of a plane."""
    leg = host.robot.leg(request.leg)
    frame = LegFrame(leg.mount.vertical)
    plane = host.plane(leg, map_key(host, leg, request, frame, request.height))
    response.header.frame_id = leg.frame
    response.ny, response.nx = plane.status.shape
    response.x0, response.y0 = float(plane.x[0]), float(plane.y[0])
    response.height, response.resolution = request.height, request.resolution
    response.layers = list(plane.layers)
    response.symbols = list(plane.symbols)
    response.units = list(plane.units)
    response.values = to_field(plane.values)
    response.status = to_field(plane.status, np.uint8)


def map_key(
    host: GroundsHost, leg: Leg, request: Any, frame: LegFrame, height: float | None
) -> MapKey:
    """Return the key of the map that a request asks for, of a volume if there is no height.

    Raises:
        LegError: If it cannot be computed.
    """
    if not leg.mechanism.has_point_foot:
        raise NotSupportedError(f"leg: {leg.name!r} has no point foot with x, y, z")
    nz, ny, nx = grid_shape(leg.mechanism, request.resolution)
    count = ny * nx * (1 if height is not None else nz)
    check_count("resolution", count, host.max_points)
    layers = tuple(request.layers)
    needed = CAPACITY_LAYER in layers or is_ground(request.ground)
    contact = read_ground(host.grounds, request.ground, frame) if needed else None
    return MapKey.of(leg, height, request.resolution, layers, contact)
