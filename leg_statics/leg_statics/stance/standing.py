# SPDX-License-Identifier: Apache-2.0
"""Stances of robots: legs of a description, and where their feet and the body are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array, as_vectors, broadcast_error
from leg_kinematics.errors import NotSupportedError, ShapeError, ValueRangeError
from leg_kinematics.mechanism import Posture
from leg_kinematics.robot import Leg, Robot
from leg_statics.capacity.problem import UP
from leg_statics.stance.stances import Load, Stance
from leg_statics.weight import LEVEL_GRAVITY, weight_efforts

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


def robot_load(
    robot: Robot,
    pose: BodyPose = BodyPose(),  # noqa: B008 - an immutable tuple
    gravity: ArrayLike = LEVEL_GRAVITY,
) -> Load:
    """Return the robot's own weight.

    Args:
        robot: The robot.
        pose: Where the base frame is in that of the feet.
        gravity: Acceleration of a falling body in the frame of the feet (..., 3) [m/s²].

    Raises:
        ValueRangeError: If the description does not tell the mass.
    """
    if robot.body is None:
        raise ValueRangeError(
            f"mass: the description of {robot.name} tells none; give one, or add 'body' to it"
        )
    return Load(robot.body.mass, pose.from_base(robot.body.center_of_mass), gravity)


def robot_stance(
    robot: Robot,
    feet: Mapping[str, ArrayLike],
    friction: ArrayLike,
    pose: BodyPose = BodyPose(),  # noqa: B008 - an immutable tuple
    *,
    normal: ArrayLike = UP,
    bias_efforts: ArrayLike = 0.0,
    gravity: ArrayLike = LEVEL_GRAVITY,
) -> Stance:
    """Return the stance of a robot on some of its legs, which hold their links' weight besides.

    That weight is known of legs whose `Mechanism.has_masses`; of others it does not count.

    Candidates of one foot, or of body poses, are leading axes of that foot or pose alone; all
    others broadcast.

    Args:
        robot: The robot.
        feet: Positions (..., 3) by the names of the legs that stand, in the frame that `pose` says;
            by default the base frame [m].
        friction: Friction coefficient of the ground, or that of each foot (..., L).
        pose: Where the base frame is.
        normal: Normal of the ground (3,), or of each foot (..., L, 3).
        bias_efforts: Further efforts without ground (..., L, n) or one for all [N.m or N].
        gravity: What acts on each kg of the links, in the frame of the feet, see `Load.falling`
            (..., 3) [m/s²].

    Returns:
        A stance of the legs in the order of `feet`, with the status of the pose of each.

    Raises:
        UnknownNameError: If there is no leg of a name.
        NotSupportedError: If a leg has no point foot.
        ShapeError: If there is no leg, or leading shapes do not broadcast.
    """
    legs = _standing_legs(robot, feet)
    positions = {name: as_array(f"foot of {name}", at, 3) for name, at in feet.items()}
    falling = as_array("gravity", gravity, 3)
    shapes = {name: at.shape[:-1] for name, at in positions.items()}
    shapes |= {"position": np.shape(pose.position)[:-1], "rotation": np.shape(pose.rotation)[:-2]}
    batch = _common_batch(shapes | {"gravity": falling.shape[:-1]})
    postures = [
        leg.mechanism.inverse(leg.mount.to_leg(pose.to_base(positions[leg.name]))) for leg in legs
    ]
    stance = _of_postures(legs, postures, pose, falling, batch)
    for k, at in enumerate(positions.values()):
        stance.position[..., k, :] = at
    return stance._replace(
        friction=friction,
        normal=normal,
        bias_efforts=stance.bias_efforts
        + as_vectors("bias_efforts", bias_efforts, stance.bias_efforts.shape[-1]),
    )


def measured_stance(
    robot: Robot,
    joint_positions: Mapping[str, ArrayLike],
    stands: ArrayLike,
    friction: ArrayLike,
    gravity: ArrayLike = LEVEL_GRAVITY,
) -> Stance:
    """Return the stance of a robot by its joints and what tells which feet are on the ground.

    Args:
        robot: The robot.
        joint_positions: Actuated joints (..., n) by the names of the legs [rad or m].
        stands: Whether each of these feet is on the ground (..., L).
        friction: Friction coefficient of the ground, or that of each foot (..., L).
        gravity: Acceleration of a falling body in the base frame (..., 3) [m/s²]; the ground is
            across it.

    Returns:
        A stance in the base frame of the legs in the order of `joint_positions`.

    Raises:
        UnknownNameError: If there is no leg of a name.
        NotSupportedError: If a leg has no point foot.
        ShapeError: If there is no leg, or leading shapes do not broadcast.
    """
    legs = _standing_legs(robot, joint_positions)
    falling = as_array("gravity", gravity, 3)
    postures = [leg.mechanism.forward(joint_positions[leg.name]) for leg in legs]
    shapes = {leg.name: p.status.shape for leg, p in zip(legs, postures, strict=True)}
    batch = _common_batch(shapes | {"gravity": falling.shape[:-1]})
    stance = _of_postures(legs, postures, BodyPose(), falling, batch)
    return stance._replace(
        friction=friction, normal=-falling[..., None, :], stands=np.asarray(stands, np.bool_)
    )


def _standing_legs(robot: Robot, names: Iterable[str]) -> list[Leg]:
    """Return legs with point feet by their names."""
    legs = [robot.leg(name) for name in names]
    if not legs:
        raise ShapeError("feet must name at least one leg")
    for leg in legs:
        if not leg.mechanism.has_point_foot:
            raise NotSupportedError(f"{leg.name}: a stance needs legs with point feet x, y, z")
    return legs


def _common_batch(shapes: dict[str, tuple[int, ...]]) -> tuple[int, ...]:
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        raise broadcast_error(shapes) from None


def _of_postures(
    legs: Sequence[Leg],
    postures: Sequence[Posture],
    pose: BodyPose,
    falling: FloatArray,
    batch: tuple[int, ...],
) -> Any:
    """Return a stance of arrays (*batch, L, ...) of postures, without ground."""
    n = max(len(leg.joint_names) for leg in legs)
    jacobian = np.zeros((*batch, len(legs), 3, n))
    limits = np.broadcast_to([-np.inf, np.inf], (len(legs), n, 2)).copy()
    status = np.empty((*batch, len(legs)), np.uint8)
    position = np.empty((*batch, len(legs), 3))
    weight = np.zeros((*batch, len(legs), n))
    for k, (leg, posture) in enumerate(zip(legs, postures, strict=True)):
        rotation = as_array("rotation", pose.rotation, 3, 3) @ leg.mount.rotation
        own = leg.mechanism.jacobian(posture)
        joints = own.shape[-1]
        jacobian[..., k, :, :joints] = rotation @ own
        gravity = np.einsum("...ji,...j->...i", rotation, falling)
        weight[..., k, :joints] = weight_efforts(leg.mechanism, posture, gravity)
        limits[k, :joints] = leg.effort_limits
        status[..., k] = posture.status
        position[..., k, :] = pose.from_base(leg.mount.to_base(posture.foot_position))
    return Stance(
        position=position,
        jacobian=jacobian,
        effort_lower=limits[..., 0],
        effort_upper=limits[..., 1],
        friction=np.inf,
        bias_efforts=weight,
        status=status,
    )
