"""Where the joints of a robot's legs stand in a stream of joint states."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from leg_kinematics.mechanism import Mechanism
from leg_kinematics.robot import Leg, Robot


@dataclass(frozen=True)
class LegGroup:
    """Legs that share a mechanism and whose joints are all in the message.

    Attributes:
        mechanism: Their mechanism.
        legs: Names of the legs (L).
        columns: Where their joints stand in the message (L, n).
    """

    mechanism: Mechanism
    legs: tuple[str, ...]
    columns: NDArray[np.intp]


@dataclass(frozen=True)
class JointLayout:
    """What a message with certain joint names tells about a robot.

    Attributes:
        repeated: Names that appear more than once; such a message cannot be used.
        groups: The legs that it updates, by mechanism.
        missing: Joints missing of legs of which it has some joints, by leg.
    """

    repeated: tuple[str, ...]
    groups: tuple[LegGroup, ...]
    missing: dict[str, tuple[str, ...]]


def joint_layout(robot: Robot, names: Sequence[str]) -> JointLayout:
    """Return where the joints of the robot's legs stand among `names`, ignoring other names."""
    repeated = tuple(name for name, count in Counter(names).items() if count > 1)
    column = {name: k for k, name in enumerate(names)}
    grouped: dict[Any, list[Leg]] = {}
    missing = {}
    for leg in robot.legs.values():
        if leg.mechanism.task_coordinates != ("x", "y", "z"):
            continue  # a manipulator has no foot that bears a load
        absent = tuple(joint for joint in leg.joint_names if joint not in column)
        if not absent:
            grouped.setdefault(leg.mechanism, []).append(leg)
        elif len(absent) < len(leg.joint_names):
            missing[leg.name] = absent
    groups = tuple(
        LegGroup(
            mechanism,
            tuple(leg.name for leg in legs),
            np.array([[column[joint] for joint in leg.joint_names] for leg in legs]),
        )
        for mechanism, legs in grouped.items()
    )
    return JointLayout(repeated, groups, missing)
