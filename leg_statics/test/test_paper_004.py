# SPDX-License-Identifier: Apache-2.0
"""What paper 004 states beside what `gantry_hybrid` gives, and the pictures of its example."""

from __future__ import annotations

import numpy as np
import pytest

from leg_kinematics import Status
from leg_kinematics.mechanisms.gantry_hybrid import GantryHybrid
from leg_statics.published.figures import paper_004
from leg_statics.published.paper_004 import (
    comparisons,
    drive_motion,
    example_manipulator,
    example_motion,
    example_times,
    output_motions,
    printed_forward_acceleration,
)

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


def test_the_figures_show_what_the_example_does(tmp_path):
    paper_004.draw(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "gantry_displacements.png",
        "gantry_output_shaft.png",
    ]
    drives = drive_motion(example_manipulator(), example_motion(example_times()))
    (ax,) = paper_004.displacement_figure().axes
    for line, column in zip(ax.lines, drives.posture.joint_positions.T, strict=False):
        np.testing.assert_allclose(line.get_ydata(), column, atol=1e-15)
