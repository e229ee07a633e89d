# SPDX-License-Identifier: Apache-2.0
"""The picture of a leg shows its joints, workspace and forces in both views."""

from __future__ import annotations

import numpy as np
import pytest
from drawing_support import panels, texts

from leg_kinematics import ParallelDrive, ShapeError
from leg_kinematics.errors import ValueRangeError
from leg_statics.drawing.linkage import View, plot_linkage
from leg_statics.workspace import vertical_section

LEG = ParallelDrive()
POSTURE = LEG.initial_posture
LINKAGE, FOOT = LEG.linkage(POSTURE), POSTURE.foot_position
SIDE, FRONT = (View(vertical_section(LEG, FOOT, axis)) for axis in (0, 1))
SQUARE = np.array([[-100.0, 0.0], [100.0, 0.0], [100.0, 400.0], [-100.0, 400.0]])


def test_the_linkage_is_drawn_in_both_views():
    side, front = panels(plot_linkage(LINKAGE, FOOT, SIDE, FRONT))
    for ax, plane in ((side, [0, 2]), (front, [1, 2])):
        joints = ax.lines[-1]
        np.testing.assert_allclose(np.transpose(joints.get_data()), LINKAGE.points[:, plane])
        assert ax.get_aspect() == 1.0


def test_forces_stand_at_the_foot_in_one_scale_that_is_told():
    figure = plot_linkage(
        LINKAGE, FOOT, SIDE._replace(forces=SQUARE), FRONT._replace(forces=0.5 * SQUARE)
    )
    (scale,) = {
        float(text.split("= ")[1].split(" N")[0]) for text in texts(figure) if "0.1 m =" in text
    }
    shares = zip(panels(figure), ([0, 2], [1, 2]), (1.0, 0.5), strict=True)
    for ax, plane, share in shares:
        corners = next(p.get_xy()[:4] for p in ax.patches if len(p.get_xy()) == 5)
        np.testing.assert_allclose((corners - FOOT[plane]) * scale / 0.1, share * SQUARE)


def test_the_friction_cone_has_the_slope_of_its_coefficient():
    figure = plot_linkage(LINKAGE, FOOT, SIDE, FRONT, 0.4)
    for ax, plane in zip(panels(figure), ([0, 2], [1, 2]), strict=True):
        (cone,) = (line for line in ax.lines if "friction cone" in str(line.get_label()))
        left, tip, right = np.transpose(cone.get_data())
        np.testing.assert_allclose(tip, FOOT[plane])
        for edge, sign in ((left, -1), (right, 1)):
            across, up = edge - tip
            assert up > 0.0
            assert across / up == pytest.approx(sign * 0.4)
    with pytest.raises(ValueRangeError, match="friction must be >= 0"):
        plot_linkage(LINKAGE, FOOT, SIDE, FRONT, -1.0)


def test_several_postures_are_not_drawn_as_one():
    several = LEG.linkage(LEG.forward(np.zeros((2, 3))))
    with pytest.raises(ShapeError, match="one posture only"):
        plot_linkage(several, FOOT, SIDE, FRONT)
