# SPDX-License-Identifier: Apache-2.0
"""What the view draws and says of a robot, against the functions that planners call."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from leg_kinematics import load_robot
from leg_statics import (
    BodyPose,
    Contact,
    Load,
    Verdict,
    evaluate_footholds,
    evaluate_stances,
    robot_stance,
    support_region,
)
from leg_statics.view import colours
from leg_statics.view.readings import Reading, percent, place_text, quantity, table
from leg_statics.view.scene import ask, make_scene
from leg_statics.view.shapes import is_empty
from leg_statics.view.standing import Playground
from leg_statics.view.terrain import SHAPES
from leg_statics.weight import LEVEL_GRAVITY

LEG = "left_front"


@pytest.fixture(scope="module")
def level():
    return Playground.of(load_robot("hexapod"))


@pytest.fixture(scope="module")
def rough():
    return Playground.of(load_robot("hexapod"), "rough")


def scene_of(playground, setting):
    return make_scene(playground, playground.stand(setting), setting)


def said(readings):
    return {reading.label: reading.text for reading in readings}


def test_the_leg_is_told_what_evaluate_footholds_answers(level):
    setting = replace(level.setting, friction=0.5, load=200.0, feet={LEG: (0.05, 0.02, 0.0)})
    leg = level.robot.leg(LEG)
    place = level.first_feet[LEG] + [0.05, 0.02, 0.0]
    foot = leg.mount.to_leg([*place[:2], -setting.height])
    found = evaluate_footholds(leg, foot, Contact(0.5, load=200.0))
    told = said(scene_of(level, setting).leg)
    assert told["verdict"] == "feasible"
    assert told["load capacity"] == f"{found.load_capacity:.1f} N"
    assert told["rated friction"] == f"{found.rated_friction_full:.3f}"
    share, joint = told["largest share of a limit"].split(" % ")
    assert share == f"{100 * found.utilisation:.1f}"
    assert joint.strip("()") in leg.joint_names  # two are worked alike here


def test_the_stance_is_told_what_evaluate_stances_answers_on_a_tilted_body(rough):
    tilt = {"roll": 0.08, "pitch": -0.05, "yaw": 0.1}
    setting = replace(rough.setting, height=rough.setting.height - 0.02, mass=80.0, **tilt)
    feet = {name: rough.terrain.on_ground(foot[:2]) for name, foot in rough.first_feet.items()}
    (cr, cp, cy), (sr, sp, sy) = (f(list(tilt.values())) for f in (np.cos, np.sin))
    turn = (
        np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    )
    pose = BodyPose((0.0, 0.0, setting.height), turn)
    normal = rough.terrain.normal(np.array(list(feet.values())))
    stance = robot_stance(rough.robot, feet, setting.friction, pose, normal=normal)
    load = Load(80.0, pose.position)
    answer, region = evaluate_stances(stance, load), support_region(stance, load)
    told = said(scene_of(rough, setting).stance)
    assert told["stance"] == "6 feet: stands"
    assert told["load factor"] == f"{answer.load_factor:.2f}"
    assert told["largest share in the stance"] == f"{100 * answer.utilisation:.1f} %"
    assert told["margin of the centre of mass"] == f"{region.margin:.3f} m"


@pytest.mark.parametrize("terrain", SHAPES)
def test_a_robot_stands_on_every_terrain_at_first(terrain):
    playground = Playground.of(load_robot("hexapod"), terrain)
    told = said(scene_of(playground, playground.setting).stance)
    assert told["stance"] == "6 feet: stands"
    assert float(told["load factor"]) > 1.0


def test_a_foot_above_the_ground_carries_nothing(level):
    setting = replace(level.setting, feet={LEG: (0.0, 0.0, 0.1)})
    scene = scene_of(level, setting)
    assert said(scene.stance)["stance"].startswith("5 feet")
    assert len(scene.shapes["forces"].ends) == 5
    foot = scene.shapes[f"{LEG}/foot"].places[0]
    assert foot == pytest.approx(level.first_feet[LEG] + [0, 0, setting.height + 0.1], abs=1e-3)


def test_all_of_a_leg_is_drawn_at_its_foot_and_in_scale(level):
    setting = level.setting
    scene = scene_of(level, setting)
    standing = level.stand(setting)
    leg, posture = level.robot.leg(LEG), standing.postures[LEG]
    foot = scene.shapes[f"{LEG}/foot"].places[0]
    assert scene.shapes[f"{LEG}/linkage"].ends == pytest.approx(
        leg.segments(posture) + np.array([0.0, 0.0, setting.height])
    )
    apex, *rim = scene.shapes[f"{LEG}/friction_cone"].vertices
    assert apex == pytest.approx(foot)
    for point in rim - foot:
        assert np.hypot(*point[:2]) == pytest.approx(setting.friction * point[2])
    # the corners of the force set are where every joint is at one of its limits
    per_newton = np.linalg.norm(np.diff(scene.shapes["forces"].ends, axis=1), axis=-1).ravel()
    feet = {name: [*foot[:2], 0.0] for name, foot in level.first_feet.items()}
    pose = BodyPose((0.0, 0.0, setting.height))
    stance = robot_stance(level.robot, feet, setting.friction, pose)
    forces = evaluate_stances(stance, Load(setting.mass, pose.position)).force
    per_newton /= np.linalg.norm(forces, axis=-1)
    assert per_newton == pytest.approx(per_newton[0])
    corners = (scene.shapes[f"{LEG}/force_set"].ends.reshape(-1, 3) - foot) / per_newton[0]
    efforts = corners @ leg.mechanism.jacobian(posture)
    assert np.abs(efforts) == pytest.approx(np.full(efforts.shape, 150.0))


def test_candidates_are_coloured_by_the_verdicts_and_capacities_of_evaluate_footholds(rough):
    setting = replace(rough.setting, load=900.0, roll=0.05)
    candidates = scene_of(rough, setting).shapes["candidates"]
    standing, leg = rough.stand(setting), rough.robot.leg(LEG)
    places = rough.terrain.on_ground(candidates.places)
    turn = np.asarray(standing.pose.rotation)
    contact = Contact(
        setting.friction,
        normal=leg.mount.vectors_to_leg(rough.terrain.normal(places) @ turn),
        load=setting.load,
        gravity=leg.mount.vectors_to_leg(np.array(LEVEL_GRAVITY) @ turn),
    )
    found = evaluate_footholds(leg, leg.mount.to_leg(standing.pose.to_base(places)), contact)
    verdicts = set(found.verdict)
    assert {Verdict.FEASIBLE, Verdict.EFFORT, Verdict.FRICTION} <= verdicts
    assert Verdict.REACH not in verdicts
    expected = colours.of_footholds(found.verdict, found.load_capacity)
    assert candidates.colours == pytest.approx(expected)
    # the more a feasible one carries, the more yellow it is
    feasible = found.verdict == Verdict.FEASIBLE
    order = np.argsort(found.load_capacity[feasible])
    assert (np.diff(candidates.colours[feasible][order][:, 1]) >= -1e-12).all()


def test_a_place_is_answered_for_each_leg_that_reaches_it(level):
    setting = level.setting
    place = level.terrain.on_ground(level.first_feet["right_rear"] + [0.03, 0.01, 0.0])
    answers = ask(level, level.stand(setting), setting, place)
    assert "right_rear" in answers
    assert "left_front" not in answers
    leg = level.robot.leg("right_rear")
    foot = leg.mount.to_leg([*place[:2], -setting.height])
    found = evaluate_footholds(leg, foot, Contact(setting.friction, load=setting.load))
    assert said(answers["right_rear"])["load capacity"] == f"{found.load_capacity:.1f} N"


def test_joints_are_coloured_by_what_they_exert(level):
    setting = replace(level.setting, mass=150.0)
    scene = scene_of(level, setting)
    told = said(scene.stance)["largest share in the stance"]
    worst = colours.of_utilisation(float(told.split()[0]) / 100.0)
    shades = np.concatenate([s.colours for n, s in scene.shapes.items() if n.endswith("/joints")])
    assert len(shades) == 18
    distances = np.linalg.norm(shades - worst, axis=1)
    assert distances.min() < 2e-3
    assert shades[:, 0].max() == pytest.approx(shades[distances.argmin(), 0], abs=2e-3)


def test_colours_tell_an_idle_joint_from_one_at_and_beyond_its_limit():
    idle, full, beyond, unknown = colours.of_utilisation([0.0, 1.0, 1.2, np.nan])
    for one, other in itertools.combinations((idle, full, beyond, unknown), 2):
        assert np.abs(one - other).max() > 0.1
    assert unknown == pytest.approx(colours.GREY)


def test_a_robot_that_tells_its_joints_is_shown_as_it_stands(level):
    setting = level.setting
    standing = level.stand(replace(setting, feet={LEG: (0.05, 0.0, 0.12)}))
    joints = {name: posture.joint_positions for name, posture in standing.postures.items()}
    told = level.stand_as(joints, {LEG: True, "right_rear": False})
    assert set(told.touching) == set(level.robot.legs) - {"right_rear"}
    live = level.stand_as(joints, {})
    assert set(live.touching) == set(level.robot.legs) - {LEG}
    for name in level.robot.legs:
        shown = live.pose.from_base(level.in_base(name, live.postures[name]))
        wanted = standing.pose.from_base(level.in_base(name, standing.postures[name]))
        assert shown == pytest.approx(wanted, abs=1e-3)  # heights are set in whole millimetres
    scene = make_scene(level, live, setting, {LEG: 0.9})
    assert scene.shapes[f"{LEG}/joints"].colours == pytest.approx(
        np.tile(colours.of_utilisation(0.9), (3, 1))
    )
    grey = scene.shapes["right_rear/joints"].colours
    assert grey == pytest.approx(np.tile(colours.GREY, (3, 1)))


@pytest.mark.parametrize("name", ["quadruped", "walker", "gantry", "solo12"])
def test_every_robot_can_be_looked_at(name):
    playground = Playground.of(load_robot(name), "steps")
    scene = scene_of(playground, playground.setting)
    for leg in playground.robot.legs:
        assert f"{leg}/linkage" in scene.shapes
        assert f"{leg}/joints" in scene.shapes
    for shape in scene.shapes.values():
        assert not is_empty(shape)
        assert np.isfinite(shape[0]).all()
    assert scene.leg
    assert scene.stance


def test_a_foot_out_of_reach_is_marked_and_said(level):
    setting = replace(level.setting, feet={LEG: (2.0, 0.0, 0.0)})
    scene = scene_of(level, setting)
    assert said(scene.leg)["verdict"] == "reach"
    assert said(scene.leg)["load capacity"] == "–"
    assert f"{LEG}/linkage" not in scene.shapes
    assert scene.shapes[f"{LEG}/foot"].places[0] == pytest.approx(level.foot_of(LEG, setting))


def test_numbers_without_an_end_are_words():
    assert quantity(np.inf, "N") == "any"
    assert quantity(np.nan, "N") == "–"
    assert quantity(12.345, "N") == "12.3 N"
    assert percent(0.5) == "50.0 %"
    assert place_text([-1e-5, 0.1234, -0.5]) == "0.000, 0.123, -0.500 m"
    assert table([Reading("a", "b")]).splitlines()[-1] == "| a | b |"
