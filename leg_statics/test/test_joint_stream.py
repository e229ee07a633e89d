# SPDX-License-Identifier: Apache-2.0
"""Joint states to leg states: the same numbers as the functions of the library, one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from leg_kinematics import Robot, Status, ValueRangeError, load_robot
from leg_kinematics.robot import Drives, Leg, Mount
from leg_statics.capacity.problem import load_capacity
from leg_statics.efforts import utilisation
from leg_statics.footholds import Contact, evaluate_footholds
from leg_statics.indices import evaluate_indices, supported_indices
from leg_statics.joint_stream import KNOWN_LAYOUTS, JointStateError, JointStream, StampOrder
from leg_statics.leg_state import ContactState
from leg_statics.weight import weight_efforts

FRICTION = 0.4
SAME = {"rtol": 1e-12, "atol": 1e-12}


def joint_names(robot):
    return robot.effort_limits()[0]


def random_joint_states(robot, count, seed=1):
    """Positions in and beyond the joint ranges, some not finite; velocities and efforts."""
    rng = np.random.default_rng(seed)
    ranges = np.concatenate([leg.mechanism.joint_limits for leg in robot.legs.values()])
    lower, upper = np.maximum(ranges[:, 0], -7.0), np.minimum(ranges[:, 1], 7.0)
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    position = middle + 1.2 * half * rng.uniform(-1.0, 1.0, (count, len(ranges)))
    position[rng.random(position.shape) < 0.01] = np.nan
    velocity, effort = rng.normal(size=(2, *position.shape))
    return position, velocity, 100.0 * effort


def test_load_capacity_of_a_tilted_leg_is_vertical_on_level_ground():
    """A robot whose hips are turned: legs on both sides carry what a foothold's query says."""
    robot = load_robot("hexapod")
    tilts = {name: Rotation.random(rng=k).as_matrix() for k, name in enumerate(robot.legs)}
    legs = {
        name: replace(leg, mount=Mount(leg.mount.position, tilts[name]))
        for name, leg in robot.legs.items()
    }
    tilted = replace(robot, legs=legs)
    position, _, _ = random_joint_states(tilted, 50)
    states = JointStream(tilted, FRICTION).read(joint_names(tilted), position)
    for k, leg in enumerate(legs.values()):
        ok = states.status[:, k] == Status.OK
        found = evaluate_footholds(leg, states.foot_position[ok, k], Contact(FRICTION))
        np.testing.assert_allclose(states.load_capacity[ok, k], found.load_capacity, rtol=1e-6)


@pytest.mark.parametrize("name", ["hexapod", "solo12"])
def test_loads_count_against_the_gravity_of_each_moment(name):
    robot = load_robot(name)
    position, velocity, effort = random_joint_states(robot, 40)
    gravity = np.random.default_rng(2).normal(size=(40, 3)) - [0.0, 0.0, 9.0]
    gravity[7] = np.nan
    stream, names = JointStream(robot, FRICTION), joint_names(robot)
    states = stream.read(names, position, velocity, effort, gravity)
    assert np.isnan(states.load_capacity[7]).all()
    assert not states.contact[7].any()
    level = stream.read(names, position, velocity, effort)
    np.testing.assert_array_equal(states.status, level.status)
    for k, leg in enumerate(robot.legs.values()):
        ok = (states.status[:, k] == Status.OK) & np.isfinite(gravity[:, 0])
        own = leg.mount.vectors_to_leg(gravity[ok])
        found = evaluate_footholds(leg, states.foot_position[ok, k], Contact(FRICTION, gravity=own))
        np.testing.assert_allclose(states.load_capacity[ok, k], found.load_capacity, rtol=1e-5)
        one = stream.read(names, position[3], velocity[3], effort[3], gravity[3])
        np.testing.assert_array_equal(one.ground_force[k], states.ground_force[3, k])


@pytest.mark.parametrize("name", ["hexapod", "solo12"])
def test_the_efforts_that_hold_a_force_tell_that_force_and_contact(name):
    robot, rng = load_robot(name), np.random.default_rng(4)
    names, gravity = joint_names(robot), np.array([1.0, -0.5, -9.6])
    for leg in robot.legs.values():
        posture = leg.mechanism.initial_posture
        force = rng.normal(size=(30, 3)) * 20.0
        own = leg.mount.vectors_to_leg(gravity)
        jacobian = leg.mechanism.jacobian(posture)
        efforts = weight_efforts(leg.mechanism, posture, own) - force @ jacobian
        position, effort = np.zeros((30, len(names))), np.zeros((30, len(names)))
        columns = [names.index(joint) for joint in leg.joint_names]
        position[:, columns], effort[:, columns] = posture.joint_positions, efforts
        states = JointStream(robot, FRICTION).read(names, position, (), effort, gravity)
        k = states.legs.index(leg.name)
        np.testing.assert_allclose(states.ground_force[:, k], force, atol=1e-9)
        load = -force @ own / np.linalg.norm(own)
        wanted = np.where(load >= 10.0, ContactState.ON_THE_GROUND, ContactState.IN_THE_AIR)
        np.testing.assert_array_equal(states.contact[:, k], wanted)


@pytest.mark.parametrize("name", ["hexapod", "quadruped", "walker"])
def test_states_equal_the_separate_functions_of_the_library(name):
    robot = load_robot(name)
    fields = random_joint_states(robot, 300)
    states = JointStream(robot, FRICTION).read(joint_names(robot), *fields)
    assert states.legs == tuple(robot.legs)
    assert {Status.OK, Status.INVALID_INPUT} <= set(states.status.flat)
    first = 0
    for k, leg in enumerate(robot.legs.values()):
        columns = slice(first, first + len(leg.joint_names))
        first = columns.stop
        q, rates, efforts = (field[:, columns] for field in fields)
        posture = leg.mechanism.forward(q)
        jacobian = leg.mechanism.jacobian(posture)
        bad = posture.status != Status.OK
        capacity = load_capacity(jacobian, *leg.effort_limits.T, FRICTION).capacity
        np.testing.assert_array_equal(states.joint_positions[k], q)
        np.testing.assert_array_equal(states.status[:, k], posture.status)
        np.testing.assert_allclose(states.foot_position[:, k], posture.foot_position, **SAME)
        velocity = np.einsum("tin,tn->ti", jacobian, rates)
        np.testing.assert_allclose(states.foot_velocity[:, k], velocity, **SAME)
        np.testing.assert_allclose(
            states.load_capacity[:, k], np.where(bad, np.nan, capacity), **SAME
        )
        used, _ = utilisation(efforts, leg.effort_limits)
        np.testing.assert_allclose(states.utilisation[:, k], used, **SAME)
        for index in ("condition_number", "rated_friction", "rated_friction_full"):
            wanted = np.full(len(q), np.nan)
            if index in supported_indices(leg.mechanism):
                wanted = evaluate_indices(leg.mechanism, posture, [index])[1][:, 0]
            np.testing.assert_allclose(getattr(states, index)[:, k], wanted, **SAME)


def test_one_message_equals_its_row_of_a_recording():
    robot = load_robot("hexapod")
    fields = random_joint_states(robot, 5)
    stream = JointStream(robot, FRICTION)
    every = stream.read(joint_names(robot), *fields)
    for t in range(5):
        one = stream.read(joint_names(robot), *(field[t] for field in fields))
        for field in every._fields[2:]:
            np.testing.assert_array_equal(getattr(one, field), getattr(every, field)[t])


def test_legs_of_several_mechanisms_come_in_the_order_of_the_robot():
    hexapod, quadruped = load_robot("hexapod"), load_robot("quadruped")
    legs: dict[str, Leg] = {}
    for pair in zip(hexapod.legs.values(), quadruped.legs.values(), strict=False):
        for leg, robot in zip(pair, (hexapod, quadruped), strict=True):
            names = tuple(f"{robot.name}_{joint}" for joint in leg.joint_names)
            name = f"{robot.name}_{leg.name}"
            legs[name] = Leg(**{**vars(leg), "name": name, "joint_names": names})
    mixed = Robot("mixed", "base_link", legs)
    fields = random_joint_states(mixed, 4)
    states = JointStream(mixed, FRICTION).read(joint_names(mixed), *fields)
    assert states.legs == tuple(legs)
    for robot in (hexapod, quadruped):
        names = [name for name in legs if name.startswith(robot.name)]
        rows = [states.legs.index(name) for name in names]
        part = Robot(robot.name, "base_link", {name: legs[name] for name in names})
        columns = [joint_names(mixed).index(joint) for joint in joint_names(part)]
        alone = JointStream(part, FRICTION).read(
            joint_names(part), *(field[:, columns] for field in fields)
        )
        for field in states._fields[2:]:
            np.testing.assert_array_equal(getattr(states, field)[:, rows], getattr(alone, field))
        for k, row in enumerate(rows):
            np.testing.assert_array_equal(states.joint_positions[row], alone.joint_positions[k])


def test_what_is_not_known_is_nan():
    robot = load_robot("hexapod")
    names = joint_names(robot)
    states = JointStream(robot, FRICTION).read(names, np.zeros((2, len(names))))
    assert np.isnan(states.foot_velocity).all()
    assert np.isnan(states.utilisation).all()
    assert np.isfinite(states.load_capacity).all()


def test_names_of_no_leg_give_states_of_no_leg():
    robot = load_robot("hexapod")
    states = JointStream(robot, FRICTION).read(("wheel",), np.zeros((7, 1)))
    assert states.legs == ()
    assert states.joint_positions == ()
    assert states.status.shape == (7, 0)
    assert states.foot_position.shape == (7, 0, 3)


def test_a_leg_that_lacks_a_joint_is_named_and_left_out():
    robot = load_robot("hexapod")
    names = joint_names(robot)[1:]
    stream = JointStream(robot, FRICTION)
    missing = joint_names(robot)[0]
    (leg,) = stream.layout(names).missing
    assert stream.layout(names).missing == {leg: (missing,)}
    assert stream.read(names, np.zeros(len(names))).legs == tuple(
        name for name in robot.legs if name != leg
    )


@pytest.mark.parametrize(
    ("names", "fields", "words"),
    [
        (("a", "b", "a"), ([0.0] * 3,), "name: a appear more than once"),
        (("a", "b"), ([0.0],), "position: got 1 values; allowed: 2 values, one a name"),
        (("a", "b"), ([],), "position: got 0 values; allowed: 2"),
        (("a", "b"), ([0.0] * 2, [0.0]), "velocity: got 1 values; allowed: 2 .* or none"),
        (("a", "b"), ([0.0] * 2, [], [0.0] * 3), "effort: got 3 values; allowed: 2 .* or none"),
        (("a", "b"), (np.zeros((4, 3)),), "position: got 3 values; allowed: 2"),
        ((), ([1.0],), "position: got 1 values; allowed: 0"),
    ],
)
def test_a_message_that_cannot_be_used_is_refused_with_the_reason(names, fields, words):
    with pytest.raises(JointStateError, match=words):
        JointStream(load_robot("hexapod"), FRICTION).read(names, *fields)


@pytest.mark.parametrize("friction", [-0.1, np.nan])
def test_a_wrong_friction_is_refused(friction):
    with pytest.raises(ValueRangeError, match="friction"):
        JointStream(load_robot("hexapod"), friction)


def test_a_stream_whose_names_keep_changing_takes_no_more_memory():
    stream = JointStream(load_robot("hexapod"), FRICTION)
    for k in range(3 * KNOWN_LAYOUTS):
        stream.read((f"joint_{k}",), [0.0])
    assert len(stream._layouts) <= KNOWN_LAYOUTS


def test_stamps_of_one_stream_must_increase():
    order = StampOrder()
    a, b = ("a",), ("b",)
    assert order.advances(a, 5)
    assert order.advances(b, 3)  # another stream
    assert not order.advances(a, 5)
    assert not order.advances(a, 4)  # a jump back counts once
    assert order.advances(a, 5)
    assert order.advances(a, 0)  # no stamp at all
    assert order.advances(a, 0)
    assert order.advances(a, 6)


def test_drives_that_count_otherwise_give_the_states_of_the_joints():
    robot = load_robot("hexapod")
    generator = np.random.default_rng(5)
    told = {}
    for name in ("left_front", "right_rear"):  # one plain leg beside each of the same geometry
        scale = generator.choice([-1.0, 0.5, -2.0], 3)
        told[name] = Drives(scale, generator.uniform(-1.0, 1.0, 3))
    legs = {
        name: replace(leg, drives=told.get(name)) if name in told else leg
        for name, leg in robot.legs.items()
    }
    names, _ = robot.effort_limits()
    position = generator.uniform(-0.2, 0.2, len(names))
    velocity, effort = generator.normal(size=(2, len(names)))
    wanted = JointStream(robot, 0.4).read(names, position, velocity, effort)
    for name, drives in told.items():
        columns = [names.index(joint) for joint in robot.leg(name).joint_names]
        position[columns] = drives.told_positions(position[columns])
        velocity[columns] /= drives.scale
        effort[columns] *= drives.scale
    found = JointStream(replace(robot, legs=legs), 0.4).read(names, position, velocity, effort)
    assert found.legs == wanted.legs
    for one, other in zip(found[2:], wanted[2:], strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
