# SPDX-License-Identifier: Apache-2.0
"""What a gait planner asks: footholds and steps, equal to the library's, and clear refusals."""

import math

import numpy as np
import pytest
from leg_msgs.msg import ErrorCode, FootholdVerdict
from leg_msgs.msg import Ground as GroundMessage
from leg_msgs.srv import QueryFootholds, QueryStepLength
from leg_msgs_py import errors
from leg_msgs_py.client import LegClient
from leg_msgs_py.grounds import Ground
from nodes_support import MAX_POINTS, ask, set_parameter

from leg_statics.footholds import Contact, Verdict, evaluate_around, evaluate_footholds
from leg_statics.step_length import Criterion, common_step, longest_step

LEG = "left_front"
SLOPE = (0.2, -0.1, 1.0)
SAME = {"rtol": 1e-9, "atol": 1e-9}


def candidates(leg, shape=(3, 80)):
    """Return candidates about the initial foothold, of every verdict but FRICTION, one with NaN."""
    rng = np.random.default_rng(3)
    feet = leg.mechanism.initial_posture.foot_position + rng.uniform(-0.35, 0.35, (*shape, 3))
    feet[(0,) * len(shape)] = [0.0, np.nan, -0.6]
    return feet


def assert_same_footholds(answer, wanted):
    np.testing.assert_array_equal(answer.verdict, wanted.verdict)
    np.testing.assert_array_equal(answer.status, wanted.posture.status)
    np.testing.assert_array_equal(answer.limiting_joint, wanted.limiting_joint)
    np.testing.assert_array_equal(answer.ranking, wanted.ranking)
    for name in ("load_capacity", "rated_friction", "rated_friction_full", "friction_margin"):
        np.testing.assert_allclose(getattr(answer, name), getattr(wanted, name), **SAME)
    for name in ("utilisation", "clearance", "margin"):
        np.testing.assert_allclose(getattr(answer, name), getattr(wanted, name), **SAME)
    np.testing.assert_array_equal(answer.ranking_by_capacity, wanted.ranking_by_capacity)


# --------------------------------------------------------------------------- footholds

CASES = {
    "hard and level": ("cement", 300.0, {}, Contact(0.4, load=300.0)),
    "high end": (Ground("cement", high_end=True), 300.0, {}, Contact(0.7, load=300.0)),
    "slippery": (0.05, 300.0, {}, Contact(0.05, load=300.0)),
    "no slip": (math.inf, 900.0, {}, Contact(math.inf, load=900.0)),
    "slope": (Ground("wood", SLOPE), 200.0, {}, Contact(0.6, SLOPE, 200.0)),
    "soft": (
        0.5,
        200.0,
        {"moment": [5.0, -8.0, 1.0], "any_direction_moment": 12.0},
        Contact(0.5, load=200.0, moment=(5.0, -8.0, 1.0), any_direction_moment=12.0),
    ),
    "heavy leg": (
        0.5,
        200.0,
        {"bias_efforts": [10.0, -20.0, 15.0]},
        Contact(0.5, load=200.0, bias_efforts=(10.0, -20.0, 15.0)),
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_footholds_equal_the_library(suite, hexapod, case):
    ground, load, options, contact = case
    leg = hexapod.legs[LEG]
    feet = candidates(leg)
    wanted = evaluate_footholds(leg, feet, contact)
    answer = suite.client.query_footholds(LEG, feet, ground, load, efforts=True, **options)
    assert_same_footholds(answer, wanted)
    np.testing.assert_allclose(answer.joint_efforts, wanted.joint_efforts, **SAME)
    np.testing.assert_allclose(answer.force, wanted.force, **SAME)
    assert answer.friction_coefficient == contact.friction
    assert answer.joint_names == leg.joint_names
    assert answer.best == answer.ranking[0]
    np.testing.assert_array_equal(answer.feasible, wanted.feasible)


def test_footholds_that_the_foot_may_miss_equal_the_library(suite, hexapod):
    leg = hexapod.legs[LEG]
    feet = candidates(leg, (60,))  # each stands for 13 points
    wanted = evaluate_around(leg, feet, Contact(0.4, load=300.0), 0.01)
    answer = suite.client.query_footholds(LEG, feet, "cement", 300.0, radius=0.01)
    assert_same_footholds(answer, wanted)


def test_the_cases_meet_every_verdict(suite, hexapod):
    feet = candidates(hexapod.legs[LEG])
    met = set()
    for ground, load in (("cement", 600.0), (0.02, 600.0), ("cement", 1e5)):
        met |= set(np.unique(suite.client.query_footholds(LEG, feet, ground, load).verdict))
    assert met >= {v.value for v in Verdict} - {Verdict.SINGULAR}


def test_the_verdicts_of_the_message_are_those_of_the_library():
    for verdict in Verdict:
        assert getattr(FootholdVerdict, verdict.name) == verdict.value


def test_footholds_in_the_base_frame_are_those_of_the_leg_frame(suite, hexapod):
    leg = hexapod.legs[LEG]
    mount = leg.mount
    feet = candidates(leg, (30,))[1:]
    moment = np.array([4.0, 6.0, -1.0])
    own = suite.client.query_footholds(
        LEG, feet, Ground(0.5, SLOPE), 150.0, moment=moment, efforts=True
    )
    base = suite.client.query_footholds(
        LEG,
        mount.to_base(feet),
        Ground(0.5, mount.vectors_to_base(SLOPE)),
        150.0,
        moment=mount.vectors_to_base(moment),
        frame=hexapod.base_frame,
        efforts=True,
    )
    np.testing.assert_array_equal(base.verdict, own.verdict)
    np.testing.assert_allclose(base.load_capacity, own.load_capacity, rtol=1e-6)
    np.testing.assert_allclose(base.joint_efforts, own.joint_efforts, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(base.force, mount.vectors_to_base(own.force), rtol=1e-6, atol=1e-4)


def test_efforts_come_only_if_asked_for(suite, hexapod):
    answer = suite.client.query_footholds(LEG, candidates(hexapod.legs[LEG]), "ice", 10.0)
    assert answer.joint_names == ()
    assert answer.joint_efforts.size == answer.force.size == 0


def test_one_candidate_has_an_empty_batch(suite, hexapod):
    foot = hexapod.legs[LEG].mechanism.initial_posture.foot_position
    answer = suite.client.query_footholds(LEG, foot, "cement", 100.0, efforts=True)
    assert answer.feasible.shape == answer.load_capacity.shape == ()
    assert answer.force.shape == (3,)
    assert answer.best == 0


@pytest.mark.parametrize("empty", [[], np.empty((0, 3))], ids=["list", "array"])
def test_no_candidates_give_an_empty_answer(suite, empty):
    answer = suite.client.query_footholds(LEG, empty, "cement", 100.0, efforts=True)
    assert answer.verdict.shape == (0,)
    assert answer.best == -1
    assert len(answer.ranking) == 0


def test_without_a_feasible_candidate_there_is_no_best(suite):
    answer = suite.client.query_footholds(LEG, [[0.0, 0.0, -5.0]] * 3, "cement")
    assert answer.best == -1
    assert list(answer.verdict) == [FootholdVerdict.REACH] * 3


def test_new_effort_limits_change_the_capacity_in_proportion(suite, hexapod):
    leg = hexapod.legs[LEG]
    feet = candidates(leg, (20,))
    before = suite.client.query_footholds(LEG, feet, "cement")
    suite.client.set_effort_limits(LEG, leg.joint_names, [75.0] * 3)
    try:
        after = suite.client.query_footholds(LEG, feet, "cement")
    finally:
        suite.client.set_effort_limits(LEG, leg.joint_names, [150.0] * 3)
    np.testing.assert_allclose(after.load_capacity, 0.5 * before.load_capacity, rtol=1e-9)


# --------------------------------------------------------------------------- steps


@pytest.mark.parametrize("by_rated_friction", [False, True], ids=["capacity", "rated friction"])
def test_the_step_of_a_leg_equals_the_library(suite, hexapod, by_rated_friction):
    leg = hexapod.legs[LEG]
    heights = np.array([[-0.6, -0.65], [-0.7, -2.0]])
    wanted = longest_step(
        leg,
        heights,
        Contact(0.08, load=300.0),
        lateral_offset=0.03,
        direction=(1.0, 0.3, 0.0),
        criterion=Criterion(by_rated_friction),
    )
    answer = suite.client.query_step_length(
        LEG,
        heights,
        "ice",
        300.0,
        lateral_offsets=[0.03],
        direction=[1.0, 0.3, 0.0],
        by_rated_friction=by_rated_friction,
    )
    assert answer.legs == (LEG,)
    assert answer.length.shape == (1, 2, 2)
    np.testing.assert_allclose(answer.length[0], wanted.length, **SAME)
    np.testing.assert_allclose(answer.start[0], wanted.start, **SAME)
    np.testing.assert_allclose(answer.end[0], wanted.end, **SAME)
    np.testing.assert_array_equal(answer.start_limit[0], wanted.start_limit)
    np.testing.assert_array_equal(answer.end_limit[0], wanted.end_limit)
    np.testing.assert_allclose(answer.load_capacity[0], wanted.load_capacity, rtol=1e-6)
    np.testing.assert_allclose(answer.rated_friction[0], wanted.rated_friction, **SAME)
    np.testing.assert_allclose(answer.rated_friction_full[0], wanted.rated_friction_full, **SAME)
    np.testing.assert_allclose(answer.common_length, wanted.length, **SAME)
    assert answer.best_height == np.argmax(wanted.length)
    assert answer.length[0, 1, 1] == 0.0
    assert np.isnan(answer.start[0, 1, 1]).all()


def test_the_common_step_equals_the_library(suite, hexapod):
    contact = Contact(0.4, (0.1, 0.05, 1.0), 250.0, (0.0, 5.0, 0.0))
    wanted = common_step(hexapod.legs, [0.65, 0.7], contact)
    answer = suite.client.query_step_length(
        (), [-0.65, -0.7], Ground("cement", contact.normal), 250.0, moment=contact.moment
    )
    assert answer.legs == tuple(hexapod.legs)
    np.testing.assert_allclose(answer.common_length, wanted.common_length, **SAME)
    np.testing.assert_array_equal(answer.limiting_leg, wanted.limiting_leg)
    for k, (name, step) in enumerate(wanted.steps.items()):
        mount = hexapod.legs[name].mount
        np.testing.assert_allclose(answer.length[k], step.length, **SAME)
        np.testing.assert_allclose(answer.start[k], mount.to_base(step.start), **SAME)
        np.testing.assert_allclose(answer.end[k], mount.to_base(step.end), **SAME)
    assert answer.best_height == wanted.best_height


def test_a_slope_has_the_same_meaning_for_one_leg_in_either_frame(suite, hexapod):
    leg = hexapod.legs[LEG]
    own = suite.client.query_step_length(LEG, -0.65, Ground(0.4, SLOPE), 200.0)
    base = suite.client.query_step_length(
        LEG,
        -0.65 + leg.mount.position[2],
        Ground(0.4, leg.mount.vectors_to_base(SLOPE)),
        200.0,
        frame=hexapod.base_frame,
    )
    np.testing.assert_allclose(base.length, own.length, atol=1e-5)
    np.testing.assert_allclose(base.start, leg.mount.to_base(own.start), atol=1e-5)


def test_no_heights_give_an_empty_answer(suite):
    answer = suite.client.query_step_length((), [], "cement")
    assert answer.length.shape == (6, 0)
    assert answer.best_height == -1


def test_a_height_that_no_leg_reaches_has_no_best(suite):
    answer = suite.client.query_step_length((), [-9.0], "cement")
    assert answer.best_height == -1
    assert not answer.length.any()


# --------------------------------------------------------------------------- bad requests

P = [-0.1, 0.0, -0.65]
CEMENT = GroundMessage(name="cement")

# fields, error code, words that the message must have
BAD_FOOTHOLDS = {
    "leg": ({"legs": ["tail"]}, "UNKNOWN_LEG", ["tail", LEG]),
    "ground": ({"ground": GroundMessage(name="lava")}, "UNKNOWN_GROUND", ["lava", "cement", "ice"]),
    "mu < 0": (
        {"ground": GroundMessage(friction_coefficients=[-0.1])},
        "INVALID_INPUT",
        ["ground.friction_coefficients", "-0.1", ">= 0"],
    ),
    "mu NaN": (
        {"ground": GroundMessage(friction_coefficients=[math.nan])},
        "INVALID_INPUT",
        ["ground.friction_coefficients", "nan"],
    ),
    "NaN normal": (
        {"ground": GroundMessage(name="ice", normals=[0.0, math.nan, 1.0])},
        "INVALID_INPUT",
        ["ground.normals", "nan", "finite"],
    ),
    "no ground": (
        {"ground": GroundMessage()},
        "INVALID_INPUT",
        ["ground", "neither name nor friction_coefficients", "cement", ">= 0"],
    ),
    "normal into the ground": (
        {"ground": GroundMessage(name="ice", normals=[0.1, 0.0, -1.0])},
        "INVALID_INPUT",
        ["normal", "out of the ground", "0.1", "-1.0"],
    ),
    "negative radius": ({"radius": -0.01}, "INVALID_INPUT", ["radius", "-0.01", ">= 0"]),
    "too large with all that is around": (
        {"positions": P * (MAX_POINTS // 12), "radius": 0.01},
        "TOO_LARGE",
        ["positions", str(MAX_POINTS), "max_points"],
    ),
    "negative load": (
        {"required_load": [-1.0]},
        "INVALID_INPUT",
        ["required_load", "-1.0", ">= 0"],
    ),
    "NaN load": ({"required_load": [math.nan]}, "INVALID_INPUT", ["required_load", "nan"]),
    "infinite load": ({"required_load": [math.inf]}, "INVALID_INPUT", ["required_load", "inf"]),
    "moment": (
        {"required_moment": [0.0, math.inf, 0.0]},
        "INVALID_INPUT",
        ["required_moment", "inf", "finite"],
    ),
    "moment < 0": (
        {"any_direction_moment": [-2.0]},
        "INVALID_INPUT",
        ["any_direction_moment", "-2.0", ">= 0"],
    ),
    "two bias efforts": (
        {"bias_efforts": [1.0, 2.0]},
        "INVALID_INPUT",
        ["bias_efforts", "got 2", "3", "crank_1"],
    ),
    "NaN bias": ({"bias_efforts": [1.0, 2.0, math.nan]}, "INVALID_INPUT", ["bias_efforts", "nan"]),
    "half a point": ({"positions": P[:2]}, "INVALID_INPUT", ["positions", "got 2"]),
    "frame": ({"frame": "map"}, "INVALID_INPUT", ["header.frame_id", "map", "base_link"]),
    "too large": (
        {"positions": P * (MAX_POINTS + 1)},
        "TOO_LARGE",
        ["positions", str(MAX_POINTS + 1), str(MAX_POINTS), "max_points"],
    ),
}

BAD_STEPS = {
    "leg": ({"legs": ["tail"]}, "UNKNOWN_LEG", ["tail", LEG]),
    "leg twice": ({"legs": [LEG, LEG]}, "INVALID_INPUT", ["legs", LEG, "twice"]),
    "ground": ({"ground": GroundMessage(name="lava")}, "UNKNOWN_GROUND", ["lava", "cement"]),
    "height": ({"heights": [-0.6, math.nan]}, "INVALID_INPUT", ["heights", "nan", "finite"]),
    "height above what a foot reaches": (
        {"heights": [0.65]},
        "INVALID_INPUT",
        ["height", "negative below", "0.65"],
    ),
    "no ground": ({"ground": GroundMessage()}, "INVALID_INPUT", ["ground", "cement"]),
    "frame of one leg for several": (
        {"legs": [LEG, "right_rear"], "frame": "left_front_leg"},
        "INVALID_INPUT",
        ["header.frame_id", "left_front_leg", "base_link"],
    ),
    "frame of another leg": ({"frame": "right_rear_leg"}, "INVALID_INPUT", ["right_rear_leg"]),
    "steep direction": (
        {"direction": [0.0, 1.0, 1.0]},
        "INVALID_INPUT",
        ["direction", "horizontal"],
    ),
    "NaN direction": ({"direction": [0.0, math.nan, 0.0]}, "INVALID_INPUT", ["direction", "nan"]),
    "offsets": ({"lateral_offsets": [0.0, 0.1]}, "INVALID_INPUT", ["lateral_offsets", "got 2"]),
    "NaN offset": ({"lateral_offsets": [math.nan]}, "INVALID_INPUT", ["lateral_offsets", "nan"]),
    "criterion": ({"criterion": 7}, "INVALID_INPUT", ["criterion", "7", "RATED_FRICTION"]),
    "load": ({"required_load": -5.0}, "INVALID_INPUT", ["required_load", "-5.0"]),
    "too many heights": (
        {"legs": [], "heights": [-0.6] * 1000},
        "TOO_LARGE",
        ["heights", "6000", "1000", "max_steps"],
    ),
}

GOOD = {
    "query_footholds": (
        QueryFootholds,
        {"legs": [LEG], "positions": P, "ground": CEMENT},
        BAD_FOOTHOLDS,
    ),
    "query_step_length": (
        QueryStepLength,
        {"legs": [LEG], "heights": [-0.65], "ground": CEMENT},
        BAD_STEPS,
    ),
}
BAD = {
    f"{service}: {name}": (service, service_type, good, *case)
    for service, (service_type, good, cases) in GOOD.items()
    for name, case in cases.items()
}


@pytest.mark.parametrize("case", BAD.values(), ids=BAD.keys())
def test_a_bad_request_is_refused_and_the_next_one_answered(suite, case):
    service, service_type, good, bad, code, words = case
    fields = {"ground": CEMENT, **good, **bad}
    frame = fields.pop("frame", "")
    request = service_type.Request(**fields)
    request.header.frame_id = frame
    with pytest.raises(errors.LegServiceError) as caught:
        ask(suite.client, service, request)
    assert caught.value.code == getattr(ErrorCode, code)
    assert type(caught.value) is errors.ERRORS[caught.value.code]
    for word in words:
        assert word in caught.value.message
    assert suite.client.query_footholds(LEG, P, "cement", 100.0).best == 0


def test_ten_million_candidates_are_refused_before_they_are_sent(suite):
    many = np.broadcast_to(P, (10_000_000, 3))
    with pytest.raises(errors.TooLargeError, match="10000000 points; allowed: at most 1000000"):
        suite.client.query_footholds(LEG, many, "cement")


def test_the_limit_of_the_node_is_a_parameter(suite):
    many = np.tile(P, (MAX_POINTS + 1, 1))
    with pytest.raises(errors.TooLargeError, match="max_points"):
        suite.client.query_footholds(LEG, many, "cement")
    assert set_parameter(suite.client.node, "statics", "max_points", MAX_POINTS + 1).successful
    try:
        assert len(suite.client.query_footholds(LEG, many, "cement").verdict) == MAX_POINTS + 1
    finally:
        assert set_parameter(suite.client.node, "statics", "max_points", MAX_POINTS).successful


def test_a_smooth_ground_is_a_ground(suite):
    answer = suite.client.query_footholds(LEG, P, 0.0)
    assert answer.friction_coefficient == 0.0
    assert answer.load_capacity > 0.0


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        ((LEG, P, ""), {}, "ground"),
        ((LEG, P, None), {}, "ground"),
        ((LEG, P, Ground(0.4, (0.0, 1.0))), {}, "ground"),
        ((LEG, P, "cement", "heavy"), {}, "load"),
        ((LEG, P, "cement", 1.0), {"moment": [1.0]}, "moment"),
        ((LEG, [[1.0, 2.0]] * 3, "cement"), {}, "positions"),
    ],
)
def test_wrong_arguments_are_invalid_input(suite, arguments, options, words):
    with pytest.raises(errors.InvalidInputError, match=words):
        suite.client.query_footholds(*arguments, **options)


def test_the_client_limit_can_be_chosen():
    with LegClient(max_points=10) as client, pytest.raises(errors.TooLargeError, match="10"):
        client.inverse_kinematics(LEG, np.zeros((11, 3)))
