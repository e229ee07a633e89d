# SPDX-License-Identifier: Apache-2.0
"""Stances of robots: legs of a description, and where their feet and the body are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array, broadcast_error
from leg_kinematics.errors import NotSupportedError, ShapeError
from leg_kinematics.robot import Robot
from leg_statics.capacity.problem import UP
from leg_statics.stance.stances import Stance

LEVEL = np.eye(3)


class BodyPose(NamedTuple):
    """Where the base frame of a robot is in the frame of its feet.

    Attributes:
        position: Its origin (..., 3) [m].
        rotation: Matrices that turn vectors of the base frame into that frame (..., 3, 3).
    """

    position: ArrayLike = (0.0, 0.0, 0.0)
    rotation: ArrayLike = LEVEL

    def from_base(self, points: ArrayLike) -> FloatArray:
        """Return points (..., 3) of the base frame in the frame of the feet [m]."""
        turned = np.einsum("...ij,...j->...i", self._rotation, as_array("points", points, 3))
        return turned + as_array("position", self.position, 3)

    def to_base(self, points: ArrayLike) -> FloatArray:
        """Return points (..., 3) of the frame of the feet in the base frame [m]."""
        moved = as_array("points", points, 3) - as_array("position", self.position, 3)
        return np.einsum("...ji,...j->...i", self._rotation, moved)

    @property
    def _rotation(self) -> FloatArray:
        return as_array("rotation", self.rotation, 3, 3)


def robot_stance(
    robot: Robot,
    feet: Mapping[str, ArrayLike],
    friction: ArrayLike,
    pose: BodyPose = BodyPose(),  # noqa: B008 - an immutable tuple
    *,
    normal: ArrayLike = UP,
    bias_efforts: ArrayLike = 0.0,
) -> Stance:
    """Return the stance of a robot on some of its legs.

    Candidates of one foot, or of body poses, are leading axes of that foot or pose alone; all
    others broadcast.

    Args:
        robot: The robot.
        feet: Positions (..., 3) by the names of the legs that stand, in the frame that `pose` says;
            by default the base frame [m].
        friction: Friction coefficient of the ground, or that of each foot (..., L).
        pose: Where the base frame is.
        normal: Normal of the ground (3,), or of each foot (..., L, 3).
        bias_efforts: Efforts without ground (..., L, n) or one for all [N.m or N].

    Returns:
        A stance of the legs in the order of `feet`, with the status of the pose of each.

    Raises:
        UnknownNameError: If there is no leg of a name.
        NotSupportedError: If a leg has no point foot.
        ShapeError: If there is no leg, or leading shapes do not broadcast.
    """
    if not feet:
        raise ShapeError("feet must name at least one leg")
    legs = [robot.leg(name) for name in feet]
    for leg in legs:
        if not leg.mechanism.has_point_foot:
            raise NotSupportedError(f"{leg.name}: a stance needs legs with point feet x, y, z")
    positions = {name: as_array(f"foot of {name}", at, 3) for name, at in feet.items()}
    shapes = {name: at.shape[:-1] for name, at in positions.items()}
    shapes |= {"position": np.shape(pose.position)[:-1], "rotation": np.shape(pose.rotation)[:-2]}
    try:
        batch = np.broadcast_shapes(*shapes.values())
    except ValueError:
        raise broadcast_error(shapes) from None
    n = max(len(leg.joint_names) for leg in legs)
    jacobian = np.zeros((*batch, len(legs), 3, n))
    limits = np.broadcast_to([-np.inf, np.inf], (len(legs), n, 2)).copy()
    status = np.empty((*batch, len(legs)), np.uint8)
    position = np.empty((*batch, len(legs), 3))
    for k, leg in enumerate(legs):
        at = positions[leg.name]
        posture = leg.mechanism.inverse(leg.mount.to_leg(pose.to_base(at)))
        rotation = as_array("rotation", pose.rotation, 3, 3) @ leg.mount.rotation
        own = leg.mechanism.jacobian(posture)
        joints = own.shape[-1]
        jacobian[..., k, :, :joints] = rotation @ own
        limits[k, :joints] = leg.effort_limits
        status[..., k], position[..., k, :] = posture.status, at
    return Stance(
        position=position,
        jacobian=jacobian,
        effort_lower=limits[..., 0],
        effort_upper=limits[..., 1],
        friction=friction,
        normal=normal,
        bias_efforts=bias_efforts,
        status=status,
    )
