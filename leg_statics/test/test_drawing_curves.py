# SPDX-License-Identifier: Apache-2.0
"""Curves of friction and steps show the values they are given, beside what they are to meet."""

from __future__ import annotations

import numpy as np
import pytest
from drawing_support import panels, texts

from leg_kinematics import Leg, ParallelDrive, ShapeError
from leg_kinematics.errors import ValueRangeError
from leg_statics.drawing.friction import plot_rated_friction
from leg_statics.drawing.steps import plot_step_lengths
from leg_statics.grounds import Ground
from leg_statics.maps import line_map, plane_map
from leg_statics.published.paper_000 import GROUNDS
from leg_statics.step_length import Criterion

LEG = Leg.of(ParallelDrive())
PAPER_GROUNDS = [Ground(name, *friction) for name, friction in GROUNDS.items()]
LAYER = ["rated_friction"]


def test_a_friction_curve_runs_where_the_line_is_inside_the_workspace():
    line = line_map(LEG, 0.05, -0.7, 0.01, layers=LAYER)
    ax = plot_rated_friction({"leg": line}, []).axes[0]
    (curve,) = (shown for shown in ax.lines if "$h$" in str(shown.get_label()))
    values = line.layer("rated_friction")[0]
    inside = np.isfinite(values)
    np.testing.assert_array_equal(curve.get_xdata(), line.x[inside])
    np.testing.assert_array_equal(curve.get_ydata(), values[inside])
    assert curve.get_label() == "leg, $h$ = −0.70 m"
    assert ax.get_xlabel() == "$x$ [m], forward, at $y$ = 0.05 m"


def test_every_ground_is_named_and_spans_its_friction():
    figure = plot_rated_friction(
        {"leg": line_map(LEG, 0.0, -0.7, 0.01, layers=LAYER)}, PAPER_GROUNDS
    )
    assert set(GROUNDS) <= set(texts(figure))
    (side,) = figure.axes[0].child_axes
    spans = {(bar.get_y(), round(bar.get_y() + bar.get_height(), 9)) for bar in side.patches}
    assert spans == set(GROUNDS.values())


def test_what_is_not_one_line_in_the_workspace_is_refused():
    with pytest.raises(ShapeError, match="must be one line"):
        plot_rated_friction({"leg": plane_map(LEG, -0.7, 0.05, layers=LAYER)}, PAPER_GROUNDS)
    with pytest.raises(ValueRangeError, match="no point of the workspace at y = 0 m, height -3 m"):
        plot_rated_friction({"leg": line_map(LEG, 0.0, -3.0, 0.05, layers=LAYER)}, PAPER_GROUNDS)
    with pytest.raises(ValueRangeError, match="no curve"):
        plot_rated_friction({}, PAPER_GROUNDS)


def test_steps_are_drawn_over_the_height_of_the_leg_frame_by_criterion():
    heights = [-0.9, -0.7]
    lengths = {
        Criterion.CAPACITY: {"ice": [0.1, 0.2], "wood": [0.3, 0.4]},
        Criterion.RATED_FRICTION: {"ice": [0.0, 0.1], "wood": [0.2, 0.3]},
    }
    figure = plot_step_lengths(heights, lengths, 300.0)
    for ax, curves in zip(panels(figure), lengths.values(), strict=True):
        for line, (name, values) in zip(ax.lines, curves.items(), strict=True):
            np.testing.assert_array_equal(line.get_xdata(), [0.9, 0.7])
            np.testing.assert_array_equal(line.get_ydata(), values)
            assert line.get_label() == name
        assert ax.get_ylim()[0] == 0.0
        assert ax.get_ylim()[1] >= 0.4
    first, second = panels(figure)
    assert first.get_title() == "load capacity ≥ 300 N"
    assert second.get_title() == r"$\mu_\mathrm{e}$ ≤ friction of the ground"
    assert first.get_ylabel() == "longest step [m]"
    with pytest.raises(ValueRangeError, match="no step length"):
        plot_step_lengths(heights, {}, 300.0)
