# SPDX-License-Identifier: Apache-2.0
"""Study files: what they mean, and what is told about a wrong one."""

import math

import numpy as np
import pytest

from leg_kinematics import DescriptionError, load_robot
from leg_kinematics.documents import Document, shared_files
from leg_statics.design.search.study import Constraint
from leg_statics.design.search.study_file import load_study, study_from_document
from leg_statics.step_length import Criterion

STUDY = """\
version: 1
name: example
units: {length: mm, angle: deg}
base: {robot: hexapod, leg_type: initial}
parameters:
  drive_lever: {from: 100, to: 160}
  parallelogram_link: {from: 250, to: 350, step: 10}
  crank_zero: {values: [-36, -30]}
objectives: [condition_number, unit_effort_capacity]
constraints:
  step_length: {min: 300}
  unit_moment_effort: {max: 2.5}
record: [workspace_volume]
conditions: {ground: cement, load: 300, heights: [-700, -650], criterion: rated_friction}
method: {name: nsga2, designs: 100, population: 20}
seed: 3
tolerance: 0.02
"""


@pytest.fixture
def load(tmp_path):
    def load(old="", new=""):
        assert old in STUDY
        path = tmp_path / "study.yaml"
        path.write_text(STUDY.replace(old, new, 1))
        return load_study(path)

    return load


def test_lengths_and_angles_are_converted(load):
    study = load()
    lever, link, zero = study.parameters
    assert (lever.lower, lever.upper, lever.values) == (0.1, 0.16, ())
    np.testing.assert_allclose(link.values, np.arange(0.25, 0.355, 0.01))
    np.testing.assert_allclose(zero.values, np.radians([-36, -30]))
    assert [p.unit for p in study.parameters] == ["m", "m", "rad"]
    assert study.constraints == (
        Constraint("step_length", lower=0.3),
        Constraint("unit_moment_effort", upper=2.5),
    )
    np.testing.assert_allclose(study.conditions.heights, [-0.7, -0.65])


def test_conditions_come_from_ground_and_leg_type(load):
    conditions = load().conditions
    assert conditions.friction == 0.4
    assert conditions.load == 300.0
    assert conditions.criterion == Criterion.RATED_FRICTION
    assert conditions.tolerance == 0.02
    assert load("ground: cement", "ground: 0.55").conditions.friction == 0.55


def test_metrics_begin_with_the_objectives(load):
    assert load().metrics == (
        *("condition_number", "unit_effort_capacity", "step_length", "unit_moment_effort"),
        "workspace_volume",
    )


def test_points_of_the_unit_cube_are_designs(load):
    study = load()
    np.testing.assert_allclose(
        study.parameters_at(np.array([0.5, 0.999, 0.0])), [0.13, 0.35, math.radians(-36)]
    )
    np.testing.assert_allclose(
        study.parameters_at(np.array([1.0, 1.0, 1.0])), [0.16, 0.35, math.radians(-30)]
    )


def test_score_is_the_product_of_gains_or_the_worst_gain(load):
    study, base = load(), np.array([6.0, 4.0, 0.3, 2.0, 0.1])
    better = base * [0.9, 1.2, 1.0, 1.0, 1.0]
    assert study.score(better, base) == pytest.approx(0.1 * 0.2)
    mixed = base * [0.8, 0.95, 1.0, 1.0, 1.0]
    assert study.score(mixed, base) == pytest.approx(-0.05)
    assert study.score(base, base) == 0.0


def test_violations_are_relative_and_named(load):
    study = load()
    values = np.array([6.0, 4.0, 0.15, 5.0, 0.1])
    assert study.violation(values) == pytest.approx(0.5 + 1.0)
    assert study.complaint(values) == "step_length 0.15 < 0.3; unit_moment_effort 5 > 2.5"
    assert study.violation(values * [1, 1, 2, 0.5, 1]) == 0.0
    assert study.violation(values * [1, 1, np.nan, 1, 1]) == math.inf


def test_a_robot_beside_the_study_is_found(load, tmp_path):
    description = Document(shared_files("leg_bringup", "robots", ".yaml")["hexapod"]).text
    (tmp_path / "mine.yaml").write_text(description.replace("name: hexapod", "name: mine"))
    assert load("robot: hexapod", "robot: mine.yaml").robot.root["name"] == "mine"


def test_a_robot_may_come_from_outside(tmp_path):
    document = Document(tmp_path / "study", STUDY.replace("robot: hexapod, ", ""))
    study = study_from_document(document, "hexapod")
    robot = load_robot("hexapod")
    assert type(study.leg.mechanism) is type(robot.leg("left_front").geometry)


@pytest.mark.parametrize("name", sorted(shared_files("leg_bringup", "studies", ".yaml")))
def test_shipped_studies_are_valid(name):
    study = load_study(shared_files("leg_bringup", "studies", ".yaml")[name])
    assert study.name == name
    assert study.total > 100


BAD = {
    "another version": ("version: 1", "version: 2", [":1:", "version", "2", "reads version 1"]),
    "no version": ("version: 1\n", "", ["missing key 'version'"]),
    "unknown key": ("seed: 3", "sead: 3", ["unknown key 'sead'", "seed"]),
    "unknown robot": ("robot: hexapod", "robot: spider", ["base.robot", "spider", "hexapod"]),
    "no robot": ("robot: hexapod, ", "", ["base", "missing key 'robot'"]),
    "unknown leg type": ("leg_type: initial", "leg_type: best", [":4:", "best", "optimised"]),
    "unknown parameter": (
        "drive_lever:",
        "drive_liver:",
        [":6:", "parameters.drive_liver", "did you mean 'drive_lever'"],
    ),
    "reversed range": ("{from: 100, to: 160}", "{from: 160, to: 100}", [":6:", "to", "100", "160"]),
    "empty range": ("{from: 100, to: 160}", "{from: 100, to: 100}", ["drive_lever.to", "> from"]),
    "NaN": ("from: 100", "from: .nan", ["parameters.drive_lever.from", "finite number"]),
    "infinite": ("to: 160", "to: .inf", ["parameters.drive_lever.to", "finite number"]),
    "no upper end": ("{from: 100, to: 160}", "{from: 100}", ["drive_lever", "missing key 'to'"]),
    "a pair": ("{from: 100, to: 160}", "[100, 160]", ["drive_lever", "object"]),
    "negative length": ("{from: 100,", "{from: -1,", ["drive_lever", "-1", "> 0"]),
    "step 0": ("step: 10", "step: 0", ["parallelogram_link.step", "> 0"]),
    "step does not fit": ("step: 10", "step: 7", ["parallelogram_link.step", "whole number"]),
    "step too small": ("step: 10", "step: 1e-9", ["parallelogram_link.step", "100000"]),
    "no values": ("[-36, -30]", "[]", ["crank_zero.values"]),
    "unknown objective": (
        "[condition_number,",
        "[condition_numbre,",
        [":9:", "objectives.0", "condition_numbre", "did you mean 'condition_number'"],
    ),
    "no objective": ("[condition_number, unit_effort_capacity]", "[]", ["objectives"]),
    "objective twice": ("unit_effort_capacity]", "condition_number]", ["objectives"]),
    "objective of others": (
        "unit_effort_capacity]",
        "planar_force]",
        ["objectives.1", "parallel_drive", "planar_force", "rated_friction"],
    ),
    "unknown constraint": ("step_length:", "step:", [":11:", "constraints.step", "step_length"]),
    "reversed limits": ("{min: 300}", "{min: 300, max: 200}", ["step_length.max", "200", "300"]),
    "no limit": ("{min: 300}", "{}", ["constraints.step_length"]),
    "unknown ground": ("cement", "lava", [":14:", "conditions.ground", "lava", "cement"]),
    "no ground": ("ground: cement, ", "", ["step_length", "conditions.ground"]),
    "unknown criterion": ("rated_friction}", "luck}", ["conditions.criterion", "capacity"]),
    "unknown method": ("name: nsga2", "name: luck", [":15:", "method.name", "differential_evol"]),
    "no budget": ("designs: 100, ", "", ["method", "missing key 'designs'"]),
    "budget 0": ("designs: 100", "designs: 0", ["method.designs", ">= 1"]),
    "budget too small": ("designs: 100", "designs: 10", ["method.designs", "population = 20"]),
    "population of samples": ("nsga2", "samples", ["method", "unknown key 'population'"]),
    "grid of a range": (
        "{name: nsga2, designs: 100, population: 20}",
        "{name: grid}",
        ["parameters.drive_lever", "step or values"],
    ),
    "budget without end": ("designs: 100", "designs: 1000000000000", ["method.designs", "<= 1000"]),
    "negative seed": ("seed: 3", "seed: -3", ["seed", ">= 0"]),
    "tolerance": ("tolerance: 0.02", "tolerance: 0", ["tolerance", "> 0"]),
    "no YAML": ("units: {", "units: {{", ["study.yaml:"]),
}


@pytest.mark.parametrize("case", BAD.values(), ids=BAD.keys())
def test_a_wrong_study_is_told_where_and_why(load, case):
    old, new, words = case
    with pytest.raises(DescriptionError) as caught:
        load(old, new)
    for word in ["study.yaml", *words]:
        assert word in str(caught.value)


def test_a_grid_without_end_is_refused(tmp_path):
    text = STUDY.replace("{name: nsga2, designs: 100, population: 20}", "{name: grid}")
    text = text.replace("to: 160}", "to: 160, step: 0.001}").replace("step: 10}", "step: 0.01}")
    with pytest.raises(DescriptionError, match=r"parameters: 1200140002 combinations; allowed"):
        study_from_document(Document(tmp_path / "study", text))


def test_a_missing_study_is_told(tmp_path):
    with pytest.raises(DescriptionError, match=r"nothing\.yaml"):
        load_study(tmp_path / "nothing.yaml")
