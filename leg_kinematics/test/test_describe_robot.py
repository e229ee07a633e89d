# SPDX-License-Identifier: Apache-2.0
"""`describe_robot`: what a robot is made of, and a description to start from."""

from __future__ import annotations

import pytest

from leg_kinematics import load_robot
from leg_kinematics.describe_robot import main
from leg_kinematics.documents import shared_files

MODEL = shared_files("leg_bringup", "robots", ".urdf")["solo12"]


def test_a_model_becomes_a_description_that_loads(tmp_path, capsys):
    written = tmp_path / "mine.yaml"
    assert main([str(MODEL), "--write", str(written)]) == 0
    robot = load_robot(written)
    assert list(robot.legs) == ["FL", "FR", "HL", "HR"]
    told = capsys.readouterr().out
    for word in ("FL_HAA", "-2.7 .. 2.7 N.m", "flipped_knee", "its weight counts", "reach"):
        assert word in told


def test_what_a_model_lacks_is_told(tmp_path, capsys):
    model = tmp_path / "weak.urdf"
    model.write_text(MODEL.read_text().replace('effort="2.7"', ""))
    assert main([str(model), "--foot", "FL_FOOT"]) == 0
    told = capsys.readouterr().out
    assert "missing" in told
    assert "give model.effort_limits of: FL_HAA, FL_HFE, FL_KFE" in told


@pytest.mark.parametrize("robot", ["solo12", "hexapod"])
def test_a_robot_is_told_leg_by_leg(robot, capsys):
    assert main([robot]) == 0
    told = capsys.readouterr().out
    for name, leg in load_robot(robot).legs.items():
        assert f"\n{name}: {leg.mechanism.name}" in told


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.urdf"], "does not exist"),
        (["octopus"], "hexapod"),
        ([str(MODEL), "--foot", "paw"], "unknown link 'paw'"),
        ([str(MODEL), "--base", "hull"], "unknown link 'hull'"),
        (["hexapod", "--write", "x.yaml"], "model files"),
    ],
)
def test_mistakes_are_told_in_a_line(arguments, message, capsys):
    assert main(arguments) == 1
    assert message in capsys.readouterr().err
