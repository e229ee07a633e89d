# SPDX-License-Identifier: Apache-2.0
"""The leg mechanisms, one file each, and the registry by which descriptions name them."""

from __future__ import annotations

from typing import Any

from leg_kinematics.mechanisms.double_rhombus import DoubleRhombus
from leg_kinematics.mechanisms.gantry_hybrid import GantryHybrid
from leg_kinematics.mechanisms.parallel_drive import ParallelDrive
from leg_kinematics.mechanisms.six_bar import SixBar
from leg_kinematics.mechanisms.theo_jansen import TheoJansen

MECHANISMS: dict[str, type[Any]] = {
    kind.name: kind for kind in (ParallelDrive, SixBar, TheoJansen, DoubleRhombus, GantryHybrid)
}
