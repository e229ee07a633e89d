# SPDX-License-Identifier: Apache-2.0
"""Maps show the values they are given, blank outside of the workspace, in one colour scale."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from drawing_support import meshes, panels, texts
from matplotlib.figure import Figure

from leg_kinematics import Leg, ParallelDrive, ShapeError, UnknownNameError
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.mechanisms import DoubleRhombus
from leg_statics.drawing.maps import plot_maps
from leg_statics.drawing.style import height_title, layer_label, symbol_text
from leg_statics.indices import INDICES, supported_indices
from leg_statics.maps import plane_map

LEG = ParallelDrive()
HEIGHTS = (-0.80, -0.70)
RESOLUTION = 0.02


def maps(index, heights=HEIGHTS, resolution=RESOLUTION, mechanism=LEG):
    return {
        height_title(height): plane_map(Leg.of(mechanism), height, resolution, layers=[index])
        for height in heights
    }


@pytest.fixture(scope="module")
def index_figure():
    return plot_maps(maps("condition_number"), "condition_number")


@pytest.mark.parametrize("index", INDICES)
def test_a_map_is_labelled_by_the_registry(index):
    mechanism = next(leg for leg in (LEG, DoubleRhombus()) if index in supported_indices(leg))
    figure = plot_maps(maps(index, HEIGHTS[1:], 0.05, mechanism), index)
    label = layer_label(index)
    assert symbol_text(INDICES[index].symbol) in label
    assert f"[{INDICES[index].unit.replace('N.m', 'N·m')}]" in label
    assert any(label in text for text in texts(figure))
    (ax,) = panels(figure)
    assert ax.get_xlabel() == "$y$ [m], left"
    assert ax.get_ylabel() == "$x$ [m], forward"


def test_symbols_are_typeset():
    assert symbol_text("k") == "$k$"
    assert symbol_text("eta_cF") == r"$\eta_\mathrm{cF}$"
    assert symbol_text("mu_e,xy") == r"$\mu_\mathrm{e,xy}$"


def test_a_map_has_one_panel_a_height_and_one_colour_scale(index_figure):
    assert [ax.get_title() for ax in panels(index_figure)] == [
        "$h$ = −0.80 m",
        "$h$ = −0.70 m",
    ]
    first, second = meshes(index_figure)
    assert first.norm is second.norm
    assert all(ax.get_aspect() == 1.0 for ax in panels(index_figure))
    assert all(ax.xaxis_inverted() and not ax.yaxis_inverted() for ax in panels(index_figure))
    assert sum(ax.get_label() == "<colorbar>" for ax in index_figure.axes) == 1


def values_shown(mesh):
    """The values of a mesh in rows and columns; matplotlib 3.6 keeps them flat."""
    rows, columns, _ = mesh.get_coordinates().shape
    return np.ma.masked_invalid(mesh.get_array()).reshape(rows - 1, columns - 1)


def test_a_map_is_blank_outside_the_workspace_and_shows_the_values_inside(index_figure):
    for mesh, height in zip(meshes(index_figure), HEIGHTS, strict=True):
        m = plane_map(Leg.of(LEG), height, RESOLUTION, layers=["condition_number"])
        truth = m.layer("condition_number").T
        shown = values_shown(mesh)
        assert np.array_equal(np.ma.getmaskarray(shown), np.isnan(truth))
        assert 0 < shown.count() < shown.size
        np.testing.assert_array_equal(shown.compressed(), truth[np.isfinite(truth)])


def test_the_map_of_a_symmetric_leg_is_symmetric(index_figure):
    for mesh in meshes(index_figure):
        shown = np.ma.filled(values_shown(mesh), np.nan)
        np.testing.assert_allclose(shown, shown[:, ::-1], rtol=1e-9)


def test_a_constant_index_is_said_in_words():
    figure = plot_maps(maps("constraint_force"), "constraint_force")
    assert any("equals 1 everywhere" in text for text in texts(figure))
    assert all(ax.get_label() != "<colorbar>" for ax in figure.axes)


def test_huge_values_at_the_rim_do_not_flatten_the_map():
    m = plane_map(Leg.of(LEG), -0.7, RESOLUTION, layers=["condition_number"])
    values = m.values.copy()
    values.flat[np.nanargmax(values)] = 1e6
    (mesh,) = meshes(plot_maps({"a": m._replace(values=values)}, "condition_number"))
    assert mesh.norm.vmax < 100.0


def test_a_plane_without_a_value_is_refused():
    both = maps("condition_number", [-3.0, -0.7])
    with pytest.raises(ValueRangeError, match="no value in the workspace at h = −3"):
        plot_maps(both, "condition_number")
    with pytest.raises(ValueRangeError, match="a figure without maps"):
        plot_maps({}, "condition_number")


def test_a_layer_that_the_maps_do_not_have_is_refused():
    with pytest.raises(UnknownNameError, match="condition_number"):
        plot_maps(maps("condition_number"), "rated_friction")


def test_a_map_of_several_planes_is_refused():
    m = plane_map(Leg.of(LEG), -0.7, 0.05, layers=["condition_number"])
    twice = m._replace(values=np.stack([m.values, m.values]))
    with pytest.raises(ShapeError, match="one plane"):
        plot_maps({"a": twice}, "condition_number")


def test_a_given_figure_is_drawn_into():
    mine = Figure()
    assert plot_maps(maps("condition_number"), "condition_number", figure=mine) is mine
    assert len(panels(mine)) == 2


def test_pictures_leave_the_backend_alone():
    code = (
        "import sys, leg_statics.drawing.maps, leg_statics.drawing.linkage; "
        "sys.exit('matplotlib.pyplot' in sys.modules or 'rclpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
