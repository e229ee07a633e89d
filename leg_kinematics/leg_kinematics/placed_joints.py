# SPDX-License-Identifier: Apache-2.0
"""Makes the tree of a mechanism's bodies from its joints as they are placed in one posture."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray
from leg_kinematics.bodies import BASE, Coincidence, LegJoint, LegTree, Vector, as_vector
from leg_kinematics.mechanism import Joint, Mechanism, Posture

PIN_LENGTH = 0.1  # m, between the two points that a pin keeps together


class PlacedJoint(NamedTuple):
    """A joint of a mechanism in a posture.

    Attributes:
        name: Name of the joint.
        carrier: Name of the joint whose body it stands on; "" for the base.
        point: Name of the point of the linkage that is on it and moves with its body.
        axis: Its axis in the leg frame (3,), of any length.
    """

    name: str
    carrier: str
    point: str
    axis: ArrayLike


class Meeting(NamedTuple):
    """A point that two bodies share, where a loop is cut.

    Attributes:
        point: Name of the point of the linkage.
        first: Name of the joint that moves one of the bodies.
        second: Name of the joint that moves the other.
        axis: Axis of a pin (3,) that they share there; None for a point alone.
    """

    point: str
    first: str
    second: str
    axis: ArrayLike | None = None


def tree_of(
    mechanism: Mechanism,
    posture: Posture,
    joints: Sequence[PlacedJoint],
    meetings: Sequence[Meeting],
    foot: tuple[str, str],
    guides: Mapping[str, Joint] | None = None,
) -> LegTree:
    """Return the bodies of a mechanism: its joints turned back from a posture to zero.

    Args:
        mechanism: The mechanism.
        posture: One posture of it, the loops closed.
        joints: What makes the tree, each joint after the one that carries it.
        meetings: What closes its loops.
        foot: Name of the foot's point, and of the joint that moves its body.
        guides: Joints of the tree that are none of the mechanism's, by name.
    """
    linkage = mechanism.linkage(posture)
    positions = mechanism.positions_by_name(posture)
    kinds = {j.name: j for j in (*mechanism.joints, *mechanism.passive_joints)} | dict(guides or {})
    limits = _limits(mechanism)
    numbers = {"": BASE} | {joint.name: k + 1 for k, joint in enumerate(joints)}
    rotations: list[FloatArray] = [np.eye(3)]  # to zero
    origins: list[FloatArray] = [np.zeros(3)]  # in the posture
    found = []
    for name, carrier, point, axis in joints:
        parent, kind = numbers[carrier], kinds[name]
        unit = np.asarray(axis, dtype=np.float64)
        unit = unit / np.linalg.norm(unit)
        position, origin = float(positions[name]), linkage.point(point)
        offset, back = origin - origins[parent], rotations[parent]
        if kind.type == "prismatic":
            offset = offset - position * unit
            rotations.append(back)
        else:
            rotations.append(back @ rotation_about(unit, -position))
        origins.append(origin)
        found.append(
            LegJoint(
                *(name, kind.type, parent, as_vector(back @ unit), as_vector(back @ offset)),
                limits.get(name, (-math.inf, math.inf)),
                *(None, math.nan, (0.0, 0.0, 0.0)),
            )
        )

    def on_body(name: str, place: FloatArray) -> tuple[int, Vector]:
        number = numbers[name]
        return number, as_vector(rotations[number] @ (place - origins[number]))

    coincidences = []
    for point, first, second, pin in meetings:
        places = [linkage.point(point)]
        if pin is not None:
            places.append(places[0] + PIN_LENGTH * np.asarray(pin))
        coincidences += [Coincidence(*on_body(first, p), *on_body(second, p)) for p in places]
    return LegTree(tuple(found), tuple(coincidences), *on_body(foot[1], linkage.point(foot[0])))


def rotation_about(axis: FloatArray, angle: float) -> FloatArray:
    """Return the matrix (3, 3) of a turn about a unit vector; Rodrigues' formula."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: FloatArray = np.eye(3) + math.sin(angle) * skew + (1.0 - math.cos(angle)) * skew @ skew
    return turn


def _limits(mechanism: Mechanism) -> dict[str, tuple[float, float]]:
    """Return the ranges of joint positions that a mechanism tells, by name.

    Those of a passive joint come from the excursion of its name, if it has one.
    """
    ranges = zip(mechanism.joints, mechanism.joint_limits.tolist(), strict=True)
    found = {joint.name: (lower, upper) for joint, (lower, upper) in ranges}
    rest = mechanism.positions_by_name(mechanism.initial_posture)
    excursions = zip(mechanism.excursions, mechanism.passive_joint_limits.tolist(), strict=True)
    for excursion, (lower, upper) in excursions:
        if excursion.name in rest:
            start = float(rest[excursion.name])
            found[excursion.name] = (start + lower, start + upper)
    return found
