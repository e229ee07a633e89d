# SPDX-License-Identifier: Apache-2.0
"""Where the joints of a robot's legs stand in a stream of joint states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanism import Mechanism
from leg_kinematics.mirrored import without_reflection
from leg_kinematics.robot import Drives, Leg, Robot


@dataclass(frozen=True)
class LegGroup:
    """Legs of one geometry, mirrored or not, whose joints are all in the message.

    Attributes:
        mechanism: Their mechanism, without reflection.
        legs: Names of the legs (L).
        columns: Where their joints stand in the message (L, n).
        signs: Signs of the components of vectors, which tell mirrored legs (L, 3).
        lower: Least efforts (L, n) [N.m or N].
        upper: Greatest efforts (L, n) [N.m or N].
        turns: Matrices that turn vectors of the legs' frames, reflected if they are, into the base
            frame (L, 3, 3).
        drives: What their drives tell, for all legs (L, n); None for the joint positions.
    """

    mechanism: Mechanism
    legs: tuple[str, ...]
    columns: NDArray[np.intp]
    signs: FloatArray
    lower: FloatArray
    upper: FloatArray
    turns: FloatArray
    drives: Drives | None = None

    def from_base(self, vectors: FloatArray) -> FloatArray:
        """Return free vectors (..., 3) of the base frame in the frame of each leg (..., L, 3)."""
        x, y, z = np.moveaxis(vectors, -1, 0)[..., None, None]
        return self.turns[:, 0] * x + self.turns[:, 1] * y + self.turns[:, 2] * z


@dataclass(frozen=True)
class JointLayout:
    """What a message with certain joint names tells about a robot.

    Attributes:
        groups: The legs that it updates, by geometry.
        legs: Names of these legs, in the order of the robot (L).
        order: Where each of them stands among the legs of all groups (L).
        missing: Joints missing of legs of which it has some joints, by leg.
    """

    groups: tuple[LegGroup, ...]
    legs: tuple[str, ...]
    order: tuple[int, ...]
    missing: dict[str, tuple[str, ...]]


def joint_layout(robot: Robot, names: Sequence[str]) -> JointLayout:
    """Return where the joints of the robot's legs stand among `names`, ignoring other names."""
    column = {name: k for k, name in enumerate(names)}
    grouped: dict[Mechanism, list[Leg]] = {}
    missing = {}
    for leg in robot.legs.values():
        if not leg.mechanism.has_point_foot:
            continue  # a manipulator has no foot that bears a load
        absent = tuple(joint for joint in leg.joint_names if joint not in column)
        if not absent:
            grouped.setdefault(without_reflection(leg.mechanism)[0], []).append(leg)
        elif len(absent) < len(leg.joint_names):
            missing[leg.name] = absent
    groups = tuple(_leg_group(mechanism, legs, column) for mechanism, legs in grouped.items())
    present = [leg for group in groups for leg in group.legs]
    legs = tuple(name for name in robot.legs if name in present)
    return JointLayout(groups, legs, tuple(present.index(name) for name in legs), missing)


def _leg_group(mechanism: Mechanism, legs: Sequence[Leg], column: dict[str, int]) -> LegGroup:
    limits = np.array([leg.effort_limits for leg in legs])
    signs = np.array([without_reflection(leg.mechanism)[1] for leg in legs])
    return LegGroup(
        mechanism=mechanism,
        legs=tuple(leg.name for leg in legs),
        columns=np.array([[column[joint] for joint in leg.joint_names] for leg in legs]),
        signs=signs,
        lower=np.ascontiguousarray(limits[..., 0]),
        upper=np.ascontiguousarray(limits[..., 1]),
        turns=np.array([leg.mount.rotation for leg in legs]) * signs[:, None, :],
        drives=_common_drives(legs),
    )


def _common_drives(legs: Sequence[Leg]) -> Drives | None:
    """Return what the drives of several legs tell, as arrays of all of them (L, n)."""
    if all(leg.drives is None for leg in legs):
        return None
    plain = np.ones_like(legs[0].effort_limits[:, 0])
    scale = np.array([plain if leg.drives is None else leg.drives.scale for leg in legs])
    zero = np.array([0.0 * plain if leg.drives is None else leg.drives.zero for leg in legs])
    return Drives(scale, zero)
