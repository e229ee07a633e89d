# SPDX-License-Identifier: Apache-2.0
"""Pictures of terrain show scores where legs reach, and nothing where nothing is known."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import QuadMesh

from leg_kinematics import load_robot
from leg_statics.drawing.terrain import plot_terrain
from leg_statics.footholds import Contact
from leg_statics.terrain import HeightMap, foothold_map, survey


def test_a_panel_shows_the_scores_of_its_leg_and_leaves_holes_white():
    x, y = np.meshgrid(np.arange(-0.4, 1.2, 0.05), np.arange(-0.6, 0.6, 0.05))
    points = np.stack([x, y, -0.65 + 0.0 * x], axis=-1)
    points[10, 20, 2] = np.nan
    ground, robot = survey(HeightMap(points, 0.05)), load_robot("hexapod")
    legs = ("left_front", "right_front")
    maps = {name: foothold_map(robot.leg(name), ground, Contact(0.4, load=200.0)) for name in legs}
    figure = plot_terrain(ground, maps, feet={"left_front": points[4, 20]}, title="flat")
    panels = figure.axes[:3]
    assert [ax.get_title() for ax in panels] == ["height", "left front", "right front"]
    for ax, found in zip(panels[1:], maps.values(), strict=True):
        known, scores = (c for c in ax.collections if isinstance(c, QuadMesh))
        shown = scores.get_array().filled(np.nan)
        np.testing.assert_array_equal(np.nan_to_num(shown), np.nan_to_num(found.score))
        assert np.ma.getmaskarray(known.get_array())[10, 20]
    (dot,) = panels[1].lines
    assert (dot.get_xdata()[0], dot.get_ydata()[0]) == tuple(points[4, 20, :2])
    assert not panels[2].lines
