"""What paper 004 states beside what `gantry_hybrid` gives, and the pictures of its example."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from leg_kinematics import Status
from leg_kinematics.mechanisms.gantry_hybrid import GantryHybrid
from leg_statics.published.paper_004 import (
    comparisons,
    drive_motion,
    example_manipulator,
    example_motion,
    example_times,
    output_motions,
    printed_forward_acceleration,
)
from leg_statics.published.plot_gantry_example import main

TIME = example_times(501)


def test_the_example_has_the_default_dimensions():
    assert example_manipulator() == GantryHybrid()


def test_velocity_and_acceleration_are_derivatives_of_the_motion():
    step = 1e-5
    before, now, after = (example_motion(TIME + s) for s in (-step, 0.0, step))
    for value, rate in (
        ("position", "velocity"),
        ("velocity", "acceleration"),
        ("input_angle", "input_velocity"),
        ("input_velocity", "input_acceleration"),
    ):
        difference = (getattr(after, value) - getattr(before, value)) / (2.0 * step)
        np.testing.assert_allclose(getattr(now, rate), difference, atol=1e-8)


def test_the_drives_of_the_example():
    drives = drive_motion(example_manipulator(), example_motion(example_times(5001)))
    assert np.all(drives.posture.status == Status.OK)
    np.testing.assert_allclose(
        1e3 * drives.posture.joint_positions[[0, -1]],
        [[0.0006, 0.0, -0.0006, -0.0024], [-49.9994, 50.0, -50.0006, -50.0024]],
        atol=5.1e-5,
    )
    np.testing.assert_allclose(
        1e3 * np.abs(drives.velocity).max(axis=0), [41.97, 10.0, 41.97, 139.2], atol=0.05
    )


def test_the_printed_forward_acceleration_is_wrong_and_the_corrected_one_right():
    manipulator, motion = example_manipulator(), example_motion(TIME)
    drives = drive_motion(manipulator, motion)
    correct = manipulator.acceleration(drives.posture, drives.velocity, drives.acceleration)
    np.testing.assert_allclose(correct, motion.acceleration, atol=1e-12)
    printed = printed_forward_acceleration(manipulator, drives)
    assert np.abs(printed - motion.acceleration).max() > 0.1


def test_the_output_shaft_stays_within_the_axes_of_figure_5():
    exact, approximate = output_motions(example_motion(TIME))
    assert np.degrees(np.abs(exact.angular_velocity).max()) == pytest.approx(242.2, abs=0.1)
    assert np.degrees(np.abs(exact.angular_acceleration).max()) == pytest.approx(478.3, abs=0.1)
    assert np.degrees(np.abs(exact.angle - approximate.angle).max()) <= 0.9


def test_the_misprints_and_the_approximation_are_the_only_contradictions():
    rows = comparisons()
    assert {row.paper for row in rows} == {"004"}
    contradicted = [row.item for row in rows if not row.holds]
    assert len(contradicted) == 3
    assert all("(26)" in item or "(27)" in item or "phi_2" in item for item in contradicted)


def test_the_plot_command_writes_pictures(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "new" / "pictures"
    monkeypatch.setattr(sys, "argv", ["plot_gantry_example", "--output", str(folder)])
    main()
    written = sorted(path.name for path in folder.iterdir())
    assert written == [
        f"{name}.{suffix}"
        for name in ("gantry_displacements", "gantry_output_shaft")
        for suffix in ("png", "svg")
    ]
    assert all(path.stat().st_size > 10_000 for path in folder.iterdir())
    assert len(capsys.readouterr().out.splitlines()) == 4
