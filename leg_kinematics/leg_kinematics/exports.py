# SPDX-License-Identifier: Apache-2.0
"""What `leg_kinematics` offers to those who use it in their own process."""

from leg_kinematics.description import load_robot
from leg_kinematics.errors import (
    DescriptionError,
    GeometryError,
    KindError,
    LegError,
    NotSupportedError,
    ShapeError,
    UnknownNameError,
    ValueRangeError,
)
from leg_kinematics.mechanism import Excursion, Joint, Linkage, Mechanism, Posture
from leg_kinematics.mechanisms import MECHANISMS
from leg_kinematics.mechanisms.double_rhombus import DoubleRhombus
from leg_kinematics.mechanisms.gantry_hybrid import GantryHybrid
from leg_kinematics.mechanisms.parallel_drive import ParallelDrive
from leg_kinematics.mechanisms.six_bar import SixBar
from leg_kinematics.mechanisms.theo_jansen import TheoJansen
from leg_kinematics.mirrored import Mirrored
from leg_kinematics.robot import Leg, Mount, Robot
from leg_kinematics.status import Status

__all__ = [
    "MECHANISMS",
    "DescriptionError",
    "DoubleRhombus",
    "Excursion",
    "GantryHybrid",
    "GeometryError",
    "Joint",
    "KindError",
    "Leg",
    "LegError",
    "Linkage",
    "Mechanism",
    "Mirrored",
    "Mount",
    "NotSupportedError",
    "ParallelDrive",
    "Posture",
    "Robot",
    "ShapeError",
    "SixBar",
    "Status",
    "TheoJansen",
    "UnknownNameError",
    "ValueRangeError",
    "load_robot",
]
