# SPDX-License-Identifier: Apache-2.0
"""The bodies of a leg as a tree of joints, and the points that close its loops.

Bodies are numbered: 0 is the base, k + 1 is what joint k moves. With all joints at zero every
body's frame has the axes of the base, and its origin is on its joint. A posture is therefore found
without any constant rotation:

    R_(k+1) = R_parent Rot(axis_k, q_k)       p_(k+1) = p_parent + R_parent offset_k      (revolute)
    R_(k+1) = R_parent     p_(k+1) = p_parent + R_parent (offset_k + axis_k q_k)         (prismatic)
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray

Vector = tuple[float, float, float]
BASE = 0  # the body that does not move
STRAIGHT = 1e-12  # components of axes and offsets below that are rounding


class LegJoint(NamedTuple):
    """A joint of a leg and the body it moves.

    Attributes:
        name: Name of the joint.
        type: "revolute" or "prismatic".
        parent: Number of the body it stands on.
        axis: Unit vector, all joints at zero.
        offset: From the parent's origin to the joint, all joints at zero [m].
        limits: Range of the joint position [rad or m].
        effort: Least and most effort of its actuator [N.m or N]; None without one.
        mass: Mass of the body [kg]; NaN if it is not known.
        centre: The body's centre of mass from its origin, all joints at zero [m].
    """

    name: str
    type: Literal["revolute", "prismatic"]
    parent: int
    axis: Vector
    offset: Vector
    limits: tuple[float, float]
    effort: tuple[float, float] | None
    mass: float
    centre: Vector


class Coincidence(NamedTuple):
    """A point of one body that stays at a point of another, which closes a loop.

    Attributes:
        first: Number of a body.
        first_point: The point from its origin, all joints at zero [m].
        second: Number of another body.
        second_point: The same of that one.
    """

    first: int
    first_point: Vector
    second: int
    second_point: Vector


@dataclass(frozen=True)
class LegTree:
    """The chain of a leg, open or with loops.

    Attributes:
        joints: Its joints, each after those that carry it.
        coincidences: What closes its loops.
        foot_body: Number of the body with the foot.
        foot_point: The foot from that body's origin, all joints at zero [m].
        origin: Origin of the leg frame in the base link's frame of a robot model [m].
    """

    joints: tuple[LegJoint, ...]
    coincidences: tuple[Coincidence, ...]
    foot_body: int
    foot_point: Vector
    origin: Vector = (0.0, 0.0, 0.0)

    @cached_property
    def chain(self) -> FloatArray:
        """One row a joint: parent, whether it is prismatic, axis, offset (N, 8)."""
        rows = [(j.parent, j.type == "prismatic", *j.axis, *j.offset) for j in self.joints]
        return np.array(rows, dtype=np.float64).reshape(-1, 8)

    @cached_property
    def loops(self) -> FloatArray:
        """One row a coincidence: body and point of the first, and of the second (L, 8)."""
        rows = [(c.first, *c.first_point, c.second, *c.second_point) for c in self.coincidences]
        return np.array(rows, dtype=np.float64).reshape(-1, 8)

    @cached_property
    def foot(self) -> FloatArray:
        """Body and point of the foot (4,)."""
        return np.array([self.foot_body, *self.foot_point])

    @cached_property
    def masses(self) -> FloatArray:
        """One row a joint: mass and centre of the body it moves (N, 4)."""
        rows = [(joint.mass, *joint.centre) for joint in self.joints]
        return np.array(rows, dtype=np.float64).reshape(-1, 4)

    @property
    def is_serial(self) -> bool:
        """Whether each joint stands on the one before it and the foot on the last."""
        in_line = all(joint.parent == k for k, joint in enumerate(self.joints))
        return in_line and not self.coincidences and self.foot_body == len(self.joints)

    def reflected(self) -> LegTree:
        """Return the mirror image at the plane y = 0; joint positions keep their meaning."""
        joints = [
            joint._replace(
                axis=_reflected(joint.axis, -1.0 if joint.type == "revolute" else 1.0),
                offset=_reflected(joint.offset),
                centre=_reflected(joint.centre),
            )
            for joint in self.joints
        ]
        coincidences = [
            c._replace(
                first_point=_reflected(c.first_point), second_point=_reflected(c.second_point)
            )
            for c in self.coincidences
        ]
        return replace(
            self,
            joints=tuple(joints),
            coincidences=tuple(coincidences),
            foot_point=_reflected(self.foot_point),
        )


def as_vector(values: Iterable[float]) -> Vector:
    """Return three numbers; what is zero but for rounding is zero."""
    x, y, z = (0.0 if abs(v) < STRAIGHT else float(v) for v in values)
    return x, y, z


def _reflected(vector: Vector, sign: float = 1.0) -> Vector:
    """Return a mirrored vector; sign -1 is for an axis of rotation."""
    x, y, z = vector
    return as_vector((sign * x, -sign * y, sign * z))
