# SPDX-License-Identifier: Apache-2.0
"""The leg mechanisms, one file each, and the registry by which descriptions name them.

A package of someone else adds its own by entry points of the group `leg_kinematics.mechanisms`,
each the class of a mechanism that is given by dimensions (`leg_kinematics.geometry.Dimensioned`).
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any

from leg_kinematics.mechanisms.double_rhombus import DoubleRhombus
from leg_kinematics.mechanisms.gantry_hybrid import GantryHybrid
from leg_kinematics.mechanisms.parallel_drive import ParallelDrive
from leg_kinematics.mechanisms.six_bar import SixBar
from leg_kinematics.mechanisms.theo_jansen import TheoJansen

MECHANISMS: dict[str, type[Any]] = {
    kind.name: kind for kind in (ParallelDrive, SixBar, TheoJansen, DoubleRhombus, GantryHybrid)
}
for _entry_point in entry_points(group="leg_kinematics.mechanisms"):
    _kind = _entry_point.load()
    MECHANISMS.setdefault(_kind.name, _kind)
