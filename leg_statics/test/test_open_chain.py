# SPDX-License-Identifier: Apache-2.0
"""A mechanism that nobody knows yet, without passive joints or loops, works in all layers above."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from leg_kinematics import Robot, Status
from leg_kinematics.geometry import Dimensioned, offset
from leg_kinematics.mechanism import Joint, Linkage, Posture
from leg_kinematics.robot import Leg, Mount
from leg_statics.contact import Contact
from leg_statics.design.designs import evaluate_design
from leg_statics.footholds import evaluate_footholds
from leg_statics.gait import Gait, gait_cycle
from leg_statics.indices import evaluate_indices
from leg_statics.joint_stream import JointStream
from leg_statics.maps import plane_map
from leg_statics.step_length import longest_step
from leg_statics.workspace import workspace_bounds

LIMIT = 100.0  # N


@dataclass(frozen=True)
class Slides(Dimensioned):
    """Three slides along x, y, z below a hip: an open chain whose Jacobian is the unit matrix."""

    name = "slides"
    joints = tuple(Joint(axis, "prismatic") for axis in "xyz")
    passive_joints = ()
    closure_names = ()
    assembly_modes = ("only",)

    drop: float = offset("Height of the foot at joint position zero", "h", -0.5)
    joint_ranges: tuple = ((-0.2, 0.2), (-0.1, 0.1), (-0.2, 0.2))
    passive_joint_ranges: tuple = ()

    def __post_init__(self):
        self.check_fields()

    def forward(self, joint_positions, assembly_mode=""):
        self.mode_index(assembly_mode)
        q = np.asarray(joint_positions, dtype=float)
        lower, upper = self.joint_limits.T
        ok = ((q >= lower) & (q <= upper)).all(axis=-1)
        known = np.isfinite(q).all(axis=-1)
        status = np.where(known, np.where(ok, Status.OK, Status.JOINT_LIMIT), Status.INVALID_INPUT)
        foot = q + np.array([0.0, 0.0, self.drop])
        return Posture(q, np.empty((*q.shape[:-1], 0)), foot, status.astype(np.uint8))

    def inverse(self, foot_position, assembly_mode=""):
        return self.forward(
            np.asarray(foot_position) - np.array([0.0, 0.0, self.drop]), assembly_mode
        )

    @property
    def initial_posture(self):
        return self.forward(np.zeros(3))

    def jacobian(self, posture):
        return np.broadcast_to(np.eye(3), (*posture.status.shape, 3, 3)).copy()

    def angular_jacobian(self, posture):
        return np.zeros((*posture.status.shape, 3, 3))

    def passive_joint_positions(self, posture):
        return np.empty((*posture.status.shape, 0))

    def linkage(self, posture):
        points = np.stack([np.zeros_like(posture.foot_position), posture.foot_position], axis=-2)
        return Linkage(("hip", "foot"), points, ((0, 1),))


@pytest.fixture
def robot():
    legs = {}
    for name, y in (("left", 0.2), ("right", -0.2)):
        one = Leg.of(Slides(), (-LIMIT, LIMIT))
        mount = Mount(np.array([0.0, y, 0.0]), np.eye(3))
        joints = tuple(f"{name}_{joint}" for joint in one.joint_names)
        legs[name] = replace(one, name=name, mount=mount, frame=f"{name}_leg", joint_names=joints)
    return Robot("slider", "base_link", legs)


def test_the_library_answers_for_it(robot):
    leg = robot.leg("left")
    found = evaluate_footholds(leg, [[0.1, 0.0, -0.5], [0.3, 0.0, -0.5]], Contact(0.4, load=50.0))
    assert found.feasible.tolist() == [True, False]
    assert found.load_capacity[0] == pytest.approx(LIMIT)
    layers = ["load_capacity", "condition_number"]
    grid = plane_map(leg, -0.5, 0.02, layers=layers, contact=Contact(0.4))
    inside = grid.status == Status.OK
    np.testing.assert_allclose(grid.layer("load_capacity")[inside], LIMIT)
    np.testing.assert_allclose(grid.layer("condition_number")[inside], 1.0)
    step = longest_step(leg, -0.5, Contact(0.4, load=50.0))
    assert step.length == pytest.approx(0.4, abs=1e-5)
    lower, upper = workspace_bounds(leg.mechanism).T
    np.testing.assert_allclose(lower, [-0.2, -0.1, -0.7], atol=0.03)
    np.testing.assert_allclose(upper, [0.2, 0.1, -0.3], atol=0.03)
    names, values = evaluate_indices(leg.mechanism, leg.mechanism.initial_posture)
    assert values[names.index("condition_number")] == pytest.approx(1.0)


def test_its_states_and_its_walk_come_from_joint_states(robot):
    cycle = gait_cycle(robot, Gait(), 50)
    states = JointStream(robot, 0.4).read(cycle.names, cycle.positions, (), cycle.efforts)
    assert states.legs == ("left", "right")
    assert (states.status == Status.OK).all()
    np.testing.assert_allclose(states.load_capacity, LIMIT)
    for k, leg in enumerate(states.legs):
        share = np.abs(cycle.forces[leg]).max(axis=-1) / LIMIT
        np.testing.assert_allclose(states.utilisation[:, k], share, atol=1e-12)


def test_designs_of_it_are_measured(robot):
    leg = robot.leg("left")
    found = evaluate_design(leg, {"drop": -0.6}, ["condition_number", "workspace_volume"])
    assert found.problem == ""
    assert found.values["workspace_volume"] == pytest.approx(0.4 * 0.2 * 0.4, rel=0.01)
