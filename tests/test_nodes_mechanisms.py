# SPDX-License-Identifier: Apache-2.0
"""One robot with a leg of every mechanism: the same services answer for all of them."""

from types import SimpleNamespace

import numpy as np
import pytest
from leg_msgs_py import errors
from leg_msgs_py.client import LegClient
from leg_msgs_py.grounds import Ground
from node_processes import NodeProcesses
from nodes_support import PATIENCE, wait_until_ready
from ruamel.yaml import YAML

from leg_kinematics import Status, load_robot
from leg_kinematics.description import find_robot_file
from leg_kinematics.mechanisms import MECHANISMS
from leg_statics.efforts import joint_efforts, utilisation
from leg_statics.footholds import Contact, evaluate_footholds
from leg_statics.indices import evaluate_indices, supported_indices
from leg_statics.step_length import longest_step

SOURCES = ("hexapod", "quadruped", "walker", "gantry")
FORCE = np.array([2.0, -3.0, 20.0])


def mixed_description() -> dict:
    """One leg of every leg type that the shipped robots have."""
    types, legs = {}, {}
    for robot in SOURCES:
        document = YAML(typ="safe").load(find_robot_file(robot).read_text())
        assert document["units"] == {"length": "mm", "angle": "deg"}
        for name, leg_type in document["leg_types"].items():
            types[f"{robot}_{name}"] = leg_type
            mount = {"position": [0, 100 * len(legs), 0], "rpy": [0, 0, 30]}
            legs[f"{robot}_{name}"] = {"type": f"{robot}_{name}", "mount": mount}
    jansen = MECHANISMS["theo_jansen"]()
    types["jansen"] = {
        "mechanism": "theo_jansen",
        "geometry": {
            f: float(np.degrees(v)) if f == "crank_zero" else 1e3 * v if f in METRES else v
            for f, v in geometry_of(jansen).items()
        },
        "joint_limits": {j.name: [-180, 180] for j in jansen.joints},
        "passive_joint_limits": {e.name: [-180, 180] for e in jansen.excursions},
        "effort_limits": {j.name: 1.0 for j in jansen.joints},
    }
    mount = {"position": [0, -100, 0], "rpy": [0, 0, 30]}
    legs["jansen"] = {"type": "jansen", "mount": mount}
    return {
        "name": "zoo",
        "base_frame": "base_link",
        "units": {"length": "mm", "angle": "deg"},
        "leg_types": types,
        "legs": legs,
    }


METRES = ("crank_length", "reach_tolerance")


def geometry_of(mechanism) -> dict:
    from leg_kinematics.geometry import geometry_parameters

    return {f.name: getattr(mechanism, f.name) for f in geometry_parameters(mechanism)}


@pytest.fixture(scope="module")
def zoo(tmp_path_factory):
    path = tmp_path_factory.mktemp("zoo") / "zoo.yaml"
    with path.open("w") as file:
        YAML(typ="safe").dump(mixed_description(), file)
    robot = load_robot(path)
    with (
        NodeProcesses(str(path), namespace="zoo") as nodes,
        LegClient(namespace="zoo", timeout=PATIENCE) as client,
    ):
        wait_until_ready(client, nodes)
        yield SimpleNamespace(robot=robot, client=client)


LEGS = (*mixed_description()["legs"],)
every_leg = pytest.mark.parametrize("name", LEGS)


def postures(leg, count=60):
    """Postures that are OK, from random actuator positions."""
    lower, upper = leg.mechanism.joint_limits.T
    q = np.random.default_rng(5).uniform(lower, upper, (40 * count, len(lower)))
    posture = leg.mechanism.forward(q)
    ok = np.flatnonzero(posture.status == Status.OK)[:count]
    assert len(ok) == count
    return leg.mechanism.forward(q[ok])


def test_every_mechanism_is_there(zoo):
    assert {leg.geometry.name for leg in zoo.robot.legs.values()} == set(MECHANISMS)
    assert set(zoo.client.legs()) == set(LEGS)


@every_leg
def test_the_description_tells_what_a_client_needs(zoo, name):
    leg, told = zoo.robot.leg(name), zoo.client.describe(name)
    assert told.mechanism == leg.mechanism.name
    assert told.joint_names == leg.joint_names
    assert told.joint_types == tuple(j.type for j in leg.mechanism.joints)
    assert told.joint_units == tuple(j.unit for j in leg.mechanism.joints)
    assert told.effort_units == tuple(j.effort_unit for j in leg.mechanism.joints)
    assert told.task_coordinates == tuple(leg.mechanism.task_coordinates)
    assert told.task_units == tuple(leg.mechanism.task_units)
    assert told.index_names == supported_indices(leg.mechanism)
    assert told.assembly_modes == tuple(leg.mechanism.assembly_modes)


@every_leg
def test_kinematics_equal_the_library(zoo, name):
    leg = zoo.robot.leg(name)
    posture = postures(leg)
    forward = zoo.client.forward_kinematics(name, posture.joint_positions)
    np.testing.assert_allclose(forward.positions, posture.foot_position, atol=1e-12)
    inverse = zoo.client.inverse_kinematics(name, posture.foot_position)
    expected = leg.mechanism.inverse(posture.foot_position)
    np.testing.assert_array_equal(inverse.status, expected.status)
    np.testing.assert_allclose(inverse.joint_positions, expected.joint_positions, atol=1e-12)
    answer = zoo.client.jacobian(name, joint_positions=posture.joint_positions)
    np.testing.assert_allclose(answer.jacobian, leg.mechanism.jacobian(posture), rtol=1e-9)
    np.testing.assert_allclose(
        answer.angular_jacobian, leg.mechanism.angular_jacobian(posture), rtol=1e-9, atol=1e-12
    )


@every_leg
def test_a_turned_mount_turns_every_vector(zoo, name):
    leg, base = zoo.robot.leg(name), zoo.robot.base_frame
    if not leg.mechanism.has_point_foot:
        return
    assert not np.allclose(leg.mount.rotation, np.eye(3))
    foot = postures(leg).foot_position
    there = leg.mount.to_base(foot)
    turned = leg.mount.vectors_to_base
    own = zoo.client.inverse_kinematics(name, foot)
    ik = zoo.client.inverse_kinematics(name, there, frame=base)
    np.testing.assert_allclose(ik.joint_positions, own.joint_positions, atol=1e-9)
    fk = zoo.client.forward_kinematics(name, own.joint_positions, frame=base)
    reached = zoo.client.forward_kinematics(name, own.joint_positions)
    np.testing.assert_allclose(fk.positions, leg.mount.to_base(reached.positions), atol=1e-12)
    jacobian = zoo.client.jacobian(name, joint_positions=own.joint_positions, frame=base)
    wanted = zoo.client.jacobian(name, joint_positions=own.joint_positions)
    for field in ("jacobian", "angular_jacobian"):
        rows = leg.mount.rotation @ getattr(wanted, field)
        np.testing.assert_allclose(getattr(jacobian, field), rows, rtol=1e-9, atol=1e-12)
    held = zoo.client.compute_efforts(name, there, turned(FORCE), turned(FORCE), frame=base)
    wanted = zoo.client.compute_efforts(name, foot, FORCE, FORCE)
    np.testing.assert_allclose(held.joint_efforts, wanted.joint_efforts, rtol=1e-7, atol=1e-9)
    slope = np.array([0.2, -0.1, 1.0])
    carried = zoo.client.query_footholds(name, there, Ground(0.4, turned(slope)), frame=base)
    wanted = zoo.client.query_footholds(name, foot, Ground(0.4, slope))
    np.testing.assert_array_equal(carried.verdict, wanted.verdict)
    np.testing.assert_allclose(carried.load_capacity, wanted.load_capacity, rtol=1e-6)
    height = float(np.median(foot[:, 2]))
    oblique = np.array([1.0, 0.3, 0.0])  # forward, a symmetric leg has two steps of one length
    step = zoo.client.query_step_length(
        name, height + leg.mount.position[2], 0.4, 5.0, direction=turned(oblique), frame=base
    )
    wanted = zoo.client.query_step_length(name, height, 0.4, 5.0, direction=oblique)
    np.testing.assert_allclose(step.start, leg.mount.to_base(wanted.start), atol=1e-5)


@every_leg
def test_indices_equal_the_library(zoo, name):
    leg = zoo.robot.leg(name)
    foot = postures(leg).foot_position
    answer = zoo.client.evaluate_indices(name, foot)
    names, values = evaluate_indices(leg.mechanism, leg.mechanism.inverse(foot))
    assert answer.names == names
    np.testing.assert_allclose(answer.values, values, rtol=1e-9)


@every_leg
def test_footholds_equal_the_library_or_are_not_supported(zoo, name):
    leg = zoo.robot.leg(name)
    foot = postures(leg).foot_position
    if not leg.mechanism.has_point_foot:
        for ask in (
            lambda: zoo.client.query_footholds(name, foot, 0.4, 20.0),
            lambda: zoo.client.query_step_length(name, -0.5, 0.4, 20.0),
        ):
            with pytest.raises(errors.NotSupportedError, match=r"beta|point foot"):
                ask()
        return
    answer = zoo.client.query_footholds(name, foot, 0.4, 20.0)
    expected = evaluate_footholds(leg, foot, Contact(0.4, load=20.0))
    np.testing.assert_array_equal(answer.verdict, expected.verdict)
    np.testing.assert_allclose(answer.load_capacity, expected.load_capacity, rtol=1e-9)
    if len(leg.joint_names) == 1:  # a one-crank leg may bear any load by its structure alone
        assert np.isinf(answer.load_capacity).any()
        assert np.isnan(answer.rated_friction).all()
    posture = leg.mechanism.inverse(foot)
    held = zoo.client.compute_efforts(name, foot, FORCE)
    tau = joint_efforts(
        leg.mechanism.jacobian(posture), leg.mechanism.angular_jacobian(posture), FORCE
    )
    np.testing.assert_allclose(held.joint_efforts, tau, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(
        held.utilisation, utilisation(tau, leg.effort_limits)[0], rtol=1e-9, atol=1e-12
    )


@every_leg
def test_step_length_equals_the_library(zoo, name):
    leg = zoo.robot.leg(name)
    if not leg.mechanism.has_point_foot:
        return
    height = float(np.median(postures(leg).foot_position[:, 2]))
    answer = zoo.client.query_step_length(name, height, 0.4, 5.0)
    step = longest_step(leg, height, Contact(0.4, load=5.0))
    np.testing.assert_allclose(answer.length[0], step.length, atol=1e-9)
