"""The pictures show what was computed, say in which units, and the command writes them."""

from __future__ import annotations

import struct
import subprocess
import sys
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.text import Text

from leg_kinematics import ParallelDrive, ShapeError, UnknownNameError
from leg_kinematics.errors import NotSupportedError, ValueRangeError
from leg_kinematics.mechanisms import DoubleRhombus, TheoJansen
from leg_statics.commands import plot_index_map
from leg_statics.drawing import plots
from leg_statics.grounds import Ground
from leg_statics.indices import INDICES, supported_indices
from leg_statics.maps import plane_map
from leg_statics.published.paper_000 import GROUNDS, legs

LEG = ParallelDrive()
HEIGHTS = (-0.80, -0.70)
RESOLUTION = 0.02
LIMITS = [[-150.0, 150.0]] * 3
PAPER_GROUNDS = [Ground(name, *friction) for name, friction in GROUNDS.items()]


def meshes(figure):
    """The colour meshes of the panels, without that of a colour bar."""
    return [
        artist
        for ax in figure.axes
        if ax.get_label() != "<colorbar>"
        for artist in ax.collections
        if isinstance(artist, QuadMesh)
    ]


def panels(figure):
    return [ax for ax in figure.axes if ax.get_visible() and ax.get_label() != "<colorbar>"]


def texts(figure):
    """Everything that is written in a figure, also in its legends and the axes inside of axes."""
    return [text.get_text() for text in figure.findobj(Text)]


def labels(figure):
    """Titles, axis labels, x tick labels and legends as they are drawn."""
    found = [text for legend in figure.legends for text in legend.findobj(Text)] + figure.texts
    for ax in figure.axes:
        found += [ax.title, ax.xaxis.label, ax.yaxis.label] if ax.get_visible() else []
    for ax in panels(figure):
        low, high = ax.get_xlim()
        for place, text in zip(ax.get_xticks(), ax.get_xticklabels(), strict=False):
            found += [text] if low <= place <= high else []
    return [text for text in found if text.get_visible() and text.get_text()]


@pytest.fixture(scope="module")
def index_figure():
    return plots.plot_index(LEG, "condition_number", HEIGHTS, RESOLUTION)


# --------------------------------------------------------------------------- maps


@pytest.mark.parametrize("index", INDICES)
def test_a_map_is_labelled_by_the_registry(index):
    mechanism = next(leg for leg in (LEG, DoubleRhombus()) if index in supported_indices(leg))
    figure = plots.plot_index(mechanism, index, HEIGHTS[1:], 0.05)
    label = plots.layer_label(index)
    assert plots.symbol_text(INDICES[index].symbol) in label
    assert f"[{INDICES[index].unit.replace('N.m', 'N·m')}]" in label
    assert any(label in text for text in texts(figure))
    (ax,) = panels(figure)
    assert ax.get_xlabel() == "$x$ [m]"
    assert ax.get_ylabel() == "$y$ [m]"


def test_symbols_are_typeset():
    assert plots.symbol_text("k") == "$k$"
    assert plots.symbol_text("eta_cF") == r"$\eta_\mathrm{cF}$"
    assert plots.symbol_text("mu_e,xy") == r"$\mu_\mathrm{e,xy}$"


def test_a_map_has_one_panel_a_height_and_one_colour_scale(index_figure):
    assert [ax.get_title() for ax in panels(index_figure)] == [
        "$h$ = −0.80 m",
        "$h$ = −0.70 m",
    ]
    first, second = meshes(index_figure)
    assert first.norm is second.norm
    assert all(ax.get_aspect() == 1.0 for ax in panels(index_figure))
    assert sum(ax.get_label() == "<colorbar>" for ax in index_figure.axes) == 1


def test_a_map_is_blank_outside_the_workspace_and_shows_the_values_inside(index_figure):
    for mesh, height in zip(meshes(index_figure), HEIGHTS, strict=True):
        truth = plane_map(LEG, height, RESOLUTION, layers=["condition_number"]).values[0, ..., 0]
        shown = np.ma.masked_invalid(mesh.get_array())
        assert np.array_equal(np.ma.getmaskarray(shown), np.isnan(truth))
        assert 0 < shown.count() < shown.size
        np.testing.assert_array_equal(shown.compressed(), truth[np.isfinite(truth)])


def test_the_map_of_a_symmetric_leg_is_symmetric(index_figure):
    for mesh in meshes(index_figure):
        shown = np.ma.filled(np.ma.masked_invalid(mesh.get_array()), np.nan)
        np.testing.assert_allclose(shown, shown[:, ::-1], rtol=1e-9)


def test_a_constant_index_is_said_in_words():
    figure = plots.plot_index(LEG, "constraint_force", HEIGHTS, RESOLUTION)
    assert any("equals 1 everywhere" in text for text in texts(figure))
    assert all(ax.get_label() != "<colorbar>" for ax in figure.axes)


def test_huge_values_at_the_rim_do_not_flatten_the_map():
    m = plane_map(LEG, -0.7, RESOLUTION, layers=["condition_number"])
    values = m.values.copy()
    values.flat[np.nanargmax(values)] = 1e6
    (mesh,) = meshes(plots.plot_maps({"a": m._replace(values=values)}, "condition_number"))
    assert mesh.norm.vmax < 100.0


def test_default_heights_lie_in_the_workspace_and_differ():
    for mechanism in (LEG, DoubleRhombus()):
        heights = plots.typical_heights(mechanism)
        assert len(np.unique(heights)) == 6
        for height in heights:
            assert np.isfinite(plane_map(mechanism, height, 0.05).values).any()


def test_a_plane_outside_the_workspace_is_refused():
    with pytest.raises(ValueRangeError, match="no value in the workspace at h = −3"):
        plots.plot_index(LEG, "condition_number", [-3.0, -0.7], RESOLUTION)


def test_an_unknown_index_is_refused_with_the_names_that_exist():
    with pytest.raises(UnknownNameError, match="condition_number, unit_effort_capacity"):
        plots.plot_index(LEG, "nonsense", HEIGHTS)


def test_a_map_of_several_planes_is_refused():
    m = plane_map(LEG, -0.7, 0.05, layers=["condition_number"])
    twice = m._replace(values=np.concatenate([m.values, m.values]))
    with pytest.raises(ShapeError, match="one plane"):
        plots.plot_maps({"a": twice}, "condition_number")


def test_a_given_figure_is_drawn_into():
    mine = Figure()
    assert plots.plot_index(LEG, "condition_number", HEIGHTS, 0.05, figure=mine) is mine
    assert len(panels(mine)) == 2


def test_load_capacity_grows_with_the_friction_of_the_ground():
    figure = plots.plot_load_capacity(LEG, LIMITS, {"ice": 0.08, "wood": 0.6}, -0.75, RESOLUTION)
    ice, wood = (np.ma.masked_invalid(mesh.get_array()) for mesh in meshes(figure))
    assert np.all(ice.compressed() <= wood.compressed() + 1e-9)
    assert ice.mean() < 0.9 * wood.mean()
    assert any(r"load capacity $F_\mathrm{n,max}$ [N]" in text for text in texts(figure))
    assert [ax.get_title() for ax in panels(figure)] == [r"ice, $\mu$ = 0.08", r"wood, $\mu$ = 0.6"]


# --------------------------------------------------------------------------- figure 8


def test_rated_friction_along_y_is_a_v_with_its_minimum_near_zero():
    figure = plots.plot_rated_friction(legs(), PAPER_GROUNDS)
    curves = [line for line in figure.axes[0].lines if "$h$" in str(line.get_label())]
    assert len(curves) == 2
    assert len({str(line.get_linestyle()) for line in curves}) == 2
    for curve in curves:
        y, friction = curve.get_data()
        low = int(np.argmin(friction))
        assert friction[low] < 0.01
        assert abs(y[low]) < 0.05
        assert np.all(np.diff(friction[: low + 1]) < 0)
        assert np.all(np.diff(friction[low:]) > 0)


def test_every_ground_is_named_and_spans_its_friction():
    figure = plots.plot_rated_friction({"leg": LEG}, PAPER_GROUNDS)
    assert set(GROUNDS) <= set(texts(figure))
    (side,) = figure.axes[0].child_axes
    spans = {(bar.get_y(), round(bar.get_y() + bar.get_height(), 9)) for bar in side.patches}
    assert spans == set(GROUNDS.values())


def test_heights_of_figure_8_are_one_or_one_a_leg():
    both = legs()
    figure = plots.plot_rated_friction(both, PAPER_GROUNDS, [-0.70])
    (legend,) = figure.legends
    assert all("−0.70" in text.get_text() for text in legend.get_texts())
    with pytest.raises(ShapeError, match="2 mechanisms need as many heights, got 3"):
        plots.plot_rated_friction(both, PAPER_GROUNDS, [-0.7, -0.6, -0.65])
    with pytest.raises(ValueRangeError, match="no point of the workspace"):
        plots.plot_rated_friction(both, PAPER_GROUNDS, [-3.0])


# --------------------------------------------------------------------------- designs and steps


def test_designs_are_drawn_where_their_means_are():
    means = np.random.default_rng(0).uniform(1.0, 5.0, (50, 3))
    figure = plots.plot_designs(means, {"chosen": means[7]}, before=means[8])
    ax = figure.axes[0]
    np.testing.assert_array_equal(ax.collections[0].get_offsets(), means[:, :2])
    np.testing.assert_array_equal(ax.collections[0].get_array(), means[:, 2])
    np.testing.assert_array_equal(np.ravel(ax.lines[0].get_data()), means[7, :2])
    upright, level = ax.lines[1:]
    assert set(upright.get_xdata()) == {means[8, 0]}
    assert set(level.get_ydata()) == {means[8, 1]}
    written = " ".join(texts(figure))
    for symbol in (r"$k_\mathrm{q}$", r"$\eta_\mathrm{cFq}$", r"$\eta_\mathrm{cMq}$", "chosen"):
        assert symbol in written
    with pytest.raises(ShapeError):
        plots.plot_designs(means[:, :2])
    with pytest.raises(ValueRangeError, match="no design"):
        plots.plot_designs(np.empty((0, 3)))


def test_rougher_ground_allows_longer_steps_under_both_criteria():
    heights = np.linspace(-0.9, -0.6, 7)
    figure = plots.plot_step_lengths(LEG, LIMITS, {"ice": 0.08, "wood": 0.6}, 300.0, heights)
    for ax in panels(figure):
        ice, wood = ax.lines
        np.testing.assert_allclose(ice.get_xdata(), -np.sort(heights))
        assert np.all(ice.get_ydata() <= wood.get_ydata() + 1e-5)
        assert ax.get_ylim()[1] >= np.max(wood.get_ydata())
    assert panels(figure)[0].get_title() == "load capacity ≥ 300 N"
    assert panels(figure)[0].get_ylabel() == "longest step [m]"


# --------------------------------------------------------------------------- linkage


def test_the_linkage_is_drawn_in_both_views():
    figure = plots.plot_linkage(LEG, LIMITS, 0.4)
    points = LEG.linkage(LEG.initial_posture).points
    side, front = panels(figure)
    for ax, view in ((side, [1, 2]), (front, [0, 2])):
        joints = ax.lines[-1]
        np.testing.assert_allclose(np.transpose(joints.get_data()), points[:, view])
    assert any("friction cone" in text for text in texts(figure))
    assert any("0.1 m = " in text for text in texts(figure))


def test_a_mechanism_with_one_actuator_is_drawn_without_forces():
    mechanism = TheoJansen()
    assert len(panels(plots.plot_linkage(mechanism))) == 2
    with pytest.raises(NotSupportedError, match="too few actuators"):
        plots.plot_linkage(mechanism, [[-1.0, 1.0]])


def test_a_posture_that_is_not_ok_is_not_drawn():
    with pytest.raises(ValueRangeError, match="status OK"):
        plots.plot_linkage(LEG, posture=LEG.inverse([0.0, 0.0, -3.0]))
    with pytest.raises(ValueRangeError, match="status OK"):
        plots.plot_linkage(LEG, posture=LEG.forward(np.zeros((2, 3))))


def test_the_corners_of_the_force_polygon_use_an_actuator_fully():
    jacobian = LEG.jacobian(LEG.initial_posture)[[1, 2]]
    limits = np.array([[-150.0, 100.0], [-120.0, 150.0], [-90.0, 60.0]])
    corners = plots.force_polygon(jacobian, limits)
    efforts = -corners @ jacobian
    share = np.where(efforts > 0, efforts / limits[:, 1], efforts / limits[:, 0]).max(axis=1)
    assert np.all(corners[:, 1] >= -1e-6)
    np.testing.assert_allclose(share, 1.0, rtol=1e-6)
    with pytest.raises(ValueRangeError, match="lower < 0 < upper"):
        plots.force_polygon(jacobian, np.array([[0.0, 1.0]] * 3))


# --------------------------------------------------------------------------- readable


@pytest.mark.parametrize("name", ["2", "8", "steps", "capacity", "linkage"])
def test_labels_are_large_enough_stay_on_the_page_and_do_not_overlap(name):
    _, by_type, _ = plot_index_map.load_legs("hexapod")
    chosen = [by_type["initial"]] + ([by_type["optimised"]] if name == "8" else [])
    grounds = {ground.name: ground for ground in PAPER_GROUNDS}
    request = plot_index_map.Request("hexapod", chosen, grounds, (), 0.03, 600.0, 0.4)
    figure = plot_index_map.FIGURES[name](request)
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


def test_importing_the_plots_leaves_the_backend_alone():
    code = (
        "import sys; before = set(sys.modules); import leg_statics.drawing.plots; "
        "sys.exit('matplotlib.pyplot' in sys.modules or 'rclpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# --------------------------------------------------------------------------- command


def run(capsys, *arguments):
    """Exit code, printed lines and error of the command."""
    try:
        code = plot_index_map.main(arguments)
    except SystemExit as stop:
        code = stop.code
    captured = capsys.readouterr()
    return code, captured.out.splitlines(), captured.err


def test_the_command_writes_a_png_and_prints_its_name(tmp_path, capsys):
    path = tmp_path / "k.png"
    arguments = ["--robot", "hexapod", "--leg", "right_front", "--index", "condition_number"]
    arguments += ["--heights", "-0.7", "-0.6", "--resolution", "0.02", "--output", str(path)]
    assert run(capsys, *arguments) == (0, [str(path)], "")
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", data[16:24])
    assert (width, height > 500) == (1181, True)  # 100 mm at 300 dots per inch


def test_the_command_writes_an_svg_that_is_the_same_each_time(tmp_path, capsys):
    paths = [tmp_path / "a.svg", tmp_path / "b.svg"]
    for path in paths:
        assert run(capsys, "--figure", "8", "--output", str(path))[0] == 0
    assert ElementTree.parse(paths[0]).getroot().tag.endswith("svg")
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_the_command_draws_the_whole_set_of_a_leg_type(tmp_path, capsys):
    folder = tmp_path / "new" / "folder"
    code, lines, _ = run(
        capsys, "--type", "initial", "--all", str(folder), "--resolution", "0.1", "--format", "pdf"
    )
    assert code == 0
    slow = len(plot_index_map.SLOW_FIGURES)  # drawn on request only
    assert len(lines) == len(plot_index_map.FIGURES) - slow
    assert sorted(map(str, folder.iterdir())) == sorted(lines)
    assert all(path.read_bytes().startswith(b"%PDF") for path in folder.iterdir())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("", "one of the arguments --index --figure --all is required"),
        ("--index nonsense", "allowed: condition_number, unit_effort_capacity"),
        ("--figure 9", "allowed: 2, 5a, 5b, 5c, 6a, 6b, 7, 8, steps, capacity, linkage"),
        ("--figure 2 --leg nose", "allowed: left_front, left_middle"),
        ("--figure 2 --type big", "allowed: initial, optimised, natural"),
        ("--figure 2 --type initial natural", "only figure 8 compares several types"),
        ("--figure 2 --robot spider", "no robot named 'spider'; shipped robots: "),
        ("--robot quadruped --figure 6a", "it has: condition_number"),
        ("--robot gantry --figure steps", "does not move a point foot in space"),
        ("--robot gantry --figure 2", "does not move a point foot in space"),
        ("--robot walker --figure 8", "does not move a point foot in space"),
        ("--figure 2 --heights -3", "height -3 m is outside the workspace of left_front: -0."),
        ("--figure capacity --heights -0.6 -0.7", "takes one height, got 2"),
        ("--figure 2 --heights low", "invalid float value: 'low'"),
        ("--figure 2 --resolution 0", "resolution must be "),
        ("--figure 2 --output map.bmp", "unknown picture format 'bmp'; allowed: png, svg, pdf"),
        ("--figure 2 --output no/such/folder/map.png", "does not exist"),
        ("--figure steps --load -1", "load must be >= 0"),
        ("--figure linkage --friction -1", "friction must be >= 0"),
        ("--all pictures --heights -0.7", "--all takes no --heights"),
        ("--figure 8 --grounds none.yaml", "grounds file none.yaml does not exist"),
    ],
)
def test_a_mistake_ends_with_one_line_that_says_what_is_allowed(capsys, arguments, message):
    code, lines, error = run(capsys, *arguments.split())
    assert code == 2
    assert lines == []
    assert message in error
    assert error.startswith("plot_index_map: error: ")
    assert error.count("\n") == 1


@pytest.mark.parametrize("robot", ["gantry", "walker"])
def test_manipulators_and_planar_legs_have_a_picture_of_their_linkage_only(robot, tmp_path, capsys):
    code, lines, _ = run(capsys, "--robot", robot, "--all", str(tmp_path))
    assert code == 0
    assert len(lines) == 1
    assert lines[0].endswith("_linkage.png")


def test_help_shows_examples(capsys):
    code, lines, _ = run(capsys, "--help")
    assert code == 0
    assert any("plot_index_map --robot hexapod --figure 8" in line for line in lines)
