# SPDX-License-Identifier: Apache-2.0
"""Evaluation of designs: values that can be checked, and reasons where there are none."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from leg_kinematics import Leg, ParallelDrive, ShapeError, UnknownNameError, ValueRangeError
from leg_kinematics.mechanisms import MECHANISMS, GantryHybrid, SixBar
from leg_kinematics.mirrored import Mirrored
from leg_statics.design.designs import (
    METRICS,
    Conditions,
    changed_mechanism,
    evaluate_design,
    find_metric,
    missing_condition,
    supported_metrics,
)
from leg_statics.footholds import Contact, judge_footholds
from leg_statics.indices import INDICES, supported_indices
from leg_statics.kinematics import Kinematics
from leg_statics.published.grid_means import grid_means
from leg_statics.step_length import Criterion, longest_step
from leg_statics.workspace import sample_workspace

LEG = ParallelDrive()
LIMITS = np.array([[-150.0, 150.0]] * 3)
BASE = Leg.of(LEG, LIMITS)
GROUND = Conditions(friction=0.4, load=300.0, tolerance=0.02)
RATED = Conditions(friction=0.4, criterion=Criterion.RATED_FRICTION)
CHANGES = {"drive_lever": 0.140, "parallelogram_link": 0.330, "shank_length": 0.320}


# --------------------------------------------------------------------------- registry


def test_the_mean_of_every_index_is_a_metric():
    for name, index in INDICES.items():
        metric = find_metric(name)
        assert (metric.unit, metric.better) == (index.unit, index.better)
        assert index.doc in metric.doc
    others = {"workspace_volume", "usable_share", "step_length", "load_capacity"}
    assert METRICS.keys() == INDICES.keys() | others


@pytest.mark.parametrize("name", MECHANISMS)
def test_every_mechanism_has_a_value_for_each_metric_it_supports(name):
    leg = MECHANISMS[name]()
    conditions = Conditions(friction=0.4, tolerance=0.05)
    found = evaluate_design(Leg.of(leg, (-1e4, 1e4)), {}, supported_metrics(leg), conditions)
    assert set(supported_indices(leg)) < set(supported_metrics(leg)) == found.values.keys()
    assert all(value > 0.0 for value in found.values.values()), found
    if len(leg.joints) < 3:  # one crank: the bars alone carry what is square to the foot's path
        assert found.problem == "infinite somewhere in the workspace: load_capacity"
    else:
        assert not found.problem
        assert 0.0 < found.change <= 0.05


def test_unknown_names_are_told_with_those_that_exist():
    with pytest.raises(UnknownNameError, match=r"metric 'beauty'; allowed: condition_number, "):
        evaluate_design(BASE, {}, ["beauty"])
    with pytest.raises(UnknownNameError, match=r"geometry parameter 'wings'; allowed: .*, crank_l"):
        evaluate_design(BASE, {"wings": 2.0}, ["usable_share"])


# --------------------------------------------------------------------------- values


def test_values_are_those_of_a_fine_grid_within_the_stated_error():
    names = ["condition_number", "unit_effort_capacity", "rated_friction", "constraint_moment"]
    found = evaluate_design(BASE, CHANGES, [*names, "workspace_volume", "usable_share"])
    leg = replace(LEG, **CHANGES)
    fine = grid_means(leg, names, 44)
    truth = [*fine.values, fine.volume, fine.usable]
    assert not found.problem
    assert found.change <= 0.005
    np.testing.assert_allclose(list(found.values.values()), truth, rtol=found.change + 0.001)


def test_load_capacity_is_the_mean_of_the_capacity_of_all_poses():
    found = evaluate_design(BASE, CHANGES, ["load_capacity"], GROUND)
    design = replace(LEG, **CHANGES)
    sample = sample_workspace(design, 33)
    kinematics = Kinematics(design, sample.posture)
    capacity = judge_footholds(Leg.of(design, LIMITS), kinematics, Contact(0.4)).load_capacity
    mean = np.average(capacity, weights=sample.volume)
    assert found.values["load_capacity"] == pytest.approx(mean, rel=GROUND.tolerance)

    def of(limits=LIMITS, **other):
        base, conditions = Leg.of(LEG, limits), replace(GROUND, **other)
        return evaluate_design(base, CHANGES, ["load_capacity"], conditions).values["load_capacity"]

    assert of(2.0 * LIMITS) == pytest.approx(2.0 * found.values["load_capacity"])
    assert of(friction=0.1) < of(friction=0.4) < of(friction=1.0)


@pytest.mark.parametrize("conditions", [GROUND, RATED], ids=["capacity", "rated friction"])
def test_the_step_is_the_longest_of_those_at_the_heights(conditions):
    heights = (-0.80, -0.70, -0.60)
    found = evaluate_design(BASE, {}, ["step_length"], replace(conditions, heights=heights))
    contact = Contact(0.4, load=conditions.load)
    steps = longest_step(BASE, heights, contact, criterion=conditions.criterion).length
    assert found.values["step_length"] == steps.max() > steps.min()
    assert not found.problem


def test_heights_that_are_not_given_suit_the_leg():
    scan = np.linspace(-0.95, -0.45, 101)
    steps = longest_step(BASE, scan, Contact(0.4), criterion=RATED.criterion).length
    found = evaluate_design(BASE, {}, ["step_length"], RATED).values["step_length"]
    assert 0.98 * steps.max() <= found <= 1.001 * steps.max()


def test_the_order_of_changes_and_metrics_does_not_matter():
    names = ["condition_number", "load_capacity", "unit_moment_effort"]
    one = evaluate_design(BASE, CHANGES, names, GROUND)
    other = evaluate_design(BASE, dict(reversed(CHANGES.items())), names[::-1], GROUND)
    assert one.values == other.values
    assert list(other.values) == names[::-1]


def test_the_mirror_image_of_a_design_is_worth_the_same():
    names = ["condition_number", "workspace_volume", "step_length", "load_capacity"]
    one = evaluate_design(BASE, CHANGES, names, GROUND)
    other = evaluate_design(Leg.of(Mirrored(LEG), LIMITS), CHANGES, names, GROUND)
    assert other.values == pytest.approx(one.values, rel=1e-6)
    assert changed_mechanism(Mirrored(LEG), CHANGES).original == replace(LEG, **CHANGES)


def test_a_question_travels_between_processes_and_has_one_answer():
    question = (BASE, CHANGES, ["condition_number", "step_length"], GROUND)
    answer = evaluate_design(*question)
    assert evaluate_design(*pickle.loads(pickle.dumps(question))) == answer
    assert pickle.loads(pickle.dumps(answer)) == answer


# --------------------------------------------------------------------------- reasons


def test_a_geometry_that_cannot_be_built_says_why():
    found = evaluate_design(BASE, {"rod_length": 0.01}, ["usable_share", "step_length"], GROUND)
    assert found.problem.startswith("rod_length (l1) = 0.01 m does not span")
    assert np.isnan([found.change, *found.values.values()]).all()
    negative = evaluate_design(BASE, {"shank_length": -0.1}, ["usable_share"])
    assert "shank_length (l7) must be > 0" in negative.problem


def test_a_leg_that_cannot_move_says_so():
    stuck = replace(LEG, passive_joint_ranges=((0.0, 0.0),) * 9)
    names = ["condition_number", "workspace_volume", "usable_share", "step_length"]
    found = evaluate_design(Leg.of(stuck, LIMITS), {}, names, GROUND)
    assert found.problem == "none of 512 poses within the joint ranges can be taken"
    assert list(found.values.values())[1:] == [0.0, 0.0, 0.0]
    assert np.isnan(found.values["condition_number"])


def test_means_that_do_not_converge_say_so():
    # these loops fold within the actuator ranges, where the foot's velocity is not bounded
    found = evaluate_design(BASE, {"drive_lever": 0.100}, ["unit_moment_effort"])
    assert found.problem.startswith("not known closely enough after ")
    assert "unit_moment_effort to" in found.problem
    assert found.change > 0.005


def test_what_a_mechanism_does_not_have_is_named_and_the_rest_is_given():
    found = evaluate_design(
        Leg.of(GantryHybrid(), (-1.0, 1.0)),
        {},
        ["rated_friction", "usable_share", "step_length"],
        replace(GROUND, tolerance=0.1),
    )
    assert found.problem == "mechanism 'gantry_hybrid' has no rated_friction, step_length"
    assert found.values["usable_share"] == pytest.approx(0.5, rel=0.1)
    six_bar = Leg.of(SixBar(), (-10.0, 10.0))
    crank = evaluate_design(six_bar, {}, ["step_length"], RATED)
    assert crank.problem == "mechanism 'six_bar' has no step_length"
    by_capacity = evaluate_design(six_bar, {}, ["step_length"], replace(GROUND, load=1.0))
    assert by_capacity.values["step_length"] > 0.05


def test_conditions_that_a_metric_needs_are_asked_for():
    for metric, conditions, missing in (
        ("step_length", Conditions(), "friction"),
        ("load_capacity", Conditions(), "friction"),
        ("step_length", RATED, ""),
        ("condition_number", Conditions(), ""),
    ):
        assert missing_condition(metric, conditions) == missing
    with pytest.raises(
        ValueRangeError, match="metric 'load_capacity' needs the condition friction"
    ):
        evaluate_design(BASE, {}, ["load_capacity"])
    with pytest.raises(ShapeError, match="effort_limits"):
        evaluate_design(replace(BASE, effort_limits=LIMITS[:2]), {}, ["load_capacity"], GROUND)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("friction", -0.1, "friction must be >= 0, got -0.1"),
        ("load", np.inf, "load must be finite and >= 0 N, got inf"),
        ("heights", (0.1, np.nan), "heights must be finite"),
        ("tolerance", 0.0, "tolerance must be > 0 and < 1, got 0.0"),
        ("most_points", 100, "most_points must be >= 512, got 100"),
    ],
)
def test_conditions_out_of_range_are_refused(field, value, message):
    with pytest.raises(ValueRangeError, match=message):
        Conditions(**{field: value})
