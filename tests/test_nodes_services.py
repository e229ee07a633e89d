# SPDX-License-Identifier: Apache-2.0
"""The services of the nodes: the library's answers, and clear refusals."""

import math

import numpy as np
import pytest
from leg_msgs.msg import ErrorCode, PointStatus
from leg_msgs_py import errors
from leg_msgs_py.client import SERVICES
from nodes_bad_requests import BAD, P
from nodes_support import MAX_POINTS, ask, set_parameter

from leg_kinematics import Status
from leg_kinematics.geometry import geometry_parameters
from leg_statics.efforts import joint_efforts, utilisation
from leg_statics.indices import condition_number, evaluate_indices, supported_indices

LEGS = ("left_front", "right_rear")
same = {"rtol": 1e-12, "atol": 1e-12, "equal_nan": True}


def assert_same(got, wanted):
    assert np.shape(got) == np.shape(wanted)
    np.testing.assert_allclose(got, wanted, **same)


def footholds(leg, shape=(4, 5)):
    """Return footholds about the initial one, most of them within reach, one with NaN."""
    rng = np.random.default_rng(7)
    feet = leg.mechanism.initial_posture.foot_position + rng.uniform(-0.2, 0.2, (*shape, 3))
    feet[(0,) * len(shape)] = [0.0, np.nan, -0.6]
    return feet


# --------------------------------------------------------------------------- good requests


@pytest.mark.parametrize("name", LEGS)
def test_forward_kinematics_equals_the_library(suite, hexapod, name):
    leg = hexapod.legs[name]
    joints = np.random.default_rng(1).uniform(-0.5, 0.5, (6, 3))
    joints[2, 1] = np.inf
    posture = leg.mechanism.forward(joints)
    answer = suite.client.forward_kinematics(name, joints)
    assert_same(answer.positions, posture.foot_position)
    assert_same(answer.status, posture.status)
    assert answer.status[2] == PointStatus.INVALID_INPUT


@pytest.mark.parametrize("name", LEGS)
def test_inverse_kinematics_equals_the_library(suite, hexapod, name):
    leg = hexapod.legs[name]
    feet = footholds(leg)
    posture = leg.mechanism.inverse(feet)
    answer = suite.client.inverse_kinematics(name, feet, passive_joints=True)
    assert_same(answer.joint_positions, posture.joint_positions)
    assert_same(answer.status, posture.status)
    assert_same(answer.passive_joint_positions, leg.mechanism.passive_joint_positions(posture))
    assert answer.joint_names == leg.joint_names
    assert answer.passive_joint_names == leg.passive_joint_names
    assert_same(answer.excursions, leg.mechanism.passive_joint_excursions(posture))
    assert answer.excursion_names == tuple(e.name for e in leg.mechanism.excursions)
    assert answer.assembly_modes == leg.mechanism.assembly_modes[:1]
    assert len(set(answer.status.ravel())) >= 3  # the sample is worth testing


def test_inverse_kinematics_solves_all_assembly_modes(suite, hexapod):
    leg = hexapod.legs["left_front"]
    feet = footholds(leg, (3,))
    answer = suite.client.inverse_kinematics("left_front", feet, assembly_mode="ALL")
    modes = leg.mechanism.assembly_modes
    assert answer.assembly_modes == modes
    assert answer.joint_positions.shape == (len(modes), 3, 3)
    for k, mode in enumerate(modes):
        posture = leg.mechanism.inverse(feet, mode)
        assert_same(answer.joint_positions[k], posture.joint_positions)
        assert_same(answer.status[k], posture.status)


def test_jacobian_of_positions_equals_the_library(suite, hexapod):
    leg = hexapod.legs["right_rear"]
    feet = footholds(leg)
    posture = leg.mechanism.inverse(feet)
    answer = suite.client.jacobian("right_rear", feet)
    assert_same(answer.jacobian, leg.mechanism.jacobian(posture))
    assert_same(answer.angular_jacobian, leg.mechanism.angular_jacobian(posture))
    assert_same(answer.status, posture.status)
    wanted = condition_number(leg.mechanism.jacobian(posture))
    np.testing.assert_allclose(answer.condition_number, wanted, rtol=1e-9)


def test_jacobian_of_joint_positions_equals_that_of_positions(suite, hexapod):
    leg = hexapod.legs["right_rear"]
    feet = footholds(leg)[1]
    ok = leg.mechanism.inverse(feet).status == Status.OK
    by_feet = suite.client.jacobian("right_rear", feet[ok])
    joints = suite.client.inverse_kinematics("right_rear", feet[ok]).joint_positions
    by_joints = suite.client.jacobian("right_rear", joint_positions=joints)
    np.testing.assert_allclose(by_joints.jacobian, by_feet.jacobian, rtol=1e-9, atol=1e-9)


def test_indices_equal_the_library(suite, hexapod):
    leg = hexapod.legs["left_front"]
    feet = footholds(leg)
    posture = leg.mechanism.inverse(feet)
    names, values = evaluate_indices(leg.mechanism, posture)
    answer = suite.client.evaluate_indices("left_front", feet)
    assert answer.names == names == supported_indices(leg.mechanism)
    assert_same(answer.values, values)
    assert_same(answer.status, posture.status)
    assert np.isnan(answer.values[answer.status != PointStatus.OK]).all()


def test_indices_come_in_the_order_asked_for(suite, hexapod):
    names = supported_indices(hexapod.legs["left_front"].mechanism)[:2][::-1]
    foot = hexapod.legs["left_front"].mechanism.initial_posture.foot_position
    answer = suite.client.evaluate_indices("left_front", foot, names)
    assert answer.names == names
    assert answer.values.shape == (2,)
    assert len(answer.symbols) == len(answer.units) == 2


@pytest.mark.parametrize("moment", [None, [20.0, -5.0, 3.0]], ids=["hard", "soft"])
def test_efforts_equal_the_library(suite, hexapod, moment):
    leg = hexapod.legs["right_rear"]
    feet = footholds(leg)
    posture = leg.mechanism.inverse(feet)
    force = [10.0, -40.0, 300.0]
    efforts = joint_efforts(
        leg.mechanism.jacobian(posture),
        leg.mechanism.angular_jacobian(posture),
        force,
        moment or [0.0] * 3,
    )
    efforts[posture.status != Status.OK] = np.nan
    used, joint = utilisation(efforts, leg.effort_limits)
    answer = suite.client.compute_efforts("right_rear", feet, force, moment)
    assert_same(answer.joint_efforts, efforts)
    assert_same(answer.utilisation, used)
    assert_same(answer.limiting_joint, joint)
    assert (answer.limiting_joint[answer.status != PointStatus.OK] == -1).all()


def test_efforts_take_a_force_and_a_moment_for_each_point(suite, hexapod):
    leg = hexapod.legs["left_front"]
    feet = leg.mechanism.initial_posture.foot_position + np.zeros((2, 3))
    forces = np.array([[0.0, 0.0, 100.0], [0.0, 50.0, 200.0]])
    moments = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    batch = suite.client.compute_efforts("left_front", feet, forces, moments)
    for k in range(2):
        one = suite.client.compute_efforts("left_front", feet[k], forces[k], moments[k])
        assert_same(batch.joint_efforts[k], one.joint_efforts)


def test_a_force_that_is_not_finite_spoils_only_its_point(suite, hexapod):
    foot = hexapod.legs["left_front"].mechanism.initial_posture.foot_position
    forces = np.array([[0.0, 0.0, np.nan], [0.0, 0.0, 100.0]])
    answer = suite.client.compute_efforts("left_front", np.tile(foot, (2, 1)), forces)
    assert list(answer.status) == [PointStatus.INVALID_INPUT, PointStatus.OK]
    assert np.isnan(answer.joint_efforts[0]).all()
    assert np.isfinite(answer.joint_efforts[1]).all()


def test_the_description_equals_the_robot(suite, hexapod):
    assert suite.client.legs() == tuple(hexapod.legs)
    for name in LEGS:
        leg = hexapod.legs[name]
        mechanism = leg.mechanism
        told = suite.client.describe(name)
        assert (told.leg, told.leg_type, told.mirrored) == (name, leg.leg_type, leg.mirrored)
        assert (told.base_frame, told.leg_frame) == (hexapod.base_frame, leg.frame)
        assert told.joint_names == leg.joint_names
        assert told.task_coordinates == mechanism.task_coordinates
        assert told.assembly_modes == mechanism.assembly_modes
        assert told.index_names == supported_indices(mechanism)
        assert_same(told.joint_limits, mechanism.joint_limits)
        assert told.passive_joint_names == leg.passive_joint_names
        assert told.passive_joint_types == tuple(j.type for j in mechanism.passive_joints)
        assert told.passive_joint_units == tuple(j.unit for j in mechanism.passive_joints)
        assert told.excursion_names == tuple(e.name for e in mechanism.excursions)
        assert told.excursion_units == tuple(e.unit for e in mechanism.excursions)
        assert_same(told.excursion_limits, mechanism.passive_joint_limits)
        assert_same(told.initial_foot_position, mechanism.initial_posture.foot_position)
        assert_same(told.mount_position, leg.mount.position)
        assert math.isclose(np.linalg.norm(told.mount_orientation), 1.0)
        assert {n: p.value for n, p in told.geometry.items()} == {
            f.name: getattr(leg.geometry, f.name) for f in geometry_parameters(leg.geometry)
        }


# --------------------------------------------------------------------------- frames


@pytest.mark.parametrize("name", LEGS)
def test_the_base_frame_is_the_leg_frame_moved_by_the_mount(suite, hexapod, name):
    leg = hexapod.legs[name]
    base = hexapod.base_frame
    feet = footholds(leg, (6,))[1:]
    feet_in_base = leg.mount.to_base(feet)
    here = suite.client.inverse_kinematics(name, feet)
    there = suite.client.inverse_kinematics(name, feet_in_base, frame=base)
    np.testing.assert_allclose(there.joint_positions, here.joint_positions, atol=1e-9)
    assert_same(there.status, here.status)
    joints = np.zeros((2, 3))
    forward = suite.client.forward_kinematics(name, joints, frame=base)
    own = suite.client.forward_kinematics(name, joints, frame=leg.frame)
    assert_same(forward.positions, leg.mount.to_base(own.positions))
    jacobian = suite.client.jacobian(name, joint_positions=joints, frame=base)
    own_jacobian = suite.client.jacobian(name, joint_positions=joints)
    assert_same(jacobian.jacobian, leg.mount.rotation @ own_jacobian.jacobian)
    assert_same(jacobian.angular_jacobian, leg.mount.rotation @ own_jacobian.angular_jacobian)


def test_forces_and_moments_turn_with_the_frame(suite, hexapod):
    leg = hexapod.legs["left_front"]
    feet = footholds(leg, (6,))[1:]
    force, moment = np.array([30.0, -20.0, 300.0]), np.array([5.0, 10.0, -2.0])
    own = suite.client.compute_efforts("left_front", feet, force, moment)
    base = suite.client.compute_efforts(
        "left_front",
        leg.mount.to_base(feet),
        leg.mount.vectors_to_base(force),
        leg.mount.vectors_to_base(moment),
        frame=hexapod.base_frame,
    )
    np.testing.assert_allclose(base.joint_efforts, own.joint_efforts, atol=1e-8)


def test_power_is_the_same_in_either_frame(suite, hexapod):
    base = hexapod.base_frame
    foot = suite.client.forward_kinematics("right_rear", np.zeros(3), frame=base).positions
    force = np.array([15.0, 25.0, 200.0])
    jacobian = suite.client.jacobian("right_rear", foot, frame=base).jacobian
    efforts = suite.client.compute_efforts("right_rear", foot, force, frame=base).joint_efforts
    np.testing.assert_allclose(efforts, -jacobian.T @ force, rtol=1e-9)


# --------------------------------------------------------------------------- shapes


def test_leading_axes_come_back(suite, hexapod):
    leg = hexapod.legs["left_front"]
    foot = leg.mechanism.initial_posture.foot_position
    assert suite.client.inverse_kinematics("left_front", foot).joint_positions.shape == (3,)
    assert suite.client.inverse_kinematics("left_front", foot).status.shape == ()
    grid = np.broadcast_to(foot, (2, 3, 4, 3))
    assert suite.client.jacobian("left_front", grid).jacobian.shape == (2, 3, 4, 3, 3)
    assert suite.client.evaluate_indices("left_front", grid).values.shape[:3] == (2, 3, 4)


@pytest.mark.parametrize("empty", [[], np.empty((0, 3)), np.empty((2, 0, 3))], ids=str)
def test_no_points_give_no_answers(suite, empty):
    client = suite.client
    batch = np.shape(empty)[:-1] or (0,)
    assert client.inverse_kinematics("left_front", empty).joint_positions.shape == (*batch, 3)
    assert client.forward_kinematics("left_front", empty).positions.shape == (*batch, 3)
    assert client.jacobian("left_front", empty).condition_number.shape == batch
    assert client.evaluate_indices("left_front", empty).values.shape[:-1] == batch
    efforts = client.compute_efforts("left_front", empty, [0.0, 0.0, 1.0])
    assert efforts.joint_efforts.shape == (*batch, 3)


def test_as_many_points_as_allowed_are_answered(suite, hexapod):
    foot = hexapod.legs["left_front"].mechanism.initial_posture.foot_position
    answer = suite.client.inverse_kinematics("left_front", np.tile(foot, (MAX_POINTS, 1)))
    assert len(answer.status) == MAX_POINTS


# --------------------------------------------------------------------------- bad requests


@pytest.mark.parametrize("case", BAD.values(), ids=BAD.keys())
def test_a_bad_request_is_refused_and_the_next_one_answered(suite, hexapod, case):
    service, fields, code, words = case
    fields = dict(fields)
    frame = fields.pop("frame", None)
    request = SERVICES[service].interface.Request(**fields)
    if hasattr(request, "leg") and "leg" not in fields:
        request.leg = "left_front"
    if frame is not None:
        request.header.frame_id = frame
    with pytest.raises(errors.LegServiceError) as caught:
        ask(suite.client, service, request)
    assert caught.value.code == getattr(ErrorCode, code)
    assert type(caught.value) is errors.ERRORS[caught.value.code]
    for word in words:
        assert word in caught.value.message
    foot = hexapod.legs["left_front"].mechanism.initial_posture.foot_position
    np.testing.assert_allclose(
        suite.client.inverse_kinematics("left_front", foot).joint_positions, 0.0, atol=1e-9
    )
    assert suite.client.describe("left_front").effort_limits.tolist() == [[-150.0, 150.0]] * 3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("left_front", np.zeros((4, 2))), "positions"),
        (("left_front", np.zeros((3, 2))), "positions"),  # 6 values, which would be two points
        (("left_front", 0.5), "positions"),
        (("left_front", [["a", "b", "c"]]), "positions"),
        (("left_front", [[0.0, 1.0, 2.0], [0.0]]), "positions"),
    ],
)
def test_wrong_shapes_are_invalid_input(suite, arguments, words):
    with pytest.raises(errors.InvalidInputError, match=words):
        suite.client.inverse_kinematics(*arguments)


def test_forces_must_fit_the_points(suite):
    with pytest.raises(errors.InvalidInputError, match="forces"):
        suite.client.compute_efforts("left_front", np.zeros((4, 3)), np.zeros((2, 3)))


def test_a_jacobian_needs_one_kind_of_pose(suite):
    with pytest.raises(errors.InvalidInputError, match="either"):
        suite.client.jacobian("left_front")
    with pytest.raises(errors.InvalidInputError, match="either"):
        suite.client.jacobian("left_front", P, joint_positions=[0.0] * 3)


def test_the_limit_of_points_is_a_parameter(suite):
    points = np.tile(P, (MAX_POINTS + 1, 1))
    node = suite.client.node
    assert set_parameter(node, "kinematics", "max_points", MAX_POINTS + 1).successful
    try:
        assert len(suite.client.inverse_kinematics("left_front", points).status) == MAX_POINTS + 1
    finally:
        assert set_parameter(node, "kinematics", "max_points", MAX_POINTS).successful
    with pytest.raises(errors.TooLargeError):
        suite.client.inverse_kinematics("left_front", points)
