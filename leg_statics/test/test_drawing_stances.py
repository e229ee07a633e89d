# SPDX-License-Identifier: Apache-2.0
"""Claims about the pictures of stances: they show what they are given, with units."""

import numpy as np
import pytest

from leg_statics.drawing.stances import plot_margins, plot_support_region
from leg_statics.stance.region import support_region
from leg_statics.stance.stances import Load, Stance, best_forces

FEET = np.array([[0.5, 0.3, -0.6], [0.05, -0.3, -0.6], [-0.4, 0.3, -0.6]])
NAMES = ("left_front", "right_middle", "left_rear")


@pytest.fixture(scope="module")
def stance():
    return Stance(FEET, 0.3 * np.tile(np.eye(3), (3, 1, 1)), -150.0, 150.0, 0.4)


def test_the_region_is_drawn_with_feet_forces_and_margin(stance):
    region, force = support_region(stance, Load(100.0)), best_forces(stance, Load(100.0)).force
    figure = plot_support_region(region, FEET, (0.0, 0.0, 0.0), names=NAMES, force=force)
    (ax,) = figure.axes
    corners, _, feet = ax.lines
    np.testing.assert_array_equal(corners.get_ydata()[:-1], region.tangent_corners[:, 0])
    np.testing.assert_array_equal(feet.get_xdata(), FEET[:, 1])
    inner = ax.patches[0].get_xy()[:-1]
    np.testing.assert_array_equal(inner, region.vertices[:, [1, 0]])
    texts = [text.get_text() for text in ax.texts]
    assert f"centre of mass,\nmargin {region.margin:.2f} m" in texts
    up, across = force[0, 2], np.hypot(force[0, 0], force[0, 1])
    assert f"left front\n↑ {up:.0f} N, → {across:.0f} N" in texts
    assert all(any(name.replace("_", " ") in text for text in texts) for name in NAMES)
    assert "[m]" in ax.get_xlabel()
    assert "[m]" in ax.get_ylabel()
    assert ax.xaxis_inverted()  # left is left


def test_margins_are_drawn_over_the_gait():
    figure = plot_margins([0.0, 0.5, 1.0], {"60 kg": [0.1, 0.2, 0.1], "90 kg": [0.0, 0.1, 0.0]})
    (ax,) = figure.axes
    assert [line.get_label() for line in ax.lines[:2]] == ["60 kg", "90 kg"]
    np.testing.assert_array_equal(ax.lines[1].get_ydata(), [0.0, 0.1, 0.0])
    assert ax.get_ylabel() == "margin [m]"
