# SPDX-License-Identifier: Apache-2.0
"""The command `plot_index_map` writes pictures of a leg; a mistake ends with one line."""

from __future__ import annotations

import struct
from xml.etree import ElementTree

import pytest

from leg_statics.commands import plot_index_map


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
    assert len(lines) == len(plot_index_map.FIGURES)
    assert sorted(map(str, folder.iterdir())) == sorted(lines)
    assert all(path.read_bytes().startswith(b"%PDF") for path in folder.iterdir())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("", "one of the arguments --index --figure --all is required"),
        ("--index nonsense", "allowed: condition_number, unit_effort_capacity"),
        ("--figure 9", "allowed: 2, 5a, 5b, 5c, 6a, 6b, 8, steps, capacity, linkage"),
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
