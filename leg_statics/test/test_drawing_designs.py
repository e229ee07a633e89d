# SPDX-License-Identifier: Apache-2.0
"""Pictures of designs show where their means lie, and what a search found."""

from __future__ import annotations

import numpy as np
import pytest
from drawing_support import texts

from leg_kinematics import ShapeError
from leg_kinematics.errors import ValueRangeError
from leg_statics.drawing.designs import (
    plot_convergence,
    plot_designs,
    plot_front,
    plot_parallel_coordinates,
)

RNG = np.random.default_rng(0)


def test_designs_are_drawn_where_their_means_are():
    means = np.random.default_rng(0).uniform(1.0, 5.0, (50, 3))
    figure = plot_designs(means, {"chosen": means[7]}, before=means[8])
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
        plot_designs(means[:, :2])
    with pytest.raises(ValueRangeError, match="no design"):
        plot_designs(np.empty((0, 3)))


def test_the_front_runs_through_its_designs_among_the_others():
    designs = RNG.uniform(1.0, 5.0, (40, 2))
    front = designs[:5]
    figure = plot_front(designs, front, {"before": designs[6], "winner": front[2]}, ["k", "eta"])
    ax = figure.axes[0]
    shown = {str(line.get_label()): np.transpose(line.get_data()) for line in ax.lines}
    np.testing.assert_array_equal(shown["designs"], designs)
    np.testing.assert_array_equal(shown["Pareto front"], front)
    np.testing.assert_array_equal(shown["before"], [designs[6]])
    np.testing.assert_array_equal(shown["winner"], [front[2]])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("k", "eta")


def test_a_third_objective_is_the_colour_of_the_front():
    front = RNG.uniform(1.0, 5.0, (8, 3))
    figure = plot_front(front, front, {}, ["k", "eta", "moment"])
    (dots,) = figure.axes[0].collections
    np.testing.assert_array_equal(dots.get_offsets(), front[:, :2])
    np.testing.assert_array_equal(dots.get_array(), front[:, 2])
    assert "moment" in texts(figure)


def test_parallel_coordinates_span_each_axis_from_the_least_to_the_most():
    designs = RNG.uniform(0.1, 0.2, (6, 4))
    before, winner = RNG.uniform(0.1, 0.2, 4), designs[3]
    ax = plot_parallel_coordinates(designs, before, winner, ["c", "l6", "k", "eta"]).axes[0]
    shown = {str(line.get_label()): line.get_ydata() for line in ax.lines}
    lowest = np.minimum(designs.min(axis=0), before)
    highest = np.maximum(designs.max(axis=0), before)
    np.testing.assert_allclose(lowest + shown["winner"] * (highest - lowest), winner)
    np.testing.assert_allclose(lowest + shown["before"] * (highest - lowest), before)
    assert [text.get_text() for text in ax.get_xticklabels()] == ["c", "l6", "k", "eta"]


def test_convergence_is_a_staircase_of_the_best_score():
    (line,) = plot_convergence([1, 5, 20], [0.1, 0.3, 0.3]).axes[0].lines
    assert line.get_drawstyle() == "steps-post"
    np.testing.assert_array_equal(np.transpose(line.get_data()), [[1, 0.1], [5, 0.3], [20, 0.3]])
