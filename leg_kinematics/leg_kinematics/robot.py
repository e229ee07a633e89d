# SPDX-License-Identifier: Apache-2.0
"""A robot: named legs, each a mechanism mounted on a body."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arguments import require
from leg_kinematics.arrays import FloatArray, as_array, as_matching, combined
from leg_kinematics.errors import ShapeError, UnknownNameError, ValueRangeError
from leg_kinematics.mechanism import Mechanism, Posture
from leg_kinematics.mirrored import Mirrored

FRAME_PREFIX = r"(?!/)(?!.*//)[A-Za-z0-9_./-]*"


@dataclass(frozen=True)
class Mount:
    """Where a leg frame stands in the robot's base frame.

    Attributes:
        position: Origin of the leg frame in the base frame (3,) [m].
        rotation: Matrix that turns leg coordinates into base coordinates (3, 3).
    """

    position: FloatArray
    rotation: FloatArray

    @cached_property
    def vertical(self) -> tuple[float, float, float]:
        """The z axis of the base frame in the leg frame, which counts as vertical."""
        x, y, z = self.rotation[2].tolist()
        return x, y, z

    def within(self, base: Mount) -> Mount:
        """Return where the leg frame is in a frame in which the base frame is so."""
        if base is BASE:
            return self
        return Mount(base.to_base(self.position), base.rotation @ self.rotation)

    def to_base(self, points: ArrayLike) -> FloatArray:
        """Turn points (..., 3) of the leg frame into the base frame [m]."""
        return self.vectors_to_base(points) + self.position

    def to_leg(self, points: ArrayLike) -> FloatArray:
        """Turn points (..., 3) of the base frame into the leg frame [m]."""
        return self.vectors_to_leg(as_array("points", points, 3) - self.position)

    def vectors_to_base(self, vectors: ArrayLike) -> FloatArray:
        """Turn free vectors (..., 3) of the leg frame into the base frame."""
        return combined(as_array("vectors", vectors, 3), self.rotation.T)

    def vectors_to_leg(self, vectors: ArrayLike) -> FloatArray:
        """Turn free vectors (..., 3) of the base frame into the leg frame."""
        return combined(as_array("vectors", vectors, 3), self.rotation)


BASE = Mount(np.zeros(3), np.eye(3))  # of the base frame itself


@dataclass(frozen=True)
class Drives:
    """What the drives of a leg tell in joint states, if it is not the joint positions themselves.

    A cylinder may tell its stroke, a motor count from another zero or the other way round:

        position = scale (told - zero)        effort = told effort / scale, as power is the same

    Attributes:
        scale: Of each joint (n,), not 0; negative if the drive counts the other way round.
        zero: What each drive tells at joint position zero (n,), in the unit of what it tells.
    """

    scale: FloatArray
    zero: FloatArray

    def positions(self, told: FloatArray) -> FloatArray:
        """Return joint positions (..., n) [rad or m]."""
        return self.scale * (told - self.zero)

    def velocities(self, told: FloatArray) -> FloatArray:
        """Return joint velocities (..., n) [rad/s or m/s]."""
        return self.scale * told

    def efforts(self, told: FloatArray) -> FloatArray:
        """Return joint efforts (..., n) [N.m or N]."""
        return told / self.scale

    def told_positions(self, positions: FloatArray) -> FloatArray:
        """Return what the drives tell at joint positions (..., n)."""
        return positions / self.scale + self.zero


@dataclass(frozen=True)
class Leg:
    """One leg of a robot.

    Attributes:
        name: Name within the robot.
        leg_type: Name of its type in the robot description.
        mechanism: The mechanism, reflected if the leg is mirrored.
        mount: The leg frame in the base frame.
        frame: Name of the leg frame.
        joint_names: Names of the actuated joints in the robot, in the mechanism's order.
        passive_joint_names: Names of the passive joints in the robot, in the mechanism's order.
        effort_limits: Lower and upper effort of each actuator (n, 2) [N.m or N].
        drives: What joint states tell of the joints; None for the joint positions themselves.
    """

    name: str
    leg_type: str
    mechanism: Mechanism
    mount: Mount
    frame: str
    joint_names: tuple[str, ...]
    passive_joint_names: tuple[str, ...]
    effort_limits: FloatArray
    drives: Drives | None = None

    @classmethod
    def of(cls, mechanism: Mechanism, effort_limits: ArrayLike = (-np.inf, np.inf)) -> Leg:
        """Return a leg by itself: a mechanism with the limits of its actuators, on no body.

        Its base frame is its own, and its joints have the mechanism's names.

        Args:
            mechanism: The mechanism.
            effort_limits: Lower (≤ 0) and upper (≥ 0) effort of each actuator (n, 2), or one pair
                for all [N.m or N]; by default none limits.

        Raises:
            KindError: If it is no mechanism.
            ShapeError: If there is not one pair of limits an actuator.
        """
        require("mechanism", mechanism, Mechanism)
        joints = tuple(joint.name for joint in mechanism.joints)
        limits = as_matching("effort_limits", effort_limits, (2,), (len(joints),))
        if limits.ndim > 2:
            raise ShapeError(f"effort_limits must have shape (n, 2), got {limits.shape}")
        rows = np.broadcast_to(limits, (len(joints), 2)).copy()
        name = mechanism.name
        passive = tuple(joint.name for joint in mechanism.passive_joints)
        return cls(name, name, mechanism, BASE, name, joints, passive, rows)

    def tree_joint_names(self) -> tuple[str, ...]:
        """Names in the robot of the joints of the mechanism's `body_tree`, in their order.

        Raises:
            NotSupportedError: If the mechanism does not tell its bodies.
        """
        joints = (*self.mechanism.joints, *self.mechanism.passive_joints)
        names = (*self.joint_names, *self.passive_joint_names)
        known = {joint.name: name for joint, name in zip(joints, names, strict=True)}
        tree = self.mechanism.body_tree()
        return tuple(known.get(j.name, f"{self.name}_{j.name}") for j in tree.joints)

    def segments(self, posture: Posture) -> FloatArray:
        """Return the bars of the leg as straight pieces for drawing.

        Returns:
            Both ends of each piece in the base frame (..., s, 2, 3) [m].
        """
        return self.mount.to_base(self.mechanism.linkage(posture).segments())

    @property
    def mirrored(self) -> bool:
        """Whether the mechanism is the mirror image of its geometry."""
        return isinstance(self.mechanism, Mirrored)

    @property
    def geometry(self) -> Any:
        """The mechanism's dataclass of dimensions, without the reflection."""
        return self.mechanism.original if isinstance(self.mechanism, Mirrored) else self.mechanism


class Body(NamedTuple):
    """What the feet of a robot carry: all of it, its legs included.

    Attributes:
        mass: Mass [kg].
        center_of_mass: Its centre in the base frame (3,), the legs in their initial postures [m].
    """

    mass: float
    center_of_mass: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Robot:
    """A robot with named legs.

    Attributes:
        name: Name of the robot.
        base_frame: Name of the body's frame.
        legs: The legs by name, in the order of the description.
        body: Mass of the robot and where it is; None if not known.
        frame_prefix: What stands before the names of its frames, as one of several robots.
    """

    name: str
    base_frame: str
    legs: Mapping[str, Leg]
    body: Body | None = None
    frame_prefix: str = ""

    def leg(self, name: str) -> Leg:
        """Return a leg by its name; "" is allowed when there is exactly one.

        Raises:
            UnknownNameError: If there is no such leg.
        """
        if len(self.legs) == 1 and isinstance(name, str) and not name:
            return next(iter(self.legs.values()))
        try:
            return self.legs[name]
        except (KeyError, TypeError):  # what has no hash is no name
            raise UnknownNameError("leg", name, self.legs) from None

    def with_frame_prefix(self, prefix: str) -> Robot:
        """Return the robot with other names of its frames, as one of several that show together.

        Args:
            prefix: What stands before each name, such as "robot_1/"; the `frame_prefix` of ROS's
                robot_state_publisher.

        Raises:
            KindError: If it is no text.
            ValueRangeError: If names of frames cannot begin with it.
        """
        require("frame_prefix", prefix, str)
        if not re.fullmatch(FRAME_PREFIX, prefix):
            raise ValueRangeError(
                f"frame_prefix: got {prefix!r}; allowed: letters, digits, _ . - and / between"
            )
        legs = {name: replace(leg, frame=f"{prefix}{leg.frame}") for name, leg in self.legs.items()}
        return replace(
            self,
            base_frame=f"{prefix}{self.base_frame}",
            legs=legs,
            frame_prefix=f"{prefix}{self.frame_prefix}",
        )

    def effort_limits(self) -> tuple[tuple[str, ...], FloatArray]:
        """Return all joint names and their effort limits (sum of n, 2) [N.m or N]."""
        legs = self.legs.values()
        names = tuple(name for leg in legs for name in leg.joint_names)
        return names, np.concatenate([leg.effort_limits for leg in legs])
