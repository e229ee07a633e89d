# SPDX-License-Identifier: Apache-2.0
"""Contacts of requests: one for all or one for each, for one leg or many, in any frame."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion
from hypothesis import given
from hypothesis import strategies as st
from leg_msgs.msg import ErrorCode
from leg_msgs.msg import Ground as GroundMessage
from leg_msgs.srv import QueryFootholds, QueryStepLength
from leg_msgs_py.client import Frame, Ground, LegClient
from leg_msgs_py.errors import InvalidInputError, check
from scipy.spatial.transform import Rotation
from test_services import SERVED, Host

from leg_kinematics import load_robot
from leg_statics import Contact, GroundProfile, evaluate_footholds, longest_step
from leg_statics.step_length import PROFILE_POINTS

LEG = "left_front"
RANDOM = np.random.default_rng(15)
NUMBERS = (
    *("verdict", "status", "load_capacity", "rated_friction", "rated_friction_full"),
    *("friction_margin", "utilisation", "clearance", "margin", "limiting_joint"),
)
G = 9.80665


@pytest.fixture(scope="module", params=["hexapod", "solo12"])
def robot(request):
    return load_robot(request.param)


@pytest.fixture(scope="module")
def hexapod():
    return load_robot("hexapod")


def ask(robot, question, *arguments, **options):
    """Return the answer to a question as a node gives it, without a node."""
    method = vars(LegClient)[question]
    request = method.make(*arguments, **options)
    response = answer(robot, method.name, request.message)
    check(response.error)
    return request.decode(response)


def answer(robot, service, request):
    return SERVED[service].answer(Host(robot), request, SERVED[service].type.Response())


def feet_of(leg, count):
    """Return feet in and around the workspace, in the leg frame."""
    middle = leg.mechanism.initial_posture.foot_position
    return middle + RANDOM.normal(size=(count, 3)) * 0.25 * np.linalg.norm(middle)


def mixed(count, joints, weight):
    """Return arguments of contacts that differ from each other."""
    normal = RANDOM.normal(size=(count, 3)) * 0.3 + [0.0, 0.0, 1.0]
    return {
        "ground": Ground(RANDOM.uniform(0.1, 1.0, count), normal),
        "load": RANDOM.uniform(0.0, 1.5, count) * weight,
        "moment": RANDOM.normal(size=(count, 3)) * 0.01 * weight,
        "any_direction_moment": RANDOM.uniform(0.0, 0.01, count) * weight,
        "bias_efforts": RANDOM.normal(size=(count, joints)) * 0.01 * weight,
    }


def part(options, k):
    """Return the arguments of one candidate."""
    ground = options["ground"]
    one = {name: value[k] for name, value in options.items() if name != "ground"}
    return {**one, "ground": Ground(ground.friction[k], ground.normal[k])}


def same(one, other, names=NUMBERS):
    for name in names:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def turn_of(vector):
    """Return a rotation by a vector."""
    return Rotation.from_rotvec(vector)


def pose_of(position, rotation):
    x, y, z, w = rotation.as_quat()
    place = dict(zip("xyz", map(float, position), strict=True))
    return Pose(position=Point(**place), orientation=Quaternion(x=x, y=y, z=z, w=w))


# --------------------------------------------------------------------------- one or each


@pytest.mark.parametrize("frame", ["own", "base", "map"])
def test_mixed_candidates_equal_single_requests_bit_for_bit(robot, frame):
    name = next(iter(robot.legs))
    leg, weight = robot.leg(name), 300.0 if robot.name == "hexapod" else 40.0
    feet, options = feet_of(leg, 60), mixed(60, len(leg.joint_names), weight)
    where = {"frame": ""}
    if frame == "base":
        feet, where = leg.mount.to_base(feet), {"frame": robot.base_frame}
    if frame == "map":
        pose = np.concatenate([[3.0, -2.0, 0.7], turn_of([0.1, -0.2, 2.0]).as_quat()])
        feet = turn_of([0.1, -0.2, 2.0]).apply(leg.mount.to_base(feet)) + pose[:3]
        where = {"frame": Frame("map", pose), "gravity": (0.5, -1.0, -9.6)}
    ground = options.pop("ground")
    together = ask(robot, "query_footholds", name, feet, ground, efforts=True, **options, **where)
    options["ground"] = ground
    assert len(set(together.verdict)) >= 3
    for k in range(len(feet)):
        alone = ask(
            robot, "query_footholds", name, feet[k], efforts=True, **part(options, k), **where
        )
        for field in (*NUMBERS, "joint_efforts", "force"):
            np.testing.assert_array_equal(
                getattr(together, field)[k], getattr(alone, field), err_msg=field
            )
        assert together.friction_coefficient[k] == alone.friction_coefficient


def test_arrays_broadcast_as_in_the_library(hexapod):
    leg = hexapod.leg(LEG)
    feet = feet_of(leg, 12).reshape(3, 4, 3)
    mu, load = np.array([[0.2], [0.4], [0.8]]), np.array([50.0, 100.0, 300.0, 600.0])
    found = ask(hexapod, "query_footholds", LEG, feet, mu, load)
    wanted = evaluate_footholds(leg, feet, Contact(mu, load=load))
    same(found, wanted)
    np.testing.assert_array_equal(found.ranking, wanted.ranking)
    np.testing.assert_array_equal(found.friction_coefficient, np.broadcast_to(mu, (3, 4)))


def test_a_request_of_several_legs_is_the_requests_of_each(hexapod):
    counts = {"left_front": 7, "right_rear": 0, "left_middle": 4}
    legs = {name: hexapod.leg(name) for name in counts}
    feet = {name: leg.mount.to_base(feet_of(leg, counts[name])) for name, leg in legs.items()}
    options = {name: mixed(count, 3, 300.0) for name, count in counts.items()}
    together = ask(
        hexapod,
        "query_footholds_of_legs",
        feet,
        efforts=True,
        **{key: {name: options[name][key] for name in counts} for key in options["left_front"]},
    )
    assert list(together) == list(counts)
    for name in counts:
        ground = options[name].pop("ground")
        base = hexapod.base_frame
        alone = ask(
            hexapod,
            *("query_footholds", name, feet[name], ground),
            efforts=True,
            frame=base,
            **options[name],
        )
        same(together[name], alone, (*NUMBERS, "ranking", "best", "joint_efforts", "force"))
        assert together[name].joint_names == hexapod.leg(name).joint_names


def test_every_leg_has_a_best_of_its_own(hexapod):
    feet = {}
    for name, leg in hexapod.legs.items():
        own = np.tile(leg.mechanism.initial_posture.foot_position, (2, 1))
        own[0, 2] = -9.0
        feet[name] = leg.mount.to_base(own)
    feet["left_rear"] = feet["left_rear"][:1]
    found = ask(hexapod, "query_footholds_of_legs", feet, "cement", 100.0)
    assert {name: each.best for name, each in found.items()} == {
        name: -1 if name == "left_rear" else 1 for name in hexapod.legs
    }


def test_a_plain_request_is_one_leg_one_ground_one_load(hexapod):
    request = QueryFootholds.Request(legs=[LEG], positions=[0.1, 0.0, -0.6])
    request.ground.name = "cement"
    request.required_load = [300.0]
    response = answer(hexapod, "query_footholds", request)
    assert response.error.code == ErrorCode.SUCCESS
    assert list(response.best) == [0]
    assert list(response.weight_counted) == [False]
    wanted = evaluate_footholds(hexapod.leg(LEG), (0.1, 0.0, -0.6), Contact(0.4, load=300.0))
    assert response.load_capacity[0] == wanted.load_capacity


def test_a_branch_is_that_of_the_mechanism(hexapod):
    leg = hexapod.leg(LEG)
    feet = feet_of(leg, 20)
    for mode in leg.mechanism.assembly_modes[:3]:
        found = ask(hexapod, "query_footholds", LEG, feet, 0.4, 100.0, assembly_mode=mode)
        np.testing.assert_array_equal(found.status, leg.mechanism.inverse(feet, mode).status)
        same(found, evaluate_footholds(leg, feet, Contact(0.4, load=100.0), mode))


def test_weight_is_told_where_it_counts(robot):
    name, known = next(iter(robot.legs)), robot.name == "solo12"
    foot = robot.leg(name).mechanism.initial_posture.foot_position
    assert ask(robot, "query_footholds", name, foot, 0.4).weight_counted == known
    assert ask(robot, "compute_efforts", name, foot, (0.0, 0.0, 1.0)).weight_counted == known
    assert ask(robot, "query_step_length", name, foot[2], 0.4).weight_counted.tolist() == [known]
    assert ask(robot, "describe", name).weight_counted == known


# --------------------------------------------------------------------------- direction and frame


def test_loads_along_the_normal_are_those_of_a_body_under_which_the_ground_is_level(hexapod):
    leg = hexapod.leg(LEG)
    feet, normal = feet_of(leg, 50), np.array([0.3, -0.2, 1.0])
    along = ask(
        hexapod, "query_footholds", LEG, feet, Ground(0.4, normal), 200.0, along_normal=True
    )
    under = ask(hexapod, "query_footholds", LEG, feet, 0.4, 200.0, gravity=-normal)
    np.testing.assert_array_equal(along.verdict, under.verdict)
    np.testing.assert_allclose(along.load_capacity, under.load_capacity, rtol=1e-9)
    vertical = ask(hexapod, "query_footholds", LEG, feet, Ground(0.4, normal), 200.0)
    assert np.nanmax(np.abs(vertical.load_capacity - along.load_capacity)) > 1.0


@given(st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
def test_turning_body_gravity_and_ground_together_changes_nothing(robot, numbers):
    place, turn = np.array(numbers[:3]), turn_of(numbers[3:])
    name = next(iter(robot.legs))
    leg, weight = robot.leg(name), 300.0 if robot.name == "hexapod" else 10.0
    feet = leg.mount.to_base(leg.mechanism.initial_posture.foot_position)
    feet = feet + 0.1 * np.linalg.norm(leg.mount.to_leg(feet)) * SPREAD
    normal, gravity, moment = SPREAD * 0.3 + [0.0, 0.0, 1.0], [1.0, -2.0, -9.3], [0.1, 0.0, 0.2]
    base = ask(
        robot,
        *("query_footholds", name, feet, Ground(0.4, normal), weight),
        moment=moment,
        gravity=gravity,
        frame=robot.base_frame,
        efforts=True,
    )
    around = ask(
        robot,
        *("query_footholds", name, turn.apply(feet) + place, Ground(0.4, turn.apply(normal))),
        weight,
        moment=turn.apply(moment),
        gravity=turn.apply(gravity),
        frame=Frame("map", pose_of(place, turn)),
        efforts=True,
    )
    np.testing.assert_array_equal(around.verdict, base.verdict)
    for field in ("load_capacity", "utilisation", "margin", "joint_efforts"):
        wanted = getattr(base, field)
        scale = np.nanmax(np.abs(wanted))
        np.testing.assert_allclose(getattr(around, field), wanted, rtol=1e-6, atol=1e-7 * scale)
    force = turn.apply(np.nan_to_num(base.force))
    np.testing.assert_allclose(np.nan_to_num(around.force), force, rtol=1e-6, atol=1e-5 * weight)


SPREAD = np.random.default_rng(3).normal(size=(8, 3))


def test_a_level_map_needs_no_gravity_and_a_pitched_body_gets_its_own(hexapod):
    leg, pitch = hexapod.leg(LEG), turn_of([0.0, 0.25, 0.0])
    feet = leg.mount.to_base(feet_of(leg, 40))
    frame = Frame("odom", pose_of([1.0, 2.0, 0.5], pitch))
    around = pitch.apply(feet) + np.array([1.0, 2.0, 0.5])
    level = ask(hexapod, "query_footholds", LEG, around, 0.4, 200.0, frame=frame)
    down = pitch.inv().apply([0.0, 0.0, -G])
    told = ask(
        hexapod, "query_footholds", LEG, feet, 0.4, 200.0, gravity=down, frame=hexapod.base_frame
    )
    np.testing.assert_array_equal(level.verdict, told.verdict)
    np.testing.assert_allclose(level.load_capacity, told.load_capacity, rtol=1e-7)


@pytest.mark.parametrize(
    "question", ["inverse_kinematics", "jacobian", "evaluate_indices", "compute_efforts"]
)
def test_every_question_about_positions_takes_a_frame_around_the_robot(hexapod, question):
    leg, turn, place = hexapod.leg(LEG), turn_of([0.2, -0.1, 1.0]), np.array([4.0, 5.0, 6.0])
    feet = leg.mount.to_base(leg.mechanism.initial_posture.foot_position + 0.05 * SPREAD)
    more = (np.array([10.0, 0.0, 100.0]),) if question == "compute_efforts" else ()
    turned = [turn.apply(vector) for vector in more]
    base = ask(hexapod, question, LEG, feet, *more, frame=hexapod.base_frame)
    frame = Frame("map", pose_of(place, turn))
    around = ask(hexapod, question, LEG, turn.apply(feet) + place, *turned, frame=frame)
    np.testing.assert_array_equal(around.status, base.status)
    if question == "jacobian":
        rows = turn.as_matrix() @ base.jacobian
        np.testing.assert_allclose(around.jacobian, rows, atol=1e-9)
    else:
        np.testing.assert_allclose(around[0], base[0], rtol=1e-6, atol=1e-7)


def test_forward_kinematics_answers_in_a_frame_around_the_robot(hexapod):
    turn, place = turn_of([0.0, 0.3, 1.0]), np.array([1.0, 2.0, 3.0])
    base = ask(hexapod, "forward_kinematics", LEG, [0.1, 0.0, -0.1], frame=hexapod.base_frame)
    frame = Frame("map", [*place, *turn.as_quat()])
    around = ask(hexapod, "forward_kinematics", LEG, [0.1, 0.0, -0.1], frame=frame)
    np.testing.assert_allclose(around.positions, turn.apply(base.positions) + place, atol=1e-12)


# --------------------------------------------------------------------------- profiles


def test_a_flat_profile_is_level_ground(hexapod):
    plain = ask(hexapod, "query_step_length", (), [-0.6, -0.7], 0.3, 200.0)
    flat = ask(
        hexapod,
        "query_step_length",
        (),
        [-0.7, -0.8],
        0.3,
        200.0,
        profile=([-2.0, 2.0], [0.1, 0.1]),
    )
    np.testing.assert_allclose(flat.length, plain.length, atol=3e-6)
    np.testing.assert_allclose(flat.start, plain.start, atol=3e-6)


def test_a_slope_of_the_ground_is_a_sloped_line_with_a_sloped_normal(hexapod):
    leg, rise = hexapod.leg(LEG), 0.2
    profile = GroundProfile([-1.0, 1.0], [-rise, rise])
    normal = (-rise, 0.0, 1.0)
    step = longest_step(leg, -0.65, Contact(0.4, normal, load=200.0), profile=profile)
    assert step.length > 0.1
    s = np.linspace(step.start[0] + 1e-4, step.end[0] - 1e-4, 50)
    points = np.stack([s, 0.0 * s, -0.65 + rise * s], axis=-1)
    np.testing.assert_allclose(step.start[2], -0.65 + rise * step.start[0], atol=1e-12)
    inside = evaluate_footholds(leg, points, Contact(0.4, normal, load=200.0))
    assert inside.feasible.all()
    beyond = [step.start - 1e-4 * np.array([1, 0, rise]), step.end + 1e-4 * np.array([1, 0, rise])]
    outside = evaluate_footholds(leg, np.array(beyond), Contact(0.4, normal, load=200.0))
    assert outside.verdict.tolist() == [step.start_limit, step.end_limit]


def test_a_gap_and_a_slippery_patch_of_a_profile_end_a_step(hexapod):
    whole = ask(hexapod, "query_step_length", LEG, -0.65, 0.5, 200.0)
    start, end = whole.start[0, 0], whole.end[0, 0]
    far = [start - 1.0, 0.02, 0.03, end + 1.0]
    gap = ask(
        hexapod, "query_step_length", LEG, -0.65, 0.5, 200.0, profile=(far, [0, 0, math.nan, 0])
    )
    np.testing.assert_allclose(gap.end[0, 0], 0.02, atol=1e-5)
    assert gap.end_limit[0] == 5  # INVALID_INPUT: no ground
    np.testing.assert_allclose(gap.start[0, 0], start, atol=1e-5)
    mu = [0.5, 0.5, 0.0, 0.0]
    slips = ask(
        *(hexapod, "query_step_length", LEG, -0.65, Ground(mu)),
        by_rated_friction=True,
        profile=(far, [0.0] * 4),
    )
    assert 0.02 < slips.end[0, 0] < 0.03
    assert slips.end_limit[0] == 6  # FRICTION
    np.testing.assert_array_equal(slips.friction_coefficient, mu)
    assert slips.load_capacity.shape == (1, PROFILE_POINTS)


# --------------------------------------------------------------------------- bad requests

P = [0.1, 0.0, -0.6]
TWO = P * 2
BAD = {
    "three frictions for two": (
        {"positions": TWO, "ground": GroundMessage(friction_coefficients=[0.4] * 3)},
        ["ground.friction_coefficients", "got 3", "1", "2 for the 2"],
    ),
    "name and friction": (
        {"ground": GroundMessage(name="ice", friction_coefficients=[0.4])},
        ["ground", "'ice'", "both given"],
    ),
    "half a normal": (
        {"ground": GroundMessage(name="ice", normals=[0.0, 1.0])},
        ["ground.normals", "got 2", "3 (x, y, z)"],
    ),
    "a bad normal of two": (
        {"positions": TWO, "ground": GroundMessage(name="ice", normals=[0, 0, 1, 0, math.nan, 1])},
        ["ground.normals[4]", "nan", "finite"],
    ),
    "a bad load of two": (
        {"positions": TWO, "required_load": [1.0, -2.0]},
        ["required_load[1]", "-2.0", ">= 0 N"],
    ),
    "loads": ({"positions": TWO, "required_load": [1.0] * 3}, ["required_load", "got 3"]),
    "moments": ({"positions": TWO, "required_moment": [1.0] * 4}, ["required_moment", "got 4"]),
    "gravity": ({"gravity": [0.0, math.inf, 0.0]}, ["gravity[1]", "inf", "finite"]),
    "direction of loads": ({"load_direction": 2}, ["load_direction", "got 2", "ALONG_NORMAL"]),
    "mode": ({"assembly_mode": "x"}, ["assembly mode", "'x'"]),
    "leg twice": ({"legs": [LEG, LEG], "positions": TWO}, ["legs", LEG, "twice"]),
    "no legs": ({"legs": []}, ["leg", "''", LEG]),
    "shares": (
        {"legs": [LEG, "right_rear"], "positions": P * 3},
        ["candidates", "got none", "3 points"],
    ),
    "candidates": (
        {"legs": [LEG, "right_rear"], "positions": TWO, "candidates": [2, 1]},
        ["candidates", "[2, 1], 3 in all", "2 points"],
    ),
    "numbers of candidates": (
        {"legs": [LEG, "right_rear"], "positions": TWO, "candidates": [2]},
        ["candidates", "got 1 numbers", "2 (one a leg)"],
    ),
    "frame of one for several": (
        {"legs": [LEG, "right_rear"], "positions": TWO, "frame": "left_front_leg"},
        ["header.frame_id", "left_front_leg", "base_link"],
    ),
    "pose in the base frame": (
        {"base_pose": [Pose()], "frame": "base_link"},
        ["base_pose", "base_link", "frame of the robot"],
    ),
    "pose without a frame": ({"base_pose": [Pose()]}, ["base_pose", "''"]),
    "no quaternion": (
        {"base_pose": [Pose(orientation=Quaternion(w=2.0))], "frame": "map"},
        ["base_pose.orientation", "length 2", "length 1"],
    ),
    "no place": (
        {"base_pose": [Pose(position=Point(x=math.nan))], "frame": "map"},
        ["base_pose.position", "nan", "finite"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD.values(), ids=BAD.keys())
def test_a_bad_request_tells_the_field_what_it_was_and_what_is_allowed(hexapod, case):
    fields, words = case
    fields = {"legs": [LEG], "positions": P, "ground": GroundMessage(name="ice"), **fields}
    frame = fields.pop("frame", "")
    request = QueryFootholds.Request(**fields)
    request.header.frame_id = frame
    response = answer(hexapod, "query_footholds", request)
    assert response.error.code in (ErrorCode.INVALID_INPUT, ErrorCode.UNKNOWN_LEG)
    for word in words:
        assert word in response.error.message


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"profile_distances": [0.0, 1.0]}, ["profile_heights", "got 0", "2 (one a distance)"]),
        ({"profile_heights": [0.0]}, ["profile_heights", "got 1", "allowed: 0"]),
        (
            {"profile_distances": [0.0, 0.0], "profile_heights": [0.0, 0.0]},
            ["profile_distances", "[0.0, 0.0]", "increase"],
        ),
        (
            {"profile_distances": [1.0], "profile_heights": [0.0]},
            ["profile_distances", "2 and more"],
        ),
        (
            {
                "profile_distances": [0.0, 1.0],
                "profile_heights": [0.0, 0.0],
                "ground": GroundMessage(friction_coefficients=[0.1] * 3),
            },
            ["ground.friction_coefficients", "got 3", "2 for the 2"],
        ),
    ],
)
def test_a_bad_profile_is_told(hexapod, fields, words):
    fields = {"legs": [LEG], "heights": [-0.6], "ground": GroundMessage(name="ice"), **fields}
    response = answer(hexapod, "query_step_length", QueryStepLength.Request(**fields))
    assert response.error.code == ErrorCode.INVALID_INPUT
    for word in words:
        assert word in response.error.message


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        (({LEG: P}, {LEG: "ice"}), {}, "ground of left_front: got the name 'ice'"),
        (({LEG: P}, 0.4, {"tail": 1.0}), {}, "load: given for the legs tail; allowed: one for all"),
        (({LEG: P}, 0.4, {LEG: [1.0, 2.0]}), {}, "load of left_front"),
        (({}, 0.4), {}, "at least one leg"),
        (({LEG: [[1.0, 2.0]]}, 0.4), {}, r"positions of left_front must have shape \(\.\.\., 3\)"),
        (({LEG: P}, 0.4), {"frame": Frame("map", [1.0, 2.0])}, "base_pose must be"),
        (({LEG: P}, 0.4), {"frame": Frame("map", "here")}, "base_pose must be"),
    ],
)
def test_arguments_that_do_not_fit_are_told_before_they_are_sent(arguments, options, words):
    with pytest.raises(InvalidInputError, match=words):
        vars(LegClient)["query_footholds_of_legs"].make(*arguments, **options)
