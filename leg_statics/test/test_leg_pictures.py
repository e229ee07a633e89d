# SPDX-License-Identifier: Apache-2.0
"""Pictures of a leg show what the library computes for it, in labels that can be read."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from drawing_support import labels, meshes, panels, texts

from leg_kinematics import ShapeError, UnknownNameError
from leg_kinematics.description import load_leg_types, load_robot
from leg_kinematics.errors import NotSupportedError, ValueRangeError
from leg_statics.commands import leg_pictures
from leg_statics.commands.leg_pictures import (
    capacity_picture,
    friction_picture,
    index_picture,
    linkage_picture,
    steps_picture,
)
from leg_statics.grounds import Ground
from leg_statics.maps import plane_map
from leg_statics.published.paper_000 import GROUNDS, legs

TYPES = load_leg_types("hexapod")
LEG = TYPES["initial"]
RESOLUTION = 0.02
PAPER_GROUNDS = [Ground(name, *friction) for name, friction in GROUNDS.items()]
ICE_AND_WOOD = [Ground("wood", 0.6, 0.9), Ground("ice", 0.08, 0.4)]


def test_an_index_is_mapped_at_the_heights_asked_for_from_the_lowest():
    figure = index_picture(LEG, "condition_number", [-0.70, -0.80], RESOLUTION)
    assert [ax.get_title() for ax in panels(figure)] == ["$h$ = −0.80 m", "$h$ = −0.70 m"]
    truth = plane_map(LEG, -0.80, RESOLUTION, layers=["condition_number"])
    shown = np.ma.masked_invalid(meshes(figure)[0].get_array()).compressed()
    wanted = truth.values[..., 0].T
    np.testing.assert_array_equal(shown, wanted[np.isfinite(wanted)])


def test_an_unknown_index_is_refused_with_the_names_that_exist():
    with pytest.raises(UnknownNameError, match="condition_number, unit_effort_capacity"):
        index_picture(LEG, "nonsense")


def test_load_capacity_grows_with_the_friction_of_the_ground():
    figure = capacity_picture(LEG, ICE_AND_WOOD, -0.75, RESOLUTION)
    ice, wood = (np.ma.masked_invalid(mesh.get_array()) for mesh in meshes(figure))
    assert np.all(ice.compressed() <= wood.compressed() + 1e-9)
    assert ice.mean() < 0.9 * wood.mean()
    assert any(r"load capacity $F_\mathrm{n,max}$ [N]" in text for text in texts(figure))
    assert [ax.get_title() for ax in panels(figure)] == [r"ice, $\mu$ = 0.08", r"wood, $\mu$ = 0.6"]


def test_rated_friction_along_x_is_a_v_with_its_minimum_near_zero():
    figure = friction_picture(legs(), PAPER_GROUNDS)
    curves = [line for line in figure.axes[0].lines if "$h$" in str(line.get_label())]
    assert len(curves) == 2
    assert len({str(line.get_linestyle()) for line in curves}) == 2
    for curve in curves:
        x, friction = curve.get_data()
        low = int(np.argmin(friction))
        assert friction[low] < 0.01
        assert abs(x[low]) < 0.05
        assert np.all(np.diff(friction[: low + 1]) < 0)
        assert np.all(np.diff(friction[low:]) > 0)


def test_heights_of_friction_curves_are_one_or_one_a_leg():
    both = legs()
    figure = friction_picture(both, PAPER_GROUNDS, [-0.70])
    (legend,) = figure.legends
    assert all("−0.70" in text.get_text() for text in legend.get_texts())
    with pytest.raises(ShapeError, match="2 mechanisms need as many heights, got 3"):
        friction_picture(both, PAPER_GROUNDS, [-0.7, -0.6, -0.65])
    with pytest.raises(ValueRangeError, match="no point of the workspace"):
        friction_picture(both, PAPER_GROUNDS, [-3.0])


def test_rougher_ground_allows_longer_steps_under_both_criteria():
    heights = np.linspace(-0.9, -0.6, 7)
    figure = steps_picture(LEG, ICE_AND_WOOD, 300.0, heights.tolist())
    for ax in panels(figure):
        ice, wood = ax.lines
        np.testing.assert_allclose(ice.get_xdata(), -np.sort(heights))
        assert np.all(ice.get_ydata() <= wood.get_ydata() + 1e-5)
        assert ax.get_ylim()[1] >= np.max(wood.get_ydata())


def test_a_leg_is_drawn_with_its_forces_and_the_friction_cone():
    figure = linkage_picture(LEG, 0.4)
    points = LEG.mechanism.linkage(LEG.mechanism.initial_posture).points
    side, front = panels(figure)
    for ax, plane in ((side, [0, 2]), (front, [1, 2])):
        np.testing.assert_allclose(np.transpose(ax.lines[-1].get_data()), points[:, plane])
    assert any("friction cone" in text for text in texts(figure))
    assert any("0.1 m = " in text for text in texts(figure))


def test_a_mechanism_with_one_actuator_is_drawn_without_forces():
    walker = next(iter(load_robot("walker").legs.values()))
    figure = linkage_picture(walker)
    assert len(panels(figure)) == 2
    assert not any("0.1 m = " in text for text in texts(figure))
    with pytest.raises(NotSupportedError, match="only its linkage can be drawn"):
        index_picture(walker, "condition_number")


PICTURES = {
    "index": lambda leg: index_picture(leg, "condition_number", (), 0.03, title="hexapod initial"),
    "friction": lambda leg: friction_picture(
        {name: TYPES[name].mechanism for name in ("initial", "optimised")},
        PAPER_GROUNDS,
        title="hexapod",
    ),
    "steps": lambda leg: steps_picture(leg, PAPER_GROUNDS, 600.0, title="hexapod initial"),
    "capacity": lambda leg: capacity_picture(
        leg, PAPER_GROUNDS, None, 0.03, title="hexapod initial"
    ),
    "linkage": lambda leg: linkage_picture(leg, 0.4, title="hexapod initial"),
}


def test_every_kind_of_picture_is_checked_for_its_labels():
    kinds = {
        name.removesuffix("_picture") for name in dir(leg_pictures) if name.endswith("_picture")
    }
    assert set(PICTURES) == kinds


@pytest.mark.parametrize("name", PICTURES)
def test_labels_are_large_enough_stay_on_the_page_and_do_not_overlap(name):
    figure = PICTURES[name](LEG)
    assert figure.get_figwidth() * 25.4 == pytest.approx(100.0)
    figure.draw_without_rendering()
    boxes = [(text.get_text(), text.get_window_extent()) for text in labels(figure)]
    pairs = [(a, b) for (a, first), (b, second) in combinations(boxes, 2) if first.overlaps(second)]
    assert pairs == []
    page = figure.bbox.padded(1.0)
    for name, box in boxes:
        assert page.containsx(box.x0), name
        assert page.containsx(box.x1), name
        assert page.containsy(box.y0), name
        assert page.containsy(box.y1), name
    assert all(text.get_fontsize() >= 6.0 for text in labels(figure))
