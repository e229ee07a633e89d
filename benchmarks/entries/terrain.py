# SPDX-License-Identifier: Apache-2.0
"""Foothold maps of terrain for all legs of a robot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from harness import Goal, Row, Settings, measure, timed_row

from leg_kinematics import load_robot
from leg_kinematics.robot import Mount
from leg_statics.footholds import Contact
from leg_statics.terrain import HeightMap, foothold_map, gridded, survey

CELLS = 100  # along each side
SPACING = 0.02  # m
BODY = Mount(np.array([0.0, 0.0, 0.65]), np.eye(3))


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the time of the ground alone, and of the ground with the maps of six legs."""
    robot, heights = load_robot("hexapod"), rubble()
    contact = Contact(0.4, load=300.0)
    note = f"{CELLS} x {CELLS} cells"
    points = heights.points.reshape(-1, 3)
    yield timed_row(
        "points to a grid", measure(lambda: gridded(points, SPACING), settings), note=note
    )
    yield timed_row(
        "survey: normals, slopes, edges", measure(lambda: survey(heights), settings), note=note
    )

    def whole() -> None:
        ground = survey(heights)
        for leg in robot.legs.values():
            foothold_map(leg, ground, contact, BODY)

    timing = measure(whole, settings)
    yield timed_row("survey and foothold maps of six legs", timing, Goal(0.1), note)


def rubble() -> HeightMap:
    """Return ground that is level in the large and rough in the small."""
    along = SPACING * (np.arange(CELLS) - 0.5 * CELLS)
    x, y = np.meshgrid(along, along)
    height = 0.04 * np.sin(9.0 * x) * np.cos(7.0 * y) + 0.01 * np.sin(40.0 * x + 25.0 * y)
    return HeightMap(np.stack([x, y, height], axis=-1), SPACING)
